"""Keys of set l: two rates, two clocks, a correction of varying dimension, late measurements and what ignoring a tag costs."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import sympy as sp

from kfcourse.exercises.shared import substituted, vehicle
from kfcourse.laws import Array, Gaussian
from kfcourse.linear.arithmetic import FORMS
from kfcourse.linear.system import LinearSystem
from kfcourse.scenarios.navigation import Clock, Observation, Sensor
from kfcourse.scenarios.navigation import fuse as fuse_events

# -- l1: two rates in one vector; l2: two time scales


def dimension(steps: int, ratio: int, first: int) -> Array:
    """How many components the measurement has at each step."""
    dimension = np.ones(steps)
    dimension[first::ratio] = 2
    return dimension


def own_time(reading: sp.Expr, rate: sp.Expr, shift: sp.Expr) -> sp.Expr:
    """The moment at which a clock shows the reading."""
    return Clock(rate, shift).time(reading)


# -- l3: a correction of varying dimension


def correct(m: Array, P: Array, y: Array, H: Array, R: Array) -> tuple[Array, Array]:
    """The correction by the components that are there; NaN says that one is missing."""
    n = len(m)
    return tuple(FORMS["joseph"].correct(LinearSystem(np.eye(n), H, np.zeros((n, n)), R), Gaussian(m, P), y))


# -- l4: over any interval; l5: late measurements


def move(m: Array, P: Array, dt: float, q: float) -> tuple[Array, Array]:
    """Mean and covariance of position and velocity after dt."""
    step = vehicle(q).over(dt)
    return step.A @ m, step.A @ P @ step.A.T + step.Q


@lru_cache(maxsize=8)
def _receiver(r: float) -> Sensor:
    """Measures the position with variance r."""
    return Sensor.define("receiver", ["s", "V"], "s + w", variance=r, period=1.0)


def fuse(tags: Array, arrivals: Array, values: Array, m: Array, P: Array, q: float, r: float, now: float) -> tuple[Array, Array]:
    """The estimate at `now` from what has arrived, each measurement at its tag."""
    return _fused(tags, arrivals, values, m, P, q, r, now, by="tag")


def _fused(
    tags: Array, arrivals: Array, values: Array, m: Array, P: Array, q: float, r: float, now: float, by: str
) -> tuple[Array, Array]:
    """The fusion with measurements taken by tag or by arrival."""
    messages = [
        Observation("receiver", float(tag), float(arrival), np.array([[value]]))
        for tag, arrival, value in zip(tags, arrivals, values, strict=True)
    ]
    law = fuse_events(vehicle(q), [_receiver(r)], Gaussian(m, P), messages, np.array([now]), by=by)
    return law.mean[0, 0], law.cov[0, 0]


# -- l6: what ignoring the tag costs; l7: the clock from edges


@lru_cache(maxsize=1)
def _cost() -> tuple[tuple[sp.Symbol, ...], sp.ImmutableMatrix]:
    """The motion of tau ago, less the present one."""
    V, a, tau, t = sp.symbols("V a tau t", real=True)
    s = V * t + a * t**2 / 2
    late = sp.Matrix([s, s.diff(t)]).subs(t, t - tau) - sp.Matrix([s, s.diff(t)])
    return (V, a, tau), sp.ImmutableMatrix(late.subs(t, 0).expand())


def cost(V: sp.Expr, a: sp.Expr, tau: sp.Expr) -> tuple[sp.Expr, ...]:
    """Errors of position and velocity when the present is taken to be tau ago."""
    symbols, late = _cost()
    return tuple(substituted(late, symbols)(V, a, tau))


def fit_clock(edges: Array, stamps: Array) -> tuple[float, float]:
    """Rate and shift of the clock from pairs of edges and stamps."""
    clock = Clock.fit(edges, stamps)
    return clock.rate, clock.shift
