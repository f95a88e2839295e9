"""Questions of set f: the Stratonovich equation on a grid, for a scalar model whose noises enter linearly.

Answers are functions of densities at the nodes x (M,), at equal distances, and of the two conditional laws: move(x) and see(x)
return mean and variance of the next state and of the measurement, given the state x; (M,) -> (M,), (M,).

The hidden densities are smooth, resolved by their nodes, and vanish at both ends of the grid, so that all rules of
integration agree.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from kfcourse.checks.exercises import Exercise
from kfcourse.checks.question import Answer, Question, catalogue
from kfcourse.checks.registry import ExerciseSet
from kfcourse.lab.short_names import has_exact
from kfcourse.laws import Array
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import linearised

Law = Callable[[Array], tuple[Array, Array]]
Kernel = Callable[[Array, Array, Array], Array]  # density of a value, given mean and variance

# A companion's numbers: from, to; m is the mean of its x_0.
COMPANION = {"c": (0.75, 0.95), "e": (0.3, 0.5), "g": (0.4, 0.8), "h": (0.4, 0.7), "f": (0.3, 0.5), "m": (0.2, 0.8)}


def companion_numbers(exercise: Exercise) -> dict[str, float]:
    """Numbers of a scalar companion of the variant; none if the exact filter exists for the variant's own model."""
    if has_exact(exercise.model):
        return {}
    rng = exercise.rng("companion")
    return {name: round(float(rng.uniform(*limits)), 2) for name, limits in COMPANION.items()}


def scalar_model(exercise: Exercise) -> Model:
    """The variant's model if the exact filter exists for it, else a scalar companion with numbers of the variant's own.

    x_{k+1} = c x_k + e v_k,    y_k = g x_k + h x_k^2 + f w_k,    x_0 ~ N(m, 1)
    """
    numbers = companion_numbers(exercise)
    if not numbers:
        return exercise.model
    prior = {"mean": numbers.pop("m"), "variance": 1}
    return Model.define("c*x + e*v", "g*x + h*x**2 + f*w", numbers, prior=prior)


def laws(model: Model) -> tuple[Law, Law]:
    """move(x) and see(x) of a scalar model: mean (M,) and variance (M,) of the next state and of y, given the state x (M,).

    These are the linearised structural functions at a state that is known exactly.
    """
    structure = linearised(model)

    def given(x: Array, law: Callable[[Array, Array], tuple[Array, Array]]) -> tuple[Array, Array]:
        x = np.asarray(x, dtype=float)
        mean, variance = law(x[:, None], np.zeros((len(x), 1, 1)))
        return np.array(np.broadcast_to(mean[..., 0], x.shape)), np.array(np.broadcast_to(variance[..., 0, 0], x.shape))

    def measured(x: Array, known: Array) -> tuple[Array, Array]:
        measurement = structure.measure(x, known)
        return measurement.h, measurement.F

    return lambda x: given(x, structure.predict), lambda x: given(x, measured)


# -- hidden densities and laws


def nodes(count: int = 240) -> Array:
    return np.linspace(-7.3, 8.1, count)


def density(exercise: Exercise, name: str) -> Array:
    """A hidden density at `nodes()`: two humps, not normalised."""
    rng, x = exercise.rng(name), nodes()
    centres, widths, weights = (
        rng.uniform([-1.2, 0.9], [-0.4, 1.6]),
        rng.uniform(0.5, 0.7, 2),
        rng.uniform([1.5, 0.6], [2.5, 1.0]),
    )
    return sum(w * np.exp(-((x - c) ** 2) / (2 * s**2)) for c, s, w in zip(centres, widths, weights, strict=True))


def normalised(density: Array, x: Array) -> Array:
    return density / (density.sum() * (x[1] - x[0]))


def hidden_law(exercise: Exercise, name: str) -> Law:
    """A hidden nonlinear law, with a variance that depends on the state."""
    slope, bend, level, rise = exercise.rng(name).uniform([0.6, 0.3, 0.15, 0.05], [0.9, 0.5, 0.25, 0.1])
    return lambda x: (slope * x + bend * np.sin(x) + level, level + rise * np.sin(x) ** 2 + rise * np.cos(x / 2) ** 2)


# -- f1: mass, mean and variance


def moments(density: Array, x: Array) -> tuple[Array, Array, Array]:
    h = x[1] - x[0]
    density = normalised(density, x)
    mean = h * np.sum(density * x)
    return density, mean, h * np.sum(density * (x - mean) ** 2)


def _not_normalised(density: Array, x: Array) -> tuple[Array, Array, Array]:
    h = x[1] - x[0]
    mean = h * np.sum(density * x)
    return density, mean, h * np.sum(density * (x - mean) ** 2)


def _without_step(density: Array, x: Array) -> tuple[Array, Array, Array]:
    density = normalised(density, x)
    mean = np.sum(density * x)
    return density, mean, np.sum(density * (x - mean) ** 2)


def _second_moment(density: Array, x: Array) -> tuple[Array, Array, Array]:
    density, mean, variance = moments(density, x)
    return density, mean, variance + mean**2


def _deviation(density: Array, x: Array) -> tuple[Array, Array, Array]:
    density, mean, variance = moments(density, x)
    return density, mean, np.sqrt(variance)


WRONG_MOMENTS: tuple[tuple[str, str, Answer], ...] = (
    ("not-normalised", "The density is not normalised: its integral has to be one before moments are taken.", _not_normalised),
    (
        "step-forgotten",
        "The values at the nodes add up to one. It is the integral that is one; the step of the grid is missing.",
        lambda density, x: (density / density.sum(), *moments(density, x)[1:]),
    ),
    ("step-forgotten", "An integral is approximated by a sum times the step of the grid; the step is missing.", _without_step),
    (
        "weights-forgotten",
        "That is a moment of the nodes themselves; the density has to weigh them.",
        lambda density, x: (normalised(density, x), x.mean(), x.var()),
    ),
    ("about-zero", "It is the second moment about zero; a variance is about the mean.", _second_moment),
    ("deviation", "It is a standard deviation; the variance is asked for.", _deviation),
    (
        "mode",
        "That is where the density is highest, not its mean.",
        lambda density, x: (density / density.max(), x[np.argmax(density)], moments(density, x)[2]),
    ),
)

# -- f2: the correction


def normal(value: Array, mean: Array, variance: Array) -> Array:
    return np.exp(-((value - mean) ** 2) / (2 * variance)) / np.sqrt(2 * np.pi * variance)


def correct(predicted: Array, y: float, x: Array, see: Law) -> tuple[Array, Array]:
    return correction_with()(predicted, y, x, see)


def correction_with(
    kernel: Kernel = normal,
    combine: Callable[[Array, Array], Array] = lambda predicted, likelihood: predicted * likelihood,
    finish: Callable[[Array, float], tuple[Array, Any]] = lambda joint, h: (joint / (h * joint.sum()), h * joint.sum()),
) -> Answer:
    """A correction with one thing changed: the likelihood, what is done with it, or the normalisation."""

    def answer(predicted: Array, y: float, x: Array, see: Law) -> tuple[Array, Array]:
        return finish(combine(predicted, kernel(np.asarray(y), *see(x))), x[1] - x[0])

    return answer


def log_normal(value: Array, mean: Array, variance: Array) -> Array:
    return -0.5 * ((value - mean) ** 2 / variance + np.log(2 * np.pi * variance))


WRONG_KERNELS: tuple[tuple[str, str, Kernel], ...] = (
    (
        "deviation-for-variance",
        "A standard deviation stands where the variance belongs in the normal density.",
        lambda value, mean, variance: normal(value, mean, np.sqrt(variance)),
    ),
    (
        "variance-for-deviation",
        "A variance stands where the standard deviation belongs: the scale of scipy's norm is a standard deviation.",
        lambda value, mean, variance: normal(value, mean, variance**2),
    ),
    (
        "factor-forgotten",
        "The factor before the exponential is missing in the normal density; it matters, as the variance depends on the state.",
        lambda value, mean, variance: np.exp(-((value - mean) ** 2) / (2 * variance)),
    ),
    (
        "half-forgotten",
        "The exponent of the normal density lacks its factor one half.",
        lambda value, mean, variance: np.exp(-((value - mean) ** 2) / variance) / np.sqrt(2 * np.pi * variance),
    ),
)

WRONG_CORRECTIONS: tuple[tuple[str, str, Answer], ...] = (
    *((name, says, correction_with(kernel)) for name, says, kernel in WRONG_KERNELS),
    (
        "not-normalised",
        "The product is not a density yet: it has to be divided by its integral.",
        correction_with(finish=lambda joint, h: (joint, h * joint.sum())),
    ),
    (
        "step-forgotten",
        "The step of the grid is missing: the integral, not the sum of the values, is what the product is divided by.",
        correction_with(finish=lambda joint, h: (joint / joint.sum(), joint.sum())),
    ),
    (
        "log-likelihood",
        "The logarithm of the likelihood stands where the likelihood itself belongs.",
        correction_with(log_normal),
    ),
    (
        "added",
        "Likelihood and prediction are added; by Bayes' rule they are multiplied.",
        correction_with(combine=lambda predicted, likelihood: predicted + likelihood),
    ),
    (
        "prediction-ignored",
        "That is the likelihood alone: what the filter knew before is not used.",
        correction_with(combine=lambda predicted, likelihood: likelihood),
    ),
    (
        "measurement-ignored",
        "The prediction comes back unchanged: the measurement is not used.",
        correction_with(combine=lambda predicted, likelihood: predicted),
    ),
    (
        "constant-inverted",
        "You return the constant C itself; its inverse, the density of the measurement, is asked for.",
        correction_with(finish=lambda joint, h: (joint / (h * joint.sum()), 1 / (h * joint.sum()))),
    ),
    (
        "likelihood-summed",
        "The integral of the likelihood alone is no probability; it has to be weighed by the prediction.",
        lambda predicted, y, x, see: (
            correct(predicted, y, x, see)[0],
            (x[1] - x[0]) * normal(np.asarray(y), *see(x)).sum(),
        ),
    ),
)


def correction_arguments(exercise: Exercise) -> list[tuple]:
    x, see = nodes(), hidden_law(exercise, "f2")
    predicted = normalised(density(exercise, "f2"), x)
    return [(predicted, float(y), x, see) for y in exercise.rng("f2-y").uniform([0.5, -1.2], [1.5, -0.4])]


# -- f3: the prediction


def prediction_with(kernel: Kernel = normal, total: Callable[[Array, Array, float], Array] = lambda P, p, h: h * P @ p) -> Answer:
    """A prediction with one thing changed; P[i, j] is the density of going from node j to node i, (M, M)."""

    def answer(posterior: Array, x: Array, move: Law) -> Array:
        mean, variance = move(x)
        return total(kernel(x[:, None], mean, variance), posterior, x[1] - x[0])

    return answer


def predict(posterior: Array, x: Array, move: Law) -> Array:
    return prediction_with()(posterior, x, move)


def _variance_of_target(posterior: Array, x: Array, move: Law) -> Array:
    mean, variance = move(x)
    return (x[1] - x[0]) * normal(x[:, None], mean, variance[:, None]) @ posterior


def _object_at_rest(posterior: Array, x: Array, move: Law) -> Array:
    return predict(posterior, x, lambda nodes: (nodes, move(nodes)[1]))


WRONG_PREDICTIONS: tuple[tuple[str, str, Answer], ...] = (
    *((name, says, prediction_with(kernel)) for name, says, kernel in WRONG_KERNELS),
    (
        "transposed",
        "The matrix is transposed: the sum runs over the state after the step. Integrate over the state before it.",
        prediction_with(total=lambda P, p, h: h * P.T @ p),
    ),
    (
        "step-forgotten",
        "The step of the grid is missing in the integral: the result does not integrate to one.",
        prediction_with(total=lambda P, p, h: P @ p),
    ),
    (
        "not-predicted",
        "The posterior comes back unchanged: the object moves and is shaken meanwhile.",
        prediction_with(total=lambda P, p, h: p),
    ),
    (
        "posterior-ignored",
        "The transition density is integrated alone; weigh it by the posterior density of the state before the step.",
        prediction_with(total=lambda P, p, h: h * P.sum(axis=1)),
    ),
    (
        "variance-of-target",
        "The variance of the step is taken at the state after it; it belongs to the state before it.",
        _variance_of_target,
    ),
    (
        "object-at-rest",
        "Each node spreads around itself; it spreads around where the object takes it.",
        _object_at_rest,
    ),
)


def prediction_arguments(exercise: Exercise) -> list[tuple]:
    x = nodes()
    return [(normalised(density(exercise, "f3"), x), x, hidden_law(exercise, "f3"))]


# -- f4: a whole run


def run_filter(y: Array, x: Array, prior: Array, move: Law, see: Law) -> tuple[Array, Array, Array]:
    return run_with()(y, x, prior, move, see)


def run_with(
    correction: Answer = correct,
    prediction: Answer = predict,
    moments: Answer = moments,
    again: bool = False,
    before: bool = False,
) -> Answer:
    """A run with one thing changed.

    again: every step starts from the prior;  before: moments of the predictions.
    """

    def densities(y: Array, x: Array, prior: Array, move: Law, see: Law) -> Iterator[tuple[Array, Array, Any]]:
        predicted = prior
        for value in y:
            missing = np.isnan(value)
            posterior, evidence = (predicted, 1.0) if missing else correction(predicted, float(value), x, see)
            yield predicted, posterior, evidence
            predicted = prior if again else prediction(posterior, x, move)

    def answer(y: Array, x: Array, prior: Array, move: Law, see: Law) -> tuple[Array, Array, Array]:
        found = list(densities(y, x, prior, move, see))
        _, z, p = zip(*(moments(step[0] if before else step[1], x) for step in found), strict=True)
        return np.array(z), np.array(p), np.sum(np.log([step[2] for step in found]))

    return answer


def _predicted_first(y: Array, x: Array, prior: Array, move: Law, see: Law) -> tuple[Array, Array, Array]:
    return run_filter(y, x, predict(prior, x, move), move, see)


def _zeros_for_missing(y: Array, x: Array, prior: Array, move: Law, see: Law) -> tuple[Array, Array, Array]:
    return run_filter(np.nan_to_num(y), x, prior, move, see)


def _not_predicted_over_gaps(y: Array, x: Array, prior: Array, move: Law, see: Law) -> tuple[Array, Array, Array]:
    """A missing measurement skips the whole step, prediction and all: the estimates before it are repeated."""
    z, p, total = run_filter(y[~np.isnan(y)], x, prior, move, see)
    last = np.maximum(np.cumsum(~np.isnan(y)) - 1, 0)
    return z[last], p[last], total


def _after_run(change: Callable[[Array], Any]) -> Answer:
    """The right run, with another last result made of the densities of the measurements."""

    def answer(y: Array, x: Array, prior: Array, move: Law, see: Law) -> tuple[Array, Array, Array]:
        evidences = []

        def remembered(*arguments: Any) -> tuple[Array, Array]:
            posterior, evidence = correct(*arguments)
            evidences.append(evidence)
            return posterior, evidence

        z, p, _ = run_with(remembered)(y, x, prior, move, see)
        return z, p, change(np.array(evidences))

    return answer


WRONG_RUNS: tuple[tuple[str, str, Answer], ...] = (
    (
        "predicted-first",
        "The filter predicts before the first measurement; the prior is already the law of x_0, so correct with y_0 first.",
        _predicted_first,
    ),
    (
        "prior-again",
        "Every step starts from the prior again, as if nothing had been measured before: hand the prediction on.",
        run_with(again=True),
    ),
    (
        "not-predicted",
        "The posterior is corrected again without a prediction: the object moves between two measurements.",
        run_with(prediction=lambda posterior, x, move: posterior),
    ),
    ("predictions-returned", "These are the moments before each measurement; return those after it.", run_with(before=True)),
    (
        "missing-as-zero",
        "A missing measurement is treated as the number 0; it says nothing, so the prediction stays.",
        _zeros_for_missing,
    ),
    (
        "missing-step-skipped",
        "Where a measurement is missing the whole step is left out; the object moves all the same.",
        _not_predicted_over_gaps,
    ),
    (
        "mode",
        "The estimate is where the density is highest; the best one is its mean.",
        run_with(moments=lambda density, x: (density, x[np.argmax(density)], moments(density, x)[2])),
    ),
    ("about-zero", "It is the second moment about zero; a variance is about the mean.", run_with(moments=_second_moment)),
    ("deviation", "It is a standard deviation; the variance is asked for.", run_with(moments=_deviation)),
    ("product", "It is the product of the densities; its logarithm is asked for.", _after_run(np.prod)),
    ("sum-of-densities", "The densities are added; the logarithms add, as the densities multiply.", _after_run(np.sum)),
    ("last-only", "That is the last step alone; all measurements count.", _after_run(lambda all_: np.log(all_[-1]))),
    (
        "constant-inverted",
        "The sign is that of the constants C; the density of a measurement is 1/C.",
        _after_run(lambda e: -np.log(e).sum()),
    ),
    *(
        (name, says, run_with(correction=wrong))
        for name, says, wrong in WRONG_CORRECTIONS
        if name in ("prediction-ignored", "deviation-for-variance", "variance-for-deviation", "factor-forgotten")
    ),
    *((name, says, run_with(prediction=wrong)) for name, says, wrong in WRONG_PREDICTIONS if name == "transposed"),
)


def run_arguments(exercise: Exercise) -> list[tuple]:
    x, move, see = nodes(), hidden_law(exercise, "f4-move"), hidden_law(exercise, "f4-see")
    y = exercise.rng("f4-y").uniform(0.4, 1.4, 6) * [1, -1, 1, 1, -1, 1]
    gaps = np.where(np.arange(len(y)) == 3, np.nan, y)
    return [(values, x, normalised(density(exercise, "f4"), x), move, see) for values in (y, gaps)]


# -- f5: how many nodes


def nodes_needed(low: float, high: float, sigma: float, error: float) -> Array:
    return nodes_with()(low, high, sigma, error)


def nodes_with(
    step: Callable[[float, float], float] = lambda sigma, error: np.pi * sigma * np.sqrt(2 / np.log(2 / error)),
    rounded: Callable[[float], float] = np.ceil,
    ends: int = 1,
) -> Answer:
    """A number of nodes with another step, or counted otherwise."""
    return lambda low, high, sigma, error: np.asarray(rounded((high - low) / step(sigma, error)) + ends)


WRONG_NODES: tuple[tuple[str, str, Answer], ...] = (
    ("intervals", "That is the number of intervals; there is one node more.", nodes_with(ends=0)),
    (
        "rounded-down",
        "Rounded to too few: with one interval less the step is too long. Round up.",
        nodes_with(rounded=np.floor),
    ),
    (
        "variance",
        "A variance stands where the standard deviation belongs.",
        nodes_with(lambda sigma, error: np.pi * sigma**2 * np.sqrt(2 / np.log(2 / error))),
    ),
    (
        "factor-before",
        "The factor 2 before the exponential is missing.",
        nodes_with(lambda sigma, error: np.pi * sigma * np.sqrt(2 / np.log(1 / error))),
    ),
    (
        "factor-inside",
        "The factor 2 in the exponent is missing.",
        nodes_with(lambda sigma, error: np.pi * sigma / np.sqrt(np.log(2 / error))),
    ),
    (
        "decimal-logarithm",
        "A decimal logarithm stands in the place of the natural one.",
        nodes_with(lambda sigma, error: np.pi * sigma * np.sqrt(2 / np.log10(2 / error))),
    ),
    (
        "root-forgotten",
        "The step enters the exponent squared: a root is missing.",
        nodes_with(lambda sigma, error: np.pi * sigma * 2 / np.log(2 / error)),
    ),
    (
        "one-each",
        "That is one node for each standard deviation, whatever the error asked for.",
        nodes_with(lambda sigma, error: sigma),
    ),
)


def nodes_arguments(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("f5")
    return [
        (-rng.uniform(2, 5), rng.uniform(3, 7), rng.uniform(0.002, 0.01), 10 ** -rng.uniform(exponent, exponent + 1))
        for exponent in (3, 6, 9)
    ]


QUESTIONS = (
    Question(
        "f1",
        "mass, mean and variance",
        "warm-up",
        moments,
        lambda e: [(density(e, "f1"), nodes())],
        catalogue(WRONG_MOMENTS),
        ("density", "mean", "variance"),
    ),
    Question(
        "f2",
        "the correction",
        "core",
        correct,
        correction_arguments,
        catalogue(WRONG_CORRECTIONS),
        ("posterior", "density of y"),
    ),
    Question("f3", "the prediction", "core", predict, prediction_arguments, catalogue(WRONG_PREDICTIONS)),
    Question("f4", "a run", "core", run_filter, run_arguments, catalogue(WRONG_RUNS), ("z", "p", "ln p(y)")),
    Question("f5", "how many nodes", "stretch", nodes_needed, nodes_arguments, catalogue(WRONG_NODES)),
)

SET = ExerciseSet("f", "The exact filter on a grid", Path(__file__).parent, QUESTIONS, companion_numbers)
