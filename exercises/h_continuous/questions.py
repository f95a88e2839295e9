"""Questions of set h: the filter in continuous time, for white noises of given one-sided spectral densities.

Answers are functions of numbers, of arrays (one number for each run, or matrices), and in the last question of formulas.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import sympy as sp

from kfcourse import continuous
from kfcourse.checks.exercises import Exercise
from kfcourse.checks.question import Answer, Question, catalogue
from kfcourse.checks.registry import ExerciseSet
from kfcourse.continuous import ContinuousModel, log_likelihood_rate, to_discrete
from kfcourse.exercises.shared import Map
from kfcourse.laws import Array

RUNS = 6

# dx/dt = -a x + s xi, y = h x + n or h sin(x) + n; densities S_xi, N; d is the variance of x(0): from, to.
NUMBERS = {"a": (0.4, 0.9), "s": (0.6, 1.1), "h": (0.7, 1.3), "S_xi": (1.5, 2.5), "N": (0.15, 0.4), "d": (0.8, 1.5)}


def continuous_numbers(exercise: Exercise) -> dict[str, float]:
    """Numbers of the variant's continuous model."""
    rng = exercise.rng("continuous")
    return {name: round(float(rng.uniform(*limits)), 2) for name, limits in NUMBERS.items()}


# -- h1: variances of means over a step


def noise_variances(S_xi: float, N: float, T: float) -> tuple[Array, Array]:
    discrete = to_discrete(ContinuousModel.define("-x", "1", "x", spectral_density=S_xi, noise_density=N), T)
    return discrete.state_noise.cov[0, 0], discrete.meter_noise.cov[0, 0]


def both(change: Callable[[float, float], float]) -> Answer:
    """(density, T) -> the variance, for both noises."""
    return lambda S_xi, N, T: (change(S_xi, T), change(N, T))


WRONG_VARIANCES: tuple[tuple[str, str, Answer], ...] = (
    (
        "one-sided",
        "The densities are one-sided; the intensity of the noise is not the whole of them.",
        both(lambda density, T: density / T),
    ),
    (
        "factor-wrong-way",
        "From a one-sided density to an intensity the factor goes the other way.",
        both(lambda density, T: 2 * density / T),
    ),
    (
        "times-step",
        "Multiplied by the step; the longer a mean is taken over, the less it varies.",
        both(lambda density, T: density * T / 2),
    ),
    ("step-forgotten", "The step is missing: that is an intensity, with other units.", both(lambda density, T: density / 2)),
    ("deviation", "It is a standard deviation; the variance is asked for.", both(lambda density, T: np.sqrt(density / (2 * T)))),
    (
        "step-squared",
        "Divided by the step once too often: the variance of an integral over a step is proportional to the step.",
        both(lambda density, T: density / (2 * T**2)),
    ),
)


def variances_arguments(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("h1")
    return [tuple(round(float(v), 3) for v in rng.uniform([1.2, 0.2, 0.01], [4, 0.9, 0.3])) for _ in range(3)]


# -- h2: a step of a simulation


def simulate_step(x: Array, xi: Array, n: Array, T: float, f: Callable, g: Callable, S: Callable, S_xi: float, N: float):
    return simulation_with()(x, xi, n, T, f, g, S, S_xi, N)


def simulation_with(
    drift: Callable[[Array, float], Array] = lambda f, T: T * f,
    shake: Callable[[float, float], float] = lambda S_xi, T: np.sqrt(S_xi * T / 2),
    noise: Callable[[float, float], float] = lambda N, T: np.sqrt(N / (2 * T)),
    factor: Callable[[Callable, Array, Array], Array] = lambda g, x, ahead: g(x),
    seen: Callable[[Array, Array], Array] = lambda x, x_next: x,
    kept: float = 1.0,
) -> Answer:
    """A step with one thing changed."""

    def answer(x: Array, xi: Array, n: Array, T: float, f: Callable, g: Callable, S: Callable, S_xi: float, N: float):
        size = shake(S_xi, T) * xi
        x_next = kept * x + drift(f(x), T) + factor(g, x, x + T * f(x) + g(x) * size) * size
        return x_next, S(seen(x, x_next)) + noise(N, T) * n

    return answer


WRONG_SIMULATIONS: tuple[tuple[str, str, Answer], ...] = (
    (
        "noise-times-step",
        "The noise grows with the step like the drift; over a step its variance does, its size with the root of it.",
        simulation_with(shake=lambda S_xi, T: T * np.sqrt(S_xi / 2), noise=lambda N, T: np.sqrt(N / 2) / T),
    ),
    (
        "one-sided",
        "The densities are one-sided: the intensity of the noise is not the whole of them.",
        simulation_with(shake=lambda S_xi, T: np.sqrt(S_xi * T), noise=lambda N, T: np.sqrt(N / T)),
    ),
    (
        "mean-for-integral",
        "That is the mean of the noise over the step; the state changes by its integral.",
        simulation_with(shake=lambda S_xi, T: np.sqrt(S_xi / (2 * T))),
    ),
    (
        "integral-for-mean",
        "The noise of the measurement grows with the step; a mean over a longer step varies less.",
        simulation_with(noise=lambda N, T: np.sqrt(N * T / 2)),
    ),
    (
        "variance-for-deviation",
        "A variance multiplies the standard normal number; its root belongs there.",
        simulation_with(shake=lambda S_xi, T: S_xi * T / 2, noise=lambda N, T: N / (2 * T)),
    ),
    (
        "step-forgotten-in-noise",
        "The step is missing in the noise.",
        simulation_with(shake=lambda S_xi, T: np.sqrt(S_xi / 2), noise=lambda N, T: np.sqrt(N / 2)),
    ),
    (
        "step-forgotten-in-drift",
        "The drift is a velocity: over a step the state changes by it times the step.",
        simulation_with(drift=lambda f, T: f),
    ),
    ("state-forgotten", "That is the change of the state; add it to the state.", simulation_with(kept=0.0)),
    ("drift-forgotten", "The state is only shaken: the drift is missing.", simulation_with(drift=lambda f, T: 0 * f)),
    (
        "factor-forgotten",
        "The factor of the noise is missing.",
        simulation_with(factor=lambda g, x, ahead: np.ones_like(x)),
    ),
    (
        "factor-at-end",
        "The factor of the noise is taken at the end of the step; in Ito's sense it does not know this step's noise yet.",
        simulation_with(factor=lambda g, x, ahead: g(ahead)),
    ),
    (
        "measured-at-end",
        "The signal is taken after the step; y_k belongs to the step that starts at x.",
        simulation_with(seen=lambda x, x_next: x_next),
    ),
)


def curve(rng: np.random.Generator, slope: float) -> tuple[Callable, Callable]:
    """A hidden smooth function of a number, and its derivative."""
    a, b, c, d = rng.uniform([0.8, 0.3, 0.4, 0.2], [1.2, 0.5, 0.8, 0.6])
    return lambda x: slope * (a * x + b * np.sin(x + c) + d), lambda x: slope * (a + b * np.cos(x + c))


def positive(rng: np.random.Generator) -> Callable:
    level, swing, shift = rng.uniform([0.6, 0.2, 0.3], [0.9, 0.4, 0.9])
    return lambda x: level + swing * np.sin(x + shift)


def simulation_arguments(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("h2")
    x, xi, n = rng.normal(size=(3, RUNS))
    return [
        (
            x,
            xi,
            n,
            rng.uniform(0.05, 0.2),
            curve(rng, -0.7)[0],
            positive(rng),
            curve(rng, 1.1)[0],
            *rng.uniform([1.4, 0.2], [2.6, 0.5]),
        )
    ]


# -- h3: the Riccati equation

Rate = Callable[[Array, Array, Array, Array, Array, Array], Array]


def riccati(D: Array, A: Array, G: Array, H: Array, S_xi: Array, N: Array) -> Array:
    return rate_with()(D, A, G, H, S_xi, N)


def rate_with(
    motion: Callable[[Array, Array], Array] = lambda A, D: A @ D + D @ A.T,
    shaken: Callable[[Array, Array], Array] = lambda G, S_xi: G @ S_xi @ G.T / 2,
    learnt: Callable[[Array, Array, Array], Array] = lambda D, H, N: D @ H.T @ np.linalg.solve(N / 2, H @ D),
) -> Rate:
    """dD/dt with one term changed."""
    return lambda D, A, G, H, S_xi, N: motion(A, D) + shaken(G, S_xi) - learnt(D, H, N)


def rate_arguments(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("h3")

    def covariance(size: int) -> Array:
        root = np.eye(size) + 0.4 * rng.normal(size=(size, size))
        return root @ root.T

    A, G, H = rng.normal(size=(3, 3)), rng.normal(size=(3, 3)), rng.normal(size=(2, 3))
    return [(covariance(3), A, G, H, covariance(3), 0.4 * covariance(2))]


WRONG_RATES: tuple[tuple[str, str, Rate], ...] = (
    (
        "one-side-only",
        "Both factors of M[e e^T] change with the drift; a term is missing, and the result is not symmetric.",
        rate_with(motion=lambda A, D: A @ D),
    ),
    (
        "transposed",
        "The matrix of the drift is transposed.",
        rate_with(motion=lambda A, D: A.T @ D + D @ A),
    ),
    (
        "discrete",
        "That is the term of a discrete filter; in continuous time the covariance has a rate, and A enters it once.",
        rate_with(motion=lambda A, D: A @ D @ A.T),
    ),
    (
        "process-one-sided",
        "The density of the process noise is one-sided; its intensity is not the whole of it.",
        rate_with(shaken=lambda G, S_xi: G @ S_xi @ G.T),
    ),
    (
        "meter-one-sided",
        "The density of the meter's noise is one-sided; its intensity is not the whole of it.",
        rate_with(learnt=lambda D, H, N: D @ H.T @ np.linalg.solve(N, H @ D)),
    ),
    (
        "densities-for-intensities",
        "Both densities are one-sided; the equation wants intensities.",
        rate_with(shaken=lambda G, S_xi: G @ S_xi @ G.T, learnt=lambda D, H, N: D @ H.T @ np.linalg.solve(N, H @ D)),
    ),
    (
        "riccati-sign",
        "The sign of the last term: what is measured makes the covariance smaller.",
        rate_with(learnt=lambda D, H, N: -D @ H.T @ np.linalg.solve(N / 2, H @ D)),
    ),
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
    ("noise-forgotten", "The noise of the process is missing.", rate_with(shaken=lambda G, S_xi: 0 * G)),
    (
        "measurement-forgotten",
        "Nothing is learnt from the measurement: a term is missing.",
        rate_with(learnt=lambda D, H, N: 0 * D),
    ),
)

# -- h4: the steady state of dx/dt = -a x + s xi, y = h x + n


def steady_state(a: float, s: float, h: float, S_xi: float, N: float) -> tuple[Array, Array]:
    model = ContinuousModel.define("-a*x", "s", "h*x", {"a": a, "s": s, "h": h}, spectral_density=S_xi, noise_density=N)
    D, K = continuous.steady_state(model)
    return D[0, 0], K[0, 0]


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


WRONG_STEADY: tuple[tuple[str, str, Answer], ...] = (
    ("negative-root", "That is the other root of the quadratic equation; a variance is not negative.", steady_with(root=-1.0)),
    (
        "process-one-sided",
        "The density of the process noise is one-sided; its intensity is not the whole of it.",
        steady_with(q=lambda s, S_xi: s**2 * S_xi),
    ),
    (
        "meter-one-sided",
        "The density of the meter's noise is one-sided; its intensity is not the whole of it.",
        steady_with(c=lambda h, N: h**2 / N, gain=lambda D, h, N: D * h / N),
    ),
    (
        "densities-for-intensities",
        "Both densities are one-sided; the equation wants intensities.",
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
    (
        "noise-power",
        "The factor of the noise enters the equation of the variance squared.",
        steady_with(q=lambda s, S_xi: s * S_xi / 2),
    ),
    (
        "slope-power",
        "The slope of the signal enters the equation of the variance squared.",
        steady_with(c=lambda h, N: 2 * h / N),
    ),
    (
        "gain-one-sided",
        "The gain is divided by the one-sided density; the intensity belongs there.",
        steady_with(gain=lambda D, h, N: D * h / N),
    ),
    ("gain-without-slope", "The slope of the signal is missing in the gain.", steady_with(gain=lambda D, h, N: 2 * D / N)),
    (
        "gain-discrete",
        "That is the gain of a discrete filter; beside the noise of an instant the state's part is negligible.",
        steady_with(gain=lambda D, h, N: D * h / (h**2 * D + N / 2)),
    ),
)


def steady_arguments(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("h4")
    low, high = [0.3, 0.6, 1.3, 1.3, 0.15], [0.7, 0.9, 1.8, 2.6, 0.5]
    return [tuple(round(float(v), 3) for v in rng.uniform(low, high)) for _ in range(3)]


# -- h5: a step of the filter


def filter_step(
    z: Array, D: Array, y: Array, T: float, f: Map, f_x: Map, g: Map, S: Map, S_x: Map, S_xi: float, N: float
) -> tuple[Array, Array]:
    return step_with()(z, D, y, T, f, f_x, g, S, S_x, S_xi, N)


def step_with(
    times: Callable[[float], float] = lambda T: T,
    drift: Callable[[Array, Array, Array], Array] = lambda f, f_x, z: f,
    slope: Callable[[Array, Array], Array] = lambda S, S_x: S_x,
    expected: Callable[[Array, Array, Array], Array] = lambda S, S_x, z: S,
    gain: Callable[[Array, Array, float], Array] = lambda D, S_x, N: D * S_x * 2 / N,
    motion: Callable[[Array, Array], Array] = lambda f_x, D: 2 * f_x * D,
    shaken: Callable[[Array, float], Array] = lambda g, S_xi: g**2 * S_xi / 2,
    learnt: Callable[[Array, Array, float], Array] = lambda D, S_x, N: D**2 * S_x**2 * 2 / N,
    order: str = "together",
    sign: float = 1.0,
) -> Answer:
    """Euler's step of both equations with one thing changed.

    order: "together"; "z-first": the rate of D is taken at the new z; "D-first": the gain is made of the new D.
    """

    def answer(
        z: Array,
        D: Array,
        y: Array,
        T: float,
        f: Callable,
        f_x: Callable,
        g: Callable,
        S: Callable,
        S_x: Callable,
        S_xi: float,
        N: float,
    ) -> tuple[Array, Array]:
        def moved(D: Array) -> Array:
            innovation = sign * (y - expected(S(z), S_x(z), z))
            return z + times(T) * (drift(f(z), f_x(z), z) + gain(D, slope(S(z), S_x(z)), N) * innovation)

        def shrunk(z: Array) -> Array:
            return D + times(T) * (motion(f_x(z), D) + shaken(g(z), S_xi) - learnt(D, slope(S(z), S_x(z)), N))

        D_next = shrunk(moved(D) if order == "z-first" else z)
        return moved(D_next if order == "D-first" else D), D_next

    return answer


WRONG_STEPS: tuple[tuple[str, str, Answer], ...] = (
    (
        "step-forgotten",
        "The equations give rates; over a step z and D change by them times the step.",
        step_with(times=lambda T: 1.0),
    ),
    (
        "signal-for-derivative",
        "The signal itself stands where its derivative belongs.",
        step_with(slope=lambda S, S_x: S),
    ),
    (
        "gain-one-sided",
        "The gain is divided by the one-sided density; the intensity belongs there.",
        step_with(gain=lambda D, S_x, N: D * S_x / N),
    ),
    (
        "meter-one-sided",
        "The density of the meter's noise is one-sided; its intensity is not the whole of it.",
        step_with(gain=lambda D, S_x, N: D * S_x / N, learnt=lambda D, S_x, N: D**2 * S_x**2 / N),
    ),
    (
        "meter-one-sided",
        "The density of the meter's noise is one-sided; its intensity is not the whole of it.",
        step_with(learnt=lambda D, S_x, N: D**2 * S_x**2 / N),
    ),
    (
        "process-one-sided",
        "The density of the process noise is one-sided; its intensity is not the whole of it.",
        step_with(shaken=lambda g, S_xi: g**2 * S_xi),
    ),
    ("innovation-sign", "The innovation is what came minus what was expected.", step_with(sign=-1.0)),
    (
        "innovation-without-signal",
        "The measurement itself is multiplied by the gain; subtract what was expected.",
        step_with(expected=lambda S, S_x, z: 0.0 * z),
    ),
    (
        "expected-by-slope",
        "The estimate is multiplied by the slope; what is expected of y is the signal itself at the estimate.",
        step_with(expected=lambda S, S_x, z: S_x * z),
    ),
    ("gain-without-slope", "The slope of the signal is missing in the gain.", step_with(gain=lambda D, S_x, N: D * 2 / N)),
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
    ("noise-forgotten", "The noise of the process is missing in the variance.", step_with(shaken=lambda g, S_xi: 0 * g)),
    (
        "noise-power",
        "The factor of the noise enters the variance squared.",
        step_with(shaken=lambda g, S_xi: g * S_xi / 2),
    ),
    (
        "riccati-sign",
        "The sign of the last term: what is measured makes the variance smaller.",
        step_with(learnt=lambda D, S_x, N: -(D**2) * S_x**2 * 2 / N),
    ),
    (
        "slope-power",
        "The slope of the signal enters the variance squared.",
        step_with(learnt=lambda D, S_x, N: D**2 * S_x * 2 / N),
    ),
    (
        "variance-once",
        "The last term is quadratic in the variance.",
        step_with(learnt=lambda D, S_x, N: D * S_x**2 * 2 / N),
    ),
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
)


def step_arguments(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("h5")
    z, y = rng.normal(size=(2, RUNS))
    D, T = rng.uniform(0.4, 1.2, RUNS), rng.uniform(0.01, 0.03)
    return [(z, D, y, T, *curve(rng, -0.7), positive(rng), *curve(rng, 1.3), *rng.uniform([1.4, 0.2], [2.6, 0.5]))]


# -- h6: derivatives of the log-likelihood


def derivatives(S: sp.Expr, x: sp.Symbol, y: sp.Symbol, N: sp.Symbol) -> tuple[sp.Expr, sp.Expr]:
    F = log_likelihood_rate(sp.Matrix([S]), sp.Matrix([y]), sp.Matrix([N]))
    return F.diff(x), F.diff(x, 2)


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
        "The signal itself stands where its derivative belongs.",
        derivatives_with(lambda S, S1, S2, y, k: (k * S * (y - S), -k * S**2 + k * S1 * (y - S))),
    ),
    (
        "gain-without-slope",
        "The slope of the signal is missing: the chain rule.",
        derivatives_with(lambda S, S1, S2, y, k: (k * (y - S), -k * S1)),
    ),
)


def derivatives_arguments(exercise: Exercise) -> list[tuple]:
    x, y, N = sp.symbols("x y N_n", real=True)
    a, b, c = (sp.Rational(int(k), 10) for k in exercise.rng("h6").integers(3, 10, 3))
    return [(signal, x, y, N) for signal in (sp.sin(x + a) + b * x, sp.exp(c * x) + b * x**2, x + a * x**3)]


QUESTIONS = (
    Question(
        "h1",
        "white noise on a computer",
        "warm-up",
        noise_variances,
        variances_arguments,
        catalogue(WRONG_VARIANCES),
        ("D_xi", "D_n"),
    ),
    Question(
        "h2",
        "a step of a simulation",
        "core",
        simulate_step,
        simulation_arguments,
        catalogue(WRONG_SIMULATIONS),
        ("x_next", "y"),
    ),
    Question("h3", "the Riccati equation", "core", riccati, rate_arguments, catalogue(WRONG_RATES)),
    Question("h4", "the steady state", "core", steady_state, steady_arguments, catalogue(WRONG_STEADY), ("D", "K")),
    Question("h5", "a step of the extended filter", "core", filter_step, step_arguments, catalogue(WRONG_STEPS), ("z", "D")),
    Question(
        "h6",
        "derivatives of the log-likelihood",
        "stretch",
        derivatives,
        derivatives_arguments,
        catalogue(WRONG_DERIVATIVES),
        ("u", "U"),
    ),
)

SET = ExerciseSet("h", "The continuous-time filter", Path(__file__).parent, QUESTIONS, continuous_numbers, about_variant=False)
