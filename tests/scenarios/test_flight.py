"""The simulated flight, what a radar measures of it, and errors by part."""

import numpy as np
import oracles
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

from kfcourse.scenarios.errors import rms_by_part, rms_difference
from kfcourse.scenarios.flight import aircraft
from kfcourse.scenarios.radar import (
    cartesian,
    measure_cartesian,
    measure_spherical,
    spherical,
)

# Not the defaults: every number different.
OTHER = dict(speeds=(180.0, 110.0), radii=(4_000.0, 9_000.0), descent=7.0, ramp=6.0)


def test_the_path_is_that_of_an_integrator_that_knows_only_speed_and_turn_rate():
    track = aircraft(1.3, **OTHER)
    speeds, radii, ramp = OTHER["speeds"], OTHER["radii"], OTHER["ramp"]
    first, second = 1.5 * np.pi * radii[0] / speeds[0], np.pi * radii[1] / speeds[1]
    ends = np.cumsum([120.0, first + ramp, 60.0, second + ramp, 100.0])

    def smooth(u):
        u = min(max(u, 0.0), 1.0)
        return 3 * u**2 - 2 * u**3

    def bump(t, start, end):
        return smooth((t - start) / ramp) - smooth((t - end + ramp) / ramp)

    def slope(t, state):
        _, _, _, speed, heading = state
        rate = speeds[0] / radii[0] * bump(t, ends[0], ends[1]) + speeds[1] / radii[1] * bump(
            t, ends[2], ends[3]
        )
        slowing = -(speeds[0] - speeds[1]) / (60.0 - ramp) * bump(t, ends[1], ends[2])
        sinking = -7.0 * smooth((t - ends[2]) / ramp)
        return [speed * np.cos(heading), speed * np.sin(heading), sinking, slowing, rate]

    first = [-15_000.0, 25_000.0, 8_500.0, speeds[0], 0.0]
    options = dict(method="DOP853", rtol=1e-12, atol=1e-9, max_step=0.5)
    solved = solve_ivp(slope, (0, track.time[-1]), first, t_eval=track.time, **options).y.T
    # Tolerance 1e-12 of 4e4 m over some 10^3 steps; the kinks of the ramps and the interpolation
    # between steps cost more.
    assert_allclose(track.position, solved[:, :3], rtol=0, atol=1e-4)
    assert_allclose(np.linalg.norm(track.velocity[:, :2], axis=1), solved[:, 3], rtol=0, atol=1e-6)
    assert_array_equal(track.part, 1 + np.searchsorted(ends[:4], track.time))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"interval": 0.0}, "interval must be positive"),
        ({"radii": (6e3, np.inf)}, "radii must be positive and finite"),
        ({"ramp": 30.0}, "part 3 lasts 60 s, no longer than its two ramps"),
        ({"descent": 40.0}, "lower `descent`"),
    ],
)
def test_a_flight_that_cannot_be_flown_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        aircraft(**({"interval": 1.0} | change))


# --- measurements


def test_the_two_sets_of_formulas_are_inverse():
    position = np.random.default_rng(1).normal(size=(50, 3))
    assert_allclose(cartesian(spherical(position)), position, rtol=1e-12)


def test_measurements_have_the_given_errors():
    track, runs = aircraft(10.0), 4000
    true = spherical(track.position)
    for measure, expected, sigmas in (
        (measure_cartesian, track.position, (10.0, 30.0, 50.0)),
        (measure_cartesian, track.position, 20.0),
        (measure_spherical, true, (40.0, 2e-3, 3e-3)),
    ):
        measured = measure(track, sigmas, runs, seed=1)
        assert measured.shape == (len(track.time), runs, 3)
        noise = (measured - expected[:, None]) / np.array(sigmas)
        oracles.has_moments(noise.reshape(-1, 3), np.zeros(3), np.eye(3))


@pytest.mark.parametrize(
    ("sigmas", "runs", "message"),
    [
        ((1.0, 2.0), 3, "one number or three"),
        (-1.0, 3, "not negative"),
    ],
)
def test_measurements_that_cannot_be_are_refused(sigmas, runs, message):
    with pytest.raises(ValueError, match=message):
        measure_cartesian(aircraft(50.0), sigmas, runs, seed=1)


# --- models and errors


def test_rms_by_part_by_hand():
    # (3 steps, 2 runs, 2)
    error = np.array([[[3.0, 4.0], [0.0, 1.0]], [[0.0, 0.0], [1.0, 0.0]], [[2.0, 0.0], [0.0, 6.0]]])
    part = np.array([1, 1, 7])
    rms, squares = rms_by_part(error, part), np.array([[12.5, 1], [4, 36]])
    assert rms.value == pytest.approx(np.sqrt(squares.mean(axis=1)))
    # the jackknife of two runs: half the difference of what each gives alone
    alone = np.sqrt(squares)
    assert rms.standard_error == pytest.approx(abs(alone[:, 0] - alone[:, 1]) / 2)
    assert rms.freedom == 1
    difference = rms_difference(error, 0 * error, part)
    assert_array_equal(difference.value, rms.value)
    assert_array_equal(difference.standard_error, rms.standard_error)
    with pytest.raises(ValueError, match="could not be broadcast"):  # of the same runs
        rms_difference(error, np.tile(error, (1, 2, 1)), part)
    for few, labels in ((error[:, :1], part), (error, part[:2])):
        with pytest.raises(ValueError, match="two runs at least"):
            rms_by_part(few, labels)


def test_a_position_has_three_components():
    assert spherical([3, 4, 0])[0] == 5
    with pytest.raises(ValueError, match="a range is in m and angles in rad"):
        measure_spherical(aircraft(100.0), 5.0, 1, seed=1)
