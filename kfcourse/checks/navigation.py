"""Questions of set k, an inertial system integrated with a satellite receiver, and of set l, rates and time tags.

What is derived is answered with formulas in the symbols of the arguments, what runs with arrays.  Letters are the book's: Psi
and p are the lecture's D with a tilde and D.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.arithmetic import FORMS
from kfcourse.checks.engine import Answer, Question, catalogue
from kfcourse.checks.tracking import covariance, personal, substituted
from kfcourse.gaussian import Array, Gaussian
from kfcourse.linear import run as run_linear
from kfcourse.navigation import Clock, Dynamics, Observation, Sensor
from kfcourse.navigation import fuse as fuse_events
from kfcourse.system import LinearSystem


def integration_numbers(exercise: Any) -> dict[str, float]:
    """T (s), sigma_n and sigma_xi (m/s), gap: how long the receiver is lost (s)."""
    return personal(
        exercise,
        "k",
        {"T": 0.1, "sigma_n": 0.2, "sigma_xi": 0.01, "gap": 60.0},
        {"T": (0.05, 0.4), "sigma_n": (0.1, 0.5), "sigma_xi": (0.005, 0.025), "gap": (30, 90)},
    )


def timing_numbers(exercise: Any) -> dict[str, float]:
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


# -- k1: the error of the slow sensor as the state


def right_meter(signal: Callable, y: Any, eps: Any) -> tuple:
    h = signal(y - eps)
    return h, sp.diff(h, eps)


def signals(exercise: Any) -> list[tuple]:
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


def right_steady(sigma_xi: Any, sigma_n: Any) -> tuple:
    return tuple(substituted(_steady(), (S_XI, S_N))(sigma_xi, sigma_n))


def steady_from(Psi: Callable[[Any, Any], Any]) -> Answer:
    """(Psi, p, K) made of another Psi."""

    def answer(sigma_xi: Any, sigma_n: Any) -> tuple:
        found = Psi(sigma_xi, sigma_n)
        return found, found - sigma_xi**2, -found / (found + sigma_n**2)

    return answer


def steady_with(change: Callable[..., tuple]) -> Answer:
    """change(Psi, p, K, sigma_xi, sigma_n) of the right ones."""
    return lambda sigma_xi, sigma_n: change(*right_steady(sigma_xi, sigma_n), sigma_xi, sigma_n)


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


def right_improvement(sigma_xi: Any, sigma_n: Any, T: Any) -> tuple:
    _, p, K = right_steady(sigma_xi, sigma_n)
    return sigma_n / sp.sqrt(p), -T / sp.log(1 + K)


def improvement_with(factor: Callable | None = None, time: Callable | None = None) -> Answer:
    """The right factor and time constant, with one of them changed."""

    def answer(sigma_xi: Any, sigma_n: Any, T: Any) -> tuple:
        right = right_improvement(sigma_xi, sigma_n, T)
        Psi, p, K = right_steady(sigma_xi, sigma_n)
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


def right_filter(y_ins: Array, y_sr: Array, sigma_xi: float, sigma_n: float, p0: float) -> tuple[Array, Array]:
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
    return right_filter(y_ins, y_sr, sigma_xi, sigma_n, p0 + sigma_xi**2)


def filter_arguments(exercise: Any) -> list[tuple]:
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
        lambda *a: (right_filter(*a)[0], np.concatenate([[a[4]], right_filter(*a)[1][:-1] + a[2] ** 2])),
    ),
)

# -- k5: the receiver drops out; k6: the receiver is biased


def right_growth(p: Any, sigma_xi: Any, sigma_n: Any, n: Any, T: Any) -> tuple:
    return sp.sqrt(p + n * sigma_xi**2), T * (sigma_n**2 - p) / sigma_xi**2


def growth_with(sd: Callable | None = None, until: Callable | None = None) -> Answer:
    def answer(p: Any, sigma_xi: Any, sigma_n: Any, n: Any, T: Any) -> tuple:
        right = right_growth(p, sigma_xi, sigma_n, n, T)
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


def right_bias(beta: Any, K: Any, j: Any) -> Any:
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

INTEGRATION = (
    Question(
        "k1",
        "the error as the state",
        "warm-up",
        lambda e: right_meter,
        signals,
        catalogue(WRONG_METERS),
        ("signal", "slope"),
    ),
    Question(
        "k2",
        "the steady state",
        "core",
        lambda e: right_steady,
        lambda e: [(S_XI, S_N)],
        catalogue(WRONG_STEADY),
        ("Psi", "p", "K"),
    ),
    Question(
        "k3",
        "the filter",
        "core",
        lambda e: right_filter,
        filter_arguments,
        catalogue(WRONG_FILTERS),
        ("V", "p"),
    ),
    Question(
        "k4",
        "what is gained, and how soon",
        "core",
        lambda e: right_improvement,
        lambda e: [(S_XI, S_N, sp.Symbol("T", positive=True))],
        catalogue(WRONG_IMPROVEMENTS),
        ("factor", "time_constant"),
    ),
    Question(
        "k5",
        "the receiver is lost",
        "core",
        lambda e: right_growth,
        lambda e: [(sp.Symbol("p", positive=True), S_XI, S_N, *sp.symbols("n T", positive=True))],
        catalogue(WRONG_GROWTHS),
        ("deviation", "until"),
    ),
    Question(
        "k6",
        "the receiver is biased",
        "stretch",
        lambda e: right_bias,
        lambda e: [(*sp.symbols("beta K", real=True), sp.Symbol("j", integer=True, positive=True))],
        catalogue(WRONG_BIASES),
    ),
)

# -- l1: two rates in one vector; l2: two time scales


def right_dimension(steps: int, ratio: int, first: int) -> Array:
    dimension = np.ones(steps)
    dimension[first::ratio] = 2
    return dimension


def dimension_where(both: Callable[[Array, int, int], Array], alone: float = 1, together: float = 2) -> Answer:
    """both(k, ratio, first): the steps at which the receiver is thought to be there."""
    return lambda steps, ratio, first: np.where(both(np.arange(steps), ratio, first), together, alone)


def dimension_arguments(exercise: Any) -> list[tuple]:
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
        lambda *a: right_dimension(*a) - 1,
    ),
    ("always-both", "The dimension is that of a full vector at every step.", dimension_where(lambda k, ratio, first: k >= 0)),
)


def right_time(reading: Any, rate: Any, shift: Any) -> Any:
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


def right_correction(m: Array, P: Array, y: Array, H: Array, R: Array) -> tuple[Array, Array]:
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


def correction_arguments(exercise: Any) -> list[tuple]:
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


def right_move(m: Array, P: Array, dt: float, q: float) -> tuple[Array, Array]:
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


def move_arguments(exercise: Any) -> list[tuple]:
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


def right_fusion(
    tags: Array, arrivals: Array, values: Array, m: Array, P: Array, q: float, r: float, now: float, by: str = "tag"
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


def fusion_arguments(exercise: Any) -> list[tuple]:
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
        partial(right_fusion, by="arrival"),
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


def right_cost(V: Any, a: Any, tau: Any) -> tuple:
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
        lambda V, a, tau: right_cost(V, a, 2 * tau),
    ),
    (
        "half-in-velocity",
        "The velocity is behind by the whole acceleration times the delay.",
        lambda V, a, tau: (-V * tau + a * tau**2 / 2, -a * tau / 2),
    ),
    ("per-second", "The velocity is not multiplied by the delay.", lambda V, a, tau: (-V + a * tau / 2, -a)),
)


def right_fit(edges: Array, stamps: Array) -> tuple[float, float]:
    clock = Clock.fit(edges, stamps)
    return clock.rate, clock.shift


def fit_arguments(exercise: Any) -> list[tuple]:
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
        lambda edges, stamps: (right_fit(edges, stamps)[0], _least_squares(stamps, edges)[1]),
    ),
)

TIMING = (
    Question("l1", "two rates", "warm-up", lambda e: right_dimension, dimension_arguments, catalogue(WRONG_DIMENSIONS)),
    Question(
        "l2",
        "from the sensor's clock to one's own",
        "warm-up",
        lambda e: right_time,
        lambda e: [sp.symbols("reading rate shift", positive=True)],
        catalogue(WRONG_TIMES),
    ),
    Question(
        "l3",
        "a measurement of varying dimension",
        "core",
        lambda e: right_correction,
        correction_arguments,
        catalogue(WRONG_CORRECTIONS),
        ("m", "P"),
    ),
    Question(
        "l4", "over an interval of any length", "core", lambda e: right_move, move_arguments, catalogue(WRONG_MOVES), ("m", "P")
    ),
    Question(
        "l5",
        "late and out of order",
        "core",
        lambda e: right_fusion,
        fusion_arguments,
        catalogue(WRONG_FUSIONS),
        ("m", "P"),
    ),
    Question(
        "l6",
        "what ignoring the tag costs",
        "core",
        lambda e: right_cost,
        lambda e: [sp.symbols("V a tau", positive=True)],
        catalogue(WRONG_COSTS),
        ("position", "velocity"),
    ),
    Question(
        "l7", "the clock from edges", "stretch", lambda e: right_fit, fit_arguments, catalogue(WRONG_FITS), ("rate", "shift")
    ),
)
