"""The Kalman filter of the radar chapters on an accelerated track, and the start against what it
promises."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from kfcourse import Gaussian
from kfcourse.linear import covariances
from kfcourse.linear.runs import run
from kfcourse.linear.system import linear_system
from kfcourse.scenarios.radar import kinematic
from kfcourse.scenarios.tracking import kalman_positions, roughly_known

T, SIGMA = 0.8, 100.0


def test_with_the_control_an_accelerated_track_is_followed_from_the_third_measurement_on():
    """Without noise, the start known: the two steps without control leave an error, which later
    measurements take away."""
    acceleration, t = np.array([3.0, -2.0, 1.0]), T * np.arange(60)[:, None, None]
    y = 5 + 7 * t + acceleration * t**2 / 2
    start = Gaussian(np.array([5.0, 5, 5, 7, 7, 7]), np.diag([2.0, 3, 1, 4, 1, 5]))
    free, driven = (kalman_positions(y, T, 0.5, 2.0, start, control) for control in (False, True))
    system = linear_system(kinematic(T, noise_sd=0.5, measurement_sd=2.0))[0]
    assert_allclose(free, run(system, start, y).posterior.mean[..., :3], rtol=1e-12)
    assert np.abs(driven - y)[-1].max() < 1e-6 < 0.1 < np.abs(free - y)[-1].max()


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
        (0.9, np.zeros((1, 6)), "expected positions and speeds of 3 axes"),
    ],
)
def test_a_start_that_there_is_not(gain, state, message):
    system = linear_system(kinematic(T, noise_sd=0.8, measurement_sd=SIGMA))[0]
    with pytest.raises(ValueError, match=message):
        roughly_known(system, gain, state, runs=2, seed=3)
