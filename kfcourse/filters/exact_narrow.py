"""Narrow kernels: a noise that is small, or that vanishes at a state.

Then the sum over the nodes of a posterior is no integral any more, as the kernels of neighbouring nodes do not overlap.  So the
posterior is interpolated, its logarithm by polynomials through 8 nodes, and gets new nodes between the old ones, as many as
the kernels need.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import comb

import numpy as np
from numpy.polynomial import legendre

from kfcourse.filters.densities import ScalarDensities
from kfcourse.filters.exact_kernels import Grid, Kernels, Unresolved, apart, overlapping
from kfcourse.laws import Array

STEP = 3.0  # largest distance, in sigmas, that the centres of a panel of new nodes may cover
PANEL = legendre.leggauss(8)  # errs by 2e-9 on a normal kernel three sigmas wide
BARYCENTRIC = np.array([(-1) ** i * comb(7, i) for i in range(8)], dtype=float)  # of polynomials through 8 equidistant points
STEEP = 80.0  # change of a logarithm over 8 nodes from which on no polynomial is put through them
DEAD = 700.0  # a logarithm this far below 0 is that of nothing
LIGHT = 1e-20  # mass of a kernel that may be left out
TINY = 1e-14  # keeps a node's own number from dividing by zero
UNSEEN = 1e-10  # mass of a panel whose kernels need not overlap
MOST = 24_576  # nodes of a refined posterior: with them and 257 new nodes the largest array has 50 MB, and a step takes 50 ms


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
            one = refined(grids[members[i]], law, kernels.rows(slice(i, i + 1)))
            finer.setdefault(128 * -(-one.mu.shape[1] // 128), []).append((members[i], one))
    for size, several in finer.items():
        mu, sigma, mass, even = _stacked([[array[0] for array in one[:4]] for _, one in several], size, 2)
        rest = (np.concatenate([one[i] for _, one in several]) for i in range(4, 7))
        result.append((np.array([i for i, _ in several]), Kernels(mu, sigma, mass, even, *rest)))
    return result


def _stacked(rows: Sequence[Sequence[Array]], size: int, places: int) -> Array:
    """Arrays (size,) of each row, (number of arrays, rows, size): the first are places, filled up with the last; then 0."""
    found = np.zeros((len(rows[0]), len(rows), size))
    for i, row in enumerate(rows):
        for j, array in enumerate(row):
            found[j, i, : len(array)] = array
            if j < places:
                found[j, i, len(array) :] = array[-1]
    return found


def refined(grid: Grid, law: ScalarDensities, rough: Kernels) -> Kernels:
    """The kernels of one posterior, (1, M), on panels so short that neighbouring kernels overlap.

    Parameters
    ----------
    grid : Grid
        With equidistant nodes: as functions of the node's number i, x and log mass are smooth.
    law : ScalarDensities
    rough : Kernels
        Those of the grid's own nodes, for `centre` and `width`.

    Raises
    ------
    Unresolved
        The kernels are too narrow for the budget.
    """
    with np.errstate(divide="ignore"):
        logs = np.maximum(np.log(grid.mass), -DEAD)
    i, weight = _panels(grid.x, grid.mass, law)
    (x, full), (_, even) = interpolated(np.stack([grid.x, logs]), i), interpolated(np.stack([grid.x, logs])[:, ::2], 0.5 * i)
    mass, other = (values / values.sum() for values in (weight * np.exp(full), weight * np.exp(even)))
    kept = np.maximum(mass, other) > LIGHT
    mu, sigma = law.kernel(x)
    new = (array[None, kept] for array in (mu, sigma, mass, other))
    return rough._replace(**dict(zip(("mu", "sigma", "mass", "even"), new, strict=True)), spectral=np.array([False]))


def interpolated(values: Array, at: Array) -> Array:
    """Functions given at the numbers 0, 1, 2..., (2, N), between these: (2, M).

    By the polynomials through the eight nearest; the second function, a logarithm, by lines where it falls steeply.
    """
    points = len(BARYCENTRIC)
    first = np.clip(at.astype(int) - points // 2 + 1, 0, values.shape[1] - points)
    near = first[:, None] + np.arange(points)
    share = BARYCENTRIC / (at[:, None] - near + TINY)
    result = (values[:, near] * share).sum(axis=2) / share.sum(axis=1)
    left = np.minimum(at.astype(int), values.shape[1] - 2)
    logs = values[1]
    steep = logs[near].max(axis=1) - logs[near].min(axis=1) > STEEP
    line = logs[left] + (at - left) * (logs[left + 1] - logs[left])
    result[1] = np.where(steep, line, result[1])
    return result


def _panels(x: Array, mass: Array, law: ScalarDensities) -> tuple[Array, Array]:
    """Gauss nodes and weights over the numbers of the nodes, on panels halved until kernels overlap."""
    numbers = np.arange(len(x))
    left, right = numbers[:-1:2].astype(float), numbers[2::2].astype(float)
    done: list[tuple[Array, Array]] = []
    total = 0
    while len(left):
        middle = 0.5 * (left + right)
        (a, s), (b, u), (_, t) = (law.kernel(np.interp(side, numbers, x)) for side in (left, right, middle))
        matters = (right - left) * np.maximum(mass[left.astype(int)], mass[np.ceil(right).astype(int)]) > UNSEEN
        split = matters & (np.abs(b - a) > STEP * np.minimum(np.minimum(s, u), t)) & (middle > left) & (middle < right)
        done.append((left[~split], right[~split]))
        total += int(np.count_nonzero(~split))
        if total + 2 * np.count_nonzero(split) > MOST // len(PANEL[0]):
            raise Unresolved("the transition kernel is far narrower than the posterior")
        left, right = np.concatenate([left[split], middle[split]]), np.concatenate([middle[split], right[split]])
    left, right = (np.concatenate(side)[:, None] for side in zip(*done, strict=True))
    half = 0.5 * (right - left)
    return (left + half * (1 + PANEL[0])).ravel(), (half * PANEL[1]).ravel()
