"""Integrated navigation: exact transitions, sensors with clocks and delays, and the event-driven
filter."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import oracles
import pytest
import scipy.linalg
from numpy.testing import assert_allclose

from kfcourse import Gaussian
from kfcourse.scenarios.navigation import (
    Clock,
    Dynamics,
    Inputs,
    Observation,
    Sensor,
    fuse,
    observe,
    sample,
)

# Position and velocity driven by a known acceleration, with white noise of both; everything
# non-unit.
A = np.array([[0.0, 1.0], [-0.04, -0.3]])
QC = np.array([[0.02, 0.01], [0.01, 0.5]])
B = np.array([[0.1], [1.3]])
DRIVEN = Dynamics(A, QC, B)
FREE = Dynamics(A, QC)
STATES = ["s", "V"]
PRIOR = Gaussian(np.array([3.0, -1.0]), np.array([[4.0, 0.6], [0.6, 2.0]]))
ROUNDING = 1e-10  # hundreds of steps, each rounding numbers of order 10 to 2e-15


def inputs_until(duration: float, period: float, runs: int = 1, seed: int = 5) -> Inputs:
    times = period * np.arange(math.ceil(duration / period) + 1)
    return Inputs(times, np.random.default_rng(seed).normal(size=(len(times), runs, 1)))


def two_sensors(**timing) -> list[Sensor]:
    return [
        Sensor.define("fast", STATES, "2*V - s + w", variance=0.3, period=0.05, latency=0.01),
        Sensor.define(
            "slow", STATES, ["s + w1", "s + V + w2"], [[0.5, 0.2], [0.2, 0.8]], 0.4, **timing
        ),
    ]


def measured(
    sensors: list[Sensor],
    duration: float,
    runs: int,
    outputs,
    seed: int = 1,
    dynamics=FREE,
    inputs=None,
):
    """True states at the outputs, and the messages."""
    moments = np.unique(
        np.concatenate(
            [np.asarray(outputs, float), [0.0], *(s.captures(duration) for s in sensors)]
        )
    )
    path = sample(dynamics, PRIOR, moments, runs, seed, inputs)
    return path(np.asarray(outputs, float)), observe(sensors, path, duration, seed + 1)


# ---------------------------------------------------------------- transitions


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.zeros((2, 3)), np.eye(2)), "A and Qc must be square matrices (n, n), and B"),
        ((A, [[1.0, 0.5], [0.0, 1.0]]), "symmetric"),
        ((A, QC, [[1.0]]), "got the shapes (2, 2), (2, 2) and (1, 1)"),
    ],
)
def test_dynamics_says_what_is_wrong(arguments, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        Dynamics(*arguments)


# ---------------------------------------------------------------- true paths


def test_paths_have_the_moments_of_the_dynamics():
    """At two moments, and jointly: x(2.3) = exp(1.5 A) x(0.8) and what is independent of it."""
    path = sample(FREE, PRIOR, np.array([0.5, 0.8, 2.3]), 40_000, seed=3)
    first, then = FREE.over(0.3), FREE.over(1.5)
    mean, cov = first.A @ PRIOR.mean, first.A @ PRIOR.cov @ first.A.T + first.Q
    joint = np.block([[cov, cov @ then.A.T], [then.A @ cov, then.A @ cov @ then.A.T + then.Q]])
    oracles.has_moments(np.hstack(path.states[1:]), np.hstack([mean, then.A @ mean]), joint)


@pytest.mark.parametrize("times", [[], [0.0, 0.0], [0.0, np.nan]])
def test_sampling_needs_ascending_times(times):
    with pytest.raises(ValueError, match="ascending"):
        sample(FREE, PRIOR, np.array(times), 2, 0)


# ---------------------------------------------------------------- clocks and sensors


def test_clock_is_found_from_pairs():
    clock = Clock(rate=1 + 3e-5, shift=345_600.25)  # seconds of the week
    times = np.sort(np.random.default_rng(4).uniform(0, 600, 200))
    readings = clock.reading(times)
    exact = Clock.fit(times, readings)
    # readings of 3e5 s are rounded to 3e-11 s, the span is 600 s
    assert exact.rate == pytest.approx(clock.rate, abs=1e-12)
    assert_allclose(exact.time(readings), times, rtol=0, atol=1e-9)

    sigma = 1e-3
    noisy = times + sigma * np.random.default_rng(5).normal(size=200)
    fitted = Clock.fit(noisy, readings)
    spread = np.sqrt(np.sum((times - times.mean()) ** 2))
    assert abs(fitted.rate - clock.rate) < 4 * sigma / spread
    # standard error of a regression line
    at_end = sigma * np.sqrt(1 / 200 + (600 - times.mean()) ** 2 / spread**2)
    assert abs(fitted.time(clock.reading(600.0)) - 600.0) < 4 * at_end


def test_captures_are_even_on_the_sensors_own_clock():
    sensor = Sensor.define("a", STATES, "s + w", 1.0, 0.4, offset=0.1, clock=Clock(1.6, -0.3))
    times = sensor.captures(2.0)
    # readings 0.1 + 0.4 k between -0.3 and 2.9: -0.3, 0.1, ..., 2.9, at the filter's times 0, 0.25,
    # ..., 2
    assert_allclose(times, 0.25 * np.arange(9), rtol=0, atol=1e-15)
    # ends that are moments of capture but for rounding: 0.3 / 0.1 < 3, and the reading 0.1 + 0.2 at
    # the start is above 3 * 0.1
    for clock in (Clock(), Clock(shift=0.1 + 0.2)):
        sensor = Sensor.define("b", STATES, "s + w", 1.0, 0.1, clock=clock)
        assert sensor.captures(0.3).tolist() == pytest.approx([0, 0.1, 0.2, 0.3])


def test_what_is_observed():
    clock = Clock(1 + 1e-3, 0.7)
    timing = {"latency": 0.2, "jitter": 0.05, "clock": clock}
    meter = "s*(1 + c*w) - V"
    sensor = Sensor.define("a", STATES, meter, 4.0, 0.1, parameters={"c": 0.3}, **timing)
    runs = 2000
    truth = lambda times: np.broadcast_to(  # noqa: E731
        np.stack([2 + times, 0 * times + 0.5], -1)[:, None], (len(times), runs, 2)
    )
    messages = observe([sensor], truth, 3.0, seed=6)
    times = np.array([clock.time(m.tag) for m in messages])
    order = np.argsort(times)
    assert_allclose(times[order], sensor.captures(3.0), rtol=0, atol=1e-12)
    delays = np.array([m.arrival for m in messages]) - times
    assert ((delays >= 0.2) & (delays <= 0.25)).all() and np.std(delays) > 0.005
    assert [m.arrival for m in messages] == sorted(m.arrival for m in messages)
    for message, time in zip(messages, times, strict=True):
        error = message.value[:, 0] - (2 + time - 0.5)
        oracles.is_mean(0, error)
        oracles.is_mean((0.3 * 2.0 * (2 + time)) ** 2, error**2)


@pytest.mark.parametrize(
    ("timing", "message"),
    [
        ({"latency": -0.1}, "latency must be finite and not negative"),
        ({"clock": Clock(0.0)}, "positive finite rate"),
    ],
)
def test_sensor_says_what_is_wrong(timing, message):
    with pytest.raises(ValueError, match=f"gyro: .*{message}"):
        Sensor.define("gyro", STATES, "s + w", 1.0, 0.1, **timing)


def test_observe_says_what_is_wrong():
    first, second = two_sensors()
    with pytest.raises(ValueError, match="a name of its own"):
        observe([first, replace(second, name="fast")], lambda times: np.zeros(0), 1.0, 0)


# ---------------------------------------------------------------- fusion: the Kalman filter


METERS = {
    "fast": (np.array([[-1.0, 2.0]]), np.array([[0.3]])),
    "slow": (np.array([[1.0, 0.0], [1.0, 1.0]]), np.array([[0.5, 0.2], [0.2, 0.8]])),
}


def moved(start, end, inputs):
    """A, constant and Q of the motion between two moments."""
    loan = scipy.linalg.expm(np.block([[-A, QC], [np.zeros((2, 2)), A.T]]) * (end - start))
    F, known = loan[2:, 2:].T, np.zeros(2)
    if inputs is not None:
        until = [*inputs.times[1:], np.inf]
        for begin, stop, value in zip(inputs.times, until, inputs.values[:, 0], strict=True):
            left, right = max(begin, start), min(stop, end)
            if right > left:  # the part of the interval with this value, carried on to the end
                held = scipy.linalg.expm(np.block([[A, B], [np.zeros((1, 3))]]) * (right - left))
                known += scipy.linalg.expm(A * (end - right)) @ held[:2, 2:] @ value
    return F, known, F @ loan[:2, 2:]


def slow_filter(messages, sensors, now, inputs=None):
    """Straight from the page, one run: all that has arrived, in the order of capture, from the
    prior."""
    clock = {sensor.name: sensor.clock for sensor in sensors}
    arrived = sorted(
        ((clock[m.sensor].time(m.tag), m) for m in messages if m.arrival <= now),
        key=lambda pair: pair[0],
    )
    times = [0.0, *(tag for tag, _ in arrived), now]
    (F, known, Q), *moves = (moved(*pair, inputs) for pair in pairwise(times))
    prior = F @ PRIOR.mean + known, F @ PRIOR.cov @ F.T + Q
    steps, y = [], []
    for move, (_, message) in zip(moves, arrived, strict=True):
        H, R = METERS[message.sensor]
        steps.append((*move, H, np.zeros(len(H)), R))
        y.append(message.value[0])
    # at last nothing is measured: what is predicted is the estimate
    steps.append((np.eye(2), np.zeros(2), np.zeros((2, 2)), *steps[0][3:]))
    y.append(np.full(len(steps[0][5]), np.nan))
    return list(oracles.kalman_loop(steps, prior, y))[-1][0]


@pytest.mark.parametrize("with_inputs", [False, True])
def test_late_measurements_are_used_as_on_the_page(with_inputs):
    """Delays up to three times the slow sensor's period, an own clock, outputs between
    everything."""
    sensors = two_sensors(latency=0.3, jitter=0.9, clock=Clock(1.003, 0.7))
    dynamics, inputs = (DRIVEN, inputs_until(5.0, 0.13)) if with_inputs else (FREE, None)
    outputs = np.sort(np.random.default_rng(8).uniform(0, 4.5, 25))
    _, messages = measured(sensors, 4.0, 1, outputs, 4, dynamics, inputs)
    tags = [sensors[1].clock.time(m.tag) for m in messages if m.sensor == "slow"]
    assert tags != sorted(tags), "nothing came out of order: the test would not see an error"
    ours = fuse(dynamics, sensors, PRIOR, messages, outputs, inputs=inputs)
    for k, now in enumerate(outputs):
        mean, cov = slow_filter(messages, sensors, now, inputs)
        assert_allclose(ours.mean[k, 0], mean, rtol=0, atol=ROUNDING)
        assert_allclose(ours.cov[k, 0], cov, rtol=0, atol=ROUNDING)


# ---------------------------------------------------------------- fusion: what it refuses


GOOD = Observation("fast", 1.0, 1.1, np.zeros((3, 1)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"observations": [GOOD._replace(sensor="gyro")]},
            "'gyro', but the filter knows only fast, slow",
        ),
        (
            {"observations": [GOOD._replace(tag=np.nan)]},
            "fast: a measurement has a finite tag and arrival, and a value (runs, 1); got nan, 1.1",
        ),
        (
            {"observations": [GOOD._replace(arrival=0.9)]},
            "captured at t = 1 s by its tag, but arrived before that, at 0.9 s",
        ),
        ({"observations": [GOOD._replace(value=np.full((3, 1), np.inf))]}, "finite, or NaN"),
        (
            {"observations": [GOOD, GOOD._replace(value=np.zeros((2, 1)))]},
            "different numbers of runs: [2, 3]",
        ),
        (
            {"prior": Gaussian(np.zeros(3), np.eye(3))},
            "prior's mean must have the shape (2,) or (1, 2), its covariance",
        ),
        (
            {"sensors": [Sensor.define("short", ["s"], "s + w", 1.0, 0.1)]},
            "short was defined with 1 state component(s)",
        ),
        ({"dynamics": DRIVEN}, "have 1 known input(s); give them"),
        (
            {"dynamics": DRIVEN, "inputs": Inputs(np.array([0.5]), np.zeros((1, 1, 1)))},
            "begin at t = 0.5 s, but are needed from t = 0 s",
        ),
    ],
)
def test_fuse_says_what_is_wrong(changes, message):
    usual = {"dynamics": FREE, "sensors": two_sensors(), "prior": PRIOR, "times": [2.0]}
    with pytest.raises(ValueError, match=re.escape(message)):
        fuse(**{**usual, "observations": [], **changes})


@pytest.mark.parametrize("readings", [[9, 7, 5], [1, np.nan, 3], [1, 1, 1]])
def test_no_clock_runs_backwards(readings):
    with pytest.raises(ValueError, match="readings"):
        Clock.fit([0, 1, 2], readings)
