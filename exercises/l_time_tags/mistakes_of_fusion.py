"""Known mistakes in the fusion: dimension (l1), correction (l3), any interval (l4), late measurements (l5)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.l_time_tags.keys import _fused, dimension
from kfcourse.laws import Array

# -- l1: two rates in one vector


def dimension_where(both: Callable[[Array, int, int], Array], alone: float = 1, together: float = 2) -> Answer:
    """both(k, ratio, first): the steps at which the receiver is thought to be there."""
    return lambda steps, ratio, first: np.where(both(np.arange(steps), ratio, first), together, alone)


SUM_FOR_DIFFERENCE = "first is added to the step: how many steps have passed since the first measurement?"

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
    *(
        ("one-step-late", "It is one step late: step `first` itself is that of the first measurement.", dimension_where(there))
        for there in (
            lambda k, ratio, first: (k > first) & ((k - first - 1) % ratio == 0),
            lambda k, ratio, first: (k - first - 1) % ratio == 0,
        )
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
    (
        "reversed",
        "It is the other way round: the vector is longer where the receiver measures.",
        lambda *a: 3 - dimension(*a),
    ),
    (
        "first-left-out",
        "The receiver's first measurement counts too.",
        dimension_where(lambda k, ratio, first: (k > first) & ((k - first) % ratio == 0)),
    ),
    (
        "receiver-only",
        "That says only whether the receiver is there; the number of components is asked for.",
        dimension_where(lambda k, ratio, first: k % ratio == first % ratio, 0, 1),
    ),
    ("sum-for-difference", SUM_FOR_DIFFERENCE, dimension_where(lambda k, ratio, first: (k + first) % ratio == 0)),
    (
        "sum-for-difference",
        SUM_FOR_DIFFERENCE,
        dimension_where(lambda k, ratio, first: (k >= first) & ((k + first) % ratio == 0)),
    ),
    (
        "counted-from-zero",
        "The period is counted from step 0; it begins with the first measurement.",
        dimension_where(lambda k, ratio, first: (k >= first) & (k % ratio == 0)),
    ),
    ("subtracted", "Where the receiver measures the vector is longer, not shorter.", lambda *a: 2 - dimension(*a)),
    ("receiver-twice", "The receiver counts as one component.", lambda *a: 2 * dimension(*a) - 1),
    (
        "cumulated",
        "The measurements are added up over the steps; each step has its own vector.",
        lambda *a: np.cumsum(dimension(*a) - 1) + 1,
    ),
    (
        "period-shorter",
        "The period is one step too short.",
        dimension_where(lambda k, ratio, first: (k >= first) & ((k - first) % (ratio - 1) == 0)),
    ),
)


# -- l3: a correction of varying dimension


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


def _other_end(
    cov: Callable[[Array, Array, Array, Array], Array] = lambda P, K, H, R: P - K @ H @ P,
    F: Callable[[Array, Array, Array], Array] = lambda H, P, R: H @ P @ H.T + R,
) -> Answer:
    """The right choice of components, but another covariance, or another gain."""

    def answer(m: Array, P: Array, y: Array, H: Array, R: Array) -> tuple[Array, Array]:
        there = np.isfinite(y)
        if not there.any():
            return m, P
        y, H, R = y[there], H[there], R[np.ix_(there, there)]
        K = np.linalg.solve(F(H, P, R).T, H @ P).T
        return m + K @ (y - H @ m), cov(P, K, H, R)

    return answer


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
        correction_with(lambda m, y, H, R, there: ((y - H @ m)[there], H[: there.sum()], R[np.ix_(there, there)])),
    ),
    (
        "wrong-part-of-R",
        "R has the right size, but its rows and columns are not those of the components that are there.",
        correction_with(lambda m, y, H, R, there: ((y - H @ m)[there], H[there], R[: there.sum(), : there.sum()])),
    ),
    (
        "correlation-forgotten",
        "Only the diagonal of R is used; the noises of the sensors are correlated here.",
        correction_with(lambda m, y, H, R, there: ((y - H @ m)[there], H[there], np.diag(np.diag(R)[there]))),
    ),
    (
        "innovation-sign",
        messages.INNOVATION_SIGN,
        correction_with(lambda m, y, H, R, there: ((H @ m - y)[there], H[there], R[np.ix_(there, there)])),
    ),
    ("covariance-added", messages.COVARIANCE_ADDED, _other_end(lambda P, K, H, R: P + K @ H @ P)),
    ("covariance-kept", messages.COVARIANCE_KEPT, _other_end(lambda P, K, H, R: P)),
    ("share-only", messages.SHARE_ONLY, _other_end(lambda P, K, H, R: np.eye(len(P)) - K @ H)),
    (
        "noise-squared",
        messages.NOISE_SQUARED,
        _other_end(F=lambda H, P, R: H @ P @ H.T + R @ R),
    ),
    ("noise-by-deviation", messages.NOISE_BY_DEVIATION, _other_end(F=lambda H, P, R: H @ P @ H.T + np.sqrt(np.abs(R)))),
    ("noise-forgotten", "The noise of the meter is missing in the gain.", _other_end(F=lambda H, P, R: H @ P @ H.T)),
    (
        "gain-by-noise-alone",
        messages.GAIN_BY_NOISE_ALONE,
        _other_end(F=lambda H, P, R: R),
    ),
)


# -- l4: over any interval; l5: late measurements


def move_with(
    Q: Callable[[float], list] = lambda dt: [[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]],
    carried: Callable[[Array, Array], Array] = lambda A, P: A @ P @ A.T,
    moved: Callable[[Array, Array], Array] = lambda A, m: A @ m,
) -> Answer:
    """The motion over dt, with another noise, covariance or mean."""

    def answer(m: Array, P: Array, dt: float, q: float) -> tuple[Array, Array]:
        A = np.array([[1, dt], [0, 1]])
        return moved(A, m), carried(A, P) + q * np.array(Q(dt))

    return answer


INTENSITY = "The intensity of the noise enters with another power."


def _noise_scaled(scale: Callable[[float], float]) -> Answer:
    return lambda m, P, dt, q: move_with()(m, P, dt, scale(q))


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
    ("intensity-power", INTENSITY, _noise_scaled(lambda q: q**2)),
    ("intensity-power", INTENSITY, _noise_scaled(lambda q: q**0.5)),
    ("intensity-halved", "The intensity q is given; it is not a one-sided density.", _noise_scaled(lambda q: q / 2)),
    (
        "factors-forgotten",
        "The factors from the integration are missing in the noise.",
        move_with(lambda dt: [[dt**3, dt**2], [dt**2, dt]]),
    ),
    (
        "noise-of-fixed-step",
        "The noise of the velocity does not depend on the interval, and that of the position is missing.",
        move_with(lambda dt: [[0, 0], [0, 1]]),
    ),
    (
        "correlation-sign",
        messages.CORRELATION_SIGN,
        move_with(lambda dt: [[dt**3 / 3, -(dt**2) / 2], [-(dt**2) / 2, dt]]),
    ),
    (
        "same-on-both",
        "The same noise is added to position and velocity; the position gets it by integration.",
        move_with(lambda dt: [[dt, 0], [0, dt]]),
    ),
    (
        "transition-transposed",
        "A is transposed: in A P A^T the transposed one stands on the right.",
        move_with(carried=lambda A, P: A.T @ P @ A),
    ),
    (
        "transition-transposed",
        "The transition is transposed: it is the position that moves by the velocity.",
        move_with(carried=lambda A, P: A.T @ P @ A, moved=lambda A, m: A.T @ m),
    ),
    (
        "backwards",
        "The sign of dt: that goes backwards in time.",
        move_with(carried=lambda A, P: np.linalg.inv(A) @ P @ np.linalg.inv(A).T, moved=lambda A, m: np.linalg.inv(A) @ m),
    ),
)


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


def by_tag(tags: Array, arrivals: Array) -> Array:
    """The order in which things were measured."""
    return tags


def by_arrival(tags: Array, arrivals: Array) -> Array:
    """The order in which they came."""
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
    ("noise-squared", messages.NOISE_SQUARED, lambda *a: _fusion_with(by_tag)(*a[:6], a[6] ** 2, a[7])),
    ("noise-by-deviation", messages.NOISE_BY_DEVIATION, lambda *a: _fusion_with(by_tag)(*a[:6], a[6] ** 0.5, a[7])),
    (
        "start-moved",
        "The law at the start belongs to the moment 0, not to the first tag.",
        lambda tags, arrivals, values, m, P, q, r, now: _fusion_with(by_tag)(
            tags - tags.min(), arrivals - tags.min(), values, m, P, q, r, now - tags.min()
        ),
    ),
    (
        "values-reordered",
        "The tags are sorted, but not the values with them.",
        lambda tags, arrivals, values, *rest: _fusion_with(by_tag)(np.sort(tags), arrivals[np.argsort(tags)], values, *rest),
    ),
    (
        "what-comes-later",
        "What has not arrived yet is used, and what has arrived is not.",
        _fusion_with(by_tag, used=lambda tags, arrivals, now: arrivals >= now),
    ),
)
