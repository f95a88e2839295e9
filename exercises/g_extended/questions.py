"""Questions of set g: the extended Kalman filter from its Jacobians, and whether it is right about its own errors.

Answers are functions of arrays: vectors (..., n), matrices (..., r, c), trajectories first.  They are called with hidden smooth
functions, in dimensions of the variant and in others: where the variant's own Jacobian is constant, or has one entry, one taken
at a wrong point, or transposed, would pass.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import sympy as sp
from scipy import stats

from kfcourse import laws
from kfcourse.checks.exercises import Exercise, full
from kfcourse.checks.question import Answer, Question, catalogue
from kfcourse.checks.registry import ExerciseSet
from kfcourse.exercises.shared import Map
from kfcourse.laws import Array, Gaussian, Measurement, apply, gain, symmetric, transpose
from kfcourse.linear.consistency import chi_squared_bounds, normalised_square
from kfcourse.symbolic.codegen import compile_function
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import exact_matrix

RUNS, STEPS = 6, 5
DIMENSIONS = (3, 3, 2)  # states, noises of the object, measurements: besides the variant's


class Functions(NamedTuple):
    """The lecture's x_{k+1} = f(x) + g(x) xi, y = S(x) + n with their Jacobians, as functions of arrays x (..., n).

    f (..., n), Phi = df/dx (..., n, n), g (..., n, r), covariance D_xi (r, r) of xi;
    S (..., p), H = dS/dx (..., p, n), covariance D_n (..., p, p) of n, which may depend on the state.
    """

    f: Map
    Phi: Map
    g: Map
    D_xi: Array
    S: Map
    H: Map
    D_n: Map


def linearisation(model: Model) -> Functions:
    """f, Phi, g, D_xi, S, H, D_n of a model: its equations with the noises at their means, differentiated by state and noises."""
    x, a, b = sp.Matrix(model.x), model.state_equation, model.meter_equation
    quiet = {
        noise: mean
        for names, law in ((model.v, model.state_noise), (model.w, model.meter_noise))
        for noise, mean in zip(names, exact_matrix(law.mean), strict=True)
    }
    by_noise = b.jacobian(sp.Matrix(model.w)).subs(quiet)
    matrices = {
        "f": a.subs(quiet),
        "Phi": a.subs(quiet).jacobian(x),
        "g": a.jacobian(sp.Matrix(model.v)).subs(quiet),
        "S": b.subs(quiet),
        "H": b.subs(quiet).jacobian(x),
        "D_n": by_noise * exact_matrix(model.meter_noise.cov) * by_noise.T,
    }

    def compiled(name: str) -> Map:
        formula = sp.ImmutableMatrix(matrices[name].subs(model.values))
        function = compile_function(name, {"x": x}, {name: formula}, ["x", "f", "S"], f"{name} of {model}").function
        shape = formula.shape[:1] if name in ("f", "S") else formula.shape
        return lambda at: np.array(np.broadcast_to(function(at)[0], (*np.shape(at)[:-1], *shape)))

    f, Phi, g, S, H, D_n = map(compiled, matrices)
    return Functions(f, Phi, g, model.state_noise.cov, S, H, D_n)


# -- hidden functions


def covariance(rng: np.random.Generator, size: int, scale: float = 1.0) -> Array:
    root = np.eye(size) + 0.4 * rng.normal(size=(size, size))
    return scale * root @ root.T


def curved(rng: np.random.Generator, rows: int, n: int, size: float) -> tuple[Callable, Callable]:
    """A smooth function (..., n) -> (..., rows), about `size` times its argument, and its Jacobian (..., rows, n)."""
    A, B = (factor * size * rng.normal(size=(rows, n)) / np.sqrt(n) for factor in (0.7, 1.0))
    A[:, 0] += 0.5 * size * np.sign(A[:, 0])  # nothing near zero where there is but one entry
    B += 0.3 * size * np.sign(B)
    shift, level = rng.uniform(0.3, 1.2, rows), rng.normal(size=rows)
    return (
        lambda x: x @ A.T + 0.5 * np.sin(x @ B.T + shift) + level,
        lambda x: A + 0.5 * np.cos(x @ B.T + shift)[..., :, None] * B,
    )


def varying(rng: np.random.Generator, matrix: Array, n: int) -> Map:
    """The matrix (r, c) times a positive function of the state: (..., n) -> (..., r, c)."""
    direction = rng.normal(size=n)
    return lambda x: matrix * (1 + 0.4 * np.sin(x @ direction + 0.7))[..., None, None]


def hidden(exercise: Exercise, name: str, n: int, r: int, p: int) -> Functions:
    """Hidden functions with n states, r noises of the object, p measurements."""
    rng = exercise.rng(f"{name}-functions-{n}-{r}-{p}")
    f, Phi = curved(rng, n, n, 0.7)
    S, H = curved(rng, p, n, 1.2)
    g = varying(rng, 0.3 + 0.6 * rng.uniform(size=(n, r)) + np.eye(n, r), n)
    return Functions(f, Phi, g, covariance(rng, r, 0.2), S, H, varying(rng, covariance(rng, p, 0.3), n))


def sizes(exercise: Exercise) -> tuple[tuple[int, int, int], ...]:
    """Dimensions that answers are called with."""
    return DIMENSIONS, (exercise.model.n, len(exercise.model.v), exercise.model.p)


def law(rng: np.random.Generator, n: int) -> Gaussian:
    """A normal law for every trajectory."""
    return Gaussian(rng.normal(size=(RUNS, n)), np.array([covariance(rng, n, 0.4) for _ in range(RUNS)]))


def cases(exercise: Exercise, name: str) -> list[tuple[Functions, np.random.Generator, int, int]]:
    """Hidden functions, random numbers, n and p for each of the dimensions."""
    return [
        (hidden(exercise, name, n, r, p), exercise.rng(f"{name}-{place}"), n, p)
        for place, (n, r, p) in enumerate(sizes(exercise))
    ]


# -- g1: a Jacobian by differences


def jacobian(function: Callable, x: Array, h: float) -> Array:
    return jacobian_with()(function, x, h)


def jacobian_with(
    forward: float = 1.0, backward: float = -1.0, divisor: Callable[[float], float] = lambda step: 2 * step
) -> Answer:
    """Differences of the values at x + forward * step and x + backward * step, in each component."""

    def answer(function: Callable, x: Array, step: float) -> Array:
        columns = [function(x + forward * step * e) - function(x + backward * step * e) for e in np.eye(x.shape[-1])]
        return np.stack(columns, axis=-1) / divisor(step)

    return answer


def _all_at_once(function: Callable, x: Array, step: float) -> Array:
    difference = (function(x + step) - function(x - step)) / (2 * step)
    return np.repeat(difference[..., None], x.shape[-1], axis=-1)


def jacobian_arguments(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("g1")
    return [(curved(rng, n, n, 1.0)[0], rng.normal(size=(RUNS, n)), step) for n, step in ((3, 0.02), (exercise.model.n, 0.05))]


WRONG_JACOBIANS: tuple[tuple[str, str, Answer], ...] = (
    (
        "one-sided",
        "That is a one-sided difference; take a step to either side, the error is then of the second order.",
        jacobian_with(backward=0.0, divisor=lambda step: step),
    ),
    (
        "one-sided",
        "That is a one-sided difference; take a step to either side, the error is then of the second order.",
        jacobian_with(forward=0.0, divisor=lambda step: step),
    ),
    ("divided-by-one-step", "The two points are two steps apart.", jacobian_with(divisor=lambda step: step)),
    (
        "step-forgotten",
        "It is a difference of values; divide by the distance of the points.",
        jacobian_with(divisor=lambda step: 1.0),
    ),
    ("all-at-once", "All components are shifted at once; a partial derivative shifts one.", _all_at_once),
    (
        "transposed",
        "It is transposed: row i holds the derivatives of component i of the function.",
        lambda function, x, step: np.swapaxes(jacobian(function, x, step), -1, -2),
    ),
)

# -- g2: bounds

Bounds = Callable[[int, int, float], tuple[float, float]]


def _normal_bounds(degrees: int, runs: int, confidence: float) -> tuple[float, float]:
    half = stats.norm.ppf((1 + confidence) / 2) * np.sqrt(2 * degrees / runs)
    return degrees - half, degrees + half


WRONG_BOUNDS: tuple[tuple[str, str, Bounds], ...] = (
    (
        "one-value",
        "These are the bounds of a single value. The mean of many runs varies less: the degrees of freedom of a sum add up.",
        lambda degrees, runs, confidence: stats.chi2.interval(confidence, degrees),
    ),
    (
        "not-divided",
        "These are the bounds of the sum over the runs; those of the mean are asked for.",
        lambda degrees, runs, confidence: stats.chi2.interval(confidence, degrees * runs),
    ),
    (
        "runs-only",
        "The degrees of freedom are not only the number of runs: each run adds as many as the vector has components.",
        lambda degrees, runs, confidence: tuple(np.array(stats.chi2.interval(confidence, runs)) / runs),
    ),
    (
        "per-component",
        "Divided by the number of components too; the mean itself is asked for.",
        lambda degrees, runs, confidence: tuple(np.array(chi_squared_bounds(degrees, runs, confidence)) / degrees),
    ),
    (
        "one-value-divided",
        "The sum of the runs has more degrees of freedom than one value: they add up.",
        lambda degrees, runs, confidence: tuple(np.array(stats.chi2.interval(confidence, degrees)) / runs),
    ),
    (
        "one-sided",
        "Each bound leaves out the whole of the small probability; both together may leave it out, one half each.",
        lambda degrees, runs, confidence: tuple(stats.chi2.ppf([1 - confidence, confidence], degrees * runs) / runs),
    ),
    (
        "half-confidence",
        "Halve what lies outside, not the confidence.",
        lambda degrees, runs, confidence: tuple(stats.chi2.ppf([confidence / 2, 1 - confidence / 2], degrees * runs) / runs),
    ),
    (
        "normal",
        "That is the normal approximation; the chi-squared law itself is not symmetric.",
        _normal_bounds,
    ),
)


def bounds(degrees: int, runs: int, confidence: float) -> tuple[float, float]:
    return chi_squared_bounds(degrees, runs, confidence)


def bounds_arguments(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("g2")
    return [
        (int(rng.integers(2, 7)), int(rng.integers(8, 60)), float(rng.uniform(*limits)))
        for limits in ((0.85, 0.93), (0.96, 0.99))
    ]


# -- g3: the prediction


def predict(z: Array, p: Array, f: Callable, Phi: Callable, g: Callable, D_xi: Array) -> tuple[Array, Array]:
    return prediction_with()(z, p, f, Phi, g, D_xi)


def spread(Phi: Array, p: Array, g: Array, D_xi: Array) -> Array:
    return Phi @ p @ transpose(Phi) + g @ D_xi @ transpose(g)


def prediction_with(
    cov: Callable[[Array, Array, Array, Array], Array] = spread,
    at: Callable[[Array, Callable], Array] = lambda z, f: z,
    noise_at: Callable[[Array, Callable], Array] = lambda z, f: z,
    mean: Callable[[Array, Callable, Callable], Array] = lambda z, f, Phi: f(z),
) -> Answer:
    """A prediction with one thing changed: the covariance, the points where Phi and g are taken, or the mean."""

    def answer(z: Array, p: Array, f: Callable, Phi: Callable, g: Callable, D_xi: Array) -> tuple[Array, Array]:
        return mean(z, f, Phi), cov(Phi(at(z, f)), p, g(noise_at(z, f)), D_xi)

    return answer


def prediction_arguments(exercise: Exercise) -> list[tuple]:
    return [(*law(rng, n), one.f, one.Phi, one.g, one.D_xi) for one, rng, n, _ in cases(exercise, "g3")]


WRONG_PREDICTIONS: tuple[tuple[str, str, Answer], ...] = (
    (
        "jacobian-at-prediction",
        "The Jacobian is taken at the prediction; the function is expanded where the state is believed to be, at the estimate.",
        prediction_with(at=lambda z, f: f(z)),
    ),
    (
        "noise-at-prediction",
        "The factor of the noise is taken at the prediction; the noise acts on the state before the step.",
        prediction_with(noise_at=lambda z, f: f(z)),
    ),
    (
        "jacobian-transposed",
        "The Jacobian is transposed: in M p M^T the transposed one stands on the right.",
        prediction_with(lambda Phi, p, g, D: spread(transpose(Phi), p, g, D)),
    ),
    (
        "noise-forgotten",
        "The noise of the object is not added: a filter that believes its object to be undisturbed stops learning.",
        prediction_with(lambda Phi, p, g, D: Phi @ p @ transpose(Phi)),
    ),
    (
        "factor-forgotten",
        "The covariance of the noise is added without its factor g.",
        prediction_with(lambda Phi, p, g, D: Phi @ p @ transpose(Phi) + D),
    ),
    (
        "noise-covariance-forgotten",
        "The covariance of the noise is missing between its factors.",
        prediction_with(lambda Phi, p, g, D: spread(Phi, p, g, np.eye(len(D)))),
    ),
    (
        "noise-power",
        "The factor of the noise enters with the wrong power: a covariance goes with it on both sides.",
        prediction_with(lambda Phi, p, g, D: Phi @ p @ transpose(Phi) + g @ D),
    ),
    (
        "factor-transposed",
        "The factor of the noise is transposed: in g D g^T the transposed one stands on the right.",
        prediction_with(lambda Phi, p, g, D: Phi @ p @ transpose(Phi) + transpose(g) @ D @ g),
    ),
    (
        "covariance-squared",
        "The covariance of the noise enters twice, as if it were a root.",
        prediction_with(lambda Phi, p, g, D: spread(Phi, p, g, D @ D)),
    ),
    (
        "slope-power",
        "The Jacobian enters only once: a covariance goes with it on both sides.",
        prediction_with(lambda Phi, p, g, D: Phi @ p + g @ D @ transpose(g)),
    ),
    (
        "state-forgotten",
        "Only the noise is there: the uncertainty of the estimate comes through the equation too.",
        prediction_with(lambda Phi, p, g, D: g @ D @ transpose(g)),
    ),
    (
        "mean-by-jacobian",
        "The estimate is multiplied by the Jacobian; the prediction is the function itself at the estimate.",
        prediction_with(mean=lambda z, f, Phi: apply(Phi(z), z)),
    ),
    ("mean-kept", "The prediction is not the estimate: the object moves.", prediction_with(mean=lambda z, f, Phi: z)),
)

# -- g4: the correction


def correct(lam: Array, Psi: Array, y: Array, S: Callable, H: Callable, D_n: Callable) -> tuple[Array, Array]:
    G, R = H(lam), D_n(lam)
    z, p = laws.correct(Gaussian(lam, Psi), Measurement(S(lam), G, G @ Psi @ transpose(G) + R, R), y)
    return z, full(p, len(lam))


def of_gain(Psi: Array, G: Array, R: Array) -> Array:
    return gain(Psi @ transpose(G), G @ Psi @ transpose(G) + R)


def _root(R: Array) -> Array:
    return np.linalg.cholesky(symmetric(R))


def correction_with(
    K_of: Callable[[Array, Array, Array], Array] = of_gain,
    expected: Callable[[Array, Callable, Callable], Array] = lambda lam, S, H: S(lam),
    covariance: Callable[[Array, Array, Array], Array] = lambda Psi, K, G: Psi - K @ G @ Psi,
    sign: float = 1.0,
) -> Answer:
    """A correction with one thing changed."""

    def answer(lam: Array, Psi: Array, y: Array, S: Callable, H: Callable, D_n: Callable) -> tuple[Array, Array]:
        K = K_of(Psi, H(lam), D_n(lam))
        return lam + sign * apply(K, y - expected(lam, S, H)), covariance(Psi, K, H(lam))

    return answer


def correction_arguments(exercise: Exercise) -> list[tuple]:
    found = []
    for one, rng, n, p in cases(exercise, "g4"):
        lam, Psi = law(rng, n)
        found.append((lam, Psi, one.S(lam) + rng.normal(size=(RUNS, p)), one.S, one.H, one.D_n))
    return found


WRONG_CORRECTIONS: tuple[tuple[str, str, Answer], ...] = (
    (
        "noise-of-meter-forgotten",
        "The noise of the meter is missing in the covariance that the gain is divided by: the meter is taken as perfect.",
        correction_with(lambda Psi, G, R: gain(Psi @ transpose(G), G @ Psi @ transpose(G))),
    ),
    (
        "forms-mixed",
        "That gain puts the covariance of the prediction into the information form's formula, which has that of the estimate.",
        correction_with(lambda Psi, G, R: gain(Psi @ transpose(G), R)),
    ),
    (
        "noise-by-deviation",
        "A standard deviation stands where the covariance of the meter's noise belongs.",
        correction_with(lambda Psi, G, R: gain(Psi @ transpose(G), G @ Psi @ transpose(G) + _root(R))),
    ),
    (
        "gain-not-divided",
        "The gain is not divided by the covariance of the innovation.",
        correction_with(lambda Psi, G, R: Psi @ transpose(G)),
    ),
    (
        "gain-without-Psi",
        "The covariance of the prediction is missing in the gain: how sure was the filter before?",
        correction_with(lambda Psi, G, R: gain(transpose(G), G @ Psi @ transpose(G) + R)),
    ),
    (
        "expected-by-jacobian",
        "The prediction is multiplied by the Jacobian; what is expected of y is the signal itself at the prediction.",
        correction_with(expected=lambda lam, S, H: apply(H(lam), lam)),
    ),
    (
        "innovation-without-S",
        "The measurement itself is multiplied by the gain; subtract what was expected.",
        correction_with(expected=lambda lam, S, H: np.zeros(())),
    ),
    ("innovation-sign", "The innovation is what came minus what was expected.", correction_with(sign=-1.0)),
    (
        "covariance-kept",
        "The covariance is unchanged: a measurement must make the filter surer.",
        correction_with(covariance=lambda Psi, K, G: Psi),
    ),
    (
        "covariance-added",
        "The covariance grows: what the measurement explains is subtracted.",
        correction_with(covariance=lambda Psi, K, G: Psi + K @ G @ Psi),
    ),
    (
        "covariance-once",
        "K H is a share, without units: it has to be multiplied by Psi before it is subtracted from it.",
        correction_with(covariance=lambda Psi, K, G: Psi - K @ G),
    ),
    (
        "share-only",
        "I - K H is the share that remains; multiply Psi by it.",
        correction_with(covariance=lambda Psi, K, G: np.eye(Psi.shape[-1]) - K @ G),
    ),
)

# -- g5: a whole run

Run = tuple[Array, ...]  # z, p, lam, Psi


def run_filter(y: Array, mean: Array, cov: Array, f: Map, Phi: Map, g: Map, D_xi: Map, S: Map, H: Map, D_n: Map) -> Run:
    return run_with()(y, mean, cov, f, Phi, g, D_xi, S, H, D_n)


def run_with(
    prediction: Answer = predict,
    correction: Answer = correct,
    meter_at: Callable[[Array, Array], Array] = lambda lam, before: lam,
    object_at: Callable[[Array, Array], Array] = lambda z, lam: z,
    frozen: bool = False,
    first: bool = False,
) -> Answer:
    """A run with one thing changed.

    meter_at: (lam_k, z_{k-1}) -> where H is taken;  object_at: (z_k, lam_k) -> where Phi is taken;
    frozen: Psi is never handed on;  first: predicts before the first measurement.
    """

    def answer(
        y: Array,
        mean: Array,
        cov: Array,
        f: Callable,
        Phi: Callable,
        g: Callable,
        D_xi: Array,
        S: Callable,
        H: Callable,
        D_n: Callable,
    ) -> Run:
        lam, Psi = np.tile(mean, (y.shape[1], 1)), full(cov, y.shape[1])
        if first:
            lam, Psi = prediction(lam, Psi, f, Phi, g, D_xi)
        before, start, history = lam, Psi, []
        for value in y:
            z, p = correction(lam, Psi, value, S, fixed(H, meter_at(lam, before)), D_n)
            history.append((z, p, lam, Psi))
            before = z
            lam, Psi = prediction(z, p, f, fixed(Phi, object_at(z, lam)), g, D_xi)
            Psi = start if frozen else Psi
        return tuple(np.array(column) for column in zip(*history, strict=True))

    return answer


def fixed(function: Map, at: Array) -> Map:
    """The function's value at one place, wherever it is asked for."""
    return lambda _: function(at)


def _linearised_once(
    y: Array,
    mean: Array,
    cov: Array,
    f: Callable,
    Phi: Callable,
    g: Callable,
    D_xi: Array,
    S: Callable,
    H: Callable,
    D_n: Callable,
) -> Run:
    def at_start(function: Callable) -> Callable:
        return lambda x: function(np.tile(mean, (len(x), 1)))

    return run_filter(y, mean, cov, f, at_start(Phi), g, D_xi, S, at_start(H), D_n)


def _predictions_as_estimates(*arguments: Any) -> Run:
    _, _, lam, Psi = run_filter(*arguments)
    return lam, Psi, lam, Psi


def _predictions_of_next(y: Array, mean: Array, cov: Array, *functions: Any) -> Run:
    z, p, lam, Psi = run_filter(y, mean, cov, *functions)
    following = predict(z[-1], p[-1], *functions[:4])
    return z, p, np.array([*lam[1:], following[0]]), np.array([*Psi[1:], following[1]])


def run_arguments(exercise: Exercise) -> list[tuple]:
    found = []
    for one, rng, n, p in cases(exercise, "g5"):
        mean, cov = rng.normal(size=n), covariance(rng, n, 0.6)
        x = mean + rng.normal(size=(RUNS, n)) @ np.linalg.cholesky(cov).T
        y = []
        for _ in range(STEPS):
            y.append(one.S(x) + apply(_root(one.D_n(x)), rng.normal(size=(RUNS, p))))
            x = one.f(x) + apply(one.g(x) @ _root(one.D_xi), rng.normal(size=(RUNS, len(one.D_xi))))
        found.append((np.array(y), mean, cov, *one))
    return found


WRONG_RUNS: tuple[tuple[str, str, Answer], ...] = (
    (
        "predicted-first",
        "The filter predicts before the first measurement; the prior is already the law of x_0, so correct with y_0 first.",
        run_with(first=True),
    ),
    (
        "meter-jacobian-at-old-estimate",
        "The Jacobian of the meter is taken at the last estimate; the object has moved since: expand around the prediction.",
        run_with(meter_at=lambda lam, before: before),
    ),
    (
        "object-jacobian-at-prediction",
        "The Jacobian of the object is taken at the prediction for y_k; after the correction the estimate is the better place.",
        run_with(object_at=lambda z, lam: lam),
    ),
    (
        "linearised-once",
        "The Jacobians are taken at the prior mean for ever; the extended filter moves them along with its estimate.",
        _linearised_once,
    ),
    (
        "covariance-frozen",
        "The covariance starts anew at every step: hand Psi on, not only lam.",
        run_with(frozen=True),
    ),
    (
        "covariance-not-predicted",
        "The gain is made of the covariance of the last estimate; it needs that of the prediction, after the object has moved.",
        run_with(lambda z, p, *functions: (predict(z, p, *functions)[0], p)),
    ),
    (
        "predictions-for-estimates",
        "The first two results are the predictions, before each measurement; return the estimates, after it.",
        _predictions_as_estimates,
    ),
    (
        "predictions-shifted",
        "lam and Psi are one step late: return those that y_k was compared with, not those for y_{k+1}.",
        _predictions_of_next,
    ),
    *(
        (name, says, run_with(correction=wrong))
        for name, says, wrong in WRONG_CORRECTIONS
        if name in ("innovation-sign", "covariance-kept", "forms-mixed")
    ),
    *(
        (name, says, run_with(wrong))
        for name, says, wrong in WRONG_PREDICTIONS
        if name in ("noise-forgotten", "jacobian-transposed", "noise-at-prediction")
    ),
)

# -- g6: NEES and NIS

Normalised = Callable[..., tuple[Array, ...]]  # NEES, NIS


def innovation_covariance(Psi: Array, H: Array, D_n: Array) -> Array:
    return H @ Psi @ transpose(H) + D_n


def normalised_with(
    square: Callable[[Array, Array], Array] = normalised_square,
    F: Callable[[Array, Array, Array], Array] = innovation_covariance,
    error: Callable[[Array, Array, Array], Array] = lambda x, z, lam: x - z,
    error_cov: Callable[[Array, Array], Array] = lambda p, Psi: p,
    measured_at: Callable[[Array, Array], Array] = lambda z, lam: lam,
    per_component: bool = False,
) -> Normalised:
    """Mean NEES and NIS with one thing changed."""

    def answer(
        x: Array, z: Array, p: Array, y: Array, lam: Array, Psi: Array, S: Callable, H: Callable, D_n: Callable
    ) -> tuple[Array, Array]:
        state = square(error(x, z, lam), error_cov(p, Psi)).mean(axis=-1)
        measured = square(y - S(measured_at(z, lam)), F(Psi, H(lam), D_n(lam))).mean(axis=-1)
        return (state / x.shape[-1], measured / y.shape[-1]) if per_component else (state, measured)

    return answer


def consistency(x: Array, z: Array, p: Array, y: Array, lam: Array, Psi: Array, S: Map, H: Map, D_n: Map) -> tuple[Array, Array]:
    return normalised_with()(x, z, p, y, lam, Psi, S, H, D_n)


def _by_diagonal(vector: Array, cov: Array) -> Array:
    return (vector**2 / np.diagonal(cov, axis1=-2, axis2=-1)).sum(axis=-1)


def _by_deviation(vector: Array, cov: Array) -> Array:
    return (vector**2 / np.sqrt(np.diagonal(cov, axis1=-2, axis2=-1))).sum(axis=-1)


def _without_inverse(vector: Array, cov: Array) -> Array:
    return (vector * apply(cov, vector)).sum(axis=-1)


def _mean_first(
    x: Array, z: Array, p: Array, y: Array, lam: Array, Psi: Array, S: Callable, H: Callable, D_n: Callable
) -> tuple[Array, ...]:
    """The mean error normalised, instead of the mean of normalised errors."""
    F = innovation_covariance(Psi, H(lam), D_n(lam))
    pairs = ((x - z, p), (y - S(lam), F))
    return tuple(normalised_square(vector.mean(axis=1), cov.mean(axis=1)) for vector, cov in pairs)


def normalised_arguments(exercise: Exercise) -> list[tuple]:
    found = []
    for one, rng, n, p in cases(exercise, "g6"):
        shape = (STEPS, RUNS)
        z, lam = rng.normal(size=(2, *shape, n))
        p_, Psi = (np.array([[covariance(rng, n, scale) for _ in range(RUNS)] for _ in range(STEPS)]) for scale in (0.2, 0.5))
        x, y = z + 0.4 * rng.normal(size=z.shape), one.S(lam) + rng.normal(size=(*shape, p))
        found.append((x, z, p_, y, lam, Psi, one.S, one.H, one.D_n))
    return found


WRONG_NORMALISED: tuple[tuple[str, str, Normalised], ...] = (
    (
        "inverse-forgotten",
        "The covariance itself stands between the errors; its inverse belongs there: an unsure filter may err.",
        normalised_with(_without_inverse),
    ),
    (
        "noise-for-innovation",
        "The innovation is compared with the noise of the meter alone; its covariance has the part of the state too.",
        normalised_with(F=lambda Psi, H, D_n: D_n),
    ),
    (
        "noise-forgotten",
        "The noise of the meter is missing in the covariance of the innovation.",
        normalised_with(
            lambda vector, cov: (vector * apply(np.linalg.pinv(cov), vector)).sum(axis=-1),
            F=lambda Psi, H, D_n: H @ Psi @ transpose(H),
        ),
    ),
    (
        "residual-for-innovation",
        "The measurement is compared with the estimate, which knows it already; an innovation is taken from the prediction.",
        normalised_with(measured_at=lambda z, lam: z),
    ),
    (
        "prediction-for-estimate",
        "That is the error of the prediction; NEES is about the estimate.",
        normalised_with(error=lambda x, z, lam: x - lam, error_cov=lambda p, Psi: Psi),
    ),
    (
        "covariance-of-prediction",
        "The error of the estimate is compared with the covariance of the prediction.",
        normalised_with(error_cov=lambda p, Psi: Psi),
    ),
    (
        "correlations-ignored",
        "Only the variances of the components are used; the errors are correlated: use the inverse of the whole matrix.",
        normalised_with(_by_diagonal),
    ),
    ("by-deviation", "The squares are divided by standard deviations; variances belong there.", normalised_with(_by_deviation)),
    (
        "per-component",
        "Divided by the number of components; the plain mean is asked for: it should be n, or p.",
        normalised_with(per_component=True),
    ),
    ("mean-first", "The errors are averaged before they are squared; average the squares.", _mean_first),
)

# -- g7: the information form

Information = Callable[[Array, Array, Array], tuple[Array, Array]]


def information(W: Array, H: Array, D_n: Array) -> tuple[Array, Array]:
    return information_with()(W, H, D_n)


def information_with(
    added: Callable[[Array, Array], Array] = lambda H, D_n: transpose(H) @ np.linalg.solve(D_n, H),
    prior: Map = lambda W: W,
    inverted: bool = True,
    K_of: Callable[[Array, Array, Array, Array], Array] = lambda p, W, H, D_n: gain(p @ transpose(H), D_n),
) -> Information:
    """p and K with one thing changed."""

    def answer(W: Array, H: Array, D_n: Array) -> tuple[Array, Array]:
        total = prior(W) + added(H, D_n)
        p = np.linalg.solve(total, np.broadcast_to(np.eye(W.shape[-1]), W.shape))
        return (p if inverted else total), K_of(p if inverted else total, W, H, D_n)

    return answer


def _gain_from_prior(p: Array, W: Array, H: Array, D_n: Array) -> Array:
    return gain(np.linalg.pinv(W) @ transpose(H), D_n)


def information_arguments(exercise: Exercise) -> list[tuple]:
    found = []
    for place, (n, p) in enumerate(((3, 4), (exercise.model.n, exercise.model.n + 1))):
        rng = exercise.rng(f"g7-{place}")
        W = np.array([covariance(rng, n, 1.5) for _ in range(RUNS)])
        W[0] = 0.0  # nothing known before
        H = rng.normal(size=(RUNS, p, n)) + np.sign(rng.normal(size=(RUNS, p, n)))
        D_n = np.array([covariance(rng, p, 0.4) for _ in range(RUNS)])
        found.append((W, H, D_n))
    return found


WRONG_INFORMATION: tuple[tuple[str, str, Information], ...] = (
    (
        "inverse-forgotten",
        "That is the information, not the covariance: invert the sum.",
        information_with(inverted=False),
    ),
    (
        "inverse-forgotten-in-p",
        "That is the information, not the covariance: invert the sum.",
        lambda W, H, D_n: (information_with(inverted=False)(W, H, D_n)[0], information(W, H, D_n)[1]),
    ),
    (
        "noise-not-inverted",
        "The covariance of the noise multiplies; a noisy measurement must tell less: its inverse belongs there.",
        information_with(added=lambda H, D_n: transpose(H) @ D_n @ H),
    ),
    (
        "prior-inverted",
        "W is an information already and is not inverted again; where nothing is known it has no inverse.",
        information_with(prior=np.linalg.pinv),
    ),
    (
        "prior-ignored",
        "Only the measurement's information is there: what was known before is added to it.",
        information_with(prior=lambda W: 0 * W),
    ),
    (
        "information-subtracted",
        "Information is added: a measurement cannot take any away.",
        information_with(added=lambda H, D_n: -transpose(H) @ np.linalg.solve(D_n, H)),
    ),
    (
        "gain-from-prediction",
        "The gain of this form has the covariance of the estimate, not that of the prediction.",
        information_with(K_of=_gain_from_prior),
    ),
    (
        "gain-not-divided",
        "The gain is not divided by the covariance of the noise.",
        information_with(K_of=lambda p, W, H, D_n: p @ transpose(H)),
    ),
    (
        "gain-by-information",
        "The gain is multiplied by the information; the covariance, its inverse, belongs there.",
        lambda W, H, D_n: (information(W, H, D_n)[0], information_with(inverted=False)(W, H, D_n)[1]),
    ),
)

TWO = ("z", "p")
QUESTIONS = (
    Question(
        "g1",
        "a Jacobian by differences",
        "warm-up",
        jacobian,
        jacobian_arguments,
        catalogue(WRONG_JACOBIANS),
        tolerance=1e-8,
    ),
    Question("g2", "bounds", "warm-up", bounds, bounds_arguments, catalogue(WRONG_BOUNDS), ("low", "high")),
    Question(
        "g3",
        "the prediction",
        "core",
        predict,
        prediction_arguments,
        catalogue(WRONG_PREDICTIONS),
        ("lam", "Psi"),
    ),
    Question("g4", "the correction, in the gain form", "core", correct, correction_arguments, catalogue(WRONG_CORRECTIONS), TWO),
    Question("g5", "a run", "core", run_filter, run_arguments, catalogue(WRONG_RUNS), ("z", "p", "lam", "Psi")),
    Question(
        "g6",
        "NEES and NIS",
        "core",
        consistency,
        normalised_arguments,
        catalogue(WRONG_NORMALISED),
        ("NEES", "NIS"),
    ),
    Question(
        "g7",
        "the information form",
        "stretch",
        information,
        information_arguments,
        catalogue(WRONG_INFORMATION),
        ("p", "K"),
    ),
)

SET = ExerciseSet("g", "The extended Kalman filter and its consistency", Path(__file__).parent, QUESTIONS)
