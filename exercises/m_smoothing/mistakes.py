"""Known mistakes of set m, question by question, and what is said of each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy
import sympy as sp

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.m_smoothing.keys import neighbours, new_r, smooth, smooth_with, step_back, weight
from kfcourse.laws import Array

Rows = tuple[tuple[str, str, Answer], ...]

ABOUT_THE_MEAN = "The mean error is subtracted first; the meter's errors have the mean zero by the model."

# -- m1: the gate

WRONG_GATES: Rows = (
    (
        "other-side",
        "That is the value that is exceeded with the probability beta; the gate lets the right ones pass with it.",
        lambda beta: -2 * np.log(beta),
    ),
    ("half-forgotten", "The exponent of the law of the radius has a half: a factor is missing.", lambda beta: -np.log(1 - beta)),
    (
        "radius",
        "That is the radius; the gate is on the square, nu^T F^-1 nu.",
        lambda beta: np.sqrt(-2 * np.log(1 - beta)),
    ),
    ("sign", "A square is not negative: check the sign.", lambda beta: 2 * np.log(1 - beta)),
    (
        "one-component",
        "That is the gate of one component; two are measured.",
        lambda beta: scipy.special.chdtri(1, 1 - beta),
    ),
    (
        "both-tails",
        "The density is solved for its argument, not the probability.",
        lambda beta: -2 * np.log(2 * (1 - beta)),
    ),
)

# -- m2: the likelihood of one innovation


def _log(square: Callable, log: Callable) -> Answer:
    return lambda nu, F: -square(nu, F) / 2 - log(F) / 2


def _size(nu: sp.Expr, F: sp.Expr) -> sp.Expr:
    return nu**2 / F


def _volume(F: sp.Expr) -> sp.Expr:
    return sp.log(2 * sp.pi * F)


WRONG_LOGARITHMS: Rows = (
    ("density", "That is the density itself; its logarithm is asked for.", lambda nu, F: sp.exp(_log(_size, _volume)(nu, F))),
    (
        "sign",
        "The logarithm of a density has the other sign: a larger innovation is less likely.",
        lambda nu, F: -_log(_size, _volume)(nu, F),
    ),
    (
        "volume-sign",
        "The larger F is, the flatter the density: the logarithm of F enters with the other sign.",
        _log(_size, lambda F: -_volume(F)),
    ),
    (
        "volume-forgotten",
        "Only the exponent is there: without the factor before it the largest F would always win.",
        _log(_size, lambda F: 0),
    ),
    ("constant-forgotten", "The factor 2 pi is missing.", _log(_size, sp.log)),
    (
        "half-of-volume",
        "The factor before the exponent is a root: a half is missing.",
        lambda nu, F: -_size(nu, F) / 2 - _volume(F),
    ),
    ("half-of-square", "The half of the exponent is missing.", lambda nu, F: -_size(nu, F) - _volume(F) / 2),
    ("deviation", messages.GAIN_MULTIPLIED.replace("gain", "square"), _log(lambda nu, F: nu**2 * F, _volume)),
    (
        "root-of-F",
        "The square of the innovation is divided by a standard deviation; F is a variance.",
        _log(lambda nu, F: nu**2 / sp.sqrt(F), _volume),
    ),
    ("not-squared", "The innovation is not squared.", _log(lambda nu, F: nu / F, _volume)),
    ("F-squared", "F is a variance already; it is squared in the exponent.", _log(lambda nu, F: nu**2 / F**2, _volume)),
)

# -- m3: neighbours


def _pair(cross: Callable[[Array, Array], Array], ahead: Callable[[Array, Array, Array], Array]) -> Answer:
    def answer(p: Array, A: Array, Q: Array) -> tuple[Array, Array]:
        C = cross(p, A)
        return C, C @ np.linalg.inv(ahead(p, A, Q))

    return answer


def _next(p: Array, A: Array, Q: Array) -> Array:
    return A @ p @ A.T + Q


def _own(p: Array, A: Array) -> Array:
    return p @ A.T


WRONG_PAIRS: Rows = (
    ("transposed", "The covariance of x_{k+1} with x_k stands there: the rows belong to x_k.", _pair(lambda p, A: A @ p, _next)),
    ("A-not-transposed", "A stands on the right of p, and there it is transposed.", _pair(lambda p, A: p @ A, _next)),
    (
        "carried-twice",
        "What becomes of p in a step stands there; only one of the two states has moved.",
        _pair(lambda p, A: A @ p @ A.T, _next),
    ),
    ("A-forgotten", "The object is missing: the next state is not this one.", _pair(lambda p, A: p, _next)),
    (
        "Q-forgotten",
        "The noise of the object is missing where the gain is divided: x_{k+1} is not known from x_k alone.",
        _pair(_own, lambda p, A, Q: A @ p @ A.T),
    ),
    ("divided-by-p", "The gain is divided by the covariance of x_k; it corrects x_k by x_{k+1}.", _pair(_own, lambda p, A, Q: p)),
    (
        "divided-by-Q",
        "The gain is divided by the noise of the object alone; what is not known of x_k belongs to the prediction too.",
        _pair(_own, lambda p, A, Q: Q),
    ),
    (
        "not-carried",
        "p is added to Q as it is; the prediction's covariance has it carried by A.",
        _pair(_own, lambda p, A, Q: p + Q),
    ),
    (
        "gain-multiplied",
        "The gain is multiplied by the covariance of the prediction; it is divided by it.",
        lambda p, A, Q: (_own(p, A), _own(p, A) @ _next(p, A, Q)),
    ),
    (
        "wrong-order",
        "The inverse stands on the wrong side of the covariance.",
        lambda p, A, Q: (_own(p, A), np.linalg.inv(_next(p, A, Q)) @ _own(p, A)),
    ),
)

# -- m4: one step back


def _back(mean: Callable | None = None, cov: Callable | None = None) -> Answer:
    """mean(z, S, later, ahead), cov(p, S, later_p, Psi)."""

    def answer(z: Array, p: Array, ahead: Array, Psi: Array, later: Array, later_p: Array, S: Array) -> tuple[Array, Array]:
        right = step_back(z, p, ahead, Psi, later, later_p, S)
        return mean(z, S, later, ahead) if mean else right[0], cov(p, S, later_p, Psi) if cov else right[1]

    return answer


WRONG_STEPS: Rows = (
    (
        "innovation-sign",
        "The innovation has the wrong sign: it is what is known later, less what was predicted.",
        _back(lambda z, S, later, ahead: z - S @ (later - ahead)),
    ),
    (
        "later-for-innovation",
        "The later mean itself is multiplied by the gain; subtract what was predicted.",
        _back(lambda z, S, later, ahead: z + S @ later),
    ),
    (
        "filtered-subtracted",
        "The estimate of this step is subtracted; the prediction of the next one is what was expected.",
        _back(lambda z, S, later, ahead: z + S @ (later - z)),
    ),
    (
        "correction-alone",
        "That is the correction alone; it is added to the estimate.",
        _back(lambda z, S, later, ahead: S @ (later - ahead)),
    ),
    (
        "gain-forgotten",
        "The whole difference is added; the gain says how much of it belongs to this step.",
        _back(lambda z, S, later, ahead: z + later - ahead),
    ),
    (
        "kept",
        "The estimate is the filter's: nothing has been learned from later measurements.",
        _back(lambda z, S, later, ahead: z),
    ),
    (
        "from-the-prediction",
        "The correction is added to the prediction of the next step; it belongs to the estimate of this one.",
        _back(lambda z, S, later, ahead: ahead + S @ (later - ahead)),
    ),
    (
        "covariance-kept",
        "The covariance is the filter's: later measurements make it smaller.",
        _back(cov=lambda p, S, later_p, Psi: p),
    ),
    (
        "covariance-sign",
        "The two covariances are subtracted the wrong way round: a smoother is surer than its filter.",
        _back(cov=lambda p, S, later_p, Psi: p + S @ (Psi - later_p) @ S.T),
    ),
    (
        "as-if-known",
        "That holds if the next state were known exactly; its own uncertainty comes on top.",
        _back(cov=lambda p, S, later_p, Psi: p - S @ Psi @ S.T),
    ),
    (
        "nothing-explained",
        "What the next state explains is not subtracted.",
        _back(cov=lambda p, S, later_p, Psi: p + S @ later_p @ S.T),
    ),
    (
        "gain-once",
        "The gain acts from both sides on a covariance.",
        _back(cov=lambda p, S, later_p, Psi: p + S @ (later_p - Psi)),
    ),
    (
        "gain-transposed",
        "The gain stands transposed on the wrong side.",
        _back(cov=lambda p, S, later_p, Psi: p + S.T @ (later_p - Psi) @ S),
    ),
    (
        "correction-of-covariance-alone",
        "That is what the covariance changes by; the filter's own is missing.",
        _back(cov=lambda p, S, later_p, Psi: S @ (later_p - Psi) @ S.T),
    ),
)

# -- m5: a whole record


def _with_index(shift: int) -> Answer:
    """The predictions of another step."""

    def answer(z: Array, p: Array, ahead: Array, Psi: Array, A: Array, Q: Array) -> tuple[Array, Array]:
        return smooth(z, p, np.roll(ahead, shift, axis=0), np.roll(Psi, shift, axis=0), A, Q)

    return answer


def _one_step_only(z: Array, p: Array, ahead: Array, Psi: Array, A: Array, Q: Array) -> tuple[Array, Array]:
    means, covs = [], []
    for k in range(len(z) - 1):
        mean, cov = step_back(z[k], p[k], ahead[k + 1], Psi[k + 1], z[k + 1], p[k + 1], neighbours(p[k], A, Q)[1])
        means.append(mean)
        covs.append(cov)
    return np.stack([*means, z[-1]]), np.stack([*covs, p[-1]])


def _from_prediction(z: Array, p: Array, ahead: Array, Psi: Array, A: Array, Q: Array) -> tuple[Array, Array]:
    """The last step counts as unknown: its prediction stands there."""
    z, p = z.copy(), p.copy()
    z[-1], p[-1] = ahead[-1], Psi[-1]
    return smooth(z, p, ahead, Psi, A, Q)


def _gain_of_last_step(z: Array, p: Array, ahead: Array, Psi: Array, A: Array, Q: Array) -> tuple[Array, Array]:
    S = neighbours(p[-2], A, Q)[1]
    return smooth_with(lambda *_: (None, S), step_back)(z, p, ahead, Psi, A, Q)


def _gain_of_next(z: Array, p: Array, ahead: Array, Psi: Array, A: Array, Q: Array) -> tuple[Array, Array]:
    later = iter(p[:0:-1])
    return smooth_with(lambda _, *rest: neighbours(next(later), *rest), step_back)(z, p, ahead, Psi, A, Q)


WRONG_RECORDS: Rows = (
    ("filter-returned", "These are the filter's own estimates.", lambda z, p, *rest: (z, p)),
    ("reversed", "The steps come out in reverse order.", lambda *a: tuple(part[::-1] for part in smooth(*a))),
    (
        "one-step-only",
        "Each step is corrected by the filter's next estimate; take the smoothed one, which knows all the rest.",
        _one_step_only,
    ),
    (
        "prediction-of-same-step",
        "The prediction of the same step is subtracted; that of the next one is what x_{k+1} was expected to be.",
        _with_index(1),
    ),
    (
        "from-the-prediction",
        "The look back starts from the last prediction; the last estimate already knows all measurements.",
        _from_prediction,
    ),
    ("one-gain", "One gain is used for all steps; the filter's covariance changes from step to step.", _gain_of_last_step),
    (
        "gain-of-next-step",
        "The gain is made of the covariance of the next step; it is that of the step to be corrected.",
        _gain_of_next,
    ),
)

# -- m6: a round of EM


def _round(part: Callable[[Array, Array, Array], Any]) -> Answer:
    """A mistake in what is done with the measurements that are there."""

    def answer(y: Array, z: Array, p: Array) -> float:
        there = np.isfinite(y)
        return float(part(y[there], z[there], p[there]))

    return answer


def _zero_for_missing(y: Array, z: Array, p: Array) -> float:
    return float(np.mean((np.nan_to_num(y) - z) ** 2 + p))


def _divided_by_all(y: Array, z: Array, p: Array) -> float:
    return new_r(y, z, p) * float(np.isfinite(y).mean())


WRONG_ROUNDS: Rows = (
    (
        "variance-forgotten",
        "The square of the mean error is not the mean square: the states are not known exactly.",
        _round(lambda y, z, p: np.mean((y - z) ** 2)),
    ),
    (
        "variance-subtracted",
        "The smoother's uncertainty makes the mean square larger, not smaller.",
        _round(lambda y, z, p: np.mean((y - z) ** 2 - p)),
    ),
    (
        "variance-everywhere",
        "The smoother's variance is averaged over all steps; only those with a measurement count.",
        lambda y, z, p: float(np.nanmean((y - z) ** 2) + np.mean(p)),
    ),
    ("variance-alone", "Only the smoother's variance is there.", _round(lambda y, z, p: np.mean(p))),
    ("sum-for-mean", "It is a sum over the measurements, not a mean.", _round(lambda y, z, p: np.sum((y - z) ** 2 + p))),
    ("missing-counted", "It is divided by the number of all steps; what is missing tells nothing of the meter.", _divided_by_all),
    (
        "missing-as-zero",
        "A missing measurement is treated as the number 0; it tells nothing of the meter: leave its step out.",
        _zero_for_missing,
    ),
    (
        "about-the-mean",
        ABOUT_THE_MEAN,
        _round(lambda y, z, p: np.var(y - z) + np.mean(p)),
    ),
    (
        "about-the-mean",
        ABOUT_THE_MEAN,
        lambda y, z, p: float(np.nanvar(y - z) + np.mean(p)),
    ),
    ("deviation-for-variance", messages.DEVIATION_FOR_VARIANCE, _round(lambda y, z, p: np.sqrt(np.mean((y - z) ** 2 + p)))),
    ("deviation-added", "A standard deviation is added to a square.", _round(lambda y, z, p: np.mean((y - z) ** 2 + np.sqrt(p)))),
    (
        "variance-squared",
        "The smoother's variance is squared; it is a mean square already.",
        _round(lambda y, z, p: np.mean((y - z) ** 2 + p**2)),
    ),
    ("absolute", "It is made of absolute values, not of squares.", _round(lambda y, z, p: np.mean(np.abs(y - z) + p))),
)

# -- m7: a weight


def _weight(
    size: Callable[[Array, Array], Any] = lambda r, R: r @ np.linalg.inv(R) @ r,
    unsure: Callable[[Array, Array, Array], Any] = lambda R, G, p: np.trace(np.linalg.inv(R) @ G @ p @ G.T),
    above: Callable[[float, int], float] = lambda s, m: s + m,
    below: float = 1,
) -> Answer:
    return lambda r, R, G, p, s: float(above(s, len(r)) / (below * s + size(r, R) + unsure(R, G, p)))


WRONG_WEIGHTS: Rows = (
    (
        "trace-forgotten",
        "The residual is only the mean of the error: what is not known of the state is missing.",
        _weight(unsure=lambda R, G, p: 0),
    ),
    (
        "p-not-seen",
        "The state's covariance enters as the meter sees it, through G from both sides.",
        _weight(unsure=lambda R, G, p: float(np.trace(p))),
    ),
    (
        "trace-without-R",
        "The uncertainty is compared with the noise, like the residual: R is missing.",
        _weight(unsure=lambda R, G, p: np.trace(G @ p @ G.T)),
    ),
    ("R-multiplied", "The square of the residual is multiplied by R; it is divided by it.", _weight(size=lambda r, R: r @ R @ r)),
    ("R-forgotten", "The residual is not compared with the noise: R is missing.", _weight(size=lambda r, R: r @ r)),
    ("correlation-forgotten", messages.CORRELATIONS_IGNORED, _weight(size=lambda r, R: r @ (r / np.diag(R)))),
    (
        "components-of-state",
        "The state's components are counted; the measurement's are asked for.",
        lambda r, R, G, p, s: weight(r, R, G, p, s) * (s + len(p)) / (s + len(r)),
    ),
    ("one-component", "The number of components is more than one.", _weight(above=lambda s, m: s + 1)),
    (
        "components-forgotten",
        "The number of components is missing above the line: a measurement that fits would not count in full.",
        _weight(above=lambda s, m: s),
    ),
    ("degrees-forgotten", "The degrees are missing below the line.", _weight(below=0)),
    (
        "not-squared",
        "The residual's length is there, not its square.",
        _weight(size=lambda r, R: np.sqrt(r @ np.linalg.inv(R) @ r)),
    ),
    ("inverse", "That is the inverse: the further off, the less it counts.", lambda *a: 1 / weight(*a)),
)
