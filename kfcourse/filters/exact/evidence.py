r"""How likely a measurement was before it came: Bayes' rule, read backwards at one node.

    p(y_k | y_0..k-1) = p(x | y_0..k-1) p(y_k | x) / p(x | y_0..k)       at any x

The filter has all three on its nodes.  The highest one is taken: its densities are known best, and one node costs nothing beside
the hundred that the filter takes.  Of a meter without noise the posterior is a few points x_r, and p(y_k | ...) the sum of
p(x_r | y_0..k-1) / |b'(x_r)|.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from kfcourse.filters.densities import ScalarDensities
from kfcourse.filters.exact.constants import SHARP
from kfcourse.filters.exact.kernels import Grid, Kernels
from kfcourse.laws import Array


def log_evidence(groups: Iterable[tuple[Array, Kernels]], y: Array, law: ScalarDensities, posteriors: Sequence[Grid]) -> Array:
    """ln p(y_k | y_0..k-1) of each trajectory, (runs,), from predictions, y (runs, 1), and posteriors; 0 where y is missing."""
    found = np.zeros(len(y))
    with np.errstate(divide="ignore"):
        for rows, kernels in groups:
            grids = [posteriors[i] for i in rows.tolist()]
            if law.noiseless:
                found[rows] = [_of_roots(kernels.rows(slice(i, i + 1)), grid, law) for i, grid in enumerate(grids)]
                continue
            tops = [(grid, grid.density.argmax()) for grid in grids]
            x, density = np.array([(grid.x[top], grid.density[top]) for grid, top in tops]).T[:, :, None]
            known = density >= SHARP  # a prior without variance
            before = np.where(known, 1.0, kernels.density(x, kernels.mass)[:, :, 0])
            found[rows] = (np.log(before) + law.log_likelihood(y[rows], x) - np.log(np.where(known, 1.0, density)))[:, 0]
    return np.where(np.isnan(y[:, 0]), 0.0, found)


def _of_roots(kernels: Kernels, grid: Grid, law: ScalarDensities) -> float:
    return float(np.log((kernels.density(grid.x[None], kernels.mass)[0, :, 0] / np.abs(law.slope(grid.x))).sum()))
