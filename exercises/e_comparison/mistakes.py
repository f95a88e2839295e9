"""Known mistakes of set e, question by question, and what is said of each."""

from __future__ import annotations

import numpy as np

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.e_comparison.keys import (
    difference,
    error_variance,
    normalised_error,
    ratio,
    spread_of_mean,
    squared_error,
)
from kfcourse.laws import Array

# -- e1: the error variance

WRONG_VARIANCES: tuple[tuple[str, str, Answer], ...] = (
    (
        "about-the-mean",
        "The errors' mean is subtracted: D_k is the mean of the square, bias included.",
        lambda x, z: np.sum((x - z).var(axis=1), axis=1),
    ),
    ("root", messages.DEVIATION_FOR_VARIANCE, lambda x, z: np.sqrt(error_variance(x, z))),
    (
        "wrong-index",
        "The mean is taken over the steps; it is over the trajectories, and there is one number a step.",
        lambda x, z: np.resize(squared_error(x, z).mean(axis=0), len(x)),
    ),
    ("sum-for-mean", "It is a sum over the trajectories, not a mean.", lambda x, z: squared_error(x, z).sum(axis=1)),
    ("absolute", "It is the mean of absolute values, not of squares.", lambda x, z: np.abs(x - z).sum(axis=2).mean(axis=1)),
    (
        "component-mean",
        "The squares of the components are averaged; D_k is their sum.",
        lambda x, z: ((x - z) ** 2).mean(axis=(1, 2)),
    ),
)

# -- e2: its standard error

WRONG_ERRORS: tuple[tuple[str, str, Answer], ...] = (
    (
        "spread-for-error",
        "That is the spread of single trajectories; the mean of N of them varies less.",
        lambda x, z: (error_variance(x, z), squared_error(x, z).std(axis=1, ddof=1)),
    ),
    (
        "not-root",
        "The variance of the mean, not its square root: a standard error has the units of D_k.",
        lambda x, z: (error_variance(x, z), spread_of_mean(squared_error(x, z)) ** 2),
    ),
    (
        "divided-by-N",
        "Divided by N instead of its root.",
        lambda x, z: (error_variance(x, z), squared_error(x, z).std(axis=1, ddof=1) / x.shape[1]),
    ),
    (
        "of-error",
        "That is the standard error of the mean error; here the mean of its square is estimated.",
        lambda x, z: (error_variance(x, z), spread_of_mean(np.sqrt(squared_error(x, z)))),
    ),
    (
        "biased-spread",
        "The spread is divided by N; an estimate from N trajectories around their own mean has N - 1 (ddof=1).",
        lambda x, z: (error_variance(x, z), squared_error(x, z).std(axis=1) / np.sqrt(x.shape[1])),
    ),
    (
        "normal-theory",
        "That formula, D times the root of 2/N, holds for normal errors only; use the spread of the squared errors themselves.",
        lambda x, z: (error_variance(x, z), error_variance(x, z) * np.sqrt(2 / x.shape[1])),
    ),
)

# -- e3: a paired difference


def _pairs(x: Array, z: Array, other: Array) -> tuple[Array, Array]:
    """Squared errors of both filters."""
    return squared_error(x, z), squared_error(x, other)


def _unpaired(x: Array, z: Array, other: Array) -> tuple[Array, Array]:
    """The standard errors combined as if the trajectories were different ones."""
    a, b = _pairs(x, z, other)
    return (a - b).mean(axis=1), np.hypot(spread_of_mean(a), spread_of_mean(b))


WRONG_DIFFERENCES: tuple[tuple[str, str, Answer], ...] = (
    (
        "unpaired",
        "The standard errors are combined as if the filters had run on different trajectories. They share them: take the spread "
        "of the difference, trajectory by trajectory.",
        _unpaired,
    ),
    (
        "errors-subtracted",
        "Standard errors do not subtract; take the spread of the difference.",
        lambda x, z, o: (
            difference(x, z, o)[0],
            np.abs(spread_of_mean(squared_error(x, z)) - spread_of_mean(squared_error(x, o))),
        ),
    ),
    (
        "errors-added",
        "Standard errors do not add; take the spread of the difference.",
        lambda x, z, o: (difference(x, z, o)[0], spread_of_mean(squared_error(x, z)) + spread_of_mean(squared_error(x, o))),
    ),
    (
        "distance-of-estimates",
        "That is how far the two estimates are from each other, not which of them is closer to the state.",
        lambda x, z, o: (error_variance(z, o), spread_of_mean(squared_error(z, o))),
    ),
    ("order", "The difference is the first filter's D_k minus the second's.", lambda x, z, o: difference(x, o, z)),
)

# -- e4: a ratio


def _ratio_of_errors(x: Array, z: Array, other: Array, sign: float) -> Array:
    """Relative errors combined as if the two were independent, or simply added."""
    a, b = _pairs(x, z, other)
    first, second = spread_of_mean(a) / a.mean(axis=1), spread_of_mean(b) / b.mean(axis=1)
    return ratio(x, z, other)[0] * (np.hypot(first, second) if sign > 0 else first + second)


WRONG_RATIOS: tuple[tuple[str, str, Answer], ...] = (
    (
        "unpaired",
        "The relative errors are combined as if the filters had run on different trajectories; they share them.",
        lambda x, z, o: (ratio(x, z, o)[0], _ratio_of_errors(x, z, o, 1)),
    ),
    (
        "errors-added",
        "Relative errors do not add here; the two means are correlated.",
        lambda x, z, o: (ratio(x, z, o)[0], _ratio_of_errors(x, z, o, -1)),
    ),
    (
        "mean-of-ratios",
        "It is the mean of the trajectories' ratios; a ratio of means is asked for (one small denominator would rule it).",
        lambda x, z, o: (
            (squared_error(x, z) / squared_error(x, o)).mean(axis=1),
            spread_of_mean(squared_error(x, z) / squared_error(x, o)),
        ),
    ),
    (
        "base-exact",
        "The denominator varies too, together with the numerator.",
        lambda x, z, o: (ratio(x, z, o)[0], spread_of_mean(squared_error(x, z)) / error_variance(x, o)),
    ),
    ("order", "The ratio is the first filter's D_k over the second's.", lambda x, z, o: ratio(x, o, z)),
)

# -- e5: does the filter know its own error?

WRONG_NORMALISED: tuple[tuple[str, str, Answer], ...] = (
    (
        "by-deviation",
        "The squared error is divided by a standard deviation; p is the variance that belongs there.",
        lambda x, z, p: np.mean(np.sum((x - z) ** 2 / np.sqrt(np.diagonal(p, axis1=-2, axis2=-1)), axis=2), axis=1) / x.shape[2],
    ),
    (
        "ratio-of-means",
        "It is the mean squared error over the mean variance; the quotient is taken for every trajectory, then averaged.",
        lambda x, z, p: ((x - z) ** 2).mean(axis=1).sum(axis=1) / np.trace(p.mean(axis=1), axis1=-2, axis2=-1),
    ),
    (
        "not-per-component",
        "Divide by the number of components: a filter that is right should give 1.",
        lambda x, z, p: normalised_error(x, z, p) * x.shape[2],
    ),
    (
        "correlations-ignored",
        messages.CORRELATIONS_IGNORED,
        lambda x, z, p: np.mean((x - z) ** 2 / np.diagonal(p, axis1=-2, axis2=-1), axis=(1, 2)),
    ),
    (
        "inverted",
        "It is upside down: the error over what the filter believes.",
        lambda x, z, p: np.mean(np.diagonal(p, axis1=-2, axis2=-1) / (x - z) ** 2, axis=(1, 2)),
    ),
)
