"""Errors of a track by part of the flight, with standard errors."""

from __future__ import annotations

import numpy as np

from kfcourse.laws import Array
from kfcourse.montecarlo.statistics import Estimate, means_without_each


def rms_by_part(error: Array, part: Array) -> Estimate:
    """Root mean square length of the error in each part, with standard errors.

    For a run, the mean over the steps of the part of |e|^2; then the root of its mean over the
    runs.  The runs are independent, the steps of a run are not: the standard error comes from the
    scatter of the runs, by the jackknife over batches of them.

    Parameters
    ----------
    error : ndarray (steps, runs, 3)
    part : ndarray (steps,)
        Labels, such as `track.part`; the results are in their sorted order.
    """
    return Estimate.jackknife(_roots(error, part))


def rms_difference(error: Array, other: Array, part: Array) -> Estimate:
    """RMS of `error` less that of `other` by part, as `rms_by_part`, on common runs: the standard
    error is of the pair."""
    return Estimate.jackknife(_roots(error, part) - _roots(other, part))


def _roots(error: Array, part: Array) -> Array:
    """By part, of all runs and without each batch of them, (parts, 1 + batches)."""
    if len(error) != len(part) or error.shape[1] < 2:
        raise ValueError(
            f"errors must have the shape ({len(part)}, runs, components), two runs at least; got "
            f"{error.shape}"
        )
    square = (error**2).sum(axis=-1)
    squares = np.stack([square[part == label].mean(axis=0) for label in np.unique(part)], axis=1)
    return np.sqrt(means_without_each(squares)).T
