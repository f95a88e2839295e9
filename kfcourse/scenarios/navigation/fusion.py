"""The event-driven filter: predict to the moment of capture, correct with that sensor's meter.

A measurement that arrives late belongs to the past.  The filter keeps its laws of the last seconds
and the measurements between them; it goes back to the law before the moment of capture and works
forward again, with the late one in its place::

    t:       1         2         3         4 = now
    kept:   law ----- law ----- law              used so far
    late:         x                              captured at 1.5, arrives at 4
    again:  law - law - law --- law ------->     the same as if it had not been late

Nothing is approximated; the price is memory for the longest delay, and the work of those steps once
more.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kfcourse.errors import expect
from kfcourse.laws import Array, Gaussian, correct, stacked
from kfcourse.linear.runs import check_prior
from kfcourse.scenarios.navigation.dynamics import (
    ROUNDING,
    Dynamics,
    Inputs,
    Predictor,
    predictor,
)
from kfcourse.scenarios.navigation.sensors import Observation, Sensor, by_name


class Event(NamedTuple):
    """A measurement, and the moment (filter's time) for which the filter takes it."""

    time: float
    arrival: float
    sensor: Sensor
    value: Array


class Past(NamedTuple):
    """What the filter remembers: the law right after an event; the prior has none."""

    time: float
    law: Gaussian
    event: Event | None = None


def fuse(
    dynamics: Dynamics,
    sensors: Sequence[Sensor],
    prior: Gaussian,
    observations: Sequence[Observation],
    times: Array,
    *,
    inputs: Inputs | None = None,
    by: str = "tag",
) -> Gaussian:
    """Estimates from several sensors, each at its own rate, delay and time scale.

    Parameters
    ----------
    dynamics : Dynamics
    sensors : sequence of Sensor
        As the filter believes them to be: their meters, and clocks that turn tags into the filter's
        time.
    prior : Gaussian
        Law of the state at t = 0: mean (n,) or (runs, n), covariance (n, n) or (runs, n, n).
    observations : sequence of Observation
        In any order.
    times : ndarray (s,)
        When estimates are wanted, ascending.  The estimate for a moment uses what has *arrived* by
        then.
    inputs : Inputs, optional
        The known input of the dynamics.
    by : {"tag", "arrival"}
        "arrival" ignores the tags, as if every measurement were captured when it arrives.

    Returns
    -------
    Gaussian
        Means (s, runs, n) and covariances (s, runs, n, n): read-only where all runs share them.

    Raises
    ------
    ValueError
        Sensors not known or of another state, moments not finite, before 0, or after the
        arrival; a prior with a negative variance; shapes that do not fit.
    """
    expect(dynamics, Dynamics, "fuse")
    predict, n = predictor(dynamics, inputs), len(dynamics.A)
    for sensor in sensors:
        if sensor.model.n != n:
            raise ValueError(
                f"{sensor.name} was defined with {sensor.model.n} state component(s), and the "
                f"motion has {n}: "
                "Sensor.define takes the names of all, in the order of the motion"
            )
    moments = _checked_times(times)
    events = sorted(_events(sensors, observations, by), key=lambda event: event.arrival)
    # seconds that the filter must remember
    depth = max((event.arrival - event.time for event in events), default=0.0)
    history = [Past(0.0, _checked_prior(prior, n, events, inputs))]
    laws, taken = [], 0
    for now in moments:
        until = bisect_right(events, now + ROUNDING, key=lambda event: event.arrival)
        arrived, taken = events[taken:until], until
        history = _replayed(history, arrived, predict)
        laws.append(predict(history[-1].law, history[-1].time, max(now, history[-1].time)))
        # from the last law at or before the earliest moment that a measurement may still come from
        oldest = bisect_right(history, now - depth - ROUNDING, key=lambda past: past.time) - 1
        history = history[max(oldest, 0) :]
    return stacked(laws)


def _replayed(history: list[Past], arrived: list[Event], predict: Predictor) -> list[Past]:
    """The history with the events that have arrived: back to before the earliest of them, and
    forward again."""
    if not arrived:
        return history
    kept = bisect_right(history, min(event.time for event in arrived), key=lambda past: past.time)
    again = [past.event for past in history[kept:] if past.event] + arrived
    history = history[:kept]
    for event in sorted(again, key=lambda event: event.time):
        law = predict(history[-1].law, history[-1].time, event.time)
        law = correct(law, event.sensor.measure(*law), event.value)
        history.append(Past(event.time, law, event))
    return history


def _events(
    sensors: Sequence[Sensor],
    observations: Sequence[Observation],
    by: str,
) -> list[Event]:
    if by not in ("tag", "arrival"):
        raise ValueError(f'measurements are used by "tag" or by "arrival", not by {by!r}')
    table, events = by_name(sensors), []
    for name, tag, arrival, value in observations:
        if name not in table:
            raise ValueError(
                f"a measurement of {name!r}, but the filter knows only "
                f"{', '.join(table) or 'no sensor'}"
            )
        sensor = table[name]
        shape = np.shape(value)
        if not np.isfinite([tag, arrival]).all() or shape[1:] != (sensor.model.p,):
            raise ValueError(
                f"{name}: a measurement has a finite tag and arrival, and a value (runs, "
                f"{sensor.model.p}); got {tag}, {arrival} and the shape {shape}"
            )
        if np.isinf(value).any():
            raise ValueError(f"{name}: a measurement must be finite, or NaN where it is missing")
        time = sensor.clock.time(tag) if by == "tag" else arrival
        if time > arrival + ROUNDING:
            raise ValueError(
                f"{name}: captured at t = {time:.16g} s by its tag, but arrived before that, at "
                f"{arrival:.16g} s; "
                f"the filter's clock for this sensor, {sensor.clock}, must be wrong: Clock.fit "
                f"finds it from interrupts"
            )
        if time < -ROUNDING:
            raise ValueError(
                f"{name}: captured at t = {time:.16g} s, before the prior, at 0; leave it out"
            )
        events.append(Event(max(time, 0.0), arrival, sensor, np.asarray(value, dtype=float)))
    return events


def _checked_times(times: Array) -> list[float]:
    moments = np.asarray(times, dtype=float)
    if (
        not len(moments)
        or not np.isfinite(moments).all()
        or (np.diff(moments, prepend=0.0) < 0).any()
    ):
        raise ValueError("times of estimates must be finite and ascending, from the prior's, 0, on")
    return moments.tolist()


def _checked_prior(
    prior: Gaussian, n: int, events: Sequence[Event], inputs: Inputs | None
) -> Gaussian:
    """The prior with a mean for each run; the number of runs is that of the measurements, inputs,
    or the prior itself."""
    mean, cov = np.asarray(prior.mean, dtype=float), np.asarray(prior.cov, dtype=float)
    sizes = {len(event.value) for event in events} | ({len(mean)} if mean.ndim == 2 else {1})
    sizes |= set() if inputs is None else {np.shape(inputs.values)[1]}
    if len(sizes - {1}) > 1:
        raise ValueError(
            f"measurements, inputs and prior are of different numbers of runs: "
            f"{sorted(sizes - {1})}"
        )
    runs = max(sizes)
    check_prior(prior, runs, n)
    return Gaussian(np.broadcast_to(mean, (runs, n)), cov)
