"""The alpha-beta filter against the Riccati equation and plain floats."""

import control
import numpy as np
import pytest
from numpy.testing import assert_allclose

from kfcourse import Model, ModelError, run, simulate
from kfcourse.filters import alpha_beta
from kfcourse.filters.alphabeta import steady_alpha, steady_beta, tracking_index
from kfcourse.linear.system import linear_system
from kfcourse.scenarios.radar import kinematic

T = 0.7
ROUNDING = 1e-12  # relative, after some tens of steps of a stable recursion


# --- the coefficients


@pytest.mark.parametrize("alpha", [0.01, 0.095, 0.5, 0.9, 0.99])
def test_the_coefficients_are_the_stationary_kalman_gain(alpha):
    """python-control's solution of the Riccati equation."""
    sigma = 30.0
    noise_sd = tracking_index(alpha) * sigma / T**2
    model = kinematic(T, dimensions=1, noise_sd=noise_sd, measurement_sd=sigma)
    system, _, _ = linear_system(model)
    predicted, _, _ = control.dare(system.A.T, system.H.T, system.Q, system.R)
    gain = predicted @ system.H.T / (system.H @ predicted @ system.H.T + system.R)
    # The Riccati equation loses digits where the noises differ much: alpha = 0.01 has an index of
    # 5e-5, squared 2.5e-9.
    assert_allclose(gain[:, 0], [alpha, steady_beta(alpha) / T], rtol=1e-6)


# --- the estimates


def slow_alpha_beta(measurements, alpha, beta):
    """One axis in plain floats: the first two measurements, at any distance, then the gains;
    coasting over NaN."""
    known, last, estimates, position, speed = 0, None, [], None, 0.0
    for k, y in enumerate(measurements):
        if known:
            position += T * speed
        if not np.isnan(y):
            if known == 0:
                position = y
            elif known == 1:
                position, speed = y, (y - last[1]) / (T * (k - last[0]))
            else:
                innovation, count = y - position, known + 1
                a = max(alpha, 2 * (2 * count - 1) / (count * (count + 1)))
                b = max(beta, 6 / (count * (count + 1)))
                position, speed = position + a * innovation, speed + b / T * innovation
            known, last = known + 1, (k, y)
        estimates.append((position, speed))
    return estimates


def test_the_start_from_two_measurements_with_gaps_by_a_slow_loop():
    model, alpha, beta = kinematic(T, dimensions=2, noise_sd=0.8, measurement_sd=5.0), 0.3, 0.07
    y = simulate(model, 4, 20, seed=3).y
    y[1, 0] = y[5:8, 1] = y[0, 2] = y[1, 2] = np.nan  # gaps in the start and later, all components
    y[1, 3, 0] = y[6, 3, 1] = np.nan  # and one component alone
    mean = run(alpha_beta(model, alpha, beta), y).mean
    for trajectory in range(4):
        for axis in range(2):
            expected = slow_alpha_beta(y[:, trajectory, axis], alpha, beta)
            for k, values in enumerate(expected):
                if values[0] is not None:  # nothing is known before the first measurement
                    assert_allclose(
                        mean[k, trajectory, axis::2], values, rtol=0, atol=1e3 * ROUNDING
                    )


# --- bad input


def test_other_models_are_refused():
    for model in (
        Model.define(["r + s", "s + a", "a + v"], "r + w", symbols={"x": ["r", "s", "a"]}),
        Model.define(["0.9*x1 + x2", "x2 + v1"], "x1 + w1"),
        Model.define(["x1 + x2", "x2 + v1"], "2*x1 + w1"),
        Model.define("x + v", "x + w"),
    ):
        with pytest.raises(
            ModelError,
            match=r"not position, velocity on each axis.*build it with kinematic\(interval,",
        ):
            alpha_beta(model, 0.3, 0.1)
    shifted = Model.define(["x1 + x2", "x2 + v1"], "x1 + w1", state_noise={"mean": 1.0})
    with pytest.raises(ModelError, match="mean other than 0"):
        alpha_beta(shifted, 0.3, 0.1)
    with pytest.raises(ModelError, match="not linear"):
        alpha_beta(Model.define(["x1 + x2", "x2 + v1"], "x1**2 + w1"), 0.3, 0.1)


def test_alpha_and_index_are_inverse():
    for index in (1e-9, 1e-3, 0.2, 1.0, 50.0):
        assert tracking_index(steady_alpha(index)) == pytest.approx(index, rel=1e-9)
