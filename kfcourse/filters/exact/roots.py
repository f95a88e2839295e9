"""A meter without noise: the posterior is a few points, the roots of b(x) = y.

    P(x_r) = C p(x_r) / |b'(x_r)|,    p the prediction

The next prediction is then a sum of normal kernels, one for each root, and nothing is approximated.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kfcourse.filters.densities import ScalarDensities
from kfcourse.filters.exact.constants import ELEMENTS, SHARP
from kfcourse.filters.exact.kernels import Grid, Kernels, Unresolved, chunks
from kfcourse.laws import Array

SCANNED = 4097  # equidistant states of the support, between which signs may change
HALVED = 60  # times a bracket is halved: to the last bit


def at_roots(kernels: Kernels, y: Array, law: ScalarDensities) -> list[Grid]:
    """Posteriors from the kernels of the predictions (T, M), and measurements (T, 1).

    Where no state explains y exactly, as rounding may have it, the posterior is the state that explains it best.

    Raises
    ------
    Unresolved
        The prediction has no density at any state that explains y: the object is without noise, too.
    """
    grids: list[Grid] = []
    for rows in chunks(len(y), SCANNED, ELEMENTS):
        grids += _of_chunk(kernels.rows(rows), y[rows], law)
    return grids


def _of_chunk(kernels: Kernels, y: Array, law: ScalarDensities) -> list[Grid]:
    low, high = kernels.support()
    x = low + (high - low) * np.linspace(0, 1, SCANNED)
    residual = law.residual(y, x)
    negative = residual < 0
    # an angle's residual also changes its sign on the far side of the circle, by a jump
    change = (negative[:, 1:] != negative[:, :-1]) & (np.abs(residual[:, 1:] - residual[:, :-1]) < law.jump)
    row, place = np.nonzero(change)
    brackets = [(row, x[row, place], x[row, place + 1])]
    # two roots between two scanned states: the signal turns there, beyond y
    size = np.abs(residual)
    dip = (size[:, 1:-1] <= size[:, 2:]) & (size[:, 1:-1] <= size[:, :-2]) & ~change[:, 1:] & ~change[:, :-1]
    row, place = np.nonzero(dip)
    left, right = x[row, place], x[row, place + 2]
    turn = np.mean(halved(lambda at: law.slope(at) < 0, left, right), axis=0)
    crossed = (law.residual(y[row, 0], turn) < 0) != (law.residual(y[row, 0], left) < 0)
    brackets += [(row[crossed], left[crossed], turn[crossed]), (row[crossed], turn[crossed], right[crossed])]
    row, left, right = (np.concatenate(side) for side in zip(*brackets, strict=True))
    root = np.mean(halved(lambda at: law.residual(y[row, 0], at) < 0, left, right), axis=0)
    found = [np.sort(root[row == i]) for i in range(len(y))]
    nearest = np.abs(residual).argmin(axis=1)
    roots = [one if len(one) else x[i, nearest[i] : nearest[i] + 1] for i, one in enumerate(found)]
    return [_weighed(one, kernels.rows(slice(i, i + 1)), law) for i, one in enumerate(roots)]


def halved(sign: Callable[[Array], Array], left: Array, right: Array, times: int = HALVED) -> tuple[Array, Array]:
    """Brackets in which a sign changes, after so many bisections; arrays of one shape."""
    at_left = sign(left)
    for _ in range(times):
        middle = 0.5 * (left + right)
        same = sign(middle) == at_left
        left, right = np.where(same, middle, left), np.where(same, right, middle)
    return left, right


def _weighed(roots: Array, kernels: Kernels, law: ScalarDensities) -> Grid:
    with np.errstate(divide="ignore"):
        weight = kernels.density(roots[None], kernels.mass)[0, :, 0] / np.abs(law.slope(roots))
    if len(roots) == 1:
        weight = np.ones(1)
    total = weight.sum()
    if not 0 < total < np.inf:
        raise Unresolved("object and meter are without noise there, or the meter is flat: no density tells the states apart")
    return Grid(roots, weight / total, np.full(len(roots), SHARP))
