"""Known mistakes of set p: first of all the slips themselves, then others that are made while repairing them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import sympy as sp

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.p_find_the_slip.keys import meter_variance
from kfcourse.exercises.shared import covariance_of, raw_moment, regression
from kfcourse.laws import Array

AS_PRINTED = "That is the formula as it is printed: the slip is still in it."
CENTRAL = "That is about the mean; here the mean of the square is asked for, about zero."
NOISE_FORGOTTEN = "The noise of the meter is missing."
ONE_OF_TWO = "Only one of the two terms of the mean square has the right factor."
FOURTH = "A moment of order four is wrong: of a normal law the fourth central one is 3 d^2."
DIVIDED_BY_LESS = "It is divided by N - 1; moments of an ensemble are divided by N here."
MOMENTS_OF_START = "Moments of the first step stand there; x has changed since."

# -- p1: the square of a factor

WRONG_SECOND: tuple[tuple[str, str, Answer], ...] = (
    ("as-printed", AS_PRINTED, lambda a, q, z, p: a * (z**2 + p) + q),
    ("central", CENTRAL, lambda a, q, z, p: a**2 * p + q),
    (
        "noise-squared",
        "q is the variance of the noise already; it is not squared again.",
        lambda a, q, z, p: a**2 * (z**2 + p) + q**2,
    ),
    (
        "noise-deviation",
        "The root of q stands in the equation; what does it add to a mean square?",
        lambda a, q, z, p: a**2 * (z**2 + p) + sp.sqrt(q),
    ),
    ("one-of-two", ONE_OF_TWO, lambda a, q, z, p: a**2 * z**2 + a * p + q),
    ("one-of-two", ONE_OF_TWO, lambda a, q, z, p: a * z**2 + a**2 * p + q),
)

# -- p2: a factor of the whole meter

WRONG_SCALED: tuple[tuple[str, str, Answer], ...] = (
    ("as-printed", AS_PRINTED, lambda g, G, d, r: g**2 * G**2 * d + g * r),
    (
        "noise-not-scaled",
        "The factor multiplies the noise too: it is outside of the bracket.",
        lambda g, G, d, r: g**2 * G**2 * d + r,
    ),
    ("state-not-scaled", "The factor multiplies the signal too.", lambda g, G, d, r: G**2 * d + g**2 * r),
    ("once", "The factor enters once; a variance goes with its square.", lambda g, G, d, r: g * (G**2 * d + r)),
    ("noise-squared", "r is a variance already; it seems to enter squared.", lambda g, G, d, r: g**2 * G**2 * d + g**2 * r**2),
    ("slope-once", "The slope enters once; a variance goes with its square.", lambda g, G, d, r: g**2 * G * d + g**2 * r),
    ("noise-forgotten", NOISE_FORGOTTEN, lambda g, G, d, r: g**2 * G**2 * d),
    ("fourth-power", "The factor has too high a power in one of the terms.", lambda g, G, d, r: g**4 * G**2 * d + g**2 * r),
)

# -- p3: which component is squared?

WRONG_INTENSITIES: tuple[tuple[str, str, Answer], ...] = (
    ("as-printed", AS_PRINTED, lambda z1, z2, p11, p12, p22: z1**2 + p22),
    ("tangent", "That is the value at the mean; the square is averaged over the law.", lambda z1, z2, p11, p12, p22: z1**2),
    (
        "other-component",
        "That belongs to the other component: which one multiplies the noise?",
        lambda z1, z2, p11, p12, p22: z2**2 + p22,
    ),
    (
        "covariance",
        "A covariance stands there; the square of one component has its own variance.",
        lambda z1, z2, p11, p12, p22: z1**2 + p12,
    ),
    ("product-of-components", "That is the mean of a product of both components.", lambda z1, z2, p11, p12, p22: z1 * z2 + p12),
    (
        "subtracted",
        "The variance is subtracted; the mean of a square is larger than the square of the mean.",
        lambda z1, z2, p11, p12, p22: z1**2 - p11,
    ),
    ("variance-alone", "Only the variance is there: the square of the mean is missing.", lambda z1, z2, p11, p12, p22: p11),
    (
        "deviation",
        "A standard deviation is added to a square: check the units.",
        lambda z1, z2, p11, p12, p22: z1**2 + sp.sqrt(p11),
    ),
)

# -- p4: moments of order three and four


def variance_with(
    noise: int = 1, fourth: sp.Expr | int = 2, cross: Callable[..., sp.Expr] | None = None, raw: bool = False
) -> Answer:
    """F with another noise, another factor of d11^2, another covariance, or moments about zero."""

    def answer(m1: sp.Expr, m2: sp.Expr, d11: sp.Expr, d12: sp.Expr, d22: sp.Expr) -> sp.Matrix:
        between = cross(m1, m2, d11, d12, d22) if cross else 2 * m1 * d12
        found = sp.Matrix([[4 * m1**2 * d11 + fourth * d11**2 + noise, between], [between, d22 + noise]])
        h = sp.Matrix([m1**2 + d11, m2])
        return found + h * h.T if raw else found

    return answer


def _printed(m1: sp.Expr, m2: sp.Expr, d11: sp.Expr, d12: sp.Expr, d22: sp.Expr) -> sp.Expr:
    """M[x1 x2] - h1 h2."""
    return m1 * m2 + d12 - (m1**2 + d11) * m2


WRONG_METERS: tuple[tuple[str, str, Answer], ...] = (
    ("as-printed", AS_PRINTED, variance_with(noise=0, cross=_printed)),
    ("noise-forgotten", NOISE_FORGOTTEN, variance_with(noise=0)),
    (
        "moment-of-product",
        "Off the diagonal there is still the slip: which power of x1 is measured?",
        variance_with(cross=_printed),
    ),
    ("about-zero", messages.MEANS_NOT_SUBTRACTED, variance_with(raw=True)),
    ("tangent", "That is the linearised function: over the normal law there is one more term.", variance_with(fourth=0)),
    ("fourth-moment", FOURTH, variance_with(fourth=3)),
    ("fourth-moment", FOURTH, variance_with(fourth=1)),
    (
        "product-rule",
        "The covariance of a square with another component has a factor 2: both factors of the square vary.",
        variance_with(cross=lambda m1, m2, d11, d12, d22: m1 * d12),
    ),
    (
        "plain-covariance",
        "Off the diagonal stands the covariance of the components themselves; the first is measured squared.",
        variance_with(cross=lambda m1, m2, d11, d12, d22: d12),
    ),
    (
        "correlation-forgotten",
        "The components are correlated, and so are the measurements.",
        variance_with(cross=lambda *_: sp.S.Zero),
    ),
    (
        "noise-everywhere",
        "The noises of the two meters are independent: they add nothing off the diagonal.",
        lambda *law: meter_variance(*law) + sp.Matrix([[0, 1], [1, 0]]),
    ),
)

# -- p5: a derivative

WRONG_SLOPES: tuple[tuple[str, str, Answer], ...] = (
    ("as-printed", AS_PRINTED, lambda E, k, x2: (-E * sp.sin(x2), E * sp.cos(x2))),
    (
        "other-lift",
        "The term with the lift has the other sign: which sign has it in the meter, and which one does its derivative bring?",
        lambda E, k, x2: (E * (-sp.sin(x2) + k * sp.cos(x2)), E * (sp.cos(x2) + k * sp.sin(x2))),
    ),
    (
        "function-for-derivative",
        "Those are the meters themselves; their derivatives are asked for.",
        lambda E, k, x2: (E * (sp.cos(x2) - k * sp.sin(x2)), E * (sp.sin(x2) + k * sp.cos(x2))),
    ),
    (
        "sign-of-derivative",
        "The derivatives have the wrong sign: which of sine and cosine gets a minus?",
        lambda E, k, x2: (E * (sp.sin(x2) + k * sp.cos(x2)), -E * (sp.cos(x2) - k * sp.sin(x2))),
    ),
    (
        "lift-not-differentiated",
        "The term with the lift is not differentiated.",
        lambda E, k, x2: (E * (-sp.sin(x2) - k * sp.sin(x2)), E * (sp.cos(x2) + k * sp.cos(x2))),
    ),
    (
        "force-forgotten",
        "The force E is missing.",
        lambda E, k, x2: (-sp.sin(x2) - k * sp.cos(x2), sp.cos(x2) - k * sp.sin(x2)),
    ),
)

# -- p6: normal equations


def matrix_with(cross: Callable[[Array, Array], Array], own: Callable[[Array, Array], Array]) -> Answer:
    """H from other second moments of (error, sigma)."""
    return lambda error, sigma: cross(error, sigma) @ np.linalg.pinv(own(error, sigma))


WRONG_MATRICES: tuple[tuple[str, str, Answer], ...] = (
    ("as-printed", AS_PRINTED, matrix_with(covariance_of, lambda e, s: covariance_of(e, e))),
    ("transposed", "The matrix is transposed: it acts on sigma, and gives an error.", lambda e, s: regression(e, s)[0].T),
    (
        "other-way",
        "That predicts sigma from the error; the error is to be predicted from sigma.",
        lambda e, s: regression(s, e)[0],
    ),
    (
        "about-zero",
        "The moments are taken about zero; the offset is there for the means.",
        matrix_with(raw_moment, lambda e, s: raw_moment(s, s)),
    ),
    (
        "about-zero",
        "The cross moments are taken about zero, those of sigma about its mean.",
        matrix_with(raw_moment, lambda e, s: covariance_of(s, s)),
    ),
    (
        "components-apart",
        "Each component has a regression of its own; sigma's components are correlated.",
        lambda e, s: covariance_of(e, s) / np.diagonal(covariance_of(s, s)),
    ),
    ("not-divided", "Only the cross covariance is there: check the units.", lambda e, s: covariance_of(e, s)),
    (
        "different-divisors",
        messages.DIFFERENT_DIVISORS,
        lambda e, s: regression(e, s)[0] * (1 - 1 / len(e)),
    ),
    (
        "inverse-on-the-left",
        "The inverse stands on the wrong side: the order of matrices matters.",
        lambda e, s: np.linalg.pinv(covariance_of(s, s)) @ covariance_of(e, s),
    ),
)

# -- p7: which step?


def fit_with(chi_of_start: bool = False, T_of_start: bool = False, gamma_of_start: bool = False) -> Answer:
    """The regression with moments of step 0 in the place of those of step k."""

    def answer(x_0: Array, x: Array, z: Array) -> tuple[Array, Array, Array]:
        target = x_0 if gamma_of_start else x
        Gamma = regression(target, z)[0]
        chi = (x_0 if chi_of_start else x).mean(axis=0) - Gamma @ z.mean(axis=0)
        own = x_0 if T_of_start else x
        return Gamma, chi, covariance_of(own, own) - Gamma @ covariance_of(target, z).T

    return answer


WRONG_FITS: tuple[tuple[str, str, Answer], ...] = (
    ("as-printed", AS_PRINTED, fit_with(True, True)),
    ("mean-of-start", MOMENTS_OF_START, fit_with(chi_of_start=True)),
    ("covariance-of-start", MOMENTS_OF_START, fit_with(T_of_start=True)),
    ("matrix-of-start", MOMENTS_OF_START, fit_with(gamma_of_start=True)),
    ("all-of-start", "All moments are those of the first state: that is a regression of x_0.", fit_with(True, True, True)),
    (
        "whole-variance",
        "T is the whole covariance; what the regression explains is subtracted.",
        lambda x_0, x, z: (*regression(x, z)[:2], covariance_of(x, x)),
    ),
    (
        "square-about-zero",
        "T begins with the mean square of x about zero; what is left of x is about its mean.",
        lambda x_0, x, z: (*regression(x, z)[:2], raw_moment(x, x) - covariance_of(x, x) + regression(x, z)[2]),
    ),
    (
        "divided-by-N-1",
        DIVIDED_BY_LESS,
        lambda x_0, x, z: (*regression(x, z)[:2], regression(x, z)[2] * len(x) / (len(x) - 1)),
    ),
    ("error-for-residual", messages.ERROR_FOR_RESIDUAL, lambda x_0, x, z: (*regression(x, z)[:2], covariance_of(x - z, x - z))),
    ("offset-forgotten", messages.OFFSET_FORGOTTEN, lambda x_0, x, z: (regression(x, z)[0], x.mean(axis=0), regression(x, z)[2])),
    (
        "explained-added",
        messages.EXPLAINED_ADDED,
        lambda x_0, x, z: (*regression(x, z)[:2], 2 * covariance_of(x, x) - regression(x, z)[2]),
    ),
)

# -- p8: an average over modes


def by_mode(x: Array, mode: Array) -> tuple[Array, Array, Array]:
    """Share, mean and variance of each mode that occurs."""
    inside = [x[mode == i] for i in np.unique(mode)]
    return (
        np.array([len(one) / len(x) for one in inside]),
        np.array([one.mean() for one in inside]),
        np.array(list(map(np.var, inside))),
    )


def _printed_moments(x: Array, mode: Array) -> tuple[Array, Array]:
    _, means, variances = by_mode(x, mode)
    return means.mean(), variances.mean()


def _weighted(x: Array, mode: Array) -> tuple[Array, Array]:
    share, means, variances = by_mode(x, mode)
    return share @ means, share @ variances


def _unweighted_with_spread(x: Array, mode: Array) -> tuple[Array, Array]:
    _, means, variances = by_mode(x, mode)
    return means.mean(), variances.mean() + means.var()


def _about_zero(x: Array, mode: Array) -> tuple[float, float]:
    return float(np.mean(x)), float(np.mean(x**2))


WRONG_MOMENTS: tuple[tuple[str, str, Answer], ...] = (
    ("as-printed", AS_PRINTED, _printed_moments),
    ("spread-forgotten", "The weights are right; the modes differ in their means, and that is variance too.", _weighted),
    ("not-weighted", "The modes count alike, however many trajectories are in them.", _unweighted_with_spread),
    ("about-zero", messages.ABOUT_ZERO, _about_zero),
    ("first-mode", "Only one mode is looked at.", lambda x, mode: (x[mode == 0].mean(), x[mode == 0].var())),
    ("deviation", messages.DEVIATION_FOR_VARIANCE, lambda x, mode: (x.mean(), x.std())),
    (
        "divided-by-N-1",
        DIVIDED_BY_LESS,
        lambda x, mode: (x.mean(), x.var(ddof=1)),
    ),
)
