"""Known mistakes in what is said of accuracy: steady state (k2), gain (k4), lost receiver (k5), biased receiver (k6)."""

from __future__ import annotations

from collections.abc import Callable

import sympy as sp

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.k_integration.keys import gained, lost, steady_state
from kfcourse.exercises.k_integration.mistakes_of_filter import GAIN_BY_NOISE

# -- k2, k4: the steady state


def steady_from(Psi: Callable[[sp.Expr, sp.Expr], sp.Expr]) -> Answer:
    """(Psi, p, K) made of another Psi."""

    def answer(sigma_xi: sp.Expr, sigma_n: sp.Expr) -> tuple[sp.Expr, ...]:
        found = Psi(sigma_xi, sigma_n)
        return found, found - sigma_xi**2, -found / (found + sigma_n**2)

    return answer


def steady_with(change: Callable[..., tuple]) -> Answer:
    """change(Psi, p, K, sigma_xi, sigma_n) of the right ones."""
    return lambda sigma_xi, sigma_n: change(*steady_state(sigma_xi, sigma_n), sigma_xi, sigma_n)


DEVIATIONS = "Standard deviations stand where variances belong: check the units."
TIME = "The time constant is another function of what is left of an error after a step."

WRONG_STEADY: tuple[tuple[str, str, Answer], ...] = (
    ("minus-root", messages.NEGATIVE_ROOT, steady_from(lambda xi, n: (xi**2 - sp.sqrt(xi**4 + 4 * xi**2 * n**2)) / 2)),
    (
        "variances-swapped",
        "The variances before and after the correction are swapped: which of the two must be larger?",
        steady_with(lambda Psi, p, K, xi, n: (p, Psi, K)),
    ),
    (
        "deviation-for-variance",
        DEVIATIONS,
        steady_from(lambda xi, n: (xi + sp.sqrt(xi**2 + 4 * xi * n)) / 2),
    ),
    (
        "root-of-one-term",
        "The root goes over the sum, not over one of its terms.",
        steady_from(lambda xi, n: (xi**2 + sp.sqrt(xi**4) + 4 * xi**2 * n**2) / 2),
    ),
    (
        "four-forgotten",
        "A factor is missing under the root: write down the discriminant again.",
        steady_from(lambda xi, n: (xi**2 + sp.sqrt(xi**4 + xi**2 * n**2)) / 2),
    ),
    (
        "half-forgotten",
        "A factor is missing in front: the root of a quadratic equation is divided by twice its first coefficient.",
        steady_from(lambda xi, n: xi**2 + sp.sqrt(xi**4 + 4 * xi**2 * n**2)),
    ),
    ("small-drift", messages.SMALL_DRIFT, steady_with(lambda Psi, p, K, xi, n: (xi * n, xi * n, -xi / (xi + n)))),
    (
        "gain-sign",
        "The gain has the wrong sign: what is the derivative of the signal function by the error?",
        steady_with(lambda Psi, p, K, xi, n: (Psi, p, -K)),
    ),
    (
        "gain-of-estimate",
        "The gain is made of the variance after the correction; at the measurement the filter is as sure as Psi says.",
        steady_with(lambda Psi, p, K, xi, n: (Psi, p, -p / (p + n**2))),
    ),
    (
        "gain-by-noise-alone",
        GAIN_BY_NOISE,
        steady_with(lambda Psi, p, K, xi, n: (Psi, p, -Psi / n**2)),
    ),
    (
        "deviation-for-variance",
        DEVIATIONS,
        lambda xi, n: (
            (xi**2 + sp.sqrt(xi**4 + 4 * xi**2 * n)) / 2,
            (sp.sqrt(xi**4 + 4 * xi**2 * n) - xi**2) / 2,
            -(xi**2 + sp.sqrt(xi**4 + 4 * xi**2 * n)) / (xi**2 + sp.sqrt(xi**4 + 4 * xi**2 * n) + 2 * n),
        ),
    ),
    ("deviation-for-variance", DEVIATIONS, steady_with(lambda Psi, p, K, xi, n: (Psi, p, -Psi / (Psi + n)))),
    (
        "noise-for-prediction",
        "The gain has the receiver's noise above; the uncertainty of the prediction belongs there.",
        steady_with(lambda Psi, p, K, xi, n: (Psi, p, -(n**2) / (Psi + n**2))),
    ),
    (
        "drift-added",
        "The drift makes Psi larger than p, not the other way round.",
        steady_with(lambda Psi, p, K, xi, n: (Psi, Psi + xi**2, K)),
    ),
    (
        "share-sign",
        "The share that a correction leaves is less than one, and K is negative: check a sign.",
        steady_with(lambda Psi, p, K, xi, n: (Psi, (1 - K) * Psi, K)),
    ),
    (
        "root-forgotten",
        "The square root of the discriminant is missing.",
        steady_from(lambda xi, n: (xi**2 + xi**4 + 4 * xi**2 * n**2) / 2),
    ),
)


def improvement_with(factor: Callable | None = None, time: Callable | None = None) -> Answer:
    """The right factor and time constant, with one of them changed."""

    def answer(sigma_xi: sp.Expr, sigma_n: sp.Expr, T: sp.Expr) -> tuple[sp.Expr, ...]:
        right = gained(sigma_xi, sigma_n, T)
        Psi, p, K = steady_state(sigma_xi, sigma_n)
        return (right[0] if factor is None else factor(Psi, p, sigma_xi, sigma_n), right[1] if time is None else time(K, T))

    return answer


WRONG_IMPROVEMENTS: tuple[tuple[str, str, Answer], ...] = (
    (
        "variance-ratio",
        "That is a ratio of variances; errors are compared by their standard deviations.",
        improvement_with(lambda Psi, p, xi, n: n**2 / p),
    ),
    (
        "variance-for-deviation",
        "A standard deviation is divided by a variance: check the units.",
        improvement_with(lambda Psi, p, xi, n: n / p),
    ),
    ("upside-down", "It is upside down: the factor is larger than 1.", improvement_with(lambda Psi, p, xi, n: sp.sqrt(p) / n)),
    (
        "prediction",
        "That compares with the prediction's error; the integrated velocity has that of the estimate.",
        improvement_with(lambda Psi, p, xi, n: n / sp.sqrt(Psi)),
    ),
    ("small-drift", messages.SMALL_DRIFT, improvement_with(lambda Psi, p, xi, n: sp.sqrt(n / xi))),
    (
        "compared-with-drift",
        "It is compared with the drift of one period; compare it with the receiver alone.",
        improvement_with(lambda Psi, p, xi, n: xi / sp.sqrt(p)),
    ),
    ("gain-sign", messages.LEFT_AFTER_A_STEP, improvement_with(time=lambda K, T: T / sp.log(1 - K))),
    (
        "first-order",
        "That is the leading term for a small gain; take the logarithm of what is left after a step.",
        improvement_with(time=lambda K, T: -T / K),
    ),
    (
        "in-steps",
        "The time constant is in steps; in seconds it is T times longer.",
        improvement_with(time=lambda K, T: -1 / sp.log(1 + K)),
    ),
    (
        "rate-for-time",
        "That is a rate of decay; the time constant is its inverse.",
        improvement_with(time=lambda K, T: -sp.log(1 + K) / T),
    ),
    (
        "half-life",
        "That is the time after which a half is left; a time constant is that to one e-th.",
        improvement_with(time=lambda K, T: -T * sp.log(2) / sp.log(1 + K)),
    ),
    (
        "deviation-for-variance",
        "The root is taken of a standard deviation: check the units.",
        improvement_with(lambda Psi, p, xi, n: sp.sqrt(n) / sp.sqrt(p)),
    ),
    (
        "difference",
        "That is a difference; how many times surer is a ratio.",
        improvement_with(lambda Psi, p, xi, n: n - sp.sqrt(p)),
    ),
    *(
        ("other-time-constant", TIME, improvement_with(time=wrong))
        for wrong in (
            lambda K, T: -T / sp.log(-K),
            lambda K, T: T / K,
            lambda K, T: -T * sp.log(1 + K),
            lambda K, T: -T / sp.log(1 - K),
        )
    ),
    (
        "decimal-logarithm",
        messages.DECIMAL_LOGARITHM,
        improvement_with(time=lambda K, T: -T * sp.log(10) / sp.log(1 + K)),
    ),
    ("time-constant", TIME, improvement_with(time=lambda K, T: T * (1 + K))),
    ("time-constant", TIME, improvement_with(time=lambda K, T: T / (1 + K))),
    ("small-drift", messages.SMALL_DRIFT, lambda sigma_xi, sigma_n, T: (gained(sigma_xi, sigma_n, T)[0], T * sigma_n / sigma_xi)),
)


# -- k5: the receiver drops out; k6: the receiver is biased


def growth_with(sd: Callable | None = None, until: Callable | None = None) -> Answer:
    """The right deviation and time, with one of them changed."""

    def answer(p: sp.Expr, sigma_xi: sp.Expr, sigma_n: sp.Expr, n: sp.Expr, T: sp.Expr) -> tuple[sp.Expr, ...]:
        right = lost(p, sigma_xi, sigma_n, n, T)
        return (
            right[0] if sd is None else sd(p, sigma_xi, sigma_n, n),
            right[1] if until is None else until(p, sigma_xi, sigma_n, T),
        )

    return answer


SQUARED = "sigma_xi has to be squared: check the units."

WRONG_GROWTHS: tuple[tuple[str, str, Answer], ...] = (
    (
        "drifts-in-line",
        "The drifts of the periods are added as if all went the same way; they are independent.",
        growth_with(lambda p, xi, s, n: sp.sqrt(p + n**2 * xi**2)),
    ),
    (
        "deviations-added",
        "Standard deviations are added; of independent errors the variances add.",
        growth_with(lambda p, xi, s, n: sp.sqrt(p) + sp.sqrt(n) * xi, lambda p, xi, s, T: T * (s - sp.sqrt(p)) ** 2 / xi**2),
    ),
    (
        "grows-as-n",
        "The standard deviation of a Wiener process grows with the root of the time, not with the time.",
        growth_with(lambda p, xi, s, n: sp.sqrt(p) + n * xi, lambda p, xi, s, T: T * (s - sp.sqrt(p)) / xi),
    ),
    (
        "variance-for-deviation",
        "That is a variance; the standard deviation is asked for.",
        growth_with(lambda p, xi, s, n: p + n * xi**2),
    ),
    (
        "start-forgotten",
        "The error at the beginning of the gap is forgotten: the filter did not know the INS exactly.",
        growth_with(lambda p, xi, s, n: sp.sqrt(n) * xi, lambda p, xi, s, T: T * s**2 / xi**2),
    ),
    (
        "deviation-for-variance",
        SQUARED,
        growth_with(lambda p, xi, s, n: sp.sqrt(p + n * xi), lambda p, xi, s, T: T * (s - p) / xi),
    ),
    (
        "receiver-added",
        "The receiver's noise is added; while it is lost it does nothing.",
        growth_with(lambda p, xi, s, n: sp.sqrt(p + n * xi**2 + s**2)),
    ),
    (
        "in-periods",
        "That is a number of periods; the time is asked for in seconds.",
        growth_with(until=lambda p, xi, s, T: (s**2 - p) / xi**2),
    ),
    (
        "start-added",
        "The variance at the beginning is added; part of the way is gone already when the gap begins.",
        growth_with(until=lambda p, xi, s, T: T * (s**2 + p) / xi**2),
    ),
    (
        "variance-squared",
        "p is a variance already; it seems to enter squared.",
        growth_with(lambda p, xi, s, n: sp.sqrt(p**2 + n * xi**2)),
    ),
    (
        "one-period-more",
        "One period too many is counted.",
        growth_with(lambda p, xi, s, n: sp.sqrt(p + (n + 1) * xi**2)),
    ),
    (
        "deviation-for-variance",
        SQUARED,
        growth_with(until=lambda p, xi, s, T: T * (s**2 - p) / xi),
    ),
    (
        "divided-by-period",
        "The number of periods is divided by T; a time is the number times T.",
        growth_with(until=lambda p, xi, s, T: (s**2 - p) / (T * xi**2)),
    ),
    (
        "product",
        "Variance and growth are multiplied; independent variances add.",
        growth_with(sd=lambda p, sigma_xi, sigma_n, n, T: sp.sqrt(p * n * sigma_xi**2)),
    ),
)

IN_LINE = "Each step passes on a share of what has not passed yet, not of the whole bias."

WRONG_BIASES: tuple[tuple[str, str, Answer], ...] = (
    ("gain-sign", messages.LEFT_AFTER_A_STEP, lambda beta, K, j: beta * (1 - (1 - K) ** j)),
    (
        "innovation",
        "That is the mean of the innovation, the part of the bias that has not passed yet.",
        lambda beta, K, j: beta * (1 + K) ** j,
    ),
    ("limit", "That is the limit after a long time; the way there is asked for.", lambda beta, K, j: beta + 0 * (K + j)),
    (
        "in-line",
        IN_LINE,
        lambda beta, K, j: -beta * K * j,
    ),
    ("one-step", "That is what the first biased measurement does.", lambda beta, K, j: -beta * K),
    (
        "one-step-late",
        "It is one step late: the first biased measurement counts already.",
        lambda beta, K, j: beta * (1 - (1 + K) ** (j - 1)),
    ),
    (
        "one-step-early",
        "It is one step early: after no biased measurement the error is zero.",
        lambda beta, K, j: beta * (1 - (1 + K) ** (j + 1)),
    ),
    (
        "power-of-K",
        "What is left after a step is not K: take what has not passed yet to the power.",
        lambda beta, K, j: beta * (1 - K**j),
    ),
    (
        "new-part",
        "That is what the newest measurement adds; the earlier ones have passed on their shares already.",
        lambda beta, K, j: -beta * K * (1 + K) ** j,
    ),
    ("in-line", IN_LINE, lambda beta, K, j: beta * j * (1 + K)),
    (
        "before-correction",
        "That is divided by what a step leaves: the mean is asked for after the measurement.",
        lambda beta, K, j: beta * (1 - (1 + K) ** j) / (1 + K),
    ),
)
