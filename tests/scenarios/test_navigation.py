"""Integrated navigation: exact transitions, sensors with clocks and delays, and the event-driven filter."""

from __future__ import annotations

import math
import re
import tracemalloc
from dataclasses import replace

import control
import filterpy.kalman
import numpy as np
import pytest
import scipy.linalg

from kfcourse import Model
from kfcourse.laws import Gaussian
from kfcourse.linear import LinearSystem, run
from kfcourse.linear.consistency import nees
from kfcourse.scenarios.navigation import (
    Clock,
    Dynamics,
    Inputs,
    Observation,
    Path,
    Sensor,
    follow,
    fuse,
    observe,
    sample,
)

pytestmark = pytest.mark.quick

# Position and velocity driven by a known acceleration, with white noise of both; everything non-unit.
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
        Sensor.define("slow", STATES, ["s + w1", "s + V + w2"], [[0.5, 0.2], [0.2, 0.8]], 0.4, **timing),
    ]


def measured(sensors: list[Sensor], duration: float, runs: int, outputs, seed: int = 1, dynamics=FREE, inputs=None):
    """True states at the outputs, and the messages."""
    moments = np.unique(np.concatenate([np.asarray(outputs, float), [0.0], *(s.captures(duration) for s in sensors)]))
    path = sample(dynamics, PRIOR, moments, runs, seed, inputs)
    return path(np.asarray(outputs, float)), observe(sensors, path, duration, seed + 1)


# ---------------------------------------------------------------- transitions


@pytest.mark.parametrize("dt", [0.0, 1e-6, 0.3, 40.0, 5000.0])
def test_transition_of_an_exponentially_correlated_process(dt):
    # dt = 5000: exp(+a dt) = exp(4000) would overflow; Q must be the stationary variance
    a, q, b = 0.8, 0.7, 2.0
    step = Dynamics([[-a]], [[q]], [[b]]).over(dt)
    expected = math.exp(-a * dt), -b * math.expm1(-a * dt) / a, -q * math.expm1(-2 * a * dt) / (2 * a)
    # a hundred operations of doubling, on numbers below 1: relative 1e-13, and exp(-4000) is 0
    assert (step.A.item(), step.B.item(), step.Q.item()) == pytest.approx(expected, rel=1e-13, abs=1e-300)


def test_transition_of_a_double_integrator():
    q, dt = 0.7, 1.7
    step = Dynamics([[0, 1], [0, 0]], np.diag([0, q]), [[0], [1]]).over(dt)
    np.testing.assert_allclose(step.A, [[1, dt], [0, 1]], rtol=1e-14)
    np.testing.assert_allclose(step.B, [[dt**2 / 2], [dt]], rtol=1e-14)
    np.testing.assert_allclose(step.Q, q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]), rtol=1e-14)


def test_two_transitions_are_one():
    first, second, whole = (DRIVEN.over(dt) for dt in (0.37, 1.21, 1.58))
    np.testing.assert_allclose(second.A @ first.A, whole.A, rtol=0, atol=1e-14)
    np.testing.assert_allclose(second.A @ first.B + second.B, whole.B, rtol=0, atol=1e-14)
    np.testing.assert_allclose(second.A @ first.Q @ second.A.T + second.Q, whole.Q, rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.zeros((2, 3)), np.eye(2)), "A must be a square matrix"),
        ((A, np.eye(3)), "Qc has the shape (3, 3); with 2 states it is (2, 2)"),
        ((A, np.diag([1.0, -1.0])), "not negative"),
        ((A, [[1.0, 0.5], [0.0, 1.0]]), "symmetric"),
        ((A, QC, [[1.0]]), "B has the shape (1, 1); with 2 states"),
        ((A * np.nan, QC), "A must be finite"),
        ((A, QC, [[np.inf], [0.0]]), "B must be finite"),
    ],
)
def test_dynamics_says_what_is_wrong(arguments, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        Dynamics(*arguments)


@pytest.mark.parametrize("dt", [-1e-3, np.nan, np.inf])
def test_an_interval_must_be_finite_and_not_negative(dt):
    with pytest.raises(ValueError, match="finite and not negative"):
        DRIVEN.over(dt)


# ---------------------------------------------------------------- true paths


def test_paths_have_the_moments_of_the_dynamics():
    runs, times = 40_000, np.array([0.5, 0.8, 2.3])
    path = sample(FREE, PRIOR, times, runs, seed=3)
    step = FREE.over(1.8)
    mean, cov = step.A @ PRIOR.mean, step.A @ PRIOR.cov @ step.A.T + step.Q
    last = path.states[-1]
    # four standard errors: of a mean, sqrt(c_ii / N); of a covariance, sqrt((c_ii c_jj + c_ij^2) / N)
    assert (np.abs(last.mean(axis=0) - mean) < 4 * np.sqrt(np.diag(cov) / runs)).all()
    bound = 4 * np.sqrt((np.outer(np.diag(cov), np.diag(cov)) + cov**2) / runs)
    assert (np.abs(np.cov(last.T) - cov) < bound).all()
    # ... and jointly: x(2.3) on x(0.8) has the slope exp(A 1.5)
    slope, residual, *_ = np.linalg.lstsq(path.states[1] - path.states[1].mean(0), last - last.mean(0))
    errors = np.sqrt(np.outer(np.diag(np.linalg.inv(np.cov(path.states[1].T))), residual / runs) / runs)
    assert (np.abs(slope - FREE.over(1.5).A.T) < 4 * errors).all()


def test_paths_follow_the_inputs():
    inputs = inputs_until(2.0, 0.25)
    path = sample(
        Dynamics(A, np.zeros((2, 2)), B), Gaussian(PRIOR.mean, np.zeros((2, 2))), np.array([0.1, 0.9, 1.3]), 2, 0, inputs
    )
    x, small = PRIOR.mean, DRIVEN.over(1e-3)  # the inputs change at multiples of 0.25 s
    for k in range(100, 1300):
        if k == 900:
            np.testing.assert_allclose(path.states[1], [x, x], rtol=0, atol=ROUNDING)
        x = small.A @ x + small.B @ inputs.values[k // 250, 0]
    np.testing.assert_allclose(path.states[2], [x, x], rtol=0, atol=ROUNDING)


def test_a_path_knows_only_its_own_moments():
    path = Path(np.array([0.1, 0.2, 0.1 + 0.2, 0.6, 0.9]), np.arange(5.0).reshape(5, 1, 1))
    # 0.3 < 0.1 + 0.2 and 0.6 < 6 * 0.1 by rounding
    assert path(np.array([0.3, 0.1, 6 * 0.1])).ravel().tolist() == [2.0, 0.0, 3.0]
    for time in (0.15, 0.0, 0.5, 1.0):
        with pytest.raises(ValueError, match=f"not known at t = {time:g} s"):
            path(np.array([0.2, time]))


@pytest.mark.parametrize("times", [[], [0.0, 0.0], [1.0, 0.5], [0.0, np.nan]])
def test_sampling_needs_ascending_times(times):
    with pytest.raises(ValueError, match="ascending"):
        sample(FREE, PRIOR, np.array(times), 2, 0)


# ---------------------------------------------------------------- clocks and sensors


def test_clock_there_and_back():
    clock = Clock(rate=1.25, shift=-3.0)
    assert clock.reading(8.0) == 7.0
    assert clock.time(7.0) == 8.0


def test_clock_is_found_from_pairs():
    clock = Clock(rate=1 + 3e-5, shift=345_600.25)  # seconds of the week
    times = np.sort(np.random.default_rng(4).uniform(0, 600, 200))
    readings = clock.reading(times)
    exact = Clock.fit(times, readings)
    # readings of 3e5 s are rounded to 3e-11 s, the span is 600 s
    assert exact.rate == pytest.approx(clock.rate, abs=1e-12)
    np.testing.assert_allclose(exact.time(readings), times, rtol=0, atol=1e-9)

    sigma = 1e-3
    noisy = times + sigma * np.random.default_rng(5).normal(size=200)
    fitted = Clock.fit(noisy, readings)
    spread = np.sqrt(np.sum((times - times.mean()) ** 2))
    assert abs(fitted.rate - clock.rate) < 4 * sigma / spread
    at_end = sigma * np.sqrt(1 / 200 + (600 - times.mean()) ** 2 / spread**2)  # standard error of a regression line
    assert abs(fitted.time(clock.reading(600.0)) - 600.0) < 4 * at_end


@pytest.mark.parametrize("pairs", [([1.0], [1.0]), ([1.0, 2.0], [3.0, 3.0]), ([1.0, 2.0], [3.0])])
def test_clock_needs_two_pairs(pairs):
    with pytest.raises(ValueError, match="two or more pairs"):
        Clock.fit(*map(np.array, pairs))


def test_captures_are_even_on_the_sensors_own_clock():
    sensor = Sensor.define("a", STATES, "s + w", 1.0, 0.4, offset=0.1, clock=Clock(1.6, -0.3))
    times = sensor.captures(2.0)
    # readings 0.1 + 0.4 k between -0.3 and 2.9: -0.3, 0.1, ..., 2.9, at the filter's times 0, 0.25, ..., 2
    np.testing.assert_allclose(times, 0.25 * np.arange(9), rtol=0, atol=1e-15)
    # ends that are moments of capture but for rounding: 0.3 / 0.1 < 3, and the reading 0.1 + 0.2 at the start is above 3 * 0.1
    for clock in (Clock(), Clock(shift=0.1 + 0.2)):
        sensor = Sensor.define("b", STATES, "s + w", 1.0, 0.1, clock=clock)
        assert sensor.captures(0.3).tolist() == pytest.approx([0, 0.1, 0.2, 0.3])


def test_what_is_observed():
    clock = Clock(1 + 1e-3, 0.7)
    sensor = Sensor.define("a", STATES, "s*(1 + c*w) - V", 4.0, 0.1, parameters={"c": 0.3}, latency=0.2, jitter=0.05, clock=clock)
    runs = 2000
    truth = lambda times: np.broadcast_to(np.stack([2 + times, 0 * times + 0.5], -1)[:, None], (len(times), runs, 2))  # noqa: E731
    messages = observe([sensor], truth, 3.0, seed=6)
    times = np.array([clock.time(m.tag) for m in messages])
    order = np.argsort(times)
    np.testing.assert_allclose(times[order], sensor.captures(3.0), rtol=0, atol=1e-12)
    delays = np.array([m.arrival for m in messages]) - times
    assert ((delays >= 0.2) & (delays <= 0.25)).all() and np.std(delays) > 0.005
    assert [m.arrival for m in messages] == sorted(m.arrival for m in messages)
    for message, time in zip(messages, times, strict=True):
        error = message.value[:, 0] - (2 + time - 0.5)
        sigma = 0.3 * 2.0 * (2 + time)
        # four standard errors of a mean and of a standard deviation; 31 moments are looked at
        assert abs(error.mean()) < 4 * sigma / np.sqrt(runs)
        assert abs(error.std() / sigma - 1) < 4 / np.sqrt(2 * runs)


@pytest.mark.parametrize(
    ("timing", "message"),
    [
        ({"latency": -0.1}, "latency must be finite and not negative"),
        ({"jitter": -0.1}, "jitter must be finite and not negative"),
        ({"offset": np.nan}, "offset must be finite"),
        ({"clock": Clock(0.0)}, "positive finite rate"),
        ({"clock": Clock(1.0, np.inf)}, "finite shift"),
    ],
)
def test_sensor_says_what_is_wrong(timing, message):
    with pytest.raises(ValueError, match=f"gyro: .*{message}"):
        Sensor.define("gyro", STATES, "s + w", 1.0, 0.1, **timing)


def test_sensor_needs_a_positive_period():
    with pytest.raises(ValueError, match="gyro: the period must be positive and finite, got 0"):
        Sensor.define("gyro", STATES, "s + w", 1.0, 0)


def test_observe_says_what_is_wrong():
    first, second = two_sensors()
    with pytest.raises(ValueError, match="a name of its own"):
        observe([first, replace(second, name="fast")], lambda times: np.zeros((len(times), 1, 2)), 1.0, 0)
    with pytest.raises(
        ValueError, match=re.escape("fast: the truth at 21 moments must have the shape (21, runs, 2), got (21, 2)")
    ):
        observe([first], lambda times: np.zeros((len(times), 2)), 1.0, 0)


# ---------------------------------------------------------------- fusion: the Kalman filter


def test_synchronous_sensors_are_the_kalman_filter():
    """One period, no delay, an input that changes between the steps: kfcourse.linear.run on the stacked vector."""
    period, steps, runs = 0.2, 40, 3
    sensors = [
        Sensor.define("one", STATES, "2*V - s + w", 0.3, period),
        Sensor.define("two", STATES, ["s + w1", "s + V + w2"], [[0.5, 0.2], [0.2, 0.8]], period),
    ]
    outputs = period * np.arange(steps)
    inputs = Inputs(outputs, np.random.default_rng(7).normal(size=(steps, runs, 1)))
    _, messages = measured(sensors, outputs[-1], runs, outputs, 2, DRIVEN, inputs)
    ours = fuse(DRIVEN, sensors, PRIOR, messages, outputs, inputs=inputs)

    step = DRIVEN.over(period)
    R = scipy.linalg.block_diag([[0.3]], [[0.5, 0.2], [0.2, 0.8]])
    system = LinearSystem(step.A, [[-1, 2], [1, 0], [1, 1]], step.Q, R, step.B)
    by_moment = {round(t / period): {} for t in outputs}
    for m in messages:
        by_moment[round(m.tag / period)][m.sensor] = m.value
    y = np.stack([np.concatenate([values["one"], values["two"]], axis=1) for values in by_moment.values()])
    expected = run(system, PRIOR, y, inputs.values).posterior
    np.testing.assert_allclose(ours.mean, expected.mean, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(ours.cov, expected.cov, rtol=0, atol=ROUNDING)

    riccati = control.dare(step.A.T, system.H.T, step.Q, R)[0]
    gain = np.linalg.solve(system.H @ riccati @ system.H.T + R, system.H @ riccati).T
    # after 40 steps the start is forgotten to (largest eigenvalue of (I - K H) A)^80
    forgotten = np.abs(np.linalg.eigvals((np.eye(2) - gain @ system.H) @ step.A)).max() ** (2 * steps)
    np.testing.assert_allclose(ours.cov[-1, 0], riccati - gain @ system.H @ riccati, rtol=0, atol=10 * forgotten + ROUNDING)


def slow_filter(messages, sensors, now, inputs=None):
    """Straight from the page, one run: all that has arrived, in the order of capture, from the prior; filterpy's steps."""
    H = {"fast": np.array([[-1.0, 2.0]]), "slow": np.array([[1.0, 0.0], [1.0, 1.0]])}
    R = {"fast": np.array([[0.3]]), "slow": np.array([[0.5, 0.2], [0.2, 0.8]])}
    clock = {sensor.name: sensor.clock for sensor in sensors}
    one = filterpy.kalman.KalmanFilter(dim_x=2, dim_z=2, dim_u=1)
    one.x, one.P = PRIOR.mean.copy(), PRIOR.cov.copy()

    def advance(start, end):
        loan = scipy.linalg.expm(np.block([[-A, QC], [np.zeros((2, 2)), A.T]]) * (end - start))
        F = loan[2:, 2:].T
        known = np.zeros(2)
        if inputs is not None:
            for i, (begin, value) in enumerate(zip(inputs.times, inputs.values[:, 0], strict=True)):
                until = inputs.times[i + 1] if i + 1 < len(inputs.times) else np.inf
                left, right = max(begin, start), min(until, end)
                if right > left:  # the part of the interval with this value, carried on to the end
                    held = scipy.linalg.expm(np.block([[A, B], [np.zeros((1, 3))]]) * (right - left))[:2, 2:]
                    known += scipy.linalg.expm(A * (end - right)) @ held @ value
        one.predict(F=F, Q=F @ loan[:2, 2:])
        one.x = one.x + known

    time = 0.0
    for tag, m in sorted(((clock[m.sensor].time(m.tag), m) for m in messages if m.arrival <= now), key=lambda pair: pair[0]):
        advance(time, tag)
        one.dim_z = len(H[m.sensor])
        one.update(m.value[0], R=R[m.sensor], H=H[m.sensor])
        time = tag
    advance(time, now)
    return one.x, one.P


@pytest.mark.parametrize("with_inputs", [False, True])
def test_late_measurements_are_used_as_on_the_page(with_inputs):
    """Delays up to three times the slow sensor's period, an own clock, outputs between everything."""
    sensors = two_sensors(latency=0.3, jitter=0.9, clock=Clock(1.003, 0.7))
    dynamics, inputs = (DRIVEN, inputs_until(5.0, 0.13)) if with_inputs else (FREE, None)
    outputs = np.sort(np.random.default_rng(8).uniform(0, 4.5, 25))
    _, messages = measured(sensors, 4.0, 1, outputs, 4, dynamics, inputs)
    tags = [sensors[1].clock.time(m.tag) for m in messages if m.sensor == "slow"]
    assert tags != sorted(tags), "nothing came out of order: the test would not see an error"
    ours = fuse(dynamics, sensors, PRIOR, messages, outputs, inputs=inputs)
    for k, now in enumerate(outputs):
        mean, cov = slow_filter(messages, sensors, now, inputs)
        np.testing.assert_allclose(ours.mean[k, 0], mean, rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(ours.cov[k, 0], cov, rtol=0, atol=ROUNDING)


def test_an_estimate_uses_only_what_has_arrived():
    sensors = two_sensors(latency=0.5, jitter=0.3)
    outputs = np.linspace(0, 4, 41)
    _, messages = measured(sensors, 4.0, 2, outputs, 6)
    whole = fuse(FREE, sensors, PRIOR, messages, outputs, depth=0.9)
    part = fuse(FREE, sensors, PRIOR, [m for m in messages if m.arrival <= 2.0], outputs[:21], depth=0.9)
    assert np.array_equal(whole.mean[:21], part.mean)
    assert np.array_equal(whole.cov[:21], part.cov)


def test_a_measurement_of_this_very_moment_counts():
    """0.1 + 0.2 is later than 0.3 by rounding only."""
    sensor = Sensor.define("fast", STATES, "s + w", 0.3, 0.1)
    message = Observation("fast", 0.1 + 0.2, 0.1 + 0.2, np.array([[7.0]]))
    at, after = (fuse(FREE, [sensor], PRIOR, [message], [time]).mean for time in (0.3, 0.3 + 1e-12))
    assert np.abs(at - after).max() < 1e-10
    assert np.abs(at - fuse(FREE, [sensor], PRIOR, [], [0.3]).mean).max() > 1


def test_one_run_is_an_ensemble_of_one():
    sensors = [*two_sensors(latency=0.3), Sensor.define("range", STATES, "sqrt(s**2 + 30**2) + w", 0.1, 0.3)]
    outputs = np.linspace(0, 3, 16)
    _, messages = measured(sensors, 3.0, 4, outputs, 7)
    gap = np.where(np.arange(4)[:, None] == 1, np.nan, 0.0)  # run 1 has none between 1 and 2 s
    messages = [m._replace(value=m.value + gap) if 1 < m.tag < 2 else m for m in messages]
    every = fuse(FREE, sensors, PRIOR, messages, outputs)
    for i in range(4):
        alone = fuse(FREE, sensors, PRIOR, [m._replace(value=m.value[i : i + 1]) for m in messages], outputs)
        np.testing.assert_allclose(alone.mean[:, 0], every.mean[:, i], rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(alone.cov[:, 0], every.cov[:, i], rtol=0, atol=ROUNDING)
    assert (every.cov[8, 1, 0, 0] > every.cov[8, 0, 0, 0]).all()  # the run that missed measurements knows less


def test_a_run_without_a_measurement_keeps_its_prediction():
    sensors = two_sensors()
    value = np.array([[1.0, 2.0], [np.nan, np.nan], [np.nan, 2.0]])
    law = fuse(FREE, sensors, PRIOR, [Observation("slow", 0.4, 0.5, value)], [0.6])
    free = fuse(FREE, sensors, PRIOR, [], [0.6])
    np.testing.assert_allclose(law.mean[0, 1], free.mean[0, 0], rtol=1e-13)
    np.testing.assert_allclose(law.cov[0, 1], free.cov[0, 0], rtol=1e-13)
    only = Sensor.define("slow", STATES, "s + V + w", 0.8, 0.4)
    second = fuse(FREE, [only], PRIOR, [Observation("slow", 0.4, 0.5, np.array([[2.0]]))], [0.6])
    np.testing.assert_allclose(law.mean[0, 2], second.mean[0, 0], rtol=1e-12)


# ---------------------------------------------------------------- fusion: nonlinear sensors


def test_nonlinear_sensors_are_the_extended_kalman_filter():
    """A slow loop in floats: range to a beacon, and a meter with a noise proportional to what it measures."""
    duration, outputs = 6.0, np.array([0.33, 2.0, 4.57, 6.3])
    sensors = [
        Sensor.define("range", STATES, "sqrt((s - d)**2 + 400) + w", 0.25, 0.5, parameters={"d": 7}, latency=0.2),
        Sensor.define("speed", STATES, "V*(1 + c*w)", 1.0, 0.3, parameters={"c": 0.2}, latency=0.05),
    ]
    _, messages = measured(sensors, duration, 1, outputs, 9)
    ours = fuse(FREE, sensors, PRIOR, messages, outputs)
    for k, now in enumerate(outputs):
        z, p, time = PRIOR.mean.copy(), PRIOR.cov.copy(), 0.0
        for m in [*sorted((m for m in messages if m.arrival <= now), key=lambda m: m.tag), None]:
            end = now if m is None else m.tag
            loan = scipy.linalg.expm(np.block([[-A, QC], [np.zeros((2, 2)), A.T]]) * (end - time))
            F = loan[2:, 2:].T
            z, p, time = F @ z, F @ p @ F.T + F @ loan[:2, 2:], end
            if m is None:
                break
            if m.sensor == "range":
                distance = math.hypot(z[0] - 7, 20)
                h, H, R = distance, np.array([(z[0] - 7) / distance, 0.0]), 0.25
            else:
                h, H, R = z[1], np.array([0.0, 1.0]), (0.2 * z[1]) ** 2
            gain = p @ H / (H @ p @ H + R)
            z, p = z + gain * (m.value[0, 0] - h), p - np.outer(gain, H @ p)
        np.testing.assert_allclose(ours.mean[k, 0], z, rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(ours.cov[k, 0], p, rtol=0, atol=ROUNDING)


def test_the_covariance_is_right_by_tag_and_wrong_by_arrival():
    """Three sensors, one nonlinear, late and on clocks of their own: mean NEES 2 over independent runs."""
    runs = 1000
    sensors = [
        *two_sensors(latency=0.8, clock=Clock(1.01, 0.2)),
        Sensor.define("range", STATES, "sqrt(s**2 + 900) + w", 0.1, 0.3),
    ]
    x, messages = measured(sensors, 6.0, runs, [6.5], 10)
    by_tag = nees(x, fuse(FREE, sensors, PRIOR, messages, [6.5]))
    # four standard errors of a chi-squared mean: sqrt(2 * 2 / runs)
    assert abs(by_tag.mean() - 2) < 4 * np.sqrt(4 / runs)
    by_arrival = nees(x, fuse(FREE, sensors, PRIOR, messages, [6.5], by="arrival"))
    assert by_arrival.mean() > 2 + 10 * np.sqrt(4 / runs)


# ---------------------------------------------------------------- what ignoring the tag costs


def test_by_arrival_the_estimate_is_the_motion_of_the_delay_ago():
    """s(t - tau) taken for s(t): position behind by V tau - a tau^2 / 2, velocity by a tau; the chapter derives it."""
    V, acceleration, tau = 250.0, 4.0, 0.12
    motion = Dynamics([[0, 1], [0, 0]], np.diag([0, 0.5]), [[0], [1]])
    sensor = Sensor.define("receiver", ["s", "V"], "s + w", 9.0, 0.1, latency=tau)
    path = lambda times: np.stack([V * times + acceleration * times**2 / 2, V + acceleration * times], -1)[:, None]  # noqa: E731
    messages = [Observation("receiver", t, t + tau, path(np.array([t]))[0, :, :1]) for t in sensor.captures(60.0).tolist()]
    inputs = Inputs(np.array([0.0]), np.full((1, 1, 1), acceleration))
    now = np.array([60.0])
    start = Gaussian(np.array([0.0, V]), np.diag([9.0, 1.0]))
    by_tag, by_arrival = (fuse(motion, [sensor], start, messages, now, inputs=inputs, by=by) for by in ("tag", "arrival"))
    speed = V + acceleration * 60
    # no noise in the values, and the error of the start decays by exp(-0.45 * 60) and more: root of 0.5 / (9 * 0.1) is 0.75 1/s^2
    np.testing.assert_allclose(by_tag.mean - path(now), 0, atol=1e-6)
    expected = [-speed * tau + acceleration * tau**2 / 2, -acceleration * tau]
    np.testing.assert_allclose((by_arrival.mean - path(now))[0, 0], expected, rtol=0, atol=1e-6)


# ---------------------------------------------------------------- fusion: what it refuses


GOOD = Observation("fast", 1.0, 1.1, np.zeros((3, 1)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"observations": [GOOD._replace(sensor="gyro")]}, "'gyro', but the filter knows only fast, slow"),
        ({"observations": [GOOD._replace(tag=np.nan)]}, "fast: tag and arrival must be finite, got nan and 1.1"),
        ({"observations": [GOOD._replace(arrival=np.inf)]}, "fast: tag and arrival must be finite"),
        ({"observations": [GOOD._replace(arrival=0.9)]}, "captured at t = 1 s by its tag, but arrived before that, at 0.9 s"),
        ({"observations": [GOOD._replace(tag=-0.5)]}, "captured at t = -0.5 s, before the prior's 0 s"),
        ({"observations": [GOOD._replace(value=np.zeros((3, 2)))]}, "must have the shape (runs, 1), got (3, 2)"),
        ({"observations": [GOOD._replace(value=np.zeros(3))]}, "must have the shape (runs, 1), got (3,)"),
        ({"observations": [GOOD._replace(value=np.full((3, 1), np.inf))]}, "finite, or NaN"),
        ({"observations": [GOOD, GOOD._replace(value=np.zeros((2, 1)))]}, "different numbers of runs: [2, 3]"),
        ({"observations": [GOOD], "depth": 0.08}, "remembers only 0.08 s; give depth=0.1 or more"),
        ({"times": [2.0, 1.0]}, "ascending"),
        ({"times": [np.nan]}, "finite"),
        ({"times": []}, "finite ascending vector"),
        ({"times": [0.5], "start": 1.0}, "wanted at t = 0.5 s, before the prior's 1 s"),
        ({"by": "tags"}, 'by "tag" or by "arrival", not by \'tags\''),
        ({"sensors": [two_sensors()[0]] * 2}, "a name of its own"),
        ({"prior": Gaussian(np.zeros(3), np.eye(3))}, "prior's mean must have the shape (2,) or (1, 2), got (3,)"),
        ({"prior": Gaussian(np.zeros(2), -np.eye(2))}, "prior's variances must not be negative"),
        (
            {"sensors": [Sensor.define("short", ["s"], "s + w", 1.0)]},
            "short was defined with 1 state component(s)",
        ),
        ({"observations": [GOOD._replace(value=[0.0])]}, "must have the shape (runs, 1), got (1,)"),
        ({"depth": np.nan}, "expected a number not below 0, got nan"),
        ({"depth": -1.0}, "expected a number not below 0, got -1.0"),
        ({"prior": Gaussian(np.zeros(2), np.diag([1.0, np.inf]))}, "the prior must be finite"),
        ({"dynamics": DRIVEN}, "have 1 known input(s); give them"),
        ({"inputs": inputs_until(3.0, 0.1)}, "inputs must have the shape (31, runs or 1, 0), got (31, 1, 1)"),
        (
            {"dynamics": DRIVEN, "inputs": Inputs(np.array([0.5]), np.zeros((1, 1, 1)))},
            "begin at t = 0.5 s, but are needed from t = 0 s",
        ),
        ({"dynamics": DRIVEN, "inputs": Inputs(np.array([0.0]), np.full((1, 1, 1), np.nan))}, "inputs must be finite"),
        ({"dynamics": DRIVEN, "inputs": Inputs(np.array([0.0, 0.0]), np.zeros((2, 1, 1)))}, "ascending, one for each value"),
    ],
)
def test_fuse_says_what_is_wrong(changes, message):
    arguments = {"dynamics": FREE, "sensors": two_sensors(), "prior": PRIOR, "observations": [], "times": [2.0]} | changes
    with pytest.raises(ValueError, match=re.escape(message)):
        fuse(**arguments)


def test_depth_of_exactly_the_delay_is_enough():
    sensors = two_sensors(latency=0.7)
    outputs = np.linspace(0, 3, 31)
    _, messages = measured(sensors, 3.0, 2, outputs, 11)
    shortest = fuse(FREE, sensors, PRIOR, messages, outputs, depth=0.7)
    everything = fuse(FREE, sensors, PRIOR, messages, outputs, depth=100.0)
    assert np.array_equal(shortest.mean, everything.mean)


def test_the_past_is_forgotten():
    """Memory for the delay, not for the whole flight: 1000 laws of 1000 runs would take 48 MB, those of the outputs take 5."""
    runs, sensor = 1000, Sensor.define("range", STATES, "sqrt(s**2 + 900) + w", 0.1, 0.01, latency=0.05)
    values = np.zeros((runs, 1))
    messages = [Observation("range", t, t + 0.05, values) for t in sensor.captures(10.0).tolist()]
    tracemalloc.start()
    try:
        fuse(FREE, [sensor], PRIOR, messages, np.linspace(0, 10, 101))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 25e6


# ---------------------------------------------------------------- recorded data: innovations, no period


def test_innovations_are_those_of_the_filter_that_waits_for_everything():
    """Late and early messages: in the end each innovation is that of the run in the order of capture."""
    sensors = two_sensors(latency=0.3, jitter=0.2)
    _, messages = measured(sensors, 3.0, 2, [0.0])
    messages[5] = messages[5]._replace(value=np.full_like(messages[5].value, np.nan))
    told = follow(FREE, sensors, PRIOR, messages, np.linspace(0.1, 4, 14))
    np.testing.assert_array_equal(told.law.mean, fuse(FREE, sensors, PRIOR, messages, np.linspace(0.1, 4, 14)).mean)
    ordered = sorted(messages, key=lambda message: message.tag)
    assert [one.time for one in told.innovations] == pytest.approx([message.tag for message in ordered])
    meters = {
        "fast": (np.array([[-1.0, 2.0]]), np.array([[0.3]])),
        "slow": (np.array([[1.0, 0], [1, 1]]), np.array([[0.5, 0.2], [0.2, 0.8]])),
    }
    mean, cov, now = np.tile(PRIOR.mean, (2, 1)), PRIOR.cov, 0.0
    for message, one in zip(ordered, told.innovations, strict=True):
        step = FREE.over(message.tag - now)
        mean, cov, now = mean @ step.A.T, step.A @ cov @ step.A.T + step.Q, message.tag
        H, R = meters[message.sensor]
        F = H @ cov @ H.T + R
        assert one.sensor == message.sensor
        np.testing.assert_allclose(one.innovation, message.value - mean @ H.T, rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(one.cov, np.broadcast_to(F, one.cov.shape), rtol=0, atol=ROUNDING)
        if not np.isnan(message.value).any():
            K = np.linalg.solve(F, H @ cov).T
            mean, cov = mean + (message.value - mean @ H.T) @ K.T, cov - K @ H @ cov


def test_a_recorded_sensor_needs_no_period():
    given, free = (Sensor.define("s", STATES, "s + w", 0.5, *period) for period in ([0.25], []))
    messages = [Observation("s", tag, tag, np.array([[value]])) for tag, value in ((0.1, 3.0), (0.75, 2.0), (0.8, 2.1))]
    laws = [fuse(FREE, [one], PRIOR, messages, np.array([1.0])) for one in (given, free)]
    np.testing.assert_array_equal(laws[0].mean, laws[1].mean)
    with pytest.raises(ValueError, match="s has no period, as a recorded sensor"):
        free.captures(1.0)


@pytest.mark.parametrize(
    ("times", "readings"), [([0, 1, 2], [9, 7, 5]), ([1, 1, 1], [1, 2, 3]), ([1, np.nan, 3], [1, 2, 3]), ([1], [1])]
)
def test_no_clock_runs_backwards(times, readings):
    with pytest.raises(ValueError, match="readings"):
        Clock.fit(times, readings)


@pytest.mark.parametrize("duration", [-1.0, np.nan, np.inf])
def test_captures_of_no_duration(duration):
    with pytest.raises(ValueError, match="a duration is a finite number of seconds"):
        two_sensors()[0].captures(duration)


def test_what_paths_are_not_sampled_from():
    driven = Inputs(np.array([0.0]), np.zeros((1, 3, 1)))
    for dynamics, prior, runs, inputs, message in (
        (FREE, Gaussian(np.zeros(1), np.eye(2)), 2, None, "prior's mean must have the shape"),
        (FREE, Gaussian(np.zeros(2), -np.eye(2)), 2, None, "variances must not be negative"),
        (FREE, Gaussian(np.full(2, np.nan), np.eye(2)), 2, None, "prior must be finite"),
        (FREE, PRIOR, 0, None, "runs must be a positive whole number"),
        (DRIVEN, PRIOR, 2, driven, "the inputs are those of 3 runs, and 2 are sampled"),
    ):
        with pytest.raises(ValueError, match=message):
            sample(dynamics, prior, [0.0, 1.0], runs, 1, inputs)


def test_fuse_takes_dynamics():
    with pytest.raises(TypeError, match="fuse expects a Dynamics, got Model"):
        fuse(Model.define("x + v", "x + w"), [], PRIOR, [], [1.0])


@pytest.mark.parametrize("start", [0.0, 1_484_649_904.0, 345_600.25])
def test_where_a_time_scale_begins_changes_nothing(start):
    """Stamps of Unix hold 2e-7 s: each estimate has the measurement of its own moment, however both were rounded."""
    rng = np.random.default_rng(3)
    clock = Clock(1 + 1e-5, 0.1 - start * 1e-5)
    sensor = Sensor.define("slow", STATES, "s + w", 0.01, clock=clock)
    moments, values = np.cumsum(rng.uniform(0.05, 0.15, 200)), rng.normal(size=(200, 1, 1))
    outputs = start + moments
    messages = [Observation("slow", clock.reading(t), t, y) for t, y in zip(outputs.tolist(), values, strict=True)]
    found = fuse(FREE, [sensor], PRIOR, messages, outputs, start=start)
    plain = Sensor.define("slow", STATES, "s + w", 0.01)
    expected = fuse(
        FREE, [plain], PRIOR, [Observation("slow", t, t, y) for t, y in zip(moments.tolist(), values, strict=True)], moments
    )
    # moments that are off by some 1e-6 s, of a state that moves by less than 10 a second
    np.testing.assert_allclose(found.mean, expected.mean, rtol=0, atol=1e-4)
    np.testing.assert_allclose(found.cov, expected.cov, rtol=0, atol=1e-4)
    path = sample(FREE, PRIOR, outputs, 1, 0)
    np.testing.assert_array_equal(path(outputs[7] + np.spacing(start) * np.arange(2)), path.states[[7, 7]])
