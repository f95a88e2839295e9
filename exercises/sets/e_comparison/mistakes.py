"""Known mistakes of set e, question by question: edits of the keys, and what is said of each."""

from __future__ import annotations

from kfcourse.exercises.checks.editing import edits
from kfcourse.exercises.sets import messages
from kfcourse.exercises.sets.e_comparison.keys import (
    difference,
    error_variance,
    normalised_error,
    ratio,
    with_standard_error,
)

OF_ERROR = "That is the standard error of the mean error; here the mean of its square is estimated."

# -- e1: the error variance

SQUARES = "squared_error(x, z).mean(axis=1)"
WRONG_VARIANCES = edits(
    error_variance,
    (
        "about-the-mean",
        "The errors' mean is subtracted: D_k is the mean of the square, bias included.",
        SQUARES,
        "np.sum((x - z).var(axis=1), axis=1)",
    ),
    (
        "wrong-index",
        "The mean is taken over the steps; it is over the trajectories, and there is one number a "
        "step.",
        SQUARES,
        "np.resize(squared_error(x, z).mean(axis=0), len(x))",
    ),
    (
        "absolute",
        "It is the mean of absolute values, not of squares.",
        "(x - z) ** 2",
        "np.abs(x - z)",
    ),
    (
        "component-mean",
        "The squares of the components are averaged; D_k is their sum.",
        "np.sum((x - z) ** 2",
        "np.mean((x - z) ** 2",
    ),
    (
        "mean-error",
        "The mean of the error says only whether there is a bias; square first.",
        SQUARES,
        "(x - z).mean(axis=1).sum(axis=1)",
    ),
    (
        "square-of-mean",
        messages.SQUARES_NOT_MEANS,
        SQUARES,
        "((x - z).mean(axis=1) ** 2).sum(axis=1)",
    ),
    (
        "root-before-mean",
        "A root is taken before the mean; the mean of the squares is asked for.",
        SQUARES,
        "np.sqrt(squared_error(x, z)).mean(axis=1)",
    ),
)

# -- e2: its standard error

SPREAD = "spread_of_mean(squared_error(x, z))"
WRONG_ERRORS = edits(
    with_standard_error,
    (
        "spread-for-error",
        "That is the spread of single trajectories; the mean of N of them varies less.",
        " / np.sqrt(values.shape[1])",
        "",
    ),
    (
        "divided-by-N",
        "Divided by N instead of its root.",
        "np.sqrt(values.shape[1])",
        "values.shape[1]",
    ),
    ("of-error", OF_ERROR, SPREAD, "spread_of_mean(np.sqrt(squared_error(x, z)))"),
    ("of-error", OF_ERROR, SPREAD, "spread_of_mean((x - z).sum(axis=2))"),
    (
        "biased-spread",
        "The spread is divided by N; an estimate from N trajectories around their own mean has N "
        "- 1 (ddof=1).",
        ", ddof=1",
        "",
    ),
    (
        "normal-theory",
        "That formula, D times the root of 2/N, holds for normal errors only; use the spread of "
        "the squared errors themselves.",
        SPREAD,
        "error_variance(x, z) * np.sqrt(2 / x.shape[1])",
    ),
    (
        "from-value",
        "That is made of D_k alone; how much a mean varies follows from the spread of the squares.",
        SPREAD,
        "error_variance(x, z) / np.sqrt(x.shape[1])",
    ),
)

# -- e3: a paired difference

PAIRED = "spread_of_mean(paired)"
FIRST, SECOND = (
    "spread_of_mean(squared_error(x, z_first))",
    "spread_of_mean(squared_error(x, z_second))",
)
BOTH = "squared_error(x, z_first) - squared_error(x, z_second)"
WRONG_DIFFERENCES = edits(
    difference,
    (
        "unpaired",
        "The standard errors are combined as if the filters had run on different trajectories. "
        "They share them: take the spread "
        "of the difference, trajectory by trajectory.",
        PAIRED,
        f"np.hypot({FIRST}, {SECOND})",
    ),
    (
        "errors-subtracted",
        "Standard errors do not subtract; take the spread of the difference.",
        PAIRED,
        f"np.abs({FIRST} - {SECOND})",
    ),
    (
        "errors-added",
        "Standard errors do not add; take the spread of the difference.",
        PAIRED,
        f"{FIRST} + {SECOND}",
    ),
    (
        "distance-of-estimates",
        "That is how far the two estimates are from each other, not which of them is closer to "
        "the state.",
        BOTH,
        "squared_error(z_first, z_second)",
    ),
    (
        "order",
        "The difference is the first filter's D_k minus the second's.",
        BOTH,
        "squared_error(x, z_second) - squared_error(x, z_first)",
    ),
    (
        "absolute-difference",
        "The differences lose their signs before the mean is taken: it would never be zero.",
        BOTH,
        f"np.abs({BOTH})",
    ),
    (
        "of-deviations",
        "That compares the roots of the D_k; compare the D_k themselves.",
        "paired.mean(axis=1)",
        "np.sqrt(error_variance(x, z_first)) - np.sqrt(error_variance(x, z_second))",
    ),
)

# -- e4: a ratio

LINEAR = "spread_of_mean(first - r[:, None] * second) / base"
WRONG_RATIOS = edits(
    ratio,
    (
        "unpaired",
        "The relative errors are combined as if the filters had run on different trajectories; "
        "they share them.",
        LINEAR,
        "r * np.hypot(spread_of_mean(first) / D, spread_of_mean(second) / base)",
    ),
    (
        "errors-added",
        "Relative errors do not add here; the two means are correlated.",
        LINEAR,
        "r * (spread_of_mean(first) / D + spread_of_mean(second) / base)",
    ),
    (
        "mean-of-ratios",
        "It is the mean of the trajectories' ratios; a ratio of means is asked for (one small "
        "denominator would rule it).",
        f"r, {LINEAR}",
        "(first / second).mean(axis=1), spread_of_mean(first / second)",
    ),
    (
        "base-exact",
        "The denominator varies too, together with the numerator.",
        LINEAR,
        "spread_of_mean(first) / base",
    ),
    (
        "order",
        "The ratio is the first filter's D_k over the second's.",
        "D, base =",
        "z_first, z_second = z_second, z_first; D, base =",
    ),
    (
        "of-difference",
        "That belongs to the difference; in the ratio the second filter's error counts r times.",
        "r[:, None] * ",
        "",
    ),
    (
        "sign-of-denominator",
        "A larger denominator makes the ratio smaller: check a sign.",
        "- r[",
        "+ r[",
    ),
)

# -- e5: does the filter know its own error?

FORM = "np.sum(error * np.linalg.solve(p, error[..., None])[..., 0], axis=2)"
VARIANCES = "np.diagonal(p, axis1=-2, axis2=-1)"
WRONG_NORMALISED = edits(
    normalised_error,
    (
        "by-deviation",
        "The squared error is divided by a standard deviation; p is the variance that belongs "
        "there.",
        FORM,
        f"np.sum(error**2 / np.sqrt({VARIANCES}), axis=2)",
    ),
    (
        "ratio-of-means",
        "It is the mean squared error over the mean variance; the quotient is taken for every "
        "trajectory, then averaged.",
        "np.mean(size, axis=1) / x.shape[2]",
        "(error**2).mean(axis=1).sum(axis=1) / np.trace(p.mean(axis=1), axis1=-2, axis2=-1)",
    ),
    (
        "not-per-component",
        "Divide by the number of components: a filter that is right should give 1.",
        " / x.shape[2]",
        "",
    ),
    (
        "correlations-ignored",
        messages.CORRELATIONS_IGNORED,
        FORM,
        f"np.sum(error**2 / {VARIANCES}, axis=2)",
    ),
    (
        "inverted",
        "It is upside down: the error over what the filter believes.",
        FORM,
        f"np.sum({VARIANCES} / error**2, axis=2)",
    ),
    (
        "inverse-forgotten",
        messages.INVERSE_FORGOTTEN,
        "np.linalg.solve(p, error[..., None])",
        "(p @ error[..., None])",
    ),
    (
        "bias-removed",
        "The mean error is taken off first; a bias is an error too.",
        "error = x - z",
        "error = x - z - (x - z).mean(axis=1, keepdims=True)",
    ),
)
