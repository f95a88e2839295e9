"""Keys of set f: moments, correction and prediction of a density at nodes, a run, and how many nodes are needed.

A key is the function with nothing changed that `..._with` makes; with one thing changed that is a known mistake.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from kfcourse.checks.question import Answer
from kfcourse.exercises.f_exact.companion import Law
from kfcourse.laws import Array

Kernel = Callable[[Array, Array, Array], Array]  # density of a value, given mean and variance


def normalised(density: Array, x: Array) -> Array:
    """The density over its integral."""
    return density / (density.sum() * (x[1] - x[0]))


# -- f1: mass, mean and variance


def moments(density: Array, x: Array) -> tuple[Array, Array, Array]:
    """The normalised density, its mean and its variance."""
    h = x[1] - x[0]
    density = normalised(density, x)
    mean = h * np.sum(density * x)
    return density, mean, h * np.sum(density * (x - mean) ** 2)


# -- f2: the correction


def normal(value: Array, mean: Array, variance: Array) -> Array:
    """The normal density at the value."""
    return np.exp(-((value - mean) ** 2) / (2 * variance)) / np.sqrt(2 * np.pi * variance)


def correct(predicted: Array, y: float, x: Array, see: Law) -> tuple[Array, Array]:
    """Bayes' rule: the posterior density, and the density of the measurement."""
    return correction_with()(predicted, y, x, see)


def correction_with(
    kernel: Kernel = normal,
    combine: Callable[[Array, Array], Array] = lambda predicted, likelihood: predicted * likelihood,
    finish: Callable[[Array, float], tuple[Array, Array]] = lambda joint, h: (joint / (h * joint.sum()), h * joint.sum()),
) -> Answer:
    """A correction with one thing changed: the likelihood, what is done with it, or the normalisation."""

    def answer(predicted: Array, y: float, x: Array, see: Law) -> tuple[Array, Array]:
        return finish(combine(predicted, kernel(np.asarray(y), *see(x))), x[1] - x[0])

    return answer


# -- f3: the prediction


def prediction_with(kernel: Kernel = normal, total: Callable[[Array, Array, float], Array] = lambda P, p, h: h * P @ p) -> Answer:
    """A prediction with one thing changed; P[i, j] is the density of going from node j to node i, (M, M)."""

    def answer(posterior: Array, x: Array, move: Law) -> Array:
        mean, variance = move(x)
        return total(kernel(x[:, None], mean, variance), posterior, x[1] - x[0])

    return answer


def predict(posterior: Array, x: Array, move: Law) -> Array:
    """The transition density integrated over the posterior."""
    return prediction_with()(posterior, x, move)


# -- f4: a whole run


def run_filter(y: Array, x: Array, prior: Array, move: Law, see: Law) -> tuple[Array, Array, Array]:
    """Means, variances and ln p(y); a missing measurement (NaN) leaves the prediction."""
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


# -- f5: how many nodes


def nodes_needed(low: float, high: float, sigma: float, error: float) -> Array:
    """Nodes from low to high so that the rule's error, 2 exp(-2 (pi sigma/h)^2), is at most `error`."""
    return nodes_with()(low, high, sigma, error)


def nodes_with(
    step: Callable[[float, float], float] = lambda sigma, error: np.pi * sigma * np.sqrt(2 / np.log(2 / error)),
    rounded: Callable[[float], float] = np.ceil,
    ends: int = 1,
) -> Answer:
    """A number of nodes with another step, or counted otherwise."""
    return lambda low, high, sigma, error: np.asarray(rounded((high - low) / step(sigma, error)) + ends)
