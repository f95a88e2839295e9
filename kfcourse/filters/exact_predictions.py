"""From posteriors to predictions: which of the three ways a trajectory takes.

exact_kernels  a kernel for each node, where neighbouring kernels overlap
exact_narrow   more nodes between these, where they do not
exact_noise    the integral over the noise, where too many more would be needed
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kfcourse.filters.densities import ScalarDensities
from kfcourse.filters.exact_kernels import Grid, Kernels, Unresolved, apart, overlapping
from kfcourse.filters.exact_narrow import refined
from kfcourse.filters.exact_noise import by_noise
from kfcourse.laws import Array

FEW = 2048  # nodes with which a sum of kernels is cheaper than the integral over the noise
MOST = 24_576  # nodes with which the largest array has 50 MB, and a step takes 50 ms


def predictions(grids: Sequence[Grid], law: ScalarDensities) -> list[tuple[Array, Kernels]]:
    """The predictions of all posteriors, those of equally many kernels together: (places of the posteriors, kernels)."""
    groups: dict[tuple[int, bool], list[int]] = {}
    for i, grid in enumerate(grids):
        size = len(grid.x) if grid.uniform else 64 * -(-len(grid.x) // 64)
        groups.setdefault((size, grid.uniform), []).append(i)
    result = []
    finer: dict[int, list[tuple[int, Kernels]]] = {}
    for (size, uniform), members in groups.items():
        rows = np.array(members)
        x, mass, density = _stacked([grids[i][:3] for i in members], size, 1)
        kernels = overlapping(x, mass, density, uniform, law)
        narrow = uniform & (apart(kernels.mu, kernels.sigma, mass) > 1)
        if not narrow.all():
            result.append((rows[~narrow], kernels.rows(~narrow)))
        for i in np.flatnonzero(narrow).tolist():
            one = _narrow(grids[members[i]], law, kernels.rows(slice(i, i + 1)))
            if one.pushed is not None:
                result.append((rows[i : i + 1], one))
                continue
            finer.setdefault(128 * -(-one.mu.shape[1] // 128), []).append((members[i], one))
    for size, several in finer.items():
        mu, sigma, mass, even = _stacked([[one.mu[0], one.sigma[0], one.mass[0], one.even[0]] for _, one in several], size, 2)
        centre, width, spectral = (
            np.concatenate([getattr(one, name) for _, one in several]) for name in ("centre", "width", "spectral")
        )
        result.append((np.array([i for i, _ in several]), Kernels(mu, sigma, mass, even, centre, width, spectral)))
    return result


def _narrow(grid: Grid, law: ScalarDensities, rough: Kernels) -> Kernels:
    """The prediction of one trajectory whose kernels do not overlap, by the cheapest way that there is."""
    for way in (lambda: refined(grid, law, rough, FEW), lambda: by_noise(grid, law, rough)):
        try:
            return way()
        except Unresolved:
            continue
    return refined(grid, law, rough, MOST)


def _stacked(rows: Sequence[Sequence[Array]], size: int, places: int) -> Array:
    """Arrays (size,) of each row, (number of arrays, rows, size): the first are places, filled up with the last; then 0."""
    found = np.zeros((len(rows[0]), len(rows), size))
    for i, row in enumerate(rows):
        for j, array in enumerate(row):
            found[j, i, : len(array)] = array
            if j < places:
                found[j, i, len(array) :] = array[-1]
    return found
