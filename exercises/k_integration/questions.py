"""Questions of set k, an inertial system integrated with a satellite receiver, and of set l, rates and time tags.

What is derived is answered with formulas in the symbols of the arguments, what runs with arrays.  Letters are the book's: Psi
and p are the lecture's D with a tilde and D.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.checks.exercises import Exercise
from kfcourse.checks.question import Answer, Question, catalogue
from kfcourse.checks.registry import ExerciseSet
from kfcourse.exercises.shared import personal, substituted
from kfcourse.laws import Array, Gaussian
from kfcourse.linear.runs import run as run_linear
from kfcourse.linear.system import LinearSystem


def integration_numbers(exercise: Exercise) -> dict[str, float]:
    """T (s), sigma_n and sigma_xi (m/s), gap: how long the receiver is lost (s)."""
    return personal(
        exercise,
        "k",
        {"T": 0.1, "sigma_n": 0.2, "sigma_xi": 0.01, "gap": 60.0},
        {"T": (0.05, 0.4), "sigma_n": (0.1, 0.5), "sigma_xi": (0.005, 0.025), "gap": (30, 90)},
    )


# -- k1: the error of the slow sensor as the state


def error_meter(signal: Callable, y: Any, eps: Any) -> tuple:
    h = signal(y - eps)
    return h, sp.diff(h, eps)


def signals(exercise: Exercise) -> list[tuple]:
    """The receiver measures the quantity itself, or a formula of it."""
    rng = exercise.rng("k1")
    a, b, c = (sp.Rational(int(number), 10) for number in rng.integers(12, 40, 3))
    y, eps = sp.symbols("y eps", real=True)
    return [(signal, y, eps) for signal in (lambda x: x, lambda x: a * x + sp.sqrt(b + x**2) + sp.sin(c * x))]


def _slope(signal: Callable, at: Any) -> Any:
    x = sp.Dummy("x", real=True)
    return sp.diff(signal(x), x).subs(x, at)


WRONG_METERS: tuple[tuple[str, str, Answer], ...] = (
    (
        "error-sign",
        "The error of the slow sensor is added; it measures too much by it, so the quantity itself is smaller.",
        lambda signal, y, eps: (signal(y + eps), sp.diff(signal(y + eps), eps)),
    ),
    (
        "slope-sign",
        "The derivative is taken by the quantity, not by the error: what does the chain rule add?",
        lambda signal, y, eps: (signal(y - eps), _slope(signal, y - eps)),
    ),
    (
        "slope-at-reading",
        "The derivative is taken at the sensor's reading; the error has to be removed from it first.",
        lambda signal, y, eps: (signal(y - eps), -_slope(signal, y)),
    ),
    (
        "signal-of-error",
        "The receiver measures the quantity; its error alone was put into the signal function.",
        lambda signal, y, eps: (signal(eps), sp.diff(signal(eps), eps)),
    ),
    (
        "reading-minus-signal",
        "The reading is inside the signal function, not outside.",
        lambda signal, y, eps: (y - signal(eps), -_slope(signal, eps)),
    ),
    (
        "difference-reversed",
        "The difference is reversed: it is the reading minus its error.",
        lambda signal, y, eps: (signal(eps - y), _slope(signal, eps - y)),
    ),
)

# -- k2, k4: the steady state

S_XI, S_N = sp.symbols("sigma_xi sigma_n", positive=True)


@lru_cache(maxsize=1)
def _steady() -> sp.ImmutableMatrix:
    """(Psi, p, K): the positive fixed point of Psi = p + sigma_xi^2, K = -Psi/(Psi + sigma_n^2), p = (1 + K) Psi."""
    Psi = sp.Symbol("Psi")
    K = -Psi / (Psi + S_N**2)
    roots = sp.solve(sp.numer(sp.together((1 + K) * Psi + S_XI**2 - Psi)), Psi)
    (found,) = [root for root in roots if root.subs({S_XI: 1, S_N: 1}) > 0]
    return sp.ImmutableMatrix([found, found - S_XI**2, K.subs(Psi, found)])


def steady_state(sigma_xi: Any, sigma_n: Any) -> tuple:
    return tuple(substituted(_steady(), (S_XI, S_N))(sigma_xi, sigma_n))


def steady_from(Psi: Callable[[Any, Any], Any]) -> Answer:
    """(Psi, p, K) made of another Psi."""

    def answer(sigma_xi: Any, sigma_n: Any) -> tuple:
        found = Psi(sigma_xi, sigma_n)
        return found, found - sigma_xi**2, -found / (found + sigma_n**2)

    return answer


def steady_with(change: Callable[..., tuple]) -> Answer:
    """change(Psi, p, K, sigma_xi, sigma_n) of the right ones."""
    return lambda sigma_xi, sigma_n: change(*steady_state(sigma_xi, sigma_n), sigma_xi, sigma_n)


WRONG_STEADY: tuple[tuple[str, str, Answer], ...] = (
    (
        "minus-root",
        "The other root of the quadratic equation was taken: a variance is not negative.",
        steady_from(lambda xi, n: (xi**2 - sp.sqrt(xi**4 + 4 * xi**2 * n**2)) / 2),
    ),
    (
        "variances-swapped",
        "The variances before and after the correction are swapped: which of the two must be larger?",
        steady_with(lambda Psi, p, K, xi, n: (p, Psi, K)),
    ),
    (
        "deviation-for-variance",
        "Standard deviations stand where variances belong: check the units.",
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
    (
        "small-drift",
        "That is the limit for a drift much smaller than the noise; the exact solution is asked for.",
        steady_with(lambda Psi, p, K, xi, n: (xi * n, xi * n, -xi / (xi + n))),
    ),
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
        "The gain is divided by the receiver's noise alone; the prediction's error belongs to the innovation too.",
        steady_with(lambda Psi, p, K, xi, n: (Psi, p, -Psi / n**2)),
    ),
)


def gained(sigma_xi: Any, sigma_n: Any, T: Any) -> tuple:
    _, p, K = steady_state(sigma_xi, sigma_n)
    return sigma_n / sp.sqrt(p), -T / sp.log(1 + K)


def improvement_with(factor: Callable | None = None, time: Callable | None = None) -> Answer:
    """The right factor and time constant, with one of them changed."""

    def answer(sigma_xi: Any, sigma_n: Any, T: Any) -> tuple:
        right = gained(sigma_xi, sigma_n, T)
        Psi, p, K = steady_state(sigma_xi, sigma_n)
        return (
            right[0] if factor is None else factor(Psi, p, sigma_xi, sigma_n),
            right[1] if time is None else time(K, T),
        )

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
    (
        "upside-down",
        "It is upside down: the factor is larger than 1.",
        improvement_with(lambda Psi, p, xi, n: sp.sqrt(p) / n),
    ),
    (
        "prediction",
        "That compares with the prediction's error; the integrated velocity has that of the estimate.",
        improvement_with(lambda Psi, p, xi, n: n / sp.sqrt(Psi)),
    ),
    (
        "small-drift",
        "That is the limit for a drift much smaller than the noise; the exact value is asked for.",
        improvement_with(lambda Psi, p, xi, n: sp.sqrt(n / xi)),
    ),
    (
        "compared-with-drift",
        "It is compared with the drift of one period; compare it with the receiver alone.",
        improvement_with(lambda Psi, p, xi, n: xi / sp.sqrt(p)),
    ),
    (
        "gain-sign",
        "What is left of an old error after a step is 1 + K, and K is negative.",
        improvement_with(time=lambda K, T: T / sp.log(1 - K)),
    ),
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
)

# -- k3: the filter


def integrate(y_ins: Array, y_sr: Array, sigma_xi: float, sigma_n: float, p0: float) -> tuple[Array, Array]:
    steps, runs, axes = y_ins.shape
    system = LinearSystem(np.eye(1), -np.eye(1), np.array([[sigma_xi**2]]), np.array([[sigma_n**2]]))
    each_axis = (y_sr - y_ins).reshape(steps, runs * axes, 1)  # the axes are independent: so many runs of one filter
    laws = run_linear(system, Gaussian(np.zeros(1), np.array([[p0]])), each_axis).posterior
    return y_ins - laws.mean.reshape(y_ins.shape), laws.cov[:, 0, 0, 0]


Scalar = Callable[..., Any]


def filter_with(
    gain: Scalar = lambda Psi, n: -Psi / (Psi + n**2),
    innovation: Scalar = lambda sr, ins, eps: sr - (ins - eps),
    velocity: Scalar = lambda ins, eps: ins - eps,
    variance: Scalar = lambda K, Psi: (1 + K) * Psi,
    drift: Scalar = lambda p, xi: p + xi**2,
    frozen: bool = False,
    drift_in_gap: bool = True,
    filled: float | None = None,
) -> Answer:
    """The filter as a loop, with one thing changed."""

    def answer(y_ins: Array, y_sr: Array, sigma_xi: float, sigma_n: float, p0: float) -> tuple[Array, Array]:
        eps, Psi, rows = np.zeros(y_ins.shape[1:]), p0, []
        for ins, received in zip(y_ins, y_sr, strict=True):
            lost = filled is None and np.isnan(received).any()
            sr = received if filled is None else np.nan_to_num(received, nan=filled)
            p = Psi
            if not lost:
                K = gain(Psi, sigma_n)
                eps = eps + K * innovation(sr, ins, eps)
                p = variance(K, Psi)
            rows.append((velocity(ins, eps), p))
            if not frozen and (drift_in_gap or not lost):
                Psi = drift(p, sigma_xi)
        return np.array([row[0] for row in rows]), np.array([row[1] for row in rows], dtype=float)

    return answer


def _predicted_first(y_ins: Array, y_sr: Array, sigma_xi: float, sigma_n: float, p0: float) -> tuple[Array, Array]:
    return integrate(y_ins, y_sr, sigma_xi, sigma_n, p0 + sigma_xi**2)


def filter_arguments(exercise: Exercise) -> list[tuple]:
    """A run without gaps and one with."""
    rng = exercise.rng("k3")
    sigma_xi, sigma_n, p0 = rng.uniform(0.2, 0.5), rng.uniform(0.6, 0.9), rng.uniform(1.5, 3)
    V = 5 * rng.normal(size=(8, 4, 3))
    eps = np.sqrt(p0) * rng.normal(size=(4, 3)) + np.cumsum(sigma_xi * rng.normal(size=V.shape), axis=0)
    y_sr = V + sigma_n * rng.normal(size=V.shape)
    gaps = y_sr.copy()
    gaps[[2, 3, 6]] = np.nan
    return [(V + eps, received, sigma_xi, sigma_n, p0) for received in (y_sr, gaps)]


WRONG_FILTERS: tuple[tuple[str, str, Answer], ...] = (
    (
        "error-added",
        "The estimated error is added to the reading of the INS; it reads too much by that.",
        filter_with(velocity=lambda ins, eps: ins + eps),
    ),
    (
        "gain-sign",
        "The gain has the wrong sign: the INS reads too much where the receiver's minus its velocity is negative.",
        filter_with(gain=lambda Psi, n: Psi / (Psi + n**2), variance=lambda K, Psi: (1 - K) * Psi),
    ),
    (
        "variance-grows",
        "The variance grows with a measurement: K is negative, so it is 1 + K that is less than 1.",
        filter_with(variance=lambda K, Psi: (1 - K) * Psi),
    ),
    (
        "drift-forgotten",
        "The drift of the INS is not added to the variance: the filter becomes surer and surer and falls asleep.",
        filter_with(drift=lambda p, xi: p),
    ),
    (
        "receiver-for-difference",
        "The receiver's velocity is compared with the error; compare it with what the INS reads, less its error.",
        filter_with(innovation=lambda sr, ins, eps: sr - eps),
    ),
    (
        "error-not-removed",
        "The innovation is made with the raw reading of the INS; its estimated error has to be taken off first.",
        filter_with(innovation=lambda sr, ins, eps: sr - ins),
    ),
    (
        "deviation-for-variance",
        "Standard deviations stand where variances belong: sigma_n and sigma_xi have to be squared.",
        filter_with(gain=lambda Psi, n: -Psi / (Psi + n), drift=lambda p, xi: p + xi),
    ),
    (
        "gain-frozen",
        "The gain never changes: hand the variance on from step to step.",
        filter_with(frozen=True),
    ),
    (
        "predicted-first",
        "The drift is added before the first measurement; p0 is the variance at that moment already.",
        _predicted_first,
    ),
    (
        "missing-as-zero",
        "A missing measurement is treated as the number 0; it says nothing, so the error keeps its estimate.",
        filter_with(filled=0.0),
    ),
    (
        "no-drift-in-gap",
        "While the receiver is lost the variance stands still; the INS drifts on.",
        filter_with(drift_in_gap=False),
    ),
    (
        "error-returned",
        "That is the error of the INS; the velocity is asked for.",
        filter_with(velocity=lambda ins, eps: eps),
    ),
    (
        "variance-before",
        "That is the variance before the correction; return the one after it.",
        lambda *a: (integrate(*a)[0], np.concatenate([[a[4]], integrate(*a)[1][:-1] + a[2] ** 2])),
    ),
)

# -- k5: the receiver drops out; k6: the receiver is biased


def lost(p: Any, sigma_xi: Any, sigma_n: Any, n: Any, T: Any) -> tuple:
    return sp.sqrt(p + n * sigma_xi**2), T * (sigma_n**2 - p) / sigma_xi**2


def growth_with(sd: Callable | None = None, until: Callable | None = None) -> Answer:
    def answer(p: Any, sigma_xi: Any, sigma_n: Any, n: Any, T: Any) -> tuple:
        right = lost(p, sigma_xi, sigma_n, n, T)
        return (
            right[0] if sd is None else sd(p, sigma_xi, sigma_n, n),
            right[1] if until is None else until(p, sigma_xi, sigma_n, T),
        )

    return answer


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
        "sigma_xi has to be squared: check the units.",
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
)


def bias_error(beta: Any, K: Any, j: Any) -> Any:
    return beta * (1 - (1 + K) ** j)


WRONG_BIASES: tuple[tuple[str, str, Answer], ...] = (
    (
        "gain-sign",
        "What is left of an old error after a step is 1 + K, and K is negative.",
        lambda beta, K, j: beta * (1 - (1 - K) ** j),
    ),
    (
        "innovation",
        "That is the mean of the innovation, the part of the bias that has not passed yet.",
        lambda beta, K, j: beta * (1 + K) ** j,
    ),
    ("limit", "That is the limit after a long time; the way there is asked for.", lambda beta, K, j: beta + 0 * (K + j)),
    (
        "in-line",
        "Each step passes on a share of what has not passed yet, not of the whole bias.",
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
)

QUESTIONS = (
    Question(
        "k1",
        "the error as the state",
        "warm-up",
        error_meter,
        signals,
        catalogue(WRONG_METERS),
        ("signal", "slope"),
    ),
    Question(
        "k2",
        "the steady state",
        "core",
        steady_state,
        lambda e: [(S_XI, S_N)],
        catalogue(WRONG_STEADY),
        ("Psi", "p", "K"),
    ),
    Question(
        "k3",
        "the filter",
        "core",
        integrate,
        filter_arguments,
        catalogue(WRONG_FILTERS),
        ("V", "p"),
    ),
    Question(
        "k4",
        "what is gained, and how soon",
        "core",
        gained,
        lambda e: [(S_XI, S_N, sp.Symbol("T", positive=True))],
        catalogue(WRONG_IMPROVEMENTS),
        ("factor", "time_constant"),
    ),
    Question(
        "k5",
        "the receiver is lost",
        "core",
        lost,
        lambda e: [(sp.Symbol("p", positive=True), S_XI, S_N, *sp.symbols("n T", positive=True))],
        catalogue(WRONG_GROWTHS),
        ("deviation", "until"),
    ),
    Question(
        "k6",
        "the receiver is biased",
        "stretch",
        bias_error,
        lambda e: [(*sp.symbols("beta K", real=True), sp.Symbol("j", integer=True, positive=True))],
        catalogue(WRONG_BIASES),
    ),
)

SET = ExerciseSet(
    "k", "Inertial system and satellite receiver", Path(__file__).parent, QUESTIONS, integration_numbers, about_variant=False
)
