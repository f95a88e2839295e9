"""Known mistakes in the filter: Riccati equation (h3), steady state (h4), a step (h5), derivatives of the likelihood (h6)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import sympy as sp

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.h_continuous.keys import Rate, rate_with, step_with

FACTOR_WRONG_WAY = "The factor between a one-sided density and an intensity goes the other way."
GAIN_NOT_DIVIDED = "The gain is not divided by the intensity of the meter's noise."
NOISE_INVERTED = "The intensity of the meter's noise is upside down."

# -- h3: the Riccati equation

WRONG_RATES: tuple[tuple[str, str, Rate], ...] = (
    (
        "one-side-only",
        "Both factors of M[e e^T] change with the drift; a term is missing, and the result is not symmetric.",
        rate_with(motion=lambda A, D: A @ D),
    ),
    ("transposed", "The matrix of the drift is transposed.", rate_with(motion=lambda A, D: A.T @ D + D @ A)),
    (
        "discrete",
        "That is the term of a discrete filter; in continuous time the covariance has a rate, and A enters it once.",
        rate_with(motion=lambda A, D: A @ D @ A.T),
    ),
    ("process-one-sided", messages.PROCESS_ONE_SIDED, rate_with(shaken=lambda G, S_xi: G @ S_xi @ G.T)),
    ("meter-one-sided", messages.METER_ONE_SIDED, rate_with(learnt=lambda D, H, N: D @ H.T @ np.linalg.solve(N, H @ D))),
    (
        "densities-for-intensities",
        messages.DENSITIES_FOR_INTENSITIES,
        rate_with(shaken=lambda G, S_xi: G @ S_xi @ G.T, learnt=lambda D, H, N: D @ H.T @ np.linalg.solve(N, H @ D)),
    ),
    ("riccati-sign", messages.RICCATI_SIGN, rate_with(learnt=lambda D, H, N: -D @ H.T @ np.linalg.solve(N / 2, H @ D))),
    (
        "noise-not-inverted",
        "The density of the meter's noise multiplies; the noisier the meter, the less is learnt: its inverse belongs there.",
        rate_with(learnt=lambda D, H, N: D @ H.T @ (N / 2) @ H @ D),
    ),
    (
        "covariance-once",
        "D enters the last term only once; the term is quadratic in it.",
        rate_with(learnt=lambda D, H, N: D @ H.T @ np.linalg.solve(N / 2, H)),
    ),
    (
        "noise-power",
        "The factor of the noise enters with the wrong power: an intensity goes with it on both sides.",
        rate_with(shaken=lambda G, S_xi: G @ S_xi / 2),
    ),
    ("noise-forgotten", messages.PROCESS_NOISE_FORGOTTEN, rate_with(shaken=lambda G, S_xi: 0 * G)),
    (
        "measurement-forgotten",
        "Nothing is learnt from the measurement: a term is missing.",
        rate_with(learnt=lambda D, H, N: 0 * D),
    ),
    ("noise-sign", messages.NOISE_SIGN, rate_with(shaken=lambda G, S_xi: -G @ S_xi @ G.T / 2)),
    ("noise-squared", "The intensity of the noise enters squared.", rate_with(shaken=lambda G, S_xi: G @ S_xi @ S_xi @ G.T / 4)),
    ("factor-wrong-way", FACTOR_WRONG_WAY, rate_with(learnt=lambda D, H, N: D @ H.T @ np.linalg.solve(2 * N, H @ D))),
    (
        "discrete-gain",
        messages.DISCRETE_GAIN,
        rate_with(learnt=lambda D, H, N: D @ H.T @ np.linalg.solve(H @ D @ H.T + N / 2, H @ D)),
    ),
)


# -- h4: the steady state of dx/dt = -a x + s xi, y = h x + n


def steady_with(
    drift: Callable[[float], float] = lambda a: a,
    q: Callable[[float, float], float] = lambda s, S_xi: s**2 * S_xi / 2,
    c: Callable[[float, float], float] = lambda h, N: 2 * h**2 / N,
    root: float = 1.0,
    gain: Callable[[float, float, float], float] = lambda D, h, N: 2 * D * h / N,
) -> Answer:
    """The root of -2 a D + q - c D^2 = 0 and the gain, with one thing changed."""

    def answer(a: float, s: float, h: float, S_xi: float, N: float) -> tuple[float, float]:
        alpha, curvature = drift(a), c(h, N)
        D = (root * np.sqrt(alpha**2 + curvature * q(s, S_xi)) - alpha) / curvature
        return D, gain(D, h, N)

    return answer


def _root_forgotten(a: float, s: float, h: float, S_xi: float, N: float) -> tuple[float, float]:
    c = 2 * h**2 / N
    D = (a**2 + c * s**2 * S_xi / 2 - a) / c
    return D, 2 * D * h / N


def _twice_the_root(a: float, s: float, h: float, S_xi: float, N: float) -> tuple[float, float]:
    """Divided by the coefficient of the square, not by twice that; the gain follows."""
    D, K = steady_with()(a, s, h, S_xi, N)
    return 2 * D, 2 * K


QUADRATIC_FORMULA = "A factor of the quadratic formula is wrong: write a, b, c of it down."

WRONG_STEADY: tuple[tuple[str, str, Answer], ...] = (
    ("negative-root", messages.NEGATIVE_ROOT, steady_with(root=-1.0)),
    ("process-one-sided", messages.PROCESS_ONE_SIDED, steady_with(q=lambda s, S_xi: s**2 * S_xi)),
    ("meter-one-sided", messages.METER_ONE_SIDED, steady_with(c=lambda h, N: h**2 / N, gain=lambda D, h, N: D * h / N)),
    (
        "densities-for-intensities",
        messages.DENSITIES_FOR_INTENSITIES,
        steady_with(q=lambda s, S_xi: s**2 * S_xi, c=lambda h, N: h**2 / N, gain=lambda D, h, N: D * h / N),
    ),
    ("drift-sign", "The sign of the drift: this process decays by itself.", steady_with(drift=lambda a: -a)),
    (
        "one-side-only",
        "The drift enters the equation of the variance on both sides; one of them is missing.",
        steady_with(drift=lambda a: a / 2),
    ),
    ("drift-forgotten", "The drift is missing: that is the answer for a random walk.", steady_with(drift=lambda a: 0.0)),
    (
        "without-measurement",
        "That is the variance of the process itself, without any measurement.",
        lambda a, s, h, S_xi, N: (s**2 * S_xi / (4 * a), s**2 * S_xi / (4 * a) * 2 * h / N),
    ),
    ("noise-power", messages.NOISE_POWER, steady_with(q=lambda s, S_xi: s * S_xi / 2)),
    ("slope-power", messages.SLOPE_POWER, steady_with(c=lambda h, N: 2 * h / N)),
    ("gain-one-sided", messages.GAIN_ONE_SIDED, steady_with(gain=lambda D, h, N: D * h / N)),
    ("gain-without-slope", messages.GAIN_WITHOUT_SLOPE, steady_with(gain=lambda D, h, N: 2 * D / N)),
    (
        "gain-discrete",
        messages.DISCRETE_GAIN,
        steady_with(gain=lambda D, h, N: D * h / (h**2 * D + N / 2)),
    ),
    ("gain-not-divided", GAIN_NOT_DIVIDED, steady_with(gain=lambda D, h, N: D * h)),
    ("gain-not-divided", GAIN_NOT_DIVIDED, steady_with(gain=lambda D, h, N: D * h * N / 2)),
    ("gain-with-slope-squared", "The slope enters the gain once.", steady_with(gain=lambda D, h, N: 2 * D * h**2 / N)),
    (
        "noise-inverted",
        NOISE_INVERTED,
        steady_with(c=lambda h, N: h**2 * N / 2, gain=lambda D, h, N: D * h * N / 2),
    ),
    ("root-forgotten", "A square root is missing in the solution of the quadratic equation.", _root_forgotten),
    (
        "not-divided",
        "The root is not divided by the coefficient of the square.",
        lambda a, s, h, S_xi, N: (2 * h**2 / N * steady_with()(a, s, h, S_xi, N)[0], steady_with()(a, s, h, S_xi, N)[1]),
    ),
    ("quadratic-formula", QUADRATIC_FORMULA, _twice_the_root),
    (
        "quadratic-formula",
        QUADRATIC_FORMULA,
        lambda a, s, h, S_xi, N: (
            (np.sqrt(4 * a**2 + h**2 * s**2 * S_xi / N) - 2 * a) / (4 * h**2 / N),
            steady_with()(a, s, h, S_xi, N)[1],
        ),
    ),
)


# -- h5: a step of the filter

WRONG_STEPS: tuple[tuple[str, str, Answer], ...] = (
    (
        "step-forgotten",
        "The equations give rates; over a step z and D change by them times the step.",
        step_with(times=lambda T: 1.0),
    ),
    ("signal-for-derivative", messages.SIGNAL_FOR_DERIVATIVE, step_with(slope=lambda S, S_x: S)),
    ("gain-one-sided", messages.GAIN_ONE_SIDED, step_with(gain=lambda D, S_x, N: D * S_x / N)),
    (
        "meter-one-sided",
        messages.METER_ONE_SIDED,
        step_with(gain=lambda D, S_x, N: D * S_x / N, learnt=lambda D, S_x, N: D**2 * S_x**2 / N),
    ),
    ("meter-one-sided", messages.METER_ONE_SIDED, step_with(learnt=lambda D, S_x, N: D**2 * S_x**2 / N)),
    ("process-one-sided", messages.PROCESS_ONE_SIDED, step_with(shaken=lambda g, S_xi: g**2 * S_xi)),
    ("innovation-sign", messages.INNOVATION_SIGN, step_with(sign=-1.0)),
    ("innovation-without-signal", messages.MEASUREMENT_FOR_INNOVATION, step_with(expected=lambda S, S_x, z: 0.0 * z)),
    (
        "expected-by-slope",
        "The estimate is multiplied by the slope; what is expected of y is the signal itself at the estimate.",
        step_with(expected=lambda S, S_x, z: S_x * z),
    ),
    ("gain-without-slope", messages.GAIN_WITHOUT_SLOPE, step_with(gain=lambda D, S_x, N: D * 2 / N)),
    ("drift-forgotten", "The drift is missing: the estimate moves by itself, too.", step_with(drift=lambda f, f_x, z: 0 * f)),
    (
        "drift-linear",
        "The estimate is multiplied by the slope of the drift; the drift itself at the estimate belongs there.",
        step_with(drift=lambda f, f_x, z: f_x * z),
    ),
    (
        "one-side-only",
        "The slope of the drift acts on both factors of the variance; one of the two equal terms is missing.",
        step_with(motion=lambda f_x, D: f_x * D),
    ),
    ("noise-forgotten", messages.PROCESS_NOISE_FORGOTTEN, step_with(shaken=lambda g, S_xi: 0 * g)),
    ("noise-power", messages.NOISE_POWER, step_with(shaken=lambda g, S_xi: g * S_xi / 2)),
    ("riccati-sign", messages.RICCATI_SIGN, step_with(learnt=lambda D, S_x, N: -(D**2) * S_x**2 * 2 / N)),
    ("slope-power", messages.SLOPE_POWER, step_with(learnt=lambda D, S_x, N: D**2 * S_x * 2 / N)),
    ("variance-once", "The last term is quadratic in the variance.", step_with(learnt=lambda D, S_x, N: D * S_x**2 * 2 / N)),
    (
        "z-first",
        "The rate of the variance is taken at the new estimate; both rates belong to the beginning of the step.",
        step_with(order="z-first"),
    ),
    (
        "D-first",
        "The gain is made of the new variance; both rates belong to the beginning of the step.",
        step_with(order="D-first"),
    ),
    (
        "noise-inverted",
        NOISE_INVERTED,
        step_with(gain=lambda D, S_x, N: D * S_x * N / 2, learnt=lambda D, S_x, N: D**2 * S_x**2 * N / 2),
    ),
)


# -- h6: derivatives of the log-likelihood


def derivatives_with(change: Callable[[sp.Expr, sp.Expr, sp.Expr, sp.Expr, sp.Expr], tuple[sp.Expr, sp.Expr]]) -> Answer:
    """u and U from S, S', S'', y and 2/N."""
    return lambda S, x, y, N: change(S, S.diff(x), S.diff(x, 2), y, 2 / N)


WRONG_DERIVATIVES: tuple[tuple[str, str, Answer], ...] = (
    (
        "curvature-dropped",
        "The second derivative of the signal is missing: the usual filter drops that part, here it is asked for.",
        derivatives_with(lambda S, S1, S2, y, k: (k * S1 * (y - S), -k * S1**2)),
    ),
    (
        "curvature-sign",
        "The sign of the part with the second derivative of the signal.",
        derivatives_with(lambda S, S1, S2, y, k: (k * S1 * (y - S), -k * S1**2 - k * S2 * (y - S))),
    ),
    (
        "slope-dropped",
        "The innovation depends on x as well: differentiate the product.",
        derivatives_with(lambda S, S1, S2, y, k: (k * S1 * (y - S), k * S2 * (y - S))),
    ),
    (
        "slope-sign",
        "The sign of the part without noise: at the top of the likelihood the second derivative is negative.",
        derivatives_with(lambda S, S1, S2, y, k: (k * S1 * (y - S), k * S1**2 + k * S2 * (y - S))),
    ),
    (
        "slope-power",
        "The slope of the signal enters the part without noise squared.",
        derivatives_with(lambda S, S1, S2, y, k: (k * S1 * (y - S), -k * S1 + k * S2 * (y - S))),
    ),
    (
        "one-sided",
        "Divided by the one-sided density; the intensity belongs there.",
        derivatives_with(lambda S, S1, S2, y, k: (k / 2 * S1 * (y - S), -k / 2 * S1**2 + k / 2 * S2 * (y - S))),
    ),
    (
        "half-forgotten",
        "In the logarithm of the likelihood half of the signal is subtracted from y; the derivative has the whole then.",
        derivatives_with(lambda S, S1, S2, y, k: (k * S1 * (y - 2 * S), k * S2 * (y - 2 * S) - 2 * k * S1**2)),
    ),
    (
        "signal-for-derivative",
        messages.SIGNAL_FOR_DERIVATIVE,
        derivatives_with(lambda S, S1, S2, y, k: (k * S * (y - S), -k * S**2 + k * S1 * (y - S))),
    ),
    (
        "gain-without-slope",
        "The slope of the signal is missing: the chain rule.",
        derivatives_with(lambda S, S1, S2, y, k: (k * (y - S), -k * S1)),
    ),
    (
        "noise-inverted",
        NOISE_INVERTED,
        derivatives_with(lambda S, S1, S2, y, k: (S1 * (y - S) / k, (S2 * (y - S) - S1**2) / k)),
    ),
    (
        "half-kept",
        "The half before the square of the signal goes when it is differentiated.",
        derivatives_with(lambda S, S1, S2, y, k: (k * S1 * (y - S / 2), k * S2 * (y - S / 2) - k * S1**2 / 2)),
    ),
    (
        "signal-not-subtracted",
        "The square of the signal is differentiated too.",
        derivatives_with(lambda S, S1, S2, y, k: (k * S1 * y, k * S2 * y)),
    ),
)
