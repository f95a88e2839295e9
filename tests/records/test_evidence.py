"""The likelihood of a record: a dense normal density, and what has none."""

import numpy as np
import oracles
import pytest

from kfcourse import Model, gaussian, likelihood, linearised, simulate, unscented
from kfcourse.filters import aof, duof, iterated, kalman_filter
from kfcourse.montecarlo.designing import design
from kfcourse.montecarlo.ensemble import Ensemble

pytestmark = pytest.mark.quick

FILTERS = {
    "kalman": kalman_filter,
    "linearised": lambda model: aof(linearised(model)),
    "gaussian": lambda model: aof(gaussian(model)),
    "unscented": lambda model: aof(unscented(model)),
    "iterated": lambda model: iterated(gaussian(model), 3),
}


@pytest.mark.parametrize("kind", FILTERS)
def test_on_a_linear_model_it_is_the_density_of_the_whole_record(kind):
    """Matrices that change with the step, noises with means and correlations, whole measurements
    and components missing."""
    changing = oracles.Changing()
    y = simulate(changing.model(), 3, 8, seed=3).y.copy()
    y[2, 1] = y[4, 2, 0] = y[7, 2, 1] = y[0, 1] = np.nan
    logs = likelihood(FILTERS[kind](changing.model()), y)
    assert logs.shape == (8, 3)
    assert logs[2, 1] == logs[0, 1] == 0
    expected = [
        oracles.joint_posterior(changing.steps(8), changing.laws["prior"], y[:, i])[2]
        for i in range(3)
    ]
    # a 16 x 16 determinant against eight of 2 x 2
    np.testing.assert_allclose(logs.sum(axis=0), expected, rtol=1e-11)


# ---------------------------------------------------------------- the exact filter, and particles


def test_what_has_no_density_is_told():
    model = Model.define("0.9*x + v", "x + w")
    (designed,) = design([duof(model)], Ensemble(model, 100, 3, seed=1))
    with pytest.raises(
        ValueError, match=f"the likelihood needs the structural functions.*{designed.name} has none"
    ):
        likelihood(designed, np.zeros((3, 1, 1)))
    known = Model.define(["x1"], ["x1", "x1"], prior={"mean": [1.0]}, symbols={"x": ["x1"]})
    with pytest.raises(
        ValueError,
        match=r"no density for the measurement of step 0, run 0: .* give every component of the "
        r"meter",
    ):
        likelihood(kalman_filter(known), np.ones((2, 1, 2)))
    with pytest.raises(ValueError, match="measurements must have the shape"):
        likelihood(kalman_filter(model), np.zeros((3, 2)))
