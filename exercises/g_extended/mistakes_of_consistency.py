"""Known mistakes in the test of a filter's consistency: bounds (g2), NEES and NIS (g6)."""

from __future__ import annotations

from collections.abc import Callable
from statistics import NormalDist

import numpy as np
import scipy

from kfcourse.exercises import messages
from kfcourse.exercises.g_extended.keys import Normalised, innovation_covariance, normalised_with
from kfcourse.exercises.shared import Map
from kfcourse.laws import Array, apply, transpose
from kfcourse.linear.consistency import chi_squared_bounds, normalised_square

# -- g2: bounds

Bounds = Callable[[int, int, float], tuple[float, float]]


def _quantiles(probabilities: list[float], degrees: int) -> Array:
    """Of a chi-squared law."""
    return scipy.special.chdtri(degrees, 1 - np.array(probabilities))


def _interval(confidence: float, degrees: int) -> tuple[float, float]:
    """What lies between is as probable as the confidence says, the tails equally."""
    low, high = _quantiles([(1 - confidence) / 2, (1 + confidence) / 2], degrees)
    return low, high


def _scaled(bounds: tuple[float, float], divisor: float) -> tuple[float, float]:
    return bounds[0] / divisor, bounds[1] / divisor


def _normal_bounds(degrees: int, runs: int, confidence: float) -> tuple[float, float]:
    half = NormalDist().inv_cdf((1 + confidence) / 2) * np.sqrt(2 * degrees / runs)
    return degrees - half, degrees + half


WRONG_BOUNDS: tuple[tuple[str, str, Bounds], ...] = (
    (
        "one-value",
        "These are the bounds of a single value. The mean of many runs varies less: the degrees of freedom of a sum add up.",
        lambda degrees, runs, confidence: _interval(confidence, degrees),
    ),
    (
        "not-divided",
        "These are the bounds of the sum over the runs; those of the mean are asked for.",
        lambda degrees, runs, confidence: _interval(confidence, degrees * runs),
    ),
    (
        "runs-only",
        "The degrees of freedom are not only the number of runs: each run adds as many as the vector has components.",
        lambda degrees, runs, confidence: tuple(np.array(_interval(confidence, runs)) / runs),
    ),
    (
        "per-component",
        "Divided by the number of components too; the mean itself is asked for.",
        lambda degrees, runs, confidence: tuple(np.array(chi_squared_bounds(degrees, runs, confidence)) / degrees),
    ),
    (
        "one-value-divided",
        "The sum of the runs has more degrees of freedom than one value: they add up.",
        lambda degrees, runs, confidence: tuple(np.array(_interval(confidence, degrees)) / runs),
    ),
    (
        "one-sided",
        "Each bound leaves out the whole of the small probability; both together may leave it out, one half each.",
        lambda degrees, runs, confidence: tuple(_quantiles([1 - confidence, confidence], degrees * runs) / runs),
    ),
    (
        "half-confidence",
        "Halve what lies outside, not the confidence.",
        lambda degrees, runs, confidence: tuple(_quantiles([confidence / 2, 1 - confidence / 2], degrees * runs) / runs),
    ),
    ("normal", "That is the normal approximation; the chi-squared law itself is not symmetric.", _normal_bounds),
    (
        "one-less",
        "One degree of freedom is taken off; nothing is estimated here: all of them count.",
        lambda degrees, runs, confidence: tuple(np.array(_interval(confidence, degrees * runs - 1)) / runs),
    ),
    (
        "divided-by-root",
        "The bounds of the sum are divided by a root; a mean is a sum over the number of runs.",
        lambda degrees, runs, confidence: _scaled(_interval(confidence, degrees * runs), np.sqrt(runs)),
    ),
    (
        "degrees-and-runs-added",
        "The degrees of freedom of all runs add up: how many are there together?",
        lambda degrees, runs, confidence: _scaled(_interval(confidence, degrees + runs), runs),
    ),
    (
        "one-run-less",
        "One run is left out: no mean has been estimated here.",
        lambda degrees, runs, confidence: _scaled(_interval(confidence, degrees * (runs - 1)), runs - 1),
    ),
)


# -- g6: NEES and NIS


def _by_diagonal(vector: Array, cov: Array) -> Array:
    return (vector**2 / np.diagonal(cov, axis1=-2, axis2=-1)).sum(axis=-1)


def _by_deviation(vector: Array, cov: Array) -> Array:
    return (vector**2 / np.sqrt(np.diagonal(cov, axis1=-2, axis2=-1))).sum(axis=-1)


def _without_inverse(vector: Array, cov: Array) -> Array:
    return (vector * apply(cov, vector)).sum(axis=-1)


def _mean_first(x: Array, z: Array, p: Array, y: Array, lam: Array, Psi: Array, S: Map, H: Map, D_n: Map) -> tuple[Array, Array]:
    """The mean error normalised, instead of the mean of normalised errors."""
    F = innovation_covariance(Psi, H(lam), D_n(lam))
    state, measured = ((vector.mean(axis=1), cov.mean(axis=1)) for vector, cov in ((x - z, p), (y - S(lam), F)))
    return normalised_square(*state), normalised_square(*measured)


def _over(statistic: Callable[..., Array]) -> Normalised:
    """Another statistic over the trajectories than the mean."""

    def answer(x: Array, z: Array, p: Array, y: Array, lam: Array, Psi: Array, S: Map, H: Map, D_n: Map) -> tuple[Array, Array]:
        F = innovation_covariance(Psi, H(lam), D_n(lam))
        return statistic(normalised_square(x - z, p), axis=1), statistic(normalised_square(y - S(lam), F), axis=1)

    return answer


WRONG_NORMALISED: tuple[tuple[str, str, Normalised], ...] = (
    (
        "inverse-forgotten",
        messages.INVERSE_FORGOTTEN,
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
    ("correlations-ignored", messages.CORRELATIONS_IGNORED, normalised_with(_by_diagonal)),
    ("by-deviation", "The squares are divided by standard deviations; variances belong there.", normalised_with(_by_deviation)),
    (
        "per-component",
        "Divided by the number of components; the plain mean is asked for: it should be n, or p.",
        normalised_with(per_component=True),
    ),
    ("mean-first", messages.SQUARES_NOT_MEANS, _mean_first),
    ("median", "That is a median over the trajectories; the mean is asked for.", _over(np.median)),
    ("spread", "That is the spread over the trajectories; the mean is asked for.", _over(np.var)),
)
