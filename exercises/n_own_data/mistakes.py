"""Known mistakes with recorded data: intervals (n1, n2), a filter (n3), a gate (n4), judging without a truth (n5, n6)."""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain

import numpy as np
import scipy

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.n_own_data.keys import gate, held_out, neighbours, process_noise
from kfcourse.laws import Array

# -- n1: intervals; n2: the noise of an interval

ALIKE = "All steps are made alike; the intervals of the record are not."
KEPT = "That is an acceleration which keeps its value over the interval; here it is white, and it changes all the time."

WRONG_INTERVALS: tuple[tuple[str, str, Answer], ...] = (
    (
        "since-the-last",
        "These are the intervals since the row before; the step of a row lasts until the next one.",
        lambda t: np.concatenate([[t[1] - t[0]], np.diff(t)]),
    ),
    ("zero-first", "These are the intervals since the row before, none for the first.", lambda t: np.diff(t, prepend=t[0])),
    ("zero-last", "The last step has no length; give it that of the one before.", lambda t: np.diff(t, append=t[-1])),
    ("mean", ALIKE, lambda t: np.full(len(t), np.diff(t).mean())),
    (
        "median",
        ALIKE,
        lambda t: np.full(len(t), np.median(np.diff(t))),
    ),
    ("times", "That is the time since the first row, not the length of each step.", lambda t: t - t[0]),
)


def noise_with(Q: Callable[[Array], list]) -> Answer:
    """q Q(dt) for a Q given entry by entry."""
    return lambda dt, q: q * np.moveaxis(np.array(np.broadcast_arrays(*chain(*Q(dt)))).reshape(2, 2, -1), -1, 0)


WRONG_NOISES: tuple[tuple[str, str, Answer], ...] = (
    (
        "constant-in-interval",
        KEPT,
        noise_with(lambda t: [[t**4 / 4, t**3 / 2], [t**3 / 2, t**2]]),
    ),
    (
        "constant-in-interval",
        KEPT,
        noise_with(lambda t: [[t**3 / 4, t**2 / 2], [t**2 / 2, t]]),
    ),
    (
        "diagonal",
        "Position and velocity are disturbed by the same noise: they are correlated.",
        noise_with(lambda t: [[t**3 / 3, 0 * t], [0 * t, t]]),
    ),
    (
        "velocity-only",
        "In the interval the disturbed velocity moves the position, too.",
        noise_with(lambda t: [[0 * t, 0 * t], [0 * t, t]]),
    ),
    (
        "mean-interval",
        "All intervals are taken for their mean; each row has its own.",
        lambda dt, q: np.broadcast_to(process_noise(np.array([dt.mean()]), q), (len(dt), 2, 2)),
    ),
    ("unit-interval", "All intervals are taken for 1; each row has its own.", lambda dt, q: process_noise(np.ones(len(dt)), q)),
    (
        "correlation-sign",
        "A push forwards moves forwards: the covariance is positive.",
        noise_with(lambda t: [[t**3 / 3, -(t**2) / 2], [-(t**2) / 2, t]]),
    ),
    ("swapped", "Position and velocity have changed places.", noise_with(lambda t: [[t, t**2 / 2], [t**2 / 2, t**3 / 3]])),
    (
        "intensity-squared",
        "The intensity q is a variance for each second already; it is not squared.",
        lambda dt, q: process_noise(dt, q**2),
    ),
    ("intensity-forgotten", "The intensity q of the noise is missing.", lambda dt, q: process_noise(dt, 1.0)),
)


# -- n3: a filter over unequal steps with missing measurements


def filter_with(
    interval: Callable[[Array, int], float] = lambda t, k: t[k] - t[k - 1],
    missing: str = "skipped",
    first: str = "corrected",
    noise: Callable[[float, float], Array] = lambda dt, q: process_noise(np.array([dt]), q)[0],
    returned: str = "estimates",
    carried: bool = True,
    meter_noise: Callable[[float], float] = lambda r: r,
    sign: float = 1.0,
) -> Answer:
    """The filter with something done otherwise."""

    def answer(times: Array, y: Array, q: float, r: float, m: Array, P: Array) -> tuple[Array, Array]:
        found = []
        for k, value in enumerate(y):
            if k or first == "predicted":
                dt = interval(times, max(k, 1))
                A = np.array([[1, dt], [0, 1]])
                if not (missing == "frozen" and np.isnan(value)):
                    m, P = A @ m, (A @ P @ A.T if carried else P) + noise(dt, q)
            before = m, P
            seen = not np.isnan(value)
            if seen or missing in ("zero", "expected"):
                innovation = sign * (value - m[0]) if seen else (-m[0] if missing == "zero" else 0.0)
                K = P[:, 0] / (P[0, 0] + meter_noise(r))
                m, P = m + K * innovation, P - np.outer(K, P[0])
            found.append((m, P) if returned == "estimates" else before)
        return np.stack([one for one, _ in found]), np.stack([one for _, one in found])

    return answer


WRONG_FILTERS: tuple[tuple[str, str, Answer], ...] = (
    ("missing-as-zero", messages.MISSING_AS_ZERO, filter_with(missing="zero")),
    (
        "missing-as-expected",
        "A gap is filled by what was expected: the covariance then shrinks as if it had been measured.",
        filter_with(missing="expected"),
    ),
    (
        "missing-stops-time",
        "Where a measurement is missing the body moves on: predict over that interval, too.",
        filter_with(missing="frozen"),
    ),
    (
        "next-interval",
        "The interval that leads to a row is the one before it.",
        filter_with(lambda t, k: t[min(k + 1, len(t) - 1)] - t[min(k, len(t) - 2)]),
    ),
    ("mean-interval", "All intervals are taken for their mean; each has its own.", filter_with(lambda t, k: np.diff(t).mean())),
    ("unit-interval", "All intervals are taken for 1; each has its own.", filter_with(lambda t, k: 1.0)),
    ("predicted-first", messages.PREDICTED_FIRST, filter_with(first="predicted")),
    ("predictions-returned", messages.PREDICTIONS_RETURNED, filter_with(returned="predictions")),
    (
        "noise-forgotten",
        "The noise of the state is missing in the prediction.",
        filter_with(noise=lambda dt, q: np.zeros((2, 2))),
    ),
    ("covariance-not-carried", "The motion carries the covariance, too: A P A^T.", filter_with(carried=False)),
    ("innovation-sign", messages.INNOVATION_SIGN, filter_with(sign=-1.0)),
    ("noise-squared", messages.NOISE_SQUARED, filter_with(meter_noise=lambda r: r**2)),
    ("noise-by-deviation", messages.NOISE_BY_DEVIATION, filter_with(meter_noise=np.sqrt)),
)


# -- n4: the gate


def _edge(p: int, probability: float) -> float:
    return float(scipy.special.chdtri(p, 1 - probability))


def size_with(size: Callable[[Array, Array], Array]) -> Answer:
    return lambda nu, F, probability: (size(nu, F), gate(nu, F, probability)[1])


def edge_with(edge: Callable[[int, float], float]) -> Answer:
    return lambda nu, F, probability: (gate(nu, F, probability)[0], edge(nu.shape[-1], probability))


WRONG_GATES: tuple[tuple[str, str, Answer], ...] = (
    (
        "root",
        "The root of the size is compared with nothing here: chi-squared is the law of the square.",
        size_with(lambda nu, F: np.sqrt(gate(nu, F, 0.5)[0])),
    ),
    (
        "not-normalised",
        "The innovation is not divided by what the filter expected of it.",
        size_with(lambda nu, F: np.sum(nu**2, axis=-1)),
    ),
    (
        "diagonal",
        "Only the variances in F are used; the components of the innovation are correlated.",
        size_with(lambda nu, F: np.sum(nu**2 / np.diagonal(F, axis1=-2, axis2=-1), axis=-1)),
    ),
    (
        "multiplied",
        "The innovation is multiplied by F; it is measured in units of F.",
        size_with(lambda nu, F: np.einsum("...i,...ij,...j", nu, F, nu)),
    ),
    (
        "squared-inverse",
        "The inverse of F enters twice.",
        size_with(lambda nu, F: np.sum(np.linalg.solve(F, nu[..., None])[..., 0] ** 2, axis=-1)),
    ),
    (
        "mean-of-components",
        "The size is divided by the number of components.",
        size_with(lambda nu, F: gate(nu, F, 0.5)[0] / nu.shape[-1]),
    ),
    (
        "one-degree",
        "The edge is that of one component; a measurement has more.",
        edge_with(lambda p, probability: _edge(1, probability)),
    ),
    (
        "degree-less",
        "The edge has one degree of freedom too few; nothing was fitted to this measurement.",
        edge_with(lambda p, probability: _edge(p - 1, probability)),
    ),
    (
        "refusal-probability",
        "That is the edge of the opposite event: `probability` is that of passing.",
        edge_with(lambda p, probability: _edge(p, 1 - probability)),
    ),
    (
        "two-sided",
        "The edge is two-sided; a square is too large on one side only.",
        edge_with(lambda p, probability: _edge(p, (1 + probability) / 2)),
    ),
    (
        "normal-edge",
        "That is an edge for a normal number, not for the sum of squares.",
        edge_with(lambda p, probability: float(scipy.special.ndtri((1 + probability) / 2))),
    ),
)


# -- n5: held-out measurements; n6: neighbours


def judged_with(
    rms: Callable[[Array], float] | None = None,
    claimed: Callable[[Array], float] | None = None,
    nis: Callable[[Array, Array], float] | None = None,
) -> Answer:
    def answer(errors: Array, F: Array) -> tuple[float, float, float]:
        right = held_out(errors, F)
        return (
            right[0] if rms is None else rms(errors),
            right[1] if claimed is None else claimed(F),
            right[2] if nis is None else nis(errors, F),
        )

    return answer


WRONG_JUDGEMENTS: tuple[tuple[str, str, Answer], ...] = (
    (
        "mean-distance",
        "That is the mean distance; the root of the mean square is asked for.",
        judged_with(lambda e: float(np.linalg.norm(e, axis=-1).mean())),
    ),
    (
        "per-component",
        "Each component counts for itself; the square of a distance is the sum over them.",
        judged_with(lambda e: np.sqrt(np.mean(e**2))),
    ),
    ("not-rooted", "It is a mean square; its root is asked for.", judged_with(lambda e: np.mean(np.sum(e**2, axis=-1)))),
    (
        "bias-only",
        "That is the length of the mean error; errors in all directions cancel in it.",
        judged_with(lambda e: float(np.linalg.norm(e.mean(axis=0)))),
    ),
    (
        "claimed-not-rooted",
        "What is claimed is a mean variance; its root is asked for.",
        judged_with(claimed=lambda F: np.trace(F, axis1=-2, axis2=-1).mean()),
    ),
    (
        "mean-of-deviations",
        "Standard deviations are averaged; average the variances, and take the root last.",
        judged_with(claimed=lambda F: np.sqrt(np.trace(F, axis1=-2, axis2=-1)).mean()),
    ),
    (
        "claimed-per-component",
        "What is claimed is taken for one component; the variance of a distance is the sum over them.",
        judged_with(claimed=lambda F: np.sqrt(np.trace(F, axis1=-2, axis2=-1).mean() / F.shape[-1])),
    ),
    (
        "determinant",
        "The determinant is an area; the variance of a distance is the trace.",
        judged_with(claimed=lambda F: np.sqrt(np.linalg.det(F).mean())),
    ),
    (
        "ratio-of-means",
        "One ratio of two means; each error is compared with its own covariance, and then averaged.",
        judged_with(nis=lambda e, F: np.mean(np.sum(e**2, axis=-1)) / np.trace(F, axis1=-2, axis2=-1).mean()),
    ),
    (
        "diagonal",
        "Only the variances in F are used; the components of the errors are correlated.",
        judged_with(nis=lambda e, F: np.mean(np.sum(e**2 / np.diagonal(F, axis1=-2, axis2=-1), axis=-1))),
    ),
    (
        "per-degree",
        "The mean is divided by the number of components; here it is not.",
        judged_with(nis=lambda e, F: held_out(e, F)[2] / e.shape[-1]),
    ),
)


def near_with(correlation: Callable[[Array], float] | None = None, deviation: Callable[[Array], float] | None = None) -> Answer:
    """Functions of the innovations over their deviations, NaN where nothing was measured."""

    def answer(nu: Array, F: Array) -> tuple[float, float]:
        s, right = nu / np.sqrt(F), neighbours(nu, F)
        return (right[0] if correlation is None else correlation(s), right[1] if deviation is None else deviation(s))

    return answer


def _kept(s: Array) -> Array:
    return s[~np.isnan(s)]


WRONG_NEIGHBOURS: tuple[tuple[str, str, Answer], ...] = (
    (
        "gaps-as-zero",
        "A missing innovation is taken for 0; take the next one that was measured.",
        near_with(lambda s: float(np.mean(np.nan_to_num(s)[:-1] * np.nan_to_num(s)[1:]))),
    ),
    (
        "neighbours-in-rows",
        "Pairs with a gap between them are left out; the next one that was measured is the neighbour.",
        near_with(lambda s: float(np.nanmean(s[:-1] * s[1:]))),
    ),
    (
        "not-normalised",
        "The innovations are not divided by their deviations.",
        lambda nu, F: near_with(lambda _: float(np.mean(_kept(nu)[:-1] * _kept(nu)[1:])))(nu, F),
    ),
    (
        "by-variance",
        "The innovations are divided by their variances; by the deviations they get the variance 1.",
        lambda nu, F: near_with(lambda _: float(np.mean(_kept(nu / F)[:-1] * _kept(nu / F)[1:])))(nu, F),
    ),
    (
        "sum",
        "That is the sum of the products; divide by their number.",
        near_with(lambda s: float(np.sum(_kept(s)[:-1] * _kept(s)[1:]))),
    ),
    (
        "own-product",
        "Each innovation is multiplied by itself; its neighbour belongs there.",
        near_with(lambda s: float(np.mean(_kept(s) ** 2))),
    ),
    (
        "pairs-and-innovations",
        "There is one pair less than there are innovations.",
        near_with(lambda s: float(np.mean(_kept(s)[:-1] * _kept(s)[1:]) * (len(_kept(s)) - 1) / len(_kept(s)))),
    ),
    (
        "deviation-of-innovations",
        "The deviation counts innovations; a mean over pairs is asked for.",
        near_with(deviation=lambda s: 1 / np.sqrt(len(_kept(s)))),
    ),
    (
        "variance-for-deviation",
        "That is the variance of the mean; its root is asked for.",
        near_with(deviation=lambda s: 1 / (len(_kept(s)) - 1)),
    ),
    (
        "gaps-counted",
        "The deviation counts rows in which nothing was measured.",
        near_with(deviation=lambda s: 1 / np.sqrt(len(s) - 1)),
    ),
    (
        "two-deviations",
        "That is a bound of about 95 %; one standard deviation is asked for.",
        near_with(deviation=lambda s: 2 / np.sqrt(len(_kept(s)) - 1)),
    ),
)
