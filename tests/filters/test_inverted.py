"""Meters with a noise that is solved for: the same filter as of the measurement transformed, which
is linear in the noise."""

import numpy as np
from numpy.testing import assert_allclose

from kfcourse import Model, run, simulate
from kfcourse.filters import pointmass


def test_it_is_the_filter_of_the_transformed_measurement():
    """Bayes' rule does not know in which units y is written: the factor |d omega/dy| is the same
    for all states."""
    meters = "(2 + tanh(x))*exp(0.3*w)", "log(2 + tanh(x)) + 0.3*w"
    curved, straight = (Model.define("0.9*x + 0.4*v", meter) for meter in meters)
    _, y = simulate(curved, 10, 5, seed=1)
    filters = (pointmass(model, accuracy=1e-6) for model in (curved, straight))
    law, expected = (run(f, y) for f, y in zip(filters, (y, np.log(y)), strict=True))
    sigma = np.sqrt(expected.cov[..., 0, 0])
    # twice the accuracy of a step
    assert (np.abs(law.mean - expected.mean)[..., 0] < 2e-6 * sigma).all()
    assert_allclose(law.cov, expected.cov, rtol=4e-6)
