"""Questions of set j: an alpha-beta filter on a radar track.

What is derived is answered with formulas in the symbols of the arguments, what runs with arrays.  Personal numbers are in
`radar_numbers`; hidden arguments are others, so an answer holds for any.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg
import sympy as sp

from kfcourse.checks.exercises import Exercise
from kfcourse.checks.question import Answer, Question, catalogue
from kfcourse.checks.registry import ExerciseSet
from kfcourse.exercises.shared import personal, substituted
from kfcourse.filters import alphabeta
from kfcourse.filters.alphabeta import steady_beta, tracking_index
from kfcourse.laws import Array
from kfcourse.montecarlo.experiment import run
from kfcourse.scenarios.radar import AZIMUTH, CARTESIAN, ELEVATION, RANGE, SPHERICAL, X, Y, Z, kinematic


def radar_numbers(exercise: Exercise) -> dict[str, float]:
    """T (s), sigma (m), alpha, and the radius of the first circle (m)."""
    return personal(
        exercise,
        "j",
        {"T": 0.8, "sigma": 100.0, "alpha": 0.095, "radius": 6000.0},
        {"T": (0.5, 1.5), "sigma": (50, 150), "alpha": (0.07, 0.25), "radius": (4500, 7500)},
    )


# -- j1, j2: what the radar measures


MEASURED, POSITION = (RANGE, AZIMUTH, ELEVATION), (X, Y, Z)
_cartesian = substituted(CARTESIAN, MEASURED)


def cartesian(r: Any, phi: Any, eps: Any) -> tuple:
    return tuple(_cartesian(r, phi, eps))


WRONG_CARTESIANS: tuple[tuple[str, str, Answer], ...] = (
    (
        "azimuth-from-y",
        "The azimuth is counted from the y axis; here it goes from x towards y.",
        lambda r, phi, eps: cartesian(r, sp.pi / 2 - phi, eps),
    ),
    (
        "azimuth-sense",
        "The azimuth turns the other way: it grows from x towards y.",
        lambda r, phi, eps: cartesian(r, -phi, eps),
    ),
    (
        "from-the-zenith",
        "The elevation is counted from the vertical; here it is the angle above the horizon.",
        lambda r, phi, eps: cartesian(r, phi, sp.pi / 2 - eps),
    ),
    (
        "slant-range",
        "The range is taken along the ground; it goes to the aircraft, and only its projection lies on the ground.",
        lambda r, phi, eps: (r * sp.cos(phi), r * sp.sin(phi), r * sp.sin(eps)),
    ),
    (
        "height-by-tangent",
        "The height is found as if the range were the distance along the ground.",
        lambda r, phi, eps: (*cartesian(r, phi, eps)[:2], r * sp.tan(eps)),
    ),
    (
        "degrees",
        "The angles are turned from degrees into radians; they are in radians already.",
        lambda r, phi, eps: cartesian(r, phi * sp.pi / 180, eps * sp.pi / 180),
    ),
)


def jacobian_of(formulas: Any) -> Answer:
    return substituted(sp.Matrix(formulas).jacobian(POSITION), POSITION)


SLANT, GROUND = sp.sqrt(X**2 + Y**2 + Z**2), sp.sqrt(X**2 + Y**2)


def meter_jacobian(x: Any, y: Any, z: Any) -> sp.ImmutableMatrix:
    return jacobian_of(SPHERICAL)(x, y, z)


WRONG_JACOBIANS: tuple[tuple[str, str, Answer], ...] = (
    (
        "transposed",
        "It looks transposed: row i holds the derivatives of measurement i.",
        lambda x, y, z: meter_jacobian(x, y, z).T,
    ),
    (
        "inverse",
        "These are the derivatives of the position by range and angles; the meter goes the other way.",
        substituted(CARTESIAN.jacobian(MEASURED).subs(dict(zip(MEASURED, SPHERICAL, strict=True)), simultaneous=True), POSITION),
    ),
    (
        "azimuth-from-y",
        "The azimuth is counted from the y axis; here it goes from x towards y.",
        jacobian_of([SPHERICAL[0], sp.atan2(X, Y), SPHERICAL[2]]),
    ),
    (
        "tangent-for-angle",
        "The tangents of the angles are differentiated, not the angles.",
        jacobian_of([SPHERICAL[0], Y / X, Z / GROUND]),
    ),
    (
        "sine-for-angle",
        "The sine of the elevation is differentiated, not the angle.",
        jacobian_of([*SPHERICAL[:2], Z / SLANT]),
    ),
    (
        "ground-fixed",
        "In the elevation the distance along the ground depends on x and y too.",
        substituted(
            sp.Matrix([SPHERICAL[0], SPHERICAL[1], 0]).jacobian(POSITION)
            + sp.Matrix([[0] * 3, [0] * 3, [0, 0, GROUND / SLANT**2]]),
            POSITION,
        ),
    ),
    (
        "range-for-ground",
        "In the azimuth the distance is that along the ground: the height does not turn it.",
        substituted(
            sp.Matrix([SPHERICAL[0], 0, SPHERICAL[2]]).jacobian(POSITION)
            + sp.Matrix([[0] * 3, [-Y / SLANT**2, X / SLANT**2, 0], [0] * 3]),
            POSITION,
        ),
    ),
    (
        "ground-range",
        "The first measurement is the range to the aircraft, not the distance along the ground.",
        jacobian_of([GROUND, *SPHERICAL[1:]]),
    ),
)


# -- j3: the constant gain


def steady_gain(alpha: float) -> tuple[float, float]:
    return steady_beta(alpha), tracking_index(alpha)


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
    (
        "small-alpha",
        "That holds for small alpha only.",
        lambda alpha: (alpha**2 / 2, alpha**2 / 2 / np.sqrt(1 - alpha)),
    ),
    (
        "white-in-continuous-time",
        "That is for an acceleration that is white noise in continuous time; here it is constant over an interval.",
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
)

# -- j4: the filter


@lru_cache(maxsize=8)
def _model(T: float, position: tuple[float, ...], velocity: tuple[float, ...]) -> Any:
    prior = {"mean": np.array(position + velocity), "variance": np.ones(2 * len(position))}
    return kinematic(T, dimensions=len(position), prior=prior)


def alpha_beta(y: Array, T: float, alpha: float, beta: float, r: Array, v: Array) -> tuple[Array, Array]:
    laws = run(alphabeta.alpha_beta(_model(T, tuple(r), tuple(v)), alpha, beta, start="prior"), y)
    return laws.mean[..., : len(r)], laws.mean[..., len(r) :]


Beat = Callable[..., tuple[Array, Array]]


def filter_with(
    beat: Beat | None = None,
    forward: Beat = lambda r, v, T: (r + T * v, v),
    swapped: bool = False,
    predictions: bool = False,
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


def filter_arguments(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("j4")
    T, alpha, beta = rng.uniform(1.3, 2.2), rng.uniform(0.3, 0.6), rng.uniform(0.1, 0.25)
    r, v = 10 * rng.normal(size=3), rng.normal(size=3)
    time = T * np.arange(7)[:, None, None]
    y = r + v * time + 0.3 * time**2 + 2 * rng.normal(size=(7, 4, 3))
    return [(y, T, alpha, beta, r, v)]


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
        "The innovation has the wrong sign: it is what came minus what was expected.",
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
    (
        "predictions-returned",
        "These are the predictions, before each measurement; return the estimates, after it.",
        filter_with(predictions=True),
    ),
    (
        "velocity-kept",
        "The velocity is never corrected.",
        filter_with(lambda r, v, y, T, alpha, beta: (r + alpha * (y - r), v)),
    ),
)

# -- j5, j6: lag and noise


def closed_loop(T: Any, alpha: Any, beta: Any) -> tuple[sp.Matrix, sp.Matrix]:
    """(I - K H) and A on an axis."""
    return sp.eye(2) - sp.Matrix([alpha, beta / T]) * sp.Matrix([[1, 0]]), sp.Matrix([[1, T], [0, 1]])


@lru_cache(maxsize=1)
def _lag() -> tuple[tuple[sp.Symbol, ...], sp.Matrix, sp.Matrix]:
    """Lags of position and velocity, after and before a correction: fixed points of the error without noise.

    e <- (I - K H)(A e + (T^2/2, T) a), e the truth less the estimate.
    """
    a, T, alpha, beta = symbols = sp.symbols("a T alpha beta", positive=True)
    rest, A = closed_loop(T, alpha, beta)
    push = a * sp.Matrix([T**2 / 2, T])
    after = sp.simplify((sp.eye(2) - rest * A).LUsolve(rest * push))
    return symbols, after, sp.simplify(A * after + push)


def lag(a: Any, T: Any, alpha: Any, beta: Any) -> tuple:
    symbols, after, _ = _lag()
    return tuple(substituted(after, symbols)(a, T, alpha, beta))


def _lag_of_prediction(*values: Any) -> tuple:
    symbols, _, before = _lag()
    return tuple(substituted(before, symbols)(*values))


WRONG_LAGS: tuple[tuple[str, str, Answer], ...] = (
    (
        "prediction",
        "That is the lag of the prediction; the correction takes part of it away.",
        _lag_of_prediction,
    ),
    (
        "gains-swapped",
        "alpha and beta are swapped.",
        lambda a, T, alpha, beta: lag(a, T, beta, alpha),
    ),
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
)


def _stationary(alpha: float, beta: float) -> tuple[Array, Array]:
    """Covariances of estimate and prediction, noise of the measurements alone, in units of sigma and T."""
    rest, A = (np.array(matrix, dtype=float) for matrix in closed_loop(1, alpha, beta))
    K = np.array([[alpha], [beta]])
    after = scipy.linalg.solve_discrete_lyapunov(rest @ A, K @ K.T)
    return after, A @ after @ A.T


def noise_left(alpha: float, beta: float) -> float:
    return float(_stationary(alpha, beta)[0][0, 0])


WRONG_SHARES: tuple[tuple[str, str, Answer], ...] = (
    (
        "kalman-covariance",
        "alpha is the Kalman filter's own variance, in which the unknown acceleration is contained; ask for the noise alone.",
        lambda alpha, beta: alpha,
    ),
    (
        "alpha-filter",
        "That is a filter without velocity; beta lets noise through too.",
        lambda alpha, beta: alpha / (2 - alpha),
    ),
    (
        "one-step",
        "That is the noise of the last measurement alone; the earlier ones are still in the estimate.",
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
    (
        "gains-swapped",
        "alpha and beta are swapped.",
        lambda alpha, beta: noise_left(beta, alpha),
    ),
)


def several(name: str, limits: tuple[tuple[float, float], ...]) -> Callable[[Any], list[tuple]]:
    """Three sets of hidden numbers."""

    def arguments(exercise: Exercise) -> list[tuple]:
        rng = exercise.rng(name)
        return [tuple(float(rng.uniform(*one)) for one in limits) for _ in range(3)]

    return arguments


def share_arguments(exercise: Exercise) -> list[tuple]:
    """Gains that are not those of a stationary Kalman filter: any stable pair is asked for."""
    numbers = several("j6", ((0.1, 0.6), (0.6, 1.6)))(exercise)
    return [(alpha, factor * steady_beta(alpha)) for alpha, factor in numbers]


QUESTIONS = (
    Question(
        "j1",
        "what the radar measures",
        "warm-up",
        cartesian,
        lambda e: [sp.symbols("r phi eps", positive=True)],
        catalogue(WRONG_CARTESIANS),
        ("x", "y", "z"),
    ),
    Question(
        "j2",
        "the meter's derivatives",
        "core",
        meter_jacobian,
        lambda e: [sp.symbols("x y z", positive=True)],
        catalogue(WRONG_JACOBIANS),
    ),
    Question(
        "j3",
        "the constant gain",
        "core",
        steady_gain,
        several("j3", ((0.15, 0.7),)),
        catalogue(WRONG_GAINS),
        ("beta", "index"),
    ),
    Question("j4", "the filter", "core", alpha_beta, filter_arguments, catalogue(WRONG_FILTERS), ("r", "v")),
    Question(
        "j5",
        "the lag in a turn",
        "core",
        lag,
        lambda e: [sp.symbols("a T alpha beta", positive=True)],
        catalogue(WRONG_LAGS),
        ("position", "velocity"),
    ),
    Question("j6", "the noise that is left", "stretch", noise_left, share_arguments, catalogue(WRONG_SHARES)),
)

SET = ExerciseSet("j", "Alpha-beta filter and radar track", Path(__file__).parent, QUESTIONS, radar_numbers, about_variant=False)
