"""Known mistakes of set p: first of all the slips themselves, then others that are made while
repairing them."""

from __future__ import annotations

from kfcourse.exercises.checks.editing import edits
from kfcourse.exercises.sets import messages
from kfcourse.exercises.sets.p_find_the_slip.keys import (
    by_angle,
    coefficients,
    correction_matrix,
    meter_variance,
    moments,
    noise_intensity,
    scaled_meter,
    second_moment,
)
from kfcourse.exercises.sets.shared import MOMENTS, OFFSET

AS_PRINTED = "That is the formula as it is printed: the slip is still in it."
ONE_OF_TWO = "Only one of the two terms of the mean square has the right factor."
DIVIDED_BY_LESS = "It is divided by N - 1; moments of an ensemble are divided by N here."
NOISE_FORGOTTEN = "The noise of the meter is missing."
FOURTH = "A moment of order four is wrong: of a normal law the fourth central one is 3 d^2."
MOMENTS_OF_START = "Moments of the first step stand there; x has changed since."

# -- p1, p2, p3: factors and components

WRONG_SECOND = edits(
    second_moment,
    ("as-printed", AS_PRINTED, "a**2", "a"),
    (
        "central",
        "That is about the mean; here the mean of the square is asked for, about zero.",
        "(z**2 + p)",
        "p",
    ),
    (
        "noise-squared",
        "q is the variance of the noise already; it is not squared again.",
        "+ q",
        "+ q**2",
    ),
    (
        "noise-deviation",
        "The root of q stands in the equation; what does it add to a mean square?",
        "+ q",
        "+ sp.sqrt(q)",
    ),
    (
        "one-of-two",
        ONE_OF_TWO,
        "a**2 * (z**2 + p)",
        "a**2 * z**2 + a * p",
    ),
    (
        "one-of-two",
        ONE_OF_TWO,
        "a**2 * (z**2 + p)",
        "a * z**2 + a**2 * p",
    ),
)

WRONG_SCALED = edits(
    scaled_meter,
    ("as-printed", AS_PRINTED, "gamma**2 * (G**2 * d + r)", "gamma**2 * G**2 * d + gamma * r"),
    (
        "noise-not-scaled",
        "The factor multiplies the noise too: it is outside of the bracket.",
        "gamma**2 * (G**2 * d + r)",
        "gamma**2 * G**2 * d + r",
    ),
    (
        "state-not-scaled",
        "The factor multiplies the signal too.",
        "gamma**2 * (G**2 * d + r)",
        "G**2 * d + gamma**2 * r",
    ),
    ("once", "The factor enters once; a variance goes with its square.", "gamma**2", "gamma"),
    ("noise-squared", "r is a variance already; it seems to enter squared.", "+ r", "+ r**2"),
    ("slope-once", "The slope enters once; a variance goes with its square.", "G**2", "G"),
    ("noise-forgotten", NOISE_FORGOTTEN, " + r", ""),
)

WRONG_INTENSITIES = edits(
    noise_intensity,
    ("as-printed", AS_PRINTED, "+ p11", "+ p22"),
    (
        "tangent",
        "That is the value at the mean; the square is averaged over the law.",
        " + p11",
        "",
    ),
    (
        "other-component",
        "That belongs to the other component: which one multiplies the noise?",
        "z1**2 + p11",
        "z2**2 + p22",
    ),
    (
        "covariance",
        "A covariance stands there; the square of one component has its own variance.",
        "+ p11",
        "+ p12",
    ),
    (
        "product-of-components",
        "That is the mean of a product of both components.",
        "z1**2 + p11",
        "z1 * z2 + p12",
    ),
    (
        "subtracted",
        "The variance is subtracted; the mean of a square is larger than the square of the mean.",
        "+ p11",
        "- p11",
    ),
    (
        "variance-alone",
        "Only the variance is there: the square of the mean is missing.",
        "z1**2 + ",
        "",
    ),
)

# -- p4: moments of order three and four; p5: a derivative

PRINTED = "m1 * m2 + d12 - (m1**2 + d11) * m2"
WRONG_METERS = edits(
    meter_variance,
    ("as-printed", AS_PRINTED, "1, 2 * m1 * d12", f"0, {PRINTED}"),
    ("noise-forgotten", NOISE_FORGOTTEN, "noise, cross = 1", "noise, cross = 0"),
    (
        "moment-of-product",
        "Off the diagonal there is still the slip: which power of x1 is measured?",
        "2 * m1 * d12",
        PRINTED,
    ),
    (
        "about-zero",
        messages.MEANS_NOT_SUBTRACTED,
        "return",
        "h = sp.Matrix([m1**2 + d11, m2]); return h * h.T +",
    ),
    (
        "tangent",
        "That is the linearised function: over the normal law there is one more term.",
        " + 2 * d11**2",
        "",
    ),
    ("fourth-moment", FOURTH, "2 * d11**2", "3 * d11**2"),
    ("fourth-moment", FOURTH, "2 * d11**2", "d11**2"),
    (
        "product-rule",
        "The covariance of a square with another component has a factor 2: both factors of the "
        "square vary.",
        "2 * m1",
        "m1",
    ),
    (
        "plain-covariance",
        "Off the diagonal stands the covariance of the components themselves; the first is "
        "measured squared.",
        "2 * m1 * d12",
        "d12",
    ),
)

WRONG_SLOPES = edits(
    by_angle,
    ("as-printed", AS_PRINTED, " - kappa * sp.cos(x2)", "", " - kappa * sp.sin(x2)", ""),
    (
        "other-lift",
        "The term with the lift has the other sign: which sign has it in the meter, and which one "
        "does its derivative bring?",
        "- kappa * sp.cos",
        "+ kappa * sp.cos",
        "- kappa * sp.sin",
        "+ kappa * sp.sin",
    ),
    (
        "function-for-derivative",
        "Those are the meters themselves; their derivatives are asked for.",
        "return",
        "x2 = x2 - sp.pi / 2; return",
    ),
    (
        "sign-of-derivative",
        "The derivatives have the wrong sign: which of sine and cosine gets a minus?",
        "return",
        "E = -E; return",
    ),
    (
        "lift-not-differentiated",
        "The term with the lift is not differentiated.",
        "kappa * sp.cos(x2)",
        "kappa * sp.sin(x2)",
        "(sp.cos(x2) - kappa * sp.sin(x2))",
        "(sp.cos(x2) + kappa * sp.cos(x2))",
    ),
)

# -- p6: normal equations; p7: which step?

WRONG_MATRICES = edits(
    correction_matrix,
    ("as-printed", AS_PRINTED, "r.T @ r / len(r)", "t.T @ t / len(t)"),
    (
        "other-way",
        "That predicts sigma from the error; the error is to be predicted from sigma.",
        "(error, sigma)[0]",
        "(sigma, error)[0]",
    ),
    (
        "about-zero",
        "The moments are taken about zero; the offset is there for the means.",
        *MOMENTS,
    ),
    (
        "components-apart",
        "Each component has a regression of its own; sigma's components are correlated.",
        "np.linalg.pinv(own, hermitian=True)",
        "np.diag(1 / np.diagonal(own))",
    ),
    (
        "not-divided",
        "Only the cross covariance is there: check the units.",
        " @ np.linalg.pinv(own, hermitian=True)",
        "",
    ),
    (
        "different-divisors",
        messages.DIFFERENT_DIVISORS,
        "t.T @ r / len(t)",
        "t.T @ r / (len(t) - 1)",
    ),
    (
        "inverse-on-the-left",
        "The inverse stands on the wrong side: the order of matrices matters.",
        "cross @ np.linalg.pinv(own, hermitian=True)",
        "np.linalg.pinv(own, hermitian=True) @ cross",
    ),
)

MEAN, WHOLE = (
    "chi + x_0.mean(axis=0) - x.mean(axis=0)",
    "T + np.cov(x_0.T, ddof=0) - np.cov(x.T, ddof=0)",
)
WRONG_FITS = edits(
    coefficients,
    ("as-printed", AS_PRINTED, "chi, T\n", f"{MEAN}, {WHOLE}\n"),
    ("mean-of-start", MOMENTS_OF_START, "chi, T\n", f"{MEAN}, T\n"),
    ("covariance-of-start", MOMENTS_OF_START, "chi, T\n", f"chi, {WHOLE}\n"),
    (
        "all-of-start",
        "All moments are those of the first state: that is a regression of x_0.",
        "regression(x,",
        "regression(x_0,",
    ),
    (
        "whole-variance",
        "T is the whole covariance; what the regression explains is subtracted.",
        " - matrix @ cross.T",
        "",
    ),
    (
        "divided-by-N-1",
        DIVIDED_BY_LESS,
        "chi, T\n",
        "chi, T * len(x) / (len(x) - 1)\n",
    ),
    (
        "error-for-residual",
        messages.ERROR_FOR_RESIDUAL,
        "chi, T\n",
        "chi, np.cov((x - z).T, ddof=0).reshape(T.shape)\n",
    ),
    ("offset-forgotten", messages.OFFSET_FORGOTTEN, *OFFSET),
)

# -- p8: an average over modes

MODES = (
    "mean, variance = x.mean(), x.var()",
    "parts = [x[mode == i] for i in np.unique(mode)]; share = [len(part) / len(x) for part in "
    "parts]; "
    "means, variances = list(map(np.mean, parts)), list(map(np.var, parts))",
    "mean, variance\n",
)
WRONG_MOMENTS = edits(
    moments,
    ("as-printed", AS_PRINTED, *MODES, "np.mean(means), np.mean(variances)"),
    (
        "spread-forgotten",
        "The weights are right; the modes differ in their means, and that is variance too.",
        *MODES,
        "np.dot(share, means), np.dot(share, variances)",
    ),
    (
        "not-weighted",
        "The modes count alike, however many trajectories are in them.",
        *MODES,
        "np.mean(means), np.mean(variances) + np.var(means)",
    ),
    ("about-zero", messages.ABOUT_ZERO, "x.var()", "(x**2).mean()"),
    (
        "first-mode",
        "Only one mode is looked at.",
        "    mean, variance =",
        "    x = x[mode == 0]; mean, variance =",
    ),
    ("divided-by-N-1", DIVIDED_BY_LESS, "x.var()", "x.var(ddof=1)"),
)
