"""Errors of a track by part of the flight, with standard errors."""

from __future__ import annotations

import numpy as np

from kfcourse.laws import Array
from kfcourse.montecarlo.statistics import Estimate, ratio


def rms_by_part(error: Array, part: Array) -> Estimate:
    """Root mean square length of the error in each part, with standard errors.

    For a run, the mean over the steps of the part of |e|^2; then the root of its mean over the
    runs.  The runs are independent, the steps of a run are not: the standard error comes from the
    scatter of the runs.

    Parameters
    ----------
    error : ndarray (steps, runs, 3)
    part : ndarray (steps,)
        Labels, such as `track.part`; the results are in their sorted order.
    """
    squares = _by_part(error, part)
    return _root(squares, squares.mean(axis=1))


def rms_difference(error: Array, other: Array, part: Array) -> Estimate:
    """RMS of `error` less that of `other` by part, as `rms_by_part`, on common runs: the standard
    error is of the pair."""
    ours, theirs = _by_part(error, part), _by_part(other, part)
    if ours.shape != theirs.shape:
        raise ValueError(
            f"both errors must be of the same runs, got {ours.shape[1]} and {theirs.shape[1]}"
        )
    first, second = (np.sqrt(squares.mean(axis=1)) for squares in (ours, theirs))
    influence = _influence(ours, first) - _influence(theirs, second)  # both from the same run
    return Estimate(first - second, _standard_error(influence), ours.shape[1] - 1)


def _by_part(error: Array, part: Array) -> Array:
    """Mean square length by part and run, (parts, runs)."""
    if len(error) != len(part) or error.shape[1] < 2:
        raise ValueError(
            f"errors must have the shape ({len(part)}, runs, components), two runs at least; got "
            f"{error.shape}"
        )
    square = (error**2).sum(axis=-1)
    return np.stack([square[part == label].mean(axis=0) for label in np.unique(part)])


def _root(squares: Array, mean: Array) -> Estimate:
    root = np.sqrt(mean)
    return Estimate(root, _standard_error(_influence(squares, root)), squares.shape[1] - 1)


def _influence(squares: Array, root: Array) -> Array:
    """d sqrt(m) = dm / (2 sqrt(m)); of no errors at all 0."""
    return ratio(squares, 2 * root[:, None], 0.0)


def _standard_error(values: Array) -> Array:
    return values.std(axis=1, ddof=1) / np.sqrt(values.shape[1])
