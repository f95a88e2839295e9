"""Known mistakes in the alpha-beta filter: gain (j3), filter (j4), lag (j5), noise that is left (j6)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy
import sympy as sp

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.j_radar.keys import _lag, _stationary, closed_loop, lag, noise_left, steady_gain
from kfcourse.exercises.shared import substituted
from kfcourse.filters.alphabeta import steady_beta, tracking_index
from kfcourse.laws import Array

# -- j3: the constant gain

INDEX_ROOT = "The root in the tracking index stands in another place: over which part of the fraction, above or below?"

OTHER_RELATION = "beta is taken from another relation; alpha and beta follow from one stationary filter."

WRONG_GAINS: tuple[tuple[str, str, Answer], ...] = (
    (
        "other-root",
        "The other root of the quadratic equation was taken: with it the filter is unstable.",
        lambda alpha: (2 * (2 - alpha) + 4 * np.sqrt(1 - alpha), 2 * (1 + np.sqrt(1 - alpha)) ** 2 / np.sqrt(1 - alpha)),
    ),
    (
        "benedict-bordner",
        "That is Benedict and Bordner's relation, from another criterion; take the stationary Kalman filter's.",
        lambda alpha: (alpha**2 / (2 - alpha), alpha**2 / (2 - alpha) / np.sqrt(1 - alpha)),
    ),
    ("small-alpha", messages.SMALL_ALPHA, lambda alpha: (alpha**2 / 2, alpha**2 / 2 / np.sqrt(1 - alpha))),
    (
        "white-in-continuous-time",
        messages.WHITE_IN_CONTINUOUS_TIME,
        lambda alpha: (3 * (2 - alpha - np.sqrt((2 - alpha) ** 2 - 2 * alpha**2 / 3)), tracking_index(alpha)),
    ),
    (
        "root-forgotten",
        "A square root is missing in beta.",
        lambda alpha: (2 * (2 - alpha) - 4 * (1 - alpha), tracking_index(alpha)),
    ),
    (
        "index-squared",
        "That is the square of the tracking index, a ratio of variances; the index is a ratio of standard deviations.",
        lambda alpha: (steady_beta(alpha), tracking_index(alpha) ** 2),
    ),
    (
        "index-without-root",
        "A square root is missing in the tracking index: the noise of the meter enters by its standard deviation.",
        lambda alpha: (steady_beta(alpha), steady_beta(alpha) / (1 - alpha)),
    ),
    (
        "alpha-for-beta",
        "alpha stands in the tracking index where beta belongs.",
        lambda alpha: (steady_beta(alpha), alpha / np.sqrt(1 - alpha)),
    ),
    (
        "index-inverted",
        "The tracking index is upside down: the noise of the object stands above, that of the meter below.",
        lambda alpha: (steady_beta(alpha), 1 / tracking_index(alpha)),
    ),
    ("small-alpha", messages.SMALL_ALPHA, lambda alpha: (alpha**2 / 4, alpha**2 / 4 / np.sqrt(1 - alpha))),
    (
        "coefficient-of-root",
        "The coefficient of the root in beta is wrong.",
        lambda alpha: (2 * (2 - alpha) - 2 * np.sqrt(1 - alpha), (2 * (2 - alpha) - 2 * np.sqrt(1 - alpha)) / np.sqrt(1 - alpha)),
    ),
    ("index-rooted", INDEX_ROOT, lambda alpha: (steady_beta(alpha), np.sqrt(steady_beta(alpha) / (1 - alpha)))),
    ("index-rooted", INDEX_ROOT, lambda alpha: (steady_beta(alpha), steady_beta(alpha) * np.sqrt(1 - alpha))),
    ("other-relation", OTHER_RELATION, lambda alpha: (alpha * (1 - alpha), alpha * np.sqrt(1 - alpha))),
    ("other-relation", OTHER_RELATION, lambda alpha: (np.sqrt(2 * alpha), tracking_index(alpha))),
    (
        "root-of-alpha",
        "The index is divided by the wrong root: by that of the share of the innovation that is noise.",
        lambda alpha: (steady_gain(alpha)[0], steady_gain(alpha)[0] / np.sqrt(alpha)),
    ),
)


# -- j4: the filter

Beat = Callable[..., tuple[Array, Array]]


def filter_with(
    beat: Beat | None = None, forward: Beat = lambda r, v, T: (r + T * v, v), swapped: bool = False, predictions: bool = False
) -> Answer:
    """The filter as a loop, with one thing changed: beat(r, v, y, T, alpha, beta) -> the corrected r, v."""

    def corrected(r: Array, v: Array, y: Array, T: float, alpha: float, beta: float) -> tuple[Array, Array]:
        return r + alpha * (y - r), v + beta / T * (y - r)

    def answer(y: Array, T: float, alpha: float, beta: float, r: Array, v: Array) -> tuple[Array, Array]:
        alpha, beta = (beta, alpha) if swapped else (alpha, beta)
        r, v = (np.broadcast_to(value, y.shape[1:]) for value in (r, v))
        rows = []
        for one in y:
            before = r, v
            r, v = (beat or corrected)(r, v, one, T, alpha, beta)
            rows.append(before if predictions else (r, v))
            r, v = forward(r, v, T)
        return np.array([row[0] for row in rows]), np.array([row[1] for row in rows])

    return answer


def _position_first(r: Array, v: Array, y: Array, T: float, alpha: float, beta: float) -> tuple[Array, Array]:
    r = r + alpha * (y - r)
    return r, v + beta / T * (y - r)


def _differences(y: Array, T: float, alpha: float, beta: float, r: Array, v: Array) -> tuple[Array, Array]:
    positions = filter_with()(y, T, alpha, beta, r, v)[0]
    return positions, np.diff(positions, axis=0, prepend=np.broadcast_to(r, positions[:1].shape)) / T


ALPHA_WITH_TIME = "alpha has no unit: the interval does not belong to it."

WRONG_FILTERS: tuple[tuple[str, str, Answer], ...] = (
    (
        "beta-not-divided",
        "The gain of the velocity is not divided by T: check its units.",
        filter_with(lambda r, v, y, T, alpha, beta: (r + alpha * (y - r), v + beta * (y - r))),
    ),
    (
        "beta-multiplied",
        "The gain of the velocity is multiplied by T: check its units.",
        filter_with(lambda r, v, y, T, alpha, beta: (r + alpha * (y - r), v + beta * T * (y - r))),
    ),
    (
        "prediction-forgotten",
        "The position is never moved on by the velocity: predict before the next measurement.",
        filter_with(forward=lambda r, v, T: (r, v)),
    ),
    (
        "time-missing",
        "The prediction adds the velocity to the position without the time between measurements.",
        filter_with(forward=lambda r, v, T: (r + v, v)),
    ),
    ("gains-swapped", "alpha and beta are swapped: alpha corrects the position, beta/T the velocity.", filter_with(swapped=True)),
    (
        "gain-on-measurement",
        "The gains multiply the measurement itself; they belong to the innovation, what came minus what was expected.",
        filter_with(lambda r, v, y, T, alpha, beta: (r + alpha * y, v + beta / T * y)),
    ),
    (
        "innovation-sign",
        messages.INNOVATION_SIGN,
        filter_with(lambda r, v, y, T, alpha, beta: (r - alpha * (y - r), v - beta / T * (y - r))),
    ),
    (
        "position-first",
        "The velocity is corrected with what is left after the position was corrected: use one innovation for both.",
        filter_with(_position_first),
    ),
    (
        "predicted-first",
        "The start is moved on before the first measurement; r and v are the prediction for it already.",
        lambda y, T, alpha, beta, r, v: filter_with()(y, T, alpha, beta, r + T * v, v),
    ),
    ("predictions-returned", messages.PREDICTIONS_RETURNED, filter_with(predictions=True)),
    ("velocity-kept", "The velocity is never corrected.", filter_with(lambda r, v, y, T, alpha, beta: (r + alpha * (y - r), v))),
    (
        "beta-over-T-squared",
        "The gain of the velocity is divided by T once too often: check its units.",
        filter_with(lambda r, v, y, T, alpha, beta: (r + alpha * (y - r), v + beta / T**2 * (y - r))),
    ),
    ("differences", "The velocity is a difference of positions; it has a gain of its own.", _differences),
    (
        "weights-exchanged",
        "Prediction and measurement have changed their weights: for alpha = 1 the estimate is the measurement.",
        filter_with(lambda r, v, y, T, alpha, beta: (r + (1 - alpha) * (y - r), v + beta / T * (y - r))),
    ),
    (
        "alpha-with-time",
        ALPHA_WITH_TIME,
        filter_with(lambda r, v, y, T, alpha, beta: (r + alpha / T * (y - r), v + beta / T * (y - r))),
    ),
    (
        "alpha-with-time",
        ALPHA_WITH_TIME,
        filter_with(lambda r, v, y, T, alpha, beta: (r + alpha * T * (y - r), v + beta / T * (y - r))),
    ),
    (
        "half-of-beta",
        "The velocity is corrected by half of what it should be.",
        filter_with(lambda r, v, y, T, alpha, beta: (r + alpha * (y - r), v + beta / (2 * T) * (y - r))),
    ),
    (
        "velocity-sign",
        "The velocity is corrected the wrong way.",
        filter_with(lambda r, v, y, T, alpha, beta: (r + alpha * (y - r), v - beta / T * (y - r))),
    ),
    (
        "smoothed-twice",
        "The measurement is mixed in twice.",
        lambda y, T, alpha, beta, r, v: (
            alpha * y + (1 - alpha) * filter_with()(y, T, alpha, beta, r, v)[0],
            filter_with()(y, T, alpha, beta, r, v)[1],
        ),
    ),
    (
        "velocity-by-gradient",
        "The velocity is a difference of the estimated positions; the filter has its own.",
        lambda y, T, alpha, beta, r, v: (
            filter_with()(y, T, alpha, beta, r, v)[0],
            np.gradient(filter_with()(y, T, alpha, beta, r, v)[0], T, axis=0),
        ),
    ),
)


# -- j5, j6: lag and noise


def _lag_of_prediction(*values: sp.Expr) -> tuple[sp.Expr, ...]:
    symbols, _, before = _lag()
    return tuple(substituted(before, symbols)(*values))


WRONG_LAGS: tuple[tuple[str, str, Answer], ...] = (
    ("prediction", "That is the lag of the prediction; the correction takes part of it away.", _lag_of_prediction),
    ("gains-swapped", messages.GAINS_SWAPPED, lambda a, T, alpha, beta: lag(a, T, beta, alpha)),
    (
        "time-missing",
        "The time between measurements is missing: check the units.",
        lambda a, T, alpha, beta: lag(a, 1, alpha, beta),
    ),
    (
        "half-interval",
        "The factor 1/2 of a parabola has no place here: the second difference of a t^2/2 is a T^2.",
        lambda *values: (lag(*values)[0] / 2, lag(*values)[1]),
    ),
    (
        "alpha-for-rest",
        "The share of the error that a correction leaves is 1 - alpha, not alpha.",
        lambda a, T, alpha, beta: (a * T**2 * alpha / beta, lag(a, T, alpha, beta)[1]),
    ),
    (
        "beta-forgotten",
        "The lag depends on beta too: it is what makes the velocity follow.",
        lambda a, T, alpha, beta: (a * T**2 * (1 - alpha), a * T * (alpha - sp.Rational(1, 2))),
    ),
    (
        "beta-not-divided",
        "A gain of the velocity of beta instead of beta/T was used.",
        lambda a, T, alpha, beta: lag(a, T, alpha, beta * T),
    ),
    (
        "position-not-accelerated",
        "Between measurements the acceleration moves the position too, by a T^2/2; that was left out.",
        lambda a, T, alpha, beta: tuple(
            (sp.eye(2) - closed_loop(T, alpha, beta)[0] * closed_loop(T, alpha, beta)[1]).LUsolve(
                closed_loop(T, alpha, beta)[0] * sp.Matrix([0, a * T])
            )
        ),
    ),
    ("time-missing", messages.POWER_OF_T, lambda a, T, alpha, beta: (lag(a, T, alpha, beta)[0] / T, lag(a, T, alpha, beta)[1])),
    ("time-missing", messages.POWER_OF_T, lambda a, T, alpha, beta: (lag(a, T, alpha, beta)[0], lag(a, T, alpha, beta)[1] / T)),
    (
        "half-forgotten",
        "Between measurements the velocity changes as well: half an interval's acceleration is counted otherwise.",
        lambda a, T, alpha, beta: (lag(a, T, alpha, beta)[0], lag(a, T, alpha, beta)[1] - a * T / 2),
    ),
    (
        "lag-over-time",
        "The lag of the velocity is not that of the position over T.",
        lambda a, T, alpha, beta: (lag(a, T, alpha, beta)[0], lag(a, T, alpha, beta)[0] / T),
    ),
)


def _uncorrelated(alpha: float, beta: float) -> float:
    rest, A = (np.array(matrix, dtype=float) for matrix in closed_loop(1, alpha, beta))
    return float(scipy.linalg.solve_discrete_lyapunov(rest @ A, np.diag([alpha**2, beta**2]))[0, 0])


def _gains_not_squared(alpha: float, beta: float) -> float:
    rest, A = (np.array(matrix, dtype=float) for matrix in closed_loop(1, alpha, beta))
    return float(scipy.linalg.solve_discrete_lyapunov(rest @ A, np.diag([alpha, beta]))[0, 0])


LAST_ALONE = "That is the noise of the last measurement alone; the earlier ones are still in the estimate."

WRONG_SHARES: tuple[tuple[str, str, Answer], ...] = (
    (
        "kalman-covariance",
        "alpha is the Kalman filter's own variance, in which the unknown acceleration is contained; ask for the noise alone.",
        lambda alpha, beta: alpha,
    ),
    ("alpha-filter", "That is a filter without velocity; beta lets noise through too.", lambda alpha, beta: alpha / (2 - alpha)),
    (
        "one-step",
        LAST_ALONE,
        lambda alpha, beta: alpha**2,
    ),
    (
        "prediction",
        "That is the variance of the prediction; take it after the correction.",
        lambda alpha, beta: float(_stationary(alpha, beta)[1][0, 0]),
    ),
    (
        "velocity",
        "That is the variance of the velocity (in units of sigma^2/T^2).",
        lambda alpha, beta: float(_stationary(alpha, beta)[0][1, 1]),
    ),
    ("gains-swapped", messages.GAINS_SWAPPED, lambda alpha, beta: noise_left(beta, alpha)),
    (
        "covariance-with-velocity",
        "That is a covariance of position and velocity; the variance of the position is asked for.",
        lambda alpha, beta: float(_stationary(alpha, beta)[0][0, 1]),
    ),
    ("correlation-forgotten", "One and the same noise enters position and velocity: it is correlated.", _uncorrelated),
    (
        "both-variances",
        "The variance of the velocity is added; that of the position is asked for.",
        lambda alpha, beta: float(np.trace(_stationary(alpha, beta)[0])),
    ),
    ("one-step", LAST_ALONE, lambda alpha, beta: alpha**2 + beta**2),
    (
        "corrected-twice",
        "The estimate is corrected a second time.",
        lambda alpha, beta: (1 - alpha) ** 2 * noise_left(alpha, beta) + alpha**2,
    ),
    *(
        ("slip", "The formula is nearly right: a sign or a factor is not. Put it into P = M P M^T + K K^T.", formula)
        for formula in (
            lambda alpha, beta: (2 * alpha**2 + beta * (2 - 3 * alpha)) / (alpha * (4 - alpha - beta)),
            lambda alpha, beta: (2 * alpha**2 + beta * (2 + 3 * alpha)) / (alpha * (4 - 2 * alpha - beta)),
            lambda alpha, beta: (2 * alpha + beta) / (4 - 2 * alpha - beta),
        )
    ),
    ("gains-not-squared", "The gains enter the noise's part squared.", _gains_not_squared),
)
