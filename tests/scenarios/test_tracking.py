"""The Kalman filter of the radar chapters against one written step by step, and the start against
what it promises."""

from __future__ import annotations

import numpy as np
import oracles
import pytest
from numpy.testing import assert_allclose

from kfcourse import Gaussian
from kfcourse.linear import covariances
from kfcourse.linear.system import linear_system
from kfcourse.scenarios.radar import kinematic
from kfcourse.scenarios.tracking import kalman_positions, roughly_known

T, SIGMA = 0.8, 100.0


@pytest.mark.parametrize("control", [False, True])
def test_positions_step_by_step(control):
    rng = np.random.default_rng(1)
    y, start = (
        rng.normal(size=(6, 2, 3)),
        Gaussian(rng.normal(size=(2, 6)), np.diag([2.0, 3, 1, 4, 1, 5])),
    )
    A = np.kron([[1, T], [0, 1]], np.eye(3))
    B, H = np.kron([[T**2 / 2], [T]], np.eye(3)), np.kron([[1, 0]], np.eye(3))
    u = np.zeros((6, 2, 3))
    if control:
        u[2:] = (y[2:] - 2 * y[1:-1] + y[:-2]) / T**2
    estimates = kalman_positions(y, T, 0.5, 2.0, start, control)
    for i in range(2):
        steps = [(A, a, 0.25 * B @ B.T, H, np.zeros(3), 4.0 * np.eye(3)) for a in u[:, i] @ B.T]
        loop = oracles.kalman_loop(steps, (start.mean[i], start.cov), y[:, i])
        expected = [mean[:3] for _, (mean, _) in loop]
        assert_allclose(estimates[:, i], expected, rtol=1e-10, atol=1e-12)  # rounding


def test_a_rough_start_has_the_gain_that_is_asked_for_and_spreads_as_it_says():
    system = linear_system(kinematic(T, noise_sd=0.8, measurement_sd=SIGMA))[0]
    state = np.arange(6.0)
    law = roughly_known(system, 0.55, state, runs=20_000, seed=3)
    assert covariances(system, law.cov, 1).gains[0, 0, 0] == pytest.approx(0.55, rel=1e-12)
    sd = np.sqrt(np.diag(law.cov))
    error = (law.mean - state) / sd
    assert (np.abs(error.mean(axis=0)) < 4 / np.sqrt(20_000)).all()
    # a sample correlation scatters by at most 1 / sqrt(runs)
    assert_allclose(np.corrcoef(error.T), law.cov / np.outer(sd, sd), atol=4 / np.sqrt(20_000))


@pytest.mark.parametrize(
    ("gain", "state", "message"),
    [
        (0.3, np.zeros(6), r"between 0\.5 and 1"),
        (1.0, np.zeros(6), r"between 0\.5 and 1"),
        (0.9, np.zeros((1, 6)), "expected positions and speeds of 3 axes"),
    ],
)
def test_a_start_that_there_is_not(gain, state, message):
    system = linear_system(kinematic(T, noise_sd=0.8, measurement_sd=SIGMA))[0]
    with pytest.raises(ValueError, match=message):
        roughly_known(system, gain, state, runs=2, seed=3)
