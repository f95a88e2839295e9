"""The pointer's track, the model of uniformly accelerated motion, the start-up from three
samples."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from kfcourse.linear.system import linear_system
from kfcourse.scenarios.pointer import (
    SHORTEST,
    follow,
    hand_track,
    start_up,
    uniform_acceleration,
)
from kfcourse.scenarios.radar import kinematic

# ---------------------------------------------------------------- the model


@pytest.mark.parametrize("axes", [2, 3])
def test_the_matrices_are_those_of_the_radar_and_the_input_pushes_as_the_noise(axes):
    dt, sd = 0.1, 7.0
    system = uniform_acceleration(dt, sd, 3.0, axes)
    expected = linear_system(kinematic(dt, dimensions=axes, noise_sd=sd, measurement_sd=3.0))[0]
    for name in ("A", "H", "Q", "R"):
        assert_allclose(getattr(system, name), getattr(expected, name), rtol=1e-13)
    assert_allclose(system.B, np.kron([[dt**2 / 2], [dt]], np.eye(axes)), rtol=1e-14)


# ---------------------------------------------------------------- the filter


def test_a_uniformly_accelerated_track_without_noise_is_followed_exactly():
    dt, a = 0.1, np.array([30.0, -20.0])
    t = dt * np.arange(20)[:, None, None]
    position, velocity = 5 + np.array([7.0, -3.0]) * t + a * t**2 / 2, np.array([7.0, -3.0]) + a * t
    u = np.broadcast_to(a, (20, 1, 2))
    laws = follow(uniform_acceleration(dt, 100.0, 2.0), position, dt, u)
    truth = np.concatenate([position, velocity], axis=-1)
    assert laws.posterior.mean.shape == (17, 1, 4)
    assert_allclose(laws.posterior.mean, truth[3:], rtol=1e-11)
    assert_allclose(laws.predicted.mean, truth[3:], rtol=1e-11)
    # Without the input the first prediction misses by B a, and the filter lags.
    without = follow(uniform_acceleration(dt, 100.0, 2.0), position, dt)
    assert_allclose(
        (truth[3:] - without.predicted.mean)[0, 0],
        np.concatenate([a * dt**2 / 2, a * dt]),
        rtol=1e-9,
    )


# ---------------------------------------------------------------- the track


@pytest.mark.parametrize("seed", range(5))
def test_the_track_stays_on_the_screen_and_comes_to_rest(seed):
    track = hand_track(seed)
    position = track.at(np.linspace(0, track.end, 5000)).position
    assert (position >= -1e-9).all() and (position <= np.array([640, 400]) + 1e-9).all()
    assert (np.hypot(*track.displacement.T) >= SHORTEST).all()
    before, after = track.at(np.array(-1.0)), track.at(np.array(track.end + 1))
    assert_allclose(before.position, track.origin, rtol=1e-12)
    assert_allclose(after.position, track.origin + track.displacement.sum(axis=0), rtol=1e-12)
    for motion in (before, after):
        assert not motion.velocity.any() and not motion.acceleration.any()


# ---------------------------------------------------------------- errors


def test_arguments_that_do_not_fit():
    y = np.zeros((5, 1, 2))
    system = uniform_acceleration(0.1, 1.0, 1.0)
    for call, message in (
        (lambda: uniform_acceleration(0.0, 1.0, 1.0), "interval must be positive and finite"),
        (lambda: uniform_acceleration(0.1, -1.0, 1.0), "acceleration_sd must be finite and not"),
        (lambda: start_up(y, 0.1, np.eye(2)), "three complete samples of two coordinates"),
        (lambda: follow(system, y[:3], 0.1), "more than three samples"),
        (lambda: hand_track(1, strokes=0), "strokes must be a positive whole number"),
        (lambda: follow(system, y, 0.2), "made for an interval of 0.1 s, and the samples have 0.2"),
    ):
        with pytest.raises(ValueError, match=message):
            call()
