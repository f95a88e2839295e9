"""How good a filter's prediction of the measurement is, doubt and all: proper scores.

    log score  ln p(y_k | y_0, ..., y_{k-1})
    CRPS       Integral (P(y | y_0, ..., y_{k-1}) - [y >= y_k])^2 dy

Of N(h, F) with the deviation s = sqrt(F) and z = (y - h) / s the second is s (z (2 Phi(z) - 1) +
2 phi(z) - 1 / sqrt(pi)): T. Gneiting and A. Raftery (2007).
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from kfcourse.filters.base import Filter, State
from kfcourse.laws import Array, log_density
from kfcourse.symbolic.structure import Structure


def scored(
    chosen: Filter, structure: Structure, before: State, y: Array, after: State
) -> tuple[Array, Array]:
    """Both scores of the measurement y (runs, p) for each trajectory, (runs,), by the filter's own
    structural functions, or these; NaN for the second where the prediction is not a normal law."""
    if chosen.evidence is not None:
        return chosen.evidence(before, y, after), np.full(len(y), np.nan)
    expected = after.expected
    if expected is None:
        expected = (chosen.structure or structure).at(before.step).measure(*before.predicted)
    variance = np.diagonal(expected.F, axis1=-2, axis2=-1)
    crps = crps_of_normal(expected.innovation(y), np.sqrt(variance)).sum(axis=-1)
    return log_density(expected, y), crps


def crps_of_normal(error: Array, deviation: Array) -> Array:
    """Of what came less the mean, and the deviation; |error| where that is 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.where(deviation > 0, error / deviation, np.inf)
        height = np.exp(-0.5 * z**2) / np.sqrt(2 * np.pi)
        value = deviation * (z * (2 * ndtr(z) - 1) + 2 * height - 1 / np.sqrt(np.pi))
    return np.where(deviation > 0, value, np.abs(error))
