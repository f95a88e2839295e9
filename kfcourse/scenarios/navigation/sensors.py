"""Sensors that measure at their own moments, in their own time scale, and report late.

::

    capture at t_j   --interrupt: the time tag-->   ...   --the data, over an interface-->
        arrival at a_j >= t_j

Each sensor's clock reads rate * t + shift at the filter's time t; its samples are equally spaced on
that clock.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from kfcourse.angles import on_circle
from kfcourse.errors import expect_not_negative, expect_positive
from kfcourse.laws import Array, Measurement, square_root
from kfcourse.scenarios.navigation.dynamics import ROUNDING
from kfcourse.symbolic.equations import compile_model
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import Formula, ModelError
from kfcourse.symbolic.structure import linearised


class Clock(NamedTuple):
    """A time scale: the clock reads rate * t + shift (in s) when the filter's clock reads t."""

    rate: float = 1.0
    shift: float = 0.0

    def reading(self, time: Any) -> Any:
        """What this clock shows at the filter's time."""
        return self.rate * time + self.shift

    def time(self, reading: Any) -> Any:
        """The filter's time at which this clock shows the reading."""
        return (reading - self.shift) / self.rate

    @classmethod
    def fit(cls, times: Array, readings: Array) -> Clock:
        """The clock from pairs: interrupts at the filter's times (s,), and the sensor's own
        readings (s,) at the same moments.

        Least squares of times on readings, time = a + b reading: the error is in the times, an
        interrupt being served with a delay, while a sensor knows its own clock.

        Raises
        ------
        ValueError
            Fewer than two different readings, pairs that are not finite, readings that do not grow
            with the times.
        """
        times, readings = np.asarray(times, dtype=float), np.asarray(readings, dtype=float)
        if times.shape != readings.shape or times.ndim != 1 or len(np.unique(readings)) < 2:
            raise ValueError(
                f"the clock needs two or more pairs of times and readings, got the shapes "
                f"{times.shape} and {readings.shape}"
            )
        # Around the means: readings such as seconds of the week are large beside their differences.
        deviation = readings - readings.mean()
        slope = deviation @ (times - times.mean()) / (deviation @ deviation)
        if not slope > 0:
            raise ValueError(
                "the readings of a clock grow with the times, and both are finite: drop pairs "
                "where they do not"
            )
        return cls(float(1 / slope), float(readings.mean() - times.mean() / slope))


@dataclass(frozen=True)
class Sensor:
    """A sensor; build it with `Sensor.define`, or of a `Model`, whose meter may measure angles.
    `observe` takes the true ones, `fuse` those that the filter believes in.

    Attributes
    ----------
    name : str
    model : Model
        Its meter equation is the sensor's; the state equation is not used.
    period : float
        Between samples, in s of its own clock.
    offset : float
        Its clock's reading at some sample.
    latency, jitter : float
        The data arrive latency + jitter * U after the capture (s), U uniform in (0, 1): the filter
        does not use these.
    clock : Clock
    """

    name: str
    model: Model
    period: float
    offset: float = 0.0
    latency: float = 0.0
    jitter: float = 0.0
    clock: Clock = field(default_factory=Clock)

    def __post_init__(self) -> None:
        # data cannot arrive before they are captured
        timing = {"latency": self.latency, "jitter": self.jitter}
        expect_not_negative(**{f"{self.name}: {name}": value for name, value in timing.items()})
        expect_positive(**{f"{self.name}: the period": self.period})
        if self.model.timed:
            raise ModelError(
                f"{self.name}: the meter depends on the step, {self.model.known.symbols}, but a "
                f"sensor has moments of its own; "
                "write what changes into the state"
            )
        if not (np.isfinite(self.clock).all() and self.clock.rate > 0):
            raise ValueError(
                f"{self.name}: the clock must have a positive finite rate and a finite shift, got "
                f"{self.clock}"
            )

    @classmethod
    def define(
        cls,
        name: str,
        states: Sequence[str],
        meter: Formula | Sequence[Formula],
        variance: Any,
        period: float,
        *,
        parameters: Mapping[str, float] | None = None,
        **timing: Any,
    ) -> Sensor:
        """A sensor from the formulas of its meter.

        Parameters
        ----------
        name : str
        states : sequence of str
            Names of the state components, in the order of the dynamics.
        meter : str, sympy expression, or a list of them
            In the states, the noise w (w1, w2, ... in a list) and the parameters.
        variance : float, list or matrix
            Of the noise.
        period : float
        parameters : dict, optional
        **timing
            Other attributes of `Sensor`.

        Raises
        ------
        FormulaError, ModelError
            As in `Model.define`.

        Examples
        --------
        >>> from kfcourse.scenarios.navigation import Sensor
        >>> meter = "sqrt(s**2 + h**2) + w"
        >>> Sensor.define("range", ["s", "h", "V"], meter, variance=100.0, period=0.25).model.p
        1
        """
        model = Model.define(
            list(states),
            meter,
            parameters,
            symbols={"x": list(states), "v": ["not_used"]},
            meter_noise={"variance": variance},
        )
        return cls(name, model, period, **timing)

    @cached_property
    def measure(self) -> Callable[[Array, Array], Measurement]:
        """Structural functions of the meter: (m (..., n), d (..., n, n)) -> Measurement."""
        return linearised(self.model).measure

    def captures(self, duration: float) -> Array:
        """Moments of capture from 0 to duration, in the filter's time (s,)."""
        expect_not_negative(duration=duration)
        ends = [(self.clock.reading(end) - self.offset) / self.period for end in (0.0, duration)]
        first, last = math.ceil(ends[0] - ROUNDING), math.floor(ends[1] + ROUNDING)
        times = self.clock.time(self.offset + self.period * np.arange(first, last + 1))
        return np.clip(times, 0.0, duration)

    def delays(self, count: int, rng: np.random.Generator) -> Array:
        """Delays from capture to arrival, (count,)."""
        return self.latency + self.jitter * rng.random(count)


class Observation(NamedTuple):
    """One message of a sensor.

    Attributes
    ----------
    sensor : str
    tag : float
        Moment of capture by the sensor's own clock.
    arrival : float
        When the data reach the filter, by the filter's clock.
    value : ndarray (runs, p)
        NaN where missing.
    """

    sensor: str
    tag: float
    arrival: float
    value: Array


def observe(
    sensors: Sequence[Sensor],
    truth: Callable[[Array], Array],
    duration: float,
    seed: int | np.random.Generator,
) -> list[Observation]:
    """What the sensors say of a motion, in the order of arrival.

    Parameters
    ----------
    sensors : sequence of Sensor
        The true ones.
    truth : callable
        Times (s,) -> states (s, runs, n): a formula, or a `Path` that holds the moments of all
        `captures`.
    duration : float
        Captures from 0 to duration; the last ones may arrive later.
    seed : int or Generator
        Each sensor draws from a stream of its own: one more at the end of the list does not change
        the others.

    Returns
    -------
    list of Observation
        Moments and delays are those of all runs, noises are each run's own.

    Raises
    ------
    ValueError
        Two sensors of one name; a truth of the wrong shape.
    """
    by_name(sensors)
    messages = []
    for sensor, rng in zip(sensors, np.random.default_rng(seed).spawn(len(sensors)), strict=True):
        times, model = sensor.captures(duration), sensor.model
        x = np.asarray(truth(times))
        if x.ndim != 3 or len(x) != len(times) or x.shape[2] != model.n:
            raise ValueError(
                f"{sensor.name}: the truth at {len(times)} moments must have the shape "
                f"({len(times)}, runs, {model.n}), "
                f"got {x.shape}"
            )
        arrivals = times + sensor.delays(len(times), rng)
        law = model.meter_noise
        w = law.mean + rng.standard_normal((*x.shape[:2], len(law.mean))) @ square_root(law.cov).T
        measured = np.broadcast_to(compile_model(model)[1](x, w), (*x.shape[:2], model.p))
        values, tags = on_circle(measured, model.angles.y), sensor.clock.reading(times)
        messages += [
            Observation(sensor.name, *message)
            for message in zip(tags.tolist(), arrivals.tolist(), values, strict=True)
        ]
    return sorted(messages, key=lambda message: message.arrival)


def by_name(sensors: Sequence[Sensor]) -> dict[str, Sensor]:
    """Sensors by their names; ValueError if two share one."""
    table = {sensor.name: sensor for sensor in sensors}
    if len(table) < len(sensors):
        raise ValueError(
            f"each sensor needs a name of its own, got "
            f"{', '.join(sensor.name for sensor in sensors)}"
        )
    return table
