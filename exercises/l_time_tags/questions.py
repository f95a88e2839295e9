"""Questions of set l: sensors of different rates, late and by clocks of their own.

What is derived is answered with formulas in the symbols of the arguments, what runs with arrays.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.checks.exercises import Exercise
from kfcourse.checks.question import Answer, Question, catalogue
from kfcourse.checks.registry import ExerciseSet
from kfcourse.exercises.shared import covariance, personal, substituted
from kfcourse.laws import Array, Gaussian
from kfcourse.linear.arithmetic import FORMS
from kfcourse.linear.system import LinearSystem
from kfcourse.scenarios.navigation import Clock, Dynamics, Observation, Sensor
from kfcourse.scenarios.navigation import fuse as fuse_events


def timing_numbers(exercise: Exercise) -> dict[str, float]:
    """speed (m/s), acceleration (m/s^2), period, latency and jitter (s) and sigma (m) of the receiver, ratio of the rates."""
    found = personal(
        exercise,
        "l",
        {"speed": 250.0, "acceleration": 3.0, "period": 0.1, "latency": 0.12, "jitter": 0.04, "sigma": 3.0, "ratio": 40},
        {
            "speed": (120, 300),
            "acceleration": (1.5, 4),
            "period": (0.1, 0.3),
            "latency": (0.08, 0.3),
            "jitter": (0.02, 0.1),
            "sigma": (2, 6),
            "ratio": (10, 60),
        },
    )
    return found | {"ratio": int(found["ratio"])}


# -- l1: two rates in one vector; l2: two time scales


def dimension(steps: int, ratio: int, first: int) -> Array:
    dimension = np.ones(steps)
    dimension[first::ratio] = 2
    return dimension


def dimension_where(both: Callable[[Array, int, int], Array], alone: float = 1, together: float = 2) -> Answer:
    """both(k, ratio, first): the steps at which the receiver is thought to be there."""
    return lambda steps, ratio, first: np.where(both(np.arange(steps), ratio, first), together, alone)


def dimension_arguments(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("l1")
    ratio, first = int(rng.integers(4, 7)), int(rng.integers(2, 4))
    return [(4 * ratio + 1, ratio, first), (3 * ratio, ratio, first + ratio)]


WRONG_DIMENSIONS: tuple[tuple[str, str, Answer], ...] = (
    (
        "from-the-first-step",
        "The receiver's first measurement is not at step 0.",
        dimension_where(lambda k, ratio, first: k % ratio == 0),
    ),
    (
        "before-the-first",
        "Before its first measurement the receiver gives nothing.",
        dimension_where(lambda k, ratio, first: k % ratio == first % ratio),
    ),
    (
        "one-step-off",
        "It is one step off: steps are counted from 0.",
        dimension_where(lambda k, ratio, first: (k >= first - 1) & ((k - first + 1) % ratio == 0)),
    ),
    (
        "held",
        "Once the receiver has measured, its value is counted at every step: one measurement taken for many.",
        dimension_where(lambda k, ratio, first: k >= first),
    ),
    (
        "only-between",
        "ratio is the number of steps from one measurement to the next, not the number of steps between them.",
        dimension_where(lambda k, ratio, first: (k >= first) & ((k - first) % (ratio + 1) == 0)),
    ),
    (
        "receiver-only",
        "Only the receiver's components are counted; the INS measures at every step.",
        lambda *a: dimension(*a) - 1,
    ),
    ("always-both", "The dimension is that of a full vector at every step.", dimension_where(lambda k, ratio, first: k >= 0)),
)


def own_time(reading: Any, rate: Any, shift: Any) -> Any:
    return Clock(rate, shift).time(reading)


WRONG_TIMES: tuple[tuple[str, str, Answer], ...] = (
    (
        "shift-sign",
        "The shift has the wrong sign: a clock that is ahead shows too much.",
        lambda reading, rate, shift: (reading + shift) / rate,
    ),
    (
        "rate-multiplied",
        "The rate stands on the wrong side: a clock that is fast shows too much.",
        lambda reading, rate, shift: (reading - shift) * rate,
    ),
    (
        "shift-not-divided",
        "The order is wrong: first the shift is taken off, then the rate; undo last what was done last.",
        lambda reading, rate, shift: reading / rate - shift,
    ),
    ("rate-forgotten", "The rate of the clock is forgotten.", lambda reading, rate, shift: reading - shift),
    ("shift-forgotten", "The shift of the clock is forgotten.", lambda reading, rate, shift: reading / rate),
    (
        "other-way",
        "That is what the clock shows at a given moment; the moment is asked for.",
        lambda reading, rate, shift: rate * reading + shift,
    ),
)

# -- l3: a correction of varying dimension


def correct(m: Array, P: Array, y: Array, H: Array, R: Array) -> tuple[Array, Array]:
    n = len(m)
    return tuple(FORMS["joseph"].correct(LinearSystem(np.eye(n), H, np.zeros((n, n)), R), Gaussian(m, P), y))


def _textbook(m: Array, P: Array, e: Array, H: Array, R: Array) -> tuple[Array, Array]:
    """The correction by an innovation e of any dimension, also zero."""
    K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
    return m + K @ e, P - K @ H @ P


def correction_with(change: Callable[[Array, Array, Array, Array, Array], tuple[Array, Array, Array]]) -> Answer:
    """change(m, y, H, R, there) -> innovation, H and R that are used."""

    def answer(m: Array, P: Array, y: Array, H: Array, R: Array) -> tuple[Array, Array]:
        return _textbook(m, P, *change(m, y, H, R, np.isfinite(y)))

    return answer


def _whole_dropped(m: Array, P: Array, y: Array, H: Array, R: Array) -> tuple[Array, Array]:
    return (m, P) if np.isnan(y).any() else _textbook(m, P, y - H @ m, H, R)


def correction_arguments(exercise: Exercise) -> list[tuple]:
    """All three components there; the second missing; only the last there; none there."""
    rng = exercise.rng("l3")
    m, P, H, R = rng.normal(size=3), covariance(rng, 3), rng.normal(size=(3, 3)), covariance(rng, 3)
    y = H @ m + rng.normal(size=3)
    missing: tuple[list[int], ...] = ([], [1], [0, 1], [0, 1, 2])
    return [(m, P, np.where(np.isin(np.arange(3), gone), np.nan, y), H, R) for gone in missing]


WRONG_CORRECTIONS: tuple[tuple[str, str, Answer], ...] = (
    (
        "missing-as-zero",
        "A missing component is treated as the number 0; it says nothing.",
        correction_with(lambda m, y, H, R, there: (np.nan_to_num(y) - H @ m, H, R)),
    ),
    (
        "missing-as-expected",
        "In place of what is missing stands what was expected: the covariance then shrinks as if it had been measured.",
        correction_with(lambda m, y, H, R, there: (np.where(there, y - H @ m, 0), H, R)),
    ),
    (
        "whole-vector-dropped",
        "One missing component makes the whole vector be dropped; the others still tell something.",
        _whole_dropped,
    ),
    (
        "wrong-rows-of-H",
        "H has as many rows as there are components, but not those that belong to them.",
        correction_with(
            lambda m, y, H, R, there: ((y - H @ m)[there], H[: there.sum()], R[np.ix_(there, there)]),
        ),
    ),
    (
        "wrong-part-of-R",
        "R has the right size, but its rows and columns are not those of the components that are there.",
        correction_with(
            lambda m, y, H, R, there: ((y - H @ m)[there], H[there], R[: there.sum(), : there.sum()]),
        ),
    ),
    (
        "correlation-forgotten",
        "Only the diagonal of R is used; the noises of the sensors are correlated here.",
        correction_with(lambda m, y, H, R, there: ((y - H @ m)[there], H[there], np.diag(np.diag(R)[there]))),
    ),
    (
        "innovation-sign",
        "The innovation has the wrong sign: it is what came minus what was expected.",
        correction_with(lambda m, y, H, R, there: ((H @ m - y)[there], H[there], R[np.ix_(there, there)])),
    ),
)

# -- l4: over any interval; l5: late measurements


@lru_cache(maxsize=8)
def _vehicle(q: float) -> Dynamics:
    """Position and velocity, white acceleration of the intensity q."""
    return Dynamics(np.array([[0.0, 1.0], [0.0, 0.0]]), np.diag([0.0, q]))


def move(m: Array, P: Array, dt: float, q: float) -> tuple[Array, Array]:
    step = _vehicle(q).over(dt)
    return step.A @ m, step.A @ P @ step.A.T + step.Q


def move_with(
    Q: Callable[[float], list] = lambda dt: [[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]],
    carried: Callable[[Array, Array], Array] = lambda A, P: A @ P @ A.T,
    moved: Callable[[Array, Array], Array] = lambda A, m: A @ m,
) -> Answer:
    def answer(m: Array, P: Array, dt: float, q: float) -> tuple[Array, Array]:
        A = np.array([[1, dt], [0, 1]])
        return moved(A, m), carried(A, P) + q * np.array(Q(dt))

    return answer


def move_arguments(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("l4")
    return [(rng.normal(size=2), covariance(rng, 2), float(dt), float(rng.uniform(1.3, 2))) for dt in rng.uniform(0.3, 2.6, 3)]


WRONG_MOVES: tuple[tuple[str, str, Answer], ...] = (
    (
        "constant-in-interval",
        "That is for an acceleration that is constant over the interval. With intervals of any length it does not fit: two short "
        "ones must give the same as the long one.",
        move_with(lambda dt: [[dt**4 / 4, dt**3 / 2], [dt**3 / 2, dt**2]]),
    ),
    (
        "noise-of-fixed-step",
        "The noise does not depend on the interval; a longer one brings more.",
        move_with(lambda dt: [[1 / 3, 1 / 2], [1 / 2, 1]]),
    ),
    ("velocity-only", "The noise reaches the position too.", move_with(lambda dt: [[0, 0], [0, dt]])),
    (
        "diagonal",
        "The noise of position and that of velocity are correlated: they come from one acceleration.",
        move_with(lambda dt: [[dt**3 / 3, 0], [0, dt]]),
    ),
    (
        "intensity-squared-time",
        "A power of dt is wrong: the variance of a velocity grows with the time itself.",
        move_with(lambda dt: [[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt**2]]),
    ),
    ("noise-forgotten", "The noise of the object is missing.", move_with(lambda dt: [[0, 0], [0, 0]])),
    (
        "covariance-not-carried",
        "The covariance is not carried on: an error of the velocity becomes one of the position.",
        move_with(carried=lambda A, P: P),
    ),
    (
        "carried-once",
        "The transition stands on both sides of the covariance, the second time transposed.",
        move_with(carried=lambda A, P: A @ P),
    ),
    ("mean-not-moved", "The mean stays where it is; the object moves on.", move_with(moved=lambda A, m: m)),
)


@lru_cache(maxsize=8)
def _receiver(r: float) -> Sensor:
    return Sensor.define("receiver", ["s", "V"], "s + w", variance=r, period=1.0)


def fuse(tags: Array, arrivals: Array, values: Array, m: Array, P: Array, q: float, r: float, now: float) -> tuple[Array, Array]:
    return _fused(tags, arrivals, values, m, P, q, r, now, by="tag")


def _fused(
    tags: Array, arrivals: Array, values: Array, m: Array, P: Array, q: float, r: float, now: float, by: str
) -> tuple[Array, Array]:
    messages = [
        Observation("receiver", float(tag), float(arrival), np.array([[value]]))
        for tag, arrival, value in zip(tags, arrivals, values, strict=True)
    ]
    law = fuse_events(_vehicle(q), [_receiver(r)], Gaussian(m, P), messages, np.array([now]), by=by)
    return law.mean[0, 0], law.cov[0, 0]


def _fusion_with(
    order: Callable[..., Array],
    moment: Callable[..., Array] = lambda tags, arrivals: tags,
    clip: bool = False,
    drop: bool = False,
    to_now: bool = True,
    used: Callable[..., Array] = lambda tags, arrivals, now: arrivals <= now,
) -> Answer:
    """The fusion as a loop over the measurements in some order, each taken at some moment."""

    def answer(
        tags: Array, arrivals: Array, values: Array, m: Array, P: Array, q: float, r: float, now: float
    ) -> tuple[Array, Array]:
        there = used(tags, arrivals, now)
        moments = moment(tags, arrivals)
        step, time = move_with(), 0.0
        for i in np.argsort(order(tags, arrivals), kind="stable"):
            if not there[i] or (drop and moments[i] < time):
                continue
            target = max(moments[i], time) if clip else moments[i]
            m, P = step(m, P, target - time, q)
            time = target
            m, P = _textbook(m, P, values[i] - m[:1], np.array([[1.0, 0.0]]), np.array([[r]]))
        return step(m, P, now - time, q) if to_now else (m, P)

    return answer


def fusion_arguments(exercise: Exercise) -> list[tuple]:
    """Eight measurements: the third and fourth arrive in the reverse order, the last two after the moment of the estimate."""
    rng = exercise.rng("l5")
    tags = np.cumsum(rng.uniform(0.7, 1.3, 8))
    arrivals = tags + rng.uniform(0.2, 0.5, 8)
    arrivals[2] = arrivals[3] + rng.uniform(0.1, 0.3)
    now = tags[7] + 0.1
    arrivals[6] = now + 0.2
    m, P, q, r = np.array([2.0, 3.0]), covariance(rng, 2), float(rng.uniform(0.3, 0.6)), float(rng.uniform(0.5, 0.9))
    values = m[0] + m[1] * tags + 0.4 * tags**2 + rng.normal(size=8)
    order = np.argsort(arrivals)
    return [(tags[order], arrivals[order], values[order], m, P, q, r, float(now))]


def by_tag(tags: Array, arrivals: Array) -> Array:
    return tags


def by_arrival(tags: Array, arrivals: Array) -> Array:
    return arrivals


WRONG_FUSIONS: tuple[tuple[str, str, Answer], ...] = (
    (
        "arrival-for-tag",
        "The measurements are taken at their arrival; they say where the object was at the tag.",
        partial(_fused, by="arrival"),
    ),
    (
        "mean-delay",
        "The mean delay is subtracted from the arrival; the tag says the moment of each measurement by itself.",
        _fusion_with(by_tag, lambda tags, arrivals: arrivals - (arrivals - tags).mean()),
    ),
    (
        "late-dropped",
        "A measurement that arrives out of order is dropped; it still tells something of the past, and so of the present.",
        _fusion_with(by_arrival, drop=True),
    ),
    (
        "late-as-present",
        "A measurement that arrives out of order is used without going back to its moment.",
        _fusion_with(by_arrival, clip=True),
    ),
    (
        "time-runs-backwards",
        "For a measurement that arrives out of order the filter predicts over a negative interval: noise would become negative.",
        _fusion_with(by_arrival),
    ),
    (
        "future-used",
        "Measurements are used that have not arrived yet.",
        _fusion_with(by_tag, used=lambda tags, arrivals, now: tags <= now),
    ),
    (
        "not-predicted-to-now",
        "The estimate belongs to the last measurement's moment; predict it to the moment asked for.",
        _fusion_with(by_tag, to_now=False),
    ),
)

# -- l6: what ignoring the tag costs; l7: the clock from edges


@lru_cache(maxsize=1)
def _cost() -> tuple[tuple[sp.Symbol, ...], sp.ImmutableMatrix]:
    """The motion of tau ago, less the present one."""
    V, a, tau, t = sp.symbols("V a tau t", real=True)
    s = V * t + a * t**2 / 2
    late = sp.Matrix([s, s.diff(t)]).subs(t, t - tau) - sp.Matrix([s, s.diff(t)])
    return (V, a, tau), sp.ImmutableMatrix(late.subs(t, 0).expand())


def cost(V: Any, a: Any, tau: Any) -> tuple:
    symbols, late = _cost()
    return tuple(substituted(late, symbols)(V, a, tau))


WRONG_COSTS: tuple[tuple[str, str, Answer], ...] = (
    (
        "truth-minus-estimate",
        "The sign is the other way round: the error is the estimate less the truth, and the estimate is behind.",
        lambda V, a, tau: (V * tau - a * tau**2 / 2, a * tau),
    ),
    (
        "constant-speed",
        "That is for a constant speed; the vehicle accelerates.",
        lambda V, a, tau: (-V * tau, 0 * V),
    ),
    (
        "past-speed",
        "The speed of the past is taken for the present one: the term of the acceleration has the wrong sign.",
        lambda V, a, tau: (-V * tau - a * tau**2 / 2, -a * tau),
    ),
    (
        "half-forgotten",
        "A factor is missing where the acceleration acts on the position.",
        lambda V, a, tau: (-V * tau + a * tau**2, -a * tau),
    ),
    (
        "delay-twice",
        "The delay is counted twice, there and back; the data come only one way.",
        lambda V, a, tau: cost(V, a, 2 * tau),
    ),
    (
        "half-in-velocity",
        "The velocity is behind by the whole acceleration times the delay.",
        lambda V, a, tau: (-V * tau + a * tau**2 / 2, -a * tau / 2),
    ),
    ("per-second", "The velocity is not multiplied by the delay.", lambda V, a, tau: (-V + a * tau / 2, -a)),
)


def fit_clock(edges: Array, stamps: Array) -> tuple[float, float]:
    clock = Clock.fit(edges, stamps)
    return clock.rate, clock.shift


def fit_arguments(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("l7")
    times = np.sort(rng.uniform(3, 40, 9))
    return [(times + rng.uniform(0, 0.6, 9), rng.uniform(1.1, 1.4) * times + rng.uniform(2, 5))]


def _least_squares(x: Array, y: Array) -> tuple[float, float]:
    """Slope and intercept of y on x."""
    slope = np.cov(x, y)[0, 1] / np.var(x, ddof=1)
    return float(slope), float(y.mean() - slope * x.mean())


WRONG_FITS: tuple[tuple[str, str, Answer], ...] = (
    (
        "regression-other-way",
        "The stamps are fitted on the edges; the errors are in the edges, so fit those on the stamps.",
        _least_squares,
    ),
    (
        "inverse-clock",
        "That is the map from stamps to moments; rate and shift tell what the clock shows at a given moment.",
        lambda edges, stamps: _least_squares(stamps, edges),
    ),
    (
        "end-points",
        "Only the first pair and the last are used; the others average the delays.",
        lambda edges, stamps: (
            (stamps[-1] - stamps[0]) / (edges[-1] - edges[0]),
            stamps[0] - (stamps[-1] - stamps[0]) / (edges[-1] - edges[0]) * edges[0],
        ),
    ),
    (
        "shift-only",
        "The rate is taken for 1.",
        lambda edges, stamps: (1.0, (stamps - edges).mean()),
    ),
    (
        "through-the-origin",
        "The line goes through the origin: the clock is shifted too.",
        lambda edges, stamps: (stamps @ stamps / (stamps @ edges), 0.0),
    ),
    (
        "shift-in-filter-time",
        "The shift is in the filter's time and has the other sign: what does the clock show when the filter's time is 0?",
        lambda edges, stamps: (fit_clock(edges, stamps)[0], _least_squares(stamps, edges)[1]),
    ),
)

QUESTIONS = (
    Question("l1", "two rates", "warm-up", dimension, dimension_arguments, catalogue(WRONG_DIMENSIONS)),
    Question(
        "l2",
        "two time scales",
        "warm-up",
        own_time,
        lambda e: [sp.symbols("reading rate shift", positive=True)],
        catalogue(WRONG_TIMES),
    ),
    Question(
        "l3",
        "a measurement of varying dimension",
        "core",
        correct,
        correction_arguments,
        catalogue(WRONG_CORRECTIONS),
        ("m", "P"),
    ),
    Question("l4", "over an interval of any length", "core", move, move_arguments, catalogue(WRONG_MOVES), ("m", "P")),
    Question(
        "l5",
        "late and out of order",
        "core",
        fuse,
        fusion_arguments,
        catalogue(WRONG_FUSIONS),
        ("m", "P"),
    ),
    Question(
        "l6",
        "what ignoring the tag costs",
        "core",
        cost,
        lambda e: [sp.symbols("V a tau", positive=True)],
        catalogue(WRONG_COSTS),
        ("position", "velocity"),
    ),
    Question("l7", "the clock from edges", "stretch", fit_clock, fit_arguments, catalogue(WRONG_FITS), ("rate", "shift")),
)

SET = ExerciseSet("l", "Rates and time tags", Path(__file__).parent, QUESTIONS, timing_numbers, about_variant=False)
