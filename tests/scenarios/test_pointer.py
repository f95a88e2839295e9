"""The pointer's track, the model of uniformly accelerated motion, the start-up from three
samples."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from kfcourse.scenarios.pointer import (
    SHORTEST,
    acceleration_from,
    follow,
    hand_track,
    sample,
    start_up,
    uniform_acceleration,
)

pytestmark = pytest.mark.quick

# ---------------------------------------------------------------- the model


def test_the_matrices_are_those_of_the_paper():
    dt, sd = 0.1, 7.0
    model_ = uniform_acceleration(dt, sd, 3.0)
    F = [[1, 0, dt, 0], [0, 1, 0, dt], [0, 0, 1, 0], [0, 0, 0, 1]]
    G = np.diag([dt**2 / 2, dt**2 / 2, dt, dt])  # acts on (ax, ay, ax, ay)
    assert_allclose(model_.A, F, rtol=1e-15)
    assert_allclose(model_.H, [[1, 0, 0, 0], [0, 1, 0, 0]], rtol=1e-15)
    assert_allclose(model_.B @ [2.0, -5.0], G @ [2.0, -5.0, 2.0, -5.0], rtol=1e-14)
    assert_allclose(model_.R, 9 * np.eye(2), rtol=1e-15)
    # Covariance of what a random acceleration (ax, ay), constant in the interval, does to (x, y,
    # vx, vy).
    effect = G @ np.array([[1, 0], [0, 1], [1, 0], [0, 1]])
    assert_allclose(model_.Q, sd**2 * effect @ effect.T, rtol=1e-13)


# ---------------------------------------------------------------- start-up


def test_the_start_up_is_the_parabola_through_three_samples():
    rng, dt = np.random.default_rng(1), 0.3
    y = rng.normal(size=(3, 5, 2))
    law = start_up(y, dt, np.eye(2))
    t = dt * np.array([-2, -1, 0])  # the last sample at 0
    for run in range(5):
        for axis in range(2):
            c2, c1, c0 = np.polyfit(t, y[:, run, axis], 2)
            assert_allclose(law.mean[run, axis::2], [c0, c1, 2 * c2], rtol=1e-11, atol=1e-11)


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


@pytest.mark.parametrize("interval", [0.0, np.nan])
def test_an_interval_that_is_none(interval):
    track, y = hand_track(1, strokes=2), np.zeros((5, 1, 2))
    for call in (
        lambda: uniform_acceleration(interval, 1.0, 1.0),
        lambda: start_up(y[:3], interval, np.eye(2)),
        lambda: acceleration_from(y, interval),
        lambda: sample(track, interval, 1.0, 1, 0),
    ):
        with pytest.raises(ValueError, match="interval must be positive and finite"):
            call()


def test_arguments_that_do_not_fit():
    y = np.zeros((5, 1, 2))
    system = uniform_acceleration(0.1, 1.0, 1.0)
    missing = y.copy()
    missing[1, 0, 0] = np.nan
    for call, message in (
        (lambda: uniform_acceleration(0.1, -1.0, 1.0), "acceleration_sd must be finite and not"),
        (lambda: uniform_acceleration(0.1, 1.0, np.nan), "measurement_sd must be finite and not"),
        (lambda: start_up(y, 0.1, np.eye(2)), "three complete samples of two coordinates"),
        (lambda: start_up(missing[:3], 0.1, np.eye(2)), "missing 1"),
        (lambda: follow(system, y[:3], 0.1), "more than three samples"),
        (lambda: hand_track(1, strokes=0), "strokes must be a positive whole number"),
        (lambda: sample(hand_track(1), 0.1, -1.0, 1, 0), "measurement_sd must be finite and not"),
        (lambda: follow(system, y, 0.2), "made for an interval of 0.1 s, and the samples have 0.2"),
    ):
        with pytest.raises(ValueError, match=message):
            call()
