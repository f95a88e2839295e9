"""Is a filter right about its own errors?  Tests of its covariance and of its innovations.

    NEES   e^T p^-1 e,       e = x_k - z_k            needs the true state: simulation
    NIS    nu^T F^-1 nu,     nu = y_k - h             needs only measurements, also real ones
    whiteness of the innovations                      likewise
    confidence ellipse  e^T p^-1 e < rho^2, of two components

For a filter that is right, and normal laws, NEES and NIS are chi-squared with n and p degrees of
freedom, and innovations of different steps are uncorrelated.  Bar-Shalom, Li, Kirubarajan (2001),
section 5.4.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy

from kfcourse.angles import Components, difference
from kfcourse.laws import CONFIDENCE, Array, Gaussian, Measurement, normalised_square, square_root


def confidence_ellipse(law: Gaussian, probability: float = CONFIDENCE, points: int = 200) -> Array:
    """Border of the smallest region that holds two components with the given probability, (2,
    points).

    e^T p^-1 e = rho^2 with e = x - mean and rho = sqrt(-2 ln(1 - probability)): e^T p^-1 e is
    chi-squared with two degrees.

    Parameters
    ----------
    law : Gaussian
        Of one run: mean (2,), cov (2, 2).
    probability : float
        Between 0 and 1.
    points : int
        How many; the last is the first.

    Raises
    ------
    ValueError
        The law is not one of two components, or the probability is not between 0 and 1.
    """
    if np.shape(law.mean) != (2,) or not 0 < probability < 1:
        raise ValueError(
            f"expected the law of two components of one run and a probability between 0 and 1, "
            f"got a mean {np.shape(law.mean)} and {probability}"
        )
    turn = np.linspace(0, 2 * np.pi, points)
    circle = np.sqrt(-2 * np.log(1 - probability)) * np.array([np.cos(turn), np.sin(turn)])
    return np.asarray(law.mean)[:, None] + square_root(law.cov) @ circle


class Innovations(NamedTuple):
    """What the measurements told beyond the prediction: value (steps, runs, p), and the covariance
    expected, (..., p, p)."""

    value: Array
    cov: Array


def innovations(
    measure: Callable[[Array, Array], Measurement], predicted: Gaussian, y: Array
) -> Innovations:
    """Innovations nu = y - h(lambda, Psi) and their covariances F(lambda, Psi).

    Parameters
    ----------
    measure : callable
        `structure.measure` of the filter's structural functions, or `LinearSystem.measure`.
    predicted : Gaussian
        Laws before each measurement, from `kfcourse.predictions(filter, y)`.
    y : ndarray (steps, runs, p)
        NaN where missing.
    """
    measurement = measure(*predicted)
    return Innovations(measurement.innovation(y), measurement.F)


def nees(x: Array, posterior: Gaussian, angles: Components = ()) -> Array:
    """Normalised estimation error squared, (..., n) -> (...): mean n for a filter that is right.

    `angles` are the components of x that are, `model.angles.x`.

    Raises
    ------
    ValueError
        A covariance is singular: some component is claimed to be known exactly.
    """
    return normalised_square(difference(x, posterior.mean, angles), _regular(posterior.cov))


def nis(nu: Innovations) -> Array:
    """Normalised innovation squared, (steps, runs): mean p for a filter that is right; NaN where y
    is missing.

    Raises
    ------
    ValueError
        A covariance is singular: some measurement is claimed to be known before it comes.
    """
    return normalised_square(nu.value, _regular(nu.cov))


def _regular(cov: Array) -> Array:
    if not np.linalg.det(cov).all():
        raise ValueError(
            "a covariance is singular: leave out the components that the filter knows exactly"
        )
    return cov


def chi_squared_bounds(
    degrees: int, runs: int, confidence: float = CONFIDENCE
) -> tuple[float, float]:
    """Interval in which the mean over `runs` of a chi-squared quantity lies with the given
    probability.

    The sum of independent chi-squared numbers is chi-squared with runs * degrees degrees of
    freedom.  Only *independent* terms may be counted: NEES of different runs, not of successive
    steps; NIS of successive steps too.
    """
    if degrees < 1 or runs < 1 or not 0 < confidence < 1:
        raise ValueError(
            f"expected degrees >= 1, runs >= 1 and 0 < confidence < 1, got {degrees}, {runs}, "
            f"{confidence}"
        )
    tails = ((1 + confidence) / 2, (1 - confidence) / 2)
    low, high = scipy.special.chdtri(degrees * runs, tails).tolist()
    return low / runs, high / runs


def alarms(nu: Innovations, confidence: float = CONFIDENCE) -> Array:
    """Which records fail the three tests of innovations: size, mean, whiteness; (3, runs) of bool.

    With N steps, p components and s_k = F^(-1/2) nu_k, a right filter makes

        sum_k |s_k|^2                               chi-squared with p N degrees of freedom
        |sum_k s_k|^2 / N                           chi-squared with p
        (sum_k s_k^T s_{k+1})^2 / (p (N - 1))       chi-squared with 1, for large N

    Size is suspect on both sides, the others only above.  For these, s_k is divided by its root
    mean square in the record: a wrong size alone is no alarm of theirs.

    Raises
    ------
    ValueError
        Measurements are missing.
    """
    white = _white(nu)
    steps, _, p = white.shape
    size = (white**2).mean(axis=(0, 2))  # (runs,)
    white = white / np.sqrt(size)[:, None]
    neighbours = (white[:-1] * white[1:]).sum(axis=(0, 2))
    low, high = chi_squared_bounds(p, steps, confidence)
    return np.stack(
        [
            (p * size < low) | (p * size > high),
            (white.sum(axis=0) ** 2).sum(axis=-1) / steps
            > chi_squared_bounds(p, 1, 2 * confidence - 1)[1],
            neighbours**2 / (p * (steps - 1)) > chi_squared_bounds(1, 1, 2 * confidence - 1)[1],
        ]
    )


def _white(nu: Innovations) -> Array:
    """s_k = F^(-1/2) nu_k, (steps, runs, p)."""
    if np.isnan(nu.value).any():
        raise ValueError(
            "this test needs measurements at every step; select the steps at which they are there"
        )
    return np.linalg.solve(np.linalg.cholesky(nu.cov), nu.value[..., None])[..., 0]


class Autocorrelation(NamedTuple):
    """Correlation of innovations `lag` steps apart, (lags,), and its standard deviation for a
    filter that is right."""

    value: Array
    standard_deviation: Array


def autocorrelation(nu: Innovations, lags: int) -> Autocorrelation:
    """Correlation of whitened innovations s_k = F^(-1/2) nu_k, M[s_k^T s_{k+l}] / p for l = 1 ...
    lags.

    The mean is over steps and runs.  White innovations give 0 with the standard deviation 1 /
    sqrt(p * number of pairs).
    """
    steps, runs, p = nu.value.shape
    if not 0 < lags < steps:
        raise ValueError(f"lags must be between 1 and {steps - 1}, got {lags}")
    white = _white(nu)
    apart = np.arange(1, lags + 1)
    value = [(white[:-lag] * white[lag:]).sum(axis=-1).mean() / p for lag in apart]
    return Autocorrelation(np.array(value), 1 / np.sqrt(p * runs * (steps - apart)))
