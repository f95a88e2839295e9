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

BIAS_INCLUDED = "The errors' mean is subtracted: D_k is the mean of the square, bias included."
MEDIAN = "That is a median; the mean is asked for."
DEVIATION_IS_NO_ERROR = "That is made of D_k alone; how much a mean varies follows from the spread of the squares."
VARIANCE_OF_SQUARES = "That is a variance of the squared errors; a standard error has the units of D_k."

SUM_FOR_MEAN = "It is a sum over the trajectories, not a mean."
ONE_COMPONENT = "Only the first component is there."
MEAN_ERROR = "The mean of the error says only whether there is a bias; square first."
ROOT_BEFORE_MEAN = "A root is taken before the mean; the mean of the squares is asked for."
COMPONENTS_ADDED = "The components of the error are added before they are squared."
WRONG_VARIANCES: tuple[tuple[str, str, Answer], ...] = (
    (
        "about-the-mean",
        BIAS_INCLUDED,
        lambda x, z: np.sum((x - z).var(axis=1), axis=1),
    ),
    ("root", messages.DEVIATION_FOR_VARIANCE, lambda x, z: np.sqrt(error_variance(x, z))),
    (
        "wrong-index",
        "The mean is taken over the steps; it is over the trajectories, and there is one number a step.",
        lambda x, z: np.resize(squared_error(x, z).mean(axis=0), len(x)),
    ),
    ("sum-for-mean", SUM_FOR_MEAN, lambda x, z: squared_error(x, z).sum(axis=1)),
    ("absolute", "It is the mean of absolute values, not of squares.", lambda x, z: np.abs(x - z).sum(axis=2).mean(axis=1)),
    (
        "component-mean",
        "The squares of the components are averaged; D_k is their sum.",
        lambda x, z: ((x - z) ** 2).mean(axis=(1, 2)),
    ),
    ("median", MEDIAN, lambda x, z: np.median(squared_error(x, z), axis=1)),
    ("largest", "That is the largest of the squares; their mean is asked for.", lambda x, z: squared_error(x, z).max(axis=1)),
    (
        "mean-error",
        MEAN_ERROR,
        lambda x, z: (x - z).mean(axis=1).sum(axis=1),
    ),
    ("mean-error", MEAN_ERROR, lambda x, z: (x - z)[:, :, 0].mean(axis=1)),
    (
        "square-of-mean",
        messages.SQUARES_NOT_MEANS,
        lambda x, z: ((x - z).mean(axis=1) ** 2).sum(axis=1),
    ),
    (
        "difference-of-squares",
        "The squares of state and estimate are subtracted; square their difference.",
        lambda x, z: (x**2 - z**2).mean(axis=1).sum(axis=1),
    ),
    ("about-the-mean", BIAS_INCLUDED, lambda x, z: np.sum((x - z).var(axis=1, ddof=1), axis=1)),
    ("root-before-mean", ROOT_BEFORE_MEAN, lambda x, z: np.sqrt(squared_error(x, z)).mean(axis=1)),
    ("components-added", COMPONENTS_ADDED, lambda x, z: ((x - z).sum(axis=2) ** 2).mean(axis=1)),
    ("components-added", COMPONENTS_ADDED, lambda x, z: (x - z).sum(axis=2).mean(axis=1) ** 2),
    ("one-component", ONE_COMPONENT, lambda x, z: ((x - z)[:, :, 0] ** 2).mean(axis=1)),
    (
        "cumulated",
        "The values of the steps are added up; there is one for each step.",
        lambda x, z: np.cumsum(error_variance(x, z)),
    ),
    (
        "difference-of-variances",
        "The variances of state and estimate are subtracted; take the square of their difference.",
        lambda x, z: x.var(axis=1).sum(axis=1) - z.var(axis=1).sum(axis=1),
    ),
    (
        "divided-by-N-1",
        "It is divided by N - 1; the mean of N squares is asked for.",
        lambda x, z: squared_error(x, z).sum(axis=1) / (x.shape[1] - 1),
    ),
)

# -- e2: its standard error

OF_ERROR = "That is the standard error of the mean error; here the mean of its square is estimated."

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
        OF_ERROR,
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
    *(
        (name, says, lambda x, z, wrong=wrong: (error_variance(x, z), wrong(squared_error(x, z))))
        for name, says, wrong in (
            ("from-value", DEVIATION_IS_NO_ERROR, lambda s: np.sqrt(s.mean(axis=1) / s.shape[1])),
            ("from-value", DEVIATION_IS_NO_ERROR, lambda s: s.mean(axis=1) / np.sqrt(s.shape[1])),
            ("from-value", DEVIATION_IS_NO_ERROR, lambda s: np.sqrt(s.mean(axis=1))),
            ("variance-of-squares", VARIANCE_OF_SQUARES, lambda s: s.var(axis=1, ddof=1)),
            ("variance-of-squares", VARIANCE_OF_SQUARES, lambda s: s.var(axis=1, ddof=1) / np.sqrt(s.shape[1])),
        )
    ),
    (
        "of-error",
        OF_ERROR,
        lambda x, z: (error_variance(x, z), spread_of_mean((x - z).sum(axis=2))),
    ),
    (
        "over-steps",
        "The spread is taken over the steps; it is over the trajectories.",
        lambda x, z: (error_variance(x, z), squared_error(x, z).std(axis=0, ddof=1)[: len(x)] / np.sqrt(x.shape[1])),
    ),
    (
        "of-error",
        OF_ERROR,
        lambda x, z: (error_variance(x, z), (x - z)[:, :, 0].std(axis=1, ddof=1) / np.sqrt(x.shape[1])),
    ),
    (
        "all-steps",
        "One spread is taken for all steps; each has its own.",
        lambda x, z: (error_variance(x, z), np.full(len(x), squared_error(x, z).std(ddof=1) / np.sqrt(x.shape[1]))),
    ),
)

# -- e3: a paired difference

ABSOLUTE = "The differences lose their signs before the mean is taken: it would never be zero."


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
    *(
        (name, says, lambda x, z, o, wrong=wrong: wrong(*_pairs(x, z, o)))
        for name, says, wrong in (
            (
                "absolute-difference",
                ABSOLUTE,
                lambda a, b: (np.abs(a - b).mean(axis=1), spread_of_mean(np.abs(a - b))),
            ),
            (
                "absolute-errors",
                "Absolute errors are compared; D_k is made of squares.",
                lambda a, b: (
                    (np.sqrt(a) - np.sqrt(b)).mean(axis=1),
                    spread_of_mean(np.sqrt(a) - np.sqrt(b)),
                ),
            ),
            (
                "ratio",
                "That is a ratio; a difference is asked for.",
                lambda a, b: (a.mean(axis=1) / b.mean(axis=1), spread_of_mean(a - b)),
            ),
            (
                "of-deviations",
                "That compares the roots of the D_k; compare the D_k themselves.",
                lambda a, b: (np.sqrt(a.mean(axis=1)) - np.sqrt(b.mean(axis=1)), spread_of_mean(a - b)),
            ),
            (
                "pooled",
                "The spreads of both filters are pooled; take that of the difference, trajectory by trajectory.",
                lambda a, b: (
                    (a - b).mean(axis=1),
                    np.sqrt((spread_of_mean(a) ** 2 + spread_of_mean(b) ** 2) / 2),
                ),
            ),
        )
    ),
    *(
        (
            "errors-combined",
            "The two standard errors are put together in some way; what is asked for does not follow from them.",
            lambda x, z, o, combine=combine: (difference(x, z, o)[0], combine(*map(spread_of_mean, _pairs(x, z, o)))),
        )
        for combine in (np.subtract, np.maximum, lambda a, b: np.sqrt(a * b), lambda a, b: np.sqrt(np.abs(a**2 - b**2)))
    ),
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
    *(
        (name, says, lambda x, z, o, wrong=wrong: (ratio(x, z, o)[0], wrong(*_pairs(x, z, o), ratio(x, z, o)[0][:, None])))
        for name, says, wrong in (
            (
                "ratio-of-errors",
                "A ratio of standard errors is not the standard error of a ratio.",
                lambda a, b, r: spread_of_mean(a) / spread_of_mean(b),
            ),
            (
                "of-difference",
                "That belongs to the difference; in the ratio the second filter's error counts r times.",
                lambda a, b, r: spread_of_mean(a - b) / b.mean(axis=1),
            ),
            ("not-divided", "It is not divided by the denominator: check the units.", lambda a, b, r: spread_of_mean(a - r * b)),
            (
                "sign-of-denominator",
                "A larger denominator makes the ratio smaller: check a sign.",
                lambda a, b, r: spread_of_mean(a + r * b) / b.mean(axis=1),
            ),
        )
    ),
    (
        "divided-twice",
        "It is divided by the denominator once too often: check the units.",
        lambda x, z, o: (ratio(x, z, o)[0], ratio(x, z, o)[1] / error_variance(x, o)),
    ),
)

# -- e5: does the filter know its own error?


def _mean(values: Array) -> Array:
    """Over the trajectories."""
    return values.mean(axis=1, keepdims=True)


def _weighted(x: Array, z: Array, weight: Array) -> Array:
    """The quadratic form of every error, over the number of components."""
    return np.einsum("kni,knij,knj->kn", x - z, weight, x - z) / x.shape[2]


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
    ("median", MEDIAN, lambda x, z, p: np.median(_weighted(x, z, np.linalg.inv(p)), axis=1)),
    (
        "inverse-forgotten",
        messages.INVERSE_FORGOTTEN,
        lambda x, z, p: _weighted(x, z, p).mean(axis=1),
    ),
    (
        "covariance-squared",
        "The covariance divides twice; it is a variance already.",
        lambda x, z, p: _weighted(x, z, np.linalg.inv(p @ p)).mean(axis=1),
    ),
    (
        "root-before-mean",
        ROOT_BEFORE_MEAN,
        lambda x, z, p: np.sqrt(_weighted(x, z, np.linalg.inv(p)) * x.shape[2]).mean(axis=1) / x.shape[2],
    ),
    (
        "error-once",
        "The error enters once; on both sides of the inverse there is one.",
        lambda x, z, p: np.einsum("kni,knij->kn", x - z, np.linalg.inv(p)).mean(axis=1) / x.shape[2],
    ),
    (
        "absolute",
        "Absolute errors over standard deviations are averaged; square them first.",
        lambda x, z, p: (np.abs(x - z) / np.sqrt(np.diagonal(p, axis1=-2, axis2=-1))).mean(axis=(1, 2)),
    ),
    (
        "bias-removed",
        "The mean error is taken off first; a bias is an error too.",
        lambda x, z, p: normalised_error(x - (x - z).mean(axis=1, keepdims=True), z, p),
    ),
    (
        "by-trace",
        "The square is divided by the sum of the variances; the inverse of the whole matrix belongs there.",
        lambda x, z, p: (squared_error(x, z) / np.trace(p, axis1=-2, axis2=-1)).mean(axis=1),
    ),
    (
        "mean-covariance",
        "The covariances are averaged over the trajectories first; each error has its own.",
        lambda x, z, p: _weighted(x, z, np.broadcast_to(np.linalg.inv(_mean(p)), p.shape)).mean(axis=1),
    ),
    (
        "mean-error",
        messages.SQUARES_NOT_MEANS,
        lambda x, z, p: _weighted(_mean(x), _mean(z), np.linalg.inv(_mean(p)))[:, 0],
    ),
    (
        "divided-by-runs",
        "The mean over the trajectories is divided by their number once more.",
        lambda x, z, p: normalised_error(x, z, p) * x.shape[2] / x.shape[1],
    ),
    ("sum-for-mean", SUM_FOR_MEAN, lambda x, z, p: normalised_error(x, z, p) * x.shape[1]),
)
