"""Where a posterior lies: the states that explain the measurement, and the middle of the prediction.

Where the meter is sharp, the posterior is found near a root of b(x, m_w) = y.  Its width there is that of the meter's noise
over the slope of b.  Where the meter is poor, it is found where the prediction was.  Both are tried.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kfcourse.filters.densities import ScalarDensities
from kfcourse.filters.exact_batch import Place
from kfcourse.filters.exact_kernels import ROOT, Kernels
from kfcourse.laws import Array

HIDDEN = np.log(1e-9)  # mass of a hump that does not count
SEARCHED = 33  # points of the support that are looked at for a change of sign
SECTIONS = np.linspace(0, 1, 17)  # of a bracket
EXPLANATIONS = 3  # roots that are followed: those nearest to the middle of the prediction


class Candidates(NamedTuple):
    """Where humps may be: centres, widths, and logarithms of the masses before normalising, roughly; (T, 4) each."""

    centre: Array
    width: Array
    log_mass: Array

    def rows(self, chosen: Array | slice) -> Candidates:
        return Candidates(*(array[chosen] for array in self))


def likeliest(kernels: Kernels, y: Array, law: ScalarDensities) -> tuple[Place, Candidates]:
    """The place of the likeliest hump, and all candidates."""
    low, high = kernels.support()
    x = explanations(kernels, y, law, low, high)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        scale = np.fmin(law.meter_width(x), kernels.width)
    centres = np.concatenate([x, np.clip(kernels.centre, low, high)], axis=1)
    scales = np.concatenate([scale, kernels.width], axis=1)
    known = np.where(np.isnan(centres), kernels.centre, centres)
    coarse = kernels.thinned()
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.log(coarse.density(known, coarse.mass)[:, :, 0] * scales * ROOT) + law.log_likelihood(y, known)
    logs = np.where(np.isnan(centres) | np.isnan(logs) | ~(scales > 0), -np.inf, logs)
    best = np.where(np.isfinite(logs).any(axis=1), logs.argmax(axis=1), x.shape[1])[:, None]
    chosen = Place(np.take_along_axis(known, best, axis=1), np.take_along_axis(scales, best, axis=1), low, high)
    return chosen, Candidates(known, scales, logs)


def hidden(candidates: Candidates, place: Place, count: int) -> Array:
    """Rows (T,) in which a hump that may count could fall between two nodes."""
    counts = candidates.log_mass > candidates.log_mass.max(axis=1, keepdims=True) + HIDDEN
    return (counts & (place.distance(candidates.centre, count) > 2 * candidates.width)).any(axis=1)


def explanations(kernels: Kernels, y: Array, law: ScalarDensities, low: Array, high: Array) -> Array:
    """Roots (T, 3) of b(x, m_w) = y in the support, those nearest to the middle; NaN where there are fewer."""
    x, _ = Place(kernels.centre, kernels.width, low, high).nodes(SEARCHED)
    residual = law.residual(y, x)
    negative = residual > 0
    change = (negative[:, 1:] != negative[:, :-1]) & (np.abs(residual[:, 1:] - residual[:, :-1]) < law.jump)
    if np.isnan(y).any():
        change &= ~np.isnan(y)
    middle = np.abs(0.5 * (x[:, 1:] + x[:, :-1]) - kernels.centre)
    places = np.argsort(np.where(change, middle, np.inf), axis=1, kind="stable")[:, :EXPLANATIONS]
    found = np.take_along_axis(change, places, axis=1)
    left, right = np.take_along_axis(x, places, axis=1), np.take_along_axis(x, places + 1, axis=1)
    left_negative = np.take_along_axis(negative, places, axis=1)
    for _ in range(2):
        inner = left[:, :, None] + (right - left)[:, :, None] * SECTIONS
        same = (law.residual(y[:, :, None], inner) > 0) == left_negative[:, :, None]
        last = np.minimum(np.argmin(same, axis=2), len(SECTIONS) - 1)[:, :, None]
        last = np.maximum(last, 1)
        left, right = np.take_along_axis(inner, last - 1, axis=2)[:, :, 0], np.take_along_axis(inner, last, axis=2)[:, :, 0]
    root = 0.5 * (left + right)
    for _ in range(2):
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = root + law.residual(y, root) / law.slope(root)
        root = np.where((newton > left) & (newton < right), newton, root)
    return np.where(found, root, np.nan)
