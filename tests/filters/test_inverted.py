"""Meters with a noise that is solved for: the same filter as of the measurement transformed, which
is linear in the noise."""

import numpy as np
from numpy.testing import assert_allclose
from scipy import stats

from kfcourse import Model, run, simulate
from kfcourse.filters import pointmass
from kfcourse.filters.densities import likelihood


def test_it_is_the_filter_of_the_transformed_measurement():
    """Bayes' rule does not know in which units y is written: the factor |d omega/dy| is the same
    for all states."""
    meters = "(2 + tanh(x))*exp(0.3*w)", "log(2 + tanh(x)) + 0.3*w"
    curved, straight = (Model.define("0.9*x + 0.4*v", meter) for meter in meters)
    _, y = simulate(curved, 10, 5, seed=1)
    law, expected = run(pointmass(curved), y), run(pointmass(straight), np.log(y))
    sigma = np.sqrt(expected.cov[..., 0, 0])
    # twice the accuracy of a step
    assert (np.abs(law.mean - expected.mean)[..., 0] < 2e-6 * sigma).all()
    assert_allclose(law.cov, expected.cov, rtol=4e-6)


def test_the_density_is_that_of_the_transformed_noise():
    model = Model.define("x + v", "exp(x + 0.5*w)", meter_noise={"mean": 0.2, "variance": 4})
    y, x = np.array([[0.3], [2.0], [-1.0], [np.nan]]), np.array([[0.1], [-0.4], [0.0], [0.0]])
    expected = stats.lognorm(s=1.0, scale=np.exp(x[:2, 0] + 0.1)).logpdf(y[:2, 0])
    assert_allclose(likelihood(model)(y, x)[:2], expected, rtol=1e-12)
    assert likelihood(model)(y, x)[2] == -np.inf  # no noise makes it negative
    assert likelihood(model)(y, x)[3] == 0
