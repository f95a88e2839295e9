"""The exact AOF of meters without noise: the posterior is a few points, with weights known in closed form."""

from functools import partial

import numpy as np
import pytest

from kfcourse import Model, ModelError, filters, run, simulate
from kfcourse.filters import kalman_filter

# What these tests compare with is known to far more digits than a comparison needs.
ACCURACY = 1e-6
pointmass = partial(filters.pointmass, accuracy=ACCURACY)

SIGMA = 4
LAST_BIT = 1e-13  # roots by bisection, of states near 1


def test_a_linear_meter_shows_the_state():
    model = Model.define("0.9*x + 0.3*v", "2*x + 1")
    x, y = simulate(model, 20, 6, seed=1)
    found, kalman = run(pointmass(model), y), run(kalman_filter(model), y)
    np.testing.assert_allclose(found.mean, x, rtol=0, atol=LAST_BIT)
    np.testing.assert_allclose(found.mean, kalman.mean, rtol=0, atol=LAST_BIT)
    assert (found.cov == 0).all()


def test_a_meter_may_lose_its_noise_on_the_way():
    """Noise until step 3, none at 3 and 4, some again: the Kalman filter's estimates, and the state itself in between."""
    noise = {"variance": "0 if 3 <= k < 5 else 1"}
    model = Model.define("0.9*x + 0.1*v", "x + w", meter_noise=noise)
    x, y = simulate(model, 500, 7, seed=1)
    found, kalman = run(pointmass(model), y), run(kalman_filter(model), y)
    np.testing.assert_allclose(found.mean, kalman.mean, rtol=0, atol=ACCURACY)  # deviations are below 1
    np.testing.assert_allclose(found.mean[3:5], x[3:5], rtol=0, atol=LAST_BIT)
    assert (found.cov[3:5] == 0).all()


def test_its_prediction_is_a_sum_of_kernels_one_for_each_root():
    """y = x^2 leaves +-sqrt(y), with the weights of the prior N(0.5, 1) there; then x' = 0.9 x + 0.3 v."""
    model = Model.define("0.9*x + 0.3*v", "x**2", prior={"mean": 0.5})
    y = np.array([[0.64], [2.25], [1e-4]])
    state = pointmass(model).step(pointmass(model).init(3), y)
    root = np.sqrt(y[:, 0])
    up, down = (np.exp(-0.5 * (sign * root - 0.5) ** 2) for sign in (1, -1))
    share = up / (up + down)
    mean, variance = (2 * share - 1) * root, 4 * share * (1 - share) * root**2
    np.testing.assert_allclose(state.posterior.mean[:, 0], mean, rtol=1e-12)
    np.testing.assert_allclose(state.posterior.cov[:, 0, 0], variance, rtol=1e-12)
    np.testing.assert_allclose(state.predicted.mean[:, 0], 0.9 * mean, rtol=1e-12)
    np.testing.assert_allclose(state.predicted.cov[:, 0, 0], 0.81 * variance + 0.09, rtol=1e-12)
    # the second measurement: the mixture of two kernels at +-sqrt(y')
    after = pointmass(model).step(state, np.full((3, 1), 1.0))
    heights = [
        share * np.exp(-0.5 * ((x - 0.9 * root) / 0.3) ** 2) + (1 - share) * np.exp(-0.5 * ((x + 0.9 * root) / 0.3) ** 2)
        for x in (1, -1)
    ]
    np.testing.assert_allclose(after.posterior.mean[:, 0], (heights[0] - heights[1]) / sum(heights), rtol=1e-10)
    assert (after.memory.error == 0).all()


def test_a_folding_meter_has_many_roots_and_its_own_variance_is_right():
    """Pairs of roots near an extremum of the sine weigh much, and must not be missed between two scanned states."""
    model = Model.define("0.9*x + v", "sin(3*x)")
    x, y = simulate(model, 3000, 3, seed=2)
    found = run(pointmass(model), y)
    for k in range(3):
        excess = (x[k] - found.mean[k])[:, 0] ** 2 - found.cov[k, :, 0, 0]
        assert abs(excess.mean()) < SIGMA * excess.std() / np.sqrt(3000)


def test_a_missing_measurement_is_a_prediction():
    model = Model.define("0.9*x + 0.5*v", "x**2", prior={"mean": 1.0})
    exact = pointmass(model)
    state = exact.step(exact.init(1), np.array([[0.49]]))
    after = exact.step(state, np.array([[np.nan]]))
    np.testing.assert_allclose(after.posterior.mean, state.predicted.mean, rtol=1e-6)
    np.testing.assert_allclose(after.posterior.cov, state.predicted.cov, rtol=1e-6)


def test_without_any_noise_there_is_a_message():
    """Rounding decides whether a root is met: of many trajectories, some are not."""
    model = Model.define("0.9*x", "x**2")
    _, y = simulate(model, 50, 3, seed=1)
    with pytest.raises(ModelError, match="without noise there"):
        run(pointmass(model), y)
