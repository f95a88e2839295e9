"""From posteriors to predictions: which of the three ways a trajectory takes.

kernels  a kernel for each node, where neighbouring kernels overlap
narrow   more nodes between these, where they do not, or where the object jumps
noise    the integral over the noise, where too many more would be needed
merging  fewer kernels, where panels have made them crowd
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from kfcourse.filters.densities import ScalarDensities
from kfcourse.filters.exact.constants import ELEMENTS, FEW
from kfcourse.filters.exact.kernels import Grid, Kernels, TooNarrow, Unresolved, apart, chunks, overlapping
from kfcourse.filters.exact.merging import MANY, merged
from kfcourse.filters.exact.narrow import Finer, piece, refined
from kfcourse.filters.exact.noise import by_noise
from kfcourse.laws import Array

KERNELS = 24_576  # nodes with which the largest array has 50 MB, and a step takes 50 ms
PACKED = (256, 512, 768, 1024, 1536, 2048, 4096, 8192, 16_384, KERNELS)  # kernels up to which predictions are taken together


def predictions(grids: Sequence[Grid], law: ScalarDensities) -> Iterator[tuple[Array, Kernels]]:
    """The predictions of all posteriors, those of about as many kernels together: (places of the posteriors, kernels)."""
    groups: dict[tuple[int, bool, bool], list[int]] = {}
    for place, grid in enumerate(grids):
        size = len(grid.x) if grid.uniform else 64 * -(-len(grid.x) // 64)
        groups.setdefault((size, grid.uniform, grid.rough and size > MANY), []).append(place)
    finer: list[Finer] = []
    crowded: list[Finer] = []
    middle = np.empty((2, len(grids), 1))  # centre and width of each prediction
    for (size, uniform, crowd), members in groups.items():
        for some in chunks(len(members), size, ELEMENTS // 2):
            rows = np.array(members[some])
            x, mass, density = _stacked([grids[i] for i in rows.tolist()], size)
            kernels = overlapping(x, mass, density, uniform, law)
            middle[:, rows] = kernels.centre, kernels.width
            if crowd and law.piece is None:
                found = merged(x, mass, law)
                crowded.append(found._replace(row=rows[found.row]))
                continue
            numbers = piece(x, law)
            across = (numbers[:, 1:] != numbers[:, :-1]).any(axis=1)
            if across.any() and not uniform:
                raise Unresolved("a posterior that needed panels lies across a jump of the object")
            too_narrow = across | (uniform & (apart(kernels.mu, kernels.sigma, mass) > 1))
            narrow = np.flatnonzero(too_narrow)
            if not len(narrow):
                yield rows, kernels
                continue
            if not too_narrow.all():
                yield rows[~too_narrow], kernels.rows(~too_narrow)
            for chunk in chunks(len(narrow), FEW, ELEMENTS // 2):
                i = narrow[chunk]
                found = refined(x[i], mass[i], law, FEW)
                finer.append(found._replace(row=rows[i[found.row]]))
                for j in np.setdiff1d(i, i[found.row]).tolist():
                    way = _far_narrower(Grid(x[j], mass[j], density[j], uniform=True), law, kernels.rows(slice(j, j + 1)))
                    if isinstance(way, Finer):
                        finer.append(way._replace(row=np.full(len(way.row), rows[j])))
                    else:
                        yield rows[j : j + 1], way
                if sum(len(one.row) for one in finer) > ELEMENTS // 2:
                    yield from _packed(finer, *middle)
                    finer = []
    if finer:
        yield from _packed(finer, *middle)
    if crowded:
        yield from ((places, kernels._replace(panels=True)) for places, kernels in _packed(crowded, *middle))


def _far_narrower(grid: Grid, law: ScalarDensities, rough: Kernels) -> Kernels | Finer:
    """The prediction of one trajectory whose kernels are too narrow for a sum of FEW."""
    try:
        if law.piece is not None:
            raise Unresolved("its inverse, which the integral over the noise takes, has gaps where the object jumps")
        return by_noise(grid, law, rough)
    except Unresolved:
        found = refined(grid.x[None], grid.mass[None], law, KERNELS)
        if not len(found.row):
            raise TooNarrow("the transition kernel is far narrower than the posterior") from None
        return found


def _packed(finer: Sequence[Finer], centre: Array, width: Array) -> Iterator[tuple[Array, Kernels]]:
    """Those of about as many nodes together, filled up with kernels of no mass."""
    row, *values = (np.concatenate(arrays) for arrays in zip(*finer, strict=True))
    order = np.argsort(row, kind="stable")
    row, values = row[order], [array[order] for array in values]
    count = np.bincount(row, minlength=len(centre))
    end = np.cumsum(count)
    number = np.arange(len(row)) - (end - count)[row]
    sizes = np.array(PACKED)[np.searchsorted(PACKED, count)]
    for size in np.unique(sizes[count > 0]).tolist():
        some = np.flatnonzero((sizes == size) & (count > 0))
        chosen = np.flatnonzero(sizes[row] == size)
        mu, sigma, mass, even = np.zeros((4, len(some), count[some].max()))
        mu += values[0][end[some] - 1, None]
        sigma += values[1][end[some] - 1, None]
        for array, wanted in zip((mu, sigma, mass, even), values, strict=True):
            array[np.searchsorted(some, row[chosen]), number[chosen]] = wanted[chosen]
        yield some, Kernels(mu, sigma, mass, even, centre[some], width[some], np.zeros(len(some), dtype=bool))


def _stacked(grids: Sequence[Grid], size: int) -> tuple[Array, Array, Array]:
    """Nodes, masses and densities (T, size), filled up with the last node, that has no mass a second time."""
    if all(len(grid.x) == size for grid in grids):
        x, mass, density = (np.array(arrays) for arrays in list(zip(*grids, strict=True))[:3])
        return x, mass, density
    x, mass, density = np.zeros((3, len(grids), size))
    for i, grid in enumerate(grids):
        count = len(grid.x)
        x[i, :count], mass[i, :count], density[i, :count] = grid[:3]
        x[i, count:] = grid.x[-1]
    return x, mass, density
