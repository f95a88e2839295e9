"""Known mistakes in one step: moments (f1), correction (f2), prediction (f3)."""

from __future__ import annotations

import numpy as np

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.f_exact.companion import Law
from kfcourse.exercises.f_exact.keys import (
    Kernel,
    correct,
    correction_with,
    moments,
    normal,
    normalised,
    predict,
    prediction_with,
)
from kfcourse.laws import Array

# -- f1: mass, mean and variance


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


def _median(density: Array, x: Array) -> Array:
    return x[np.searchsorted(np.cumsum(density), density.sum() / 2)]


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
    ("about-zero", messages.ABOUT_ZERO, _second_moment),
    ("deviation", messages.DEVIATION_FOR_VARIANCE, _deviation),
    (
        "mode",
        "That is where the density is highest, not its mean.",
        lambda density, x: (normalised(density, x), x[np.argmax(density)], moments(density, x)[2]),
    ),
    (
        "median",
        "That is the median; the mean is asked for.",
        lambda density, x: (normalised(density, x), _median(density, x), moments(density, x)[2]),
    ),
    (
        "highest-is-one",
        "The density is divided by its highest value; it is the integral that has to be one.",
        lambda density, x: _not_normalised(density / density.max(), x),
    ),
    (
        "mean-subtracted-twice",
        "The mean is subtracted twice: the deviations are about it already.",
        lambda density, x: (*moments(density, x)[:2], moments(density, x)[2] - moments(density, x)[1] ** 2),
    ),
)


# -- f2: the correction


def log_normal(value: Array, mean: Array, variance: Array) -> Array:
    """The logarithm of the normal density."""
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
    (
        "variance-in-factor",
        "The factor before the exponential has a standard deviation below, not a variance.",
        lambda value, mean, variance: normal(value, mean, variance) / np.sqrt(variance),
    ),
    (
        "half-a-factor",
        "The factor before the exponential is not complete: the variance depends on the state, and belongs there too.",
        lambda value, mean, variance: normal(value, mean, variance) * np.sqrt(variance),
    ),
    (
        "exponent-sign",
        "The exponent has the wrong sign: far away the density is small.",
        lambda value, mean, variance: (
            np.exp(np.minimum((value - mean) ** 2 / (2 * variance), 600)) / np.sqrt(2 * np.pi * variance)
        ),
    ),
    (
        "not-squared",
        "The deviation is not squared in the exponent.",
        lambda value, mean, variance: np.exp(-(value - mean) / (2 * variance)) / np.sqrt(2 * np.pi * variance),
    ),
    (
        "half-variance",
        "That is a normal density with half of the variance.",
        lambda value, mean, variance: normal(value, mean, variance / 2),
    ),
    (
        "double-exponential",
        "That is another density than the normal one: its exponent is quadratic.",
        lambda value, mean, variance: np.exp(-np.abs(value - mean) / variance) / (2 * variance),
    ),
    (
        "mean-variance",
        "One variance is taken for all states; it depends on the state.",
        lambda value, mean, variance: normal(value, mean, np.mean(variance)),
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
        "posterior-integrated",
        "A posterior density integrates to one whatever was measured; the integral of the product before that is asked for.",
        correction_with(finish=lambda joint, h: (joint / (h * joint.sum()), 1.0)),
    ),
    (
        "constant-inverted",
        "You return the constant C itself; its inverse, the density of the measurement, is asked for.",
        correction_with(finish=lambda joint, h: (joint / (h * joint.sum()), 1 / (h * joint.sum()))),
    ),
    (
        "likelihood-summed",
        "The integral of the likelihood alone is no probability; it has to be weighed by the prediction.",
        lambda predicted, y, x, see: (correct(predicted, y, x, see)[0], (x[1] - x[0]) * normal(np.asarray(y), *see(x)).sum()),
    ),
    (
        "logarithm",
        "That is the logarithm of the density of the measurement; the density itself is asked for.",
        correction_with(finish=lambda joint, h: (joint / (h * joint.sum()), np.log(h * joint.sum()))),
    ),
    (
        "signal-forgotten",
        "The measurement is compared with the state itself; its mean is what the meter makes of the state.",
        lambda predicted, y, x, see: correct(predicted, y, x, lambda nodes: (nodes, see(nodes)[1])),
    ),
    (
        "largest-for-integral",
        "The largest value of the product stands where its integral belongs.",
        correction_with(finish=lambda joint, h: (joint / joint.max(), joint.max())),
    ),
    (
        "normal-evidence",
        "The density of the measurement is taken as normal; it is the integral of the product.",
        lambda predicted, y, x, see: (
            correct(predicted, y, x, see)[0],
            normal(np.asarray(y), *((x[1] - x[0]) * part @ predicted for part in see(x))),
        ),
    ),
)


# -- f3: the prediction


def _variance_of_target(posterior: Array, x: Array, move: Law) -> Array:
    mean, variance = move(x)
    return (x[1] - x[0]) * normal(x[:, None], mean, variance[:, None]) @ posterior


def _object_at_rest(posterior: Array, x: Array, move: Law) -> Array:
    return predict(posterior, x, lambda nodes: (nodes, move(nodes)[1]))


def _normal_prediction(posterior: Array, x: Array, move: Law) -> Array:
    """With the right variance: the mean of the variances, and the variance of the means."""
    h, (mean, variance) = x[1] - x[0], move(x)
    z = h * mean @ posterior
    return normal(x, z, h * (variance + mean**2) @ posterior - z**2)


NORMAL_PREDICTION = "A normal density takes the place of the integral; the law after a step is as a rule not normal."

WRONG_PREDICTIONS: tuple[tuple[str, str, Answer], ...] = (
    *((name, says, prediction_with(kernel)) for name, says, kernel in WRONG_KERNELS),
    (
        "normalised",
        "The result is normalised; a prediction loses the mass that leaves the grid, and that should be seen.",
        lambda posterior, x, move: predict(posterior, x, move) / ((x[1] - x[0]) * predict(posterior, x, move).sum()),
    ),
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
    ("object-at-rest", "Each node spreads around itself; it spreads around where the object takes it.", _object_at_rest),
    (
        "node-by-node",
        "Each node is weighed with itself; every node before the step can lead to every node after it: sum over them.",
        lambda posterior, x, move: normal(x, *move(x)) * posterior,
    ),
    (
        "not-spread",
        "The nodes are moved, but the noise of the object does not spread them.",
        lambda posterior, x, move: np.interp(x, move(x)[0], posterior),
    ),
    ("normal-prediction", NORMAL_PREDICTION, _normal_prediction),
    (
        "normal-prediction",
        NORMAL_PREDICTION,
        lambda posterior, x, move: normal(x, *((x[1] - x[0]) * part @ posterior for part in move(x))),
    ),
)
