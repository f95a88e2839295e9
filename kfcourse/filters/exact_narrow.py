"""Narrow kernels: a noise that is small, or that vanishes at a state.

Then the sum over the nodes of a posterior is no integral any more, as the kernels of neighbouring nodes do not overlap.  So the
posterior is interpolated, its logarithm by polynomials through 8 nodes, and gets new nodes between the old ones, as many as
the kernels need.
"""

from __future__ import annotations

from math import comb

import numpy as np
from numpy.polynomial import legendre

from kfcourse.filters.densities import ScalarDensities
from kfcourse.filters.exact_kernels import Grid, Kernels, TooNarrow
from kfcourse.laws import Array

STEP = 3.0  # largest distance, in sigmas, that the centres of a panel of new nodes may cover
PANEL = legendre.leggauss(8)  # errs by 2e-9 on a normal kernel three sigmas wide
BARYCENTRIC = np.array([(-1) ** i * comb(7, i) for i in range(8)], dtype=float)  # of polynomials through 8 equidistant points
STEEP = 80.0  # change of a logarithm over 8 nodes from which on no polynomial is put through them
DEAD = 700.0  # a logarithm this far below 0 is that of nothing
LIGHT = 1e-20  # mass of a kernel that may be left out
TINY = 1e-14  # keeps a node's own number from dividing by zero
UNSEEN = 1e-10  # mass of a panel whose kernels need not overlap


def refined(grid: Grid, law: ScalarDensities, rough: Kernels, most: int) -> Kernels:
    """The kernels of one posterior, (1, M), on panels so short that neighbouring kernels overlap.

    Parameters
    ----------
    grid : Grid
        With equidistant nodes: as functions of the node's number i, x and log mass are smooth.
    law : ScalarDensities
    rough : Kernels
        Those of the grid's own nodes, for `centre` and `width`.
    most : int
        Nodes that there may be.

    Raises
    ------
    TooNarrow
        The kernels are too narrow for the budget.
    """
    with np.errstate(divide="ignore"):
        logs = np.maximum(np.log(grid.mass), -DEAD)
    i, weight = panels(grid.x, grid.mass, law, most)
    (x, full), (_, even) = interpolated(np.stack([grid.x, logs]), i), interpolated(np.stack([grid.x, logs])[:, ::2], 0.5 * i)
    mass, other = (values / values.sum() for values in (weight * np.exp(full), weight * np.exp(even)))
    kept = np.maximum(mass, other) > LIGHT
    mu, sigma = law.kernel(x)
    mu, sigma, mass, other = (array[None, kept] for array in (mu, sigma, mass, other))
    return rough._replace(mu=mu, sigma=sigma, mass=mass, even=other, spectral=np.array([False]))


def interpolated(values: Array, at: Array) -> Array:
    """Functions given at the numbers 0, 1, 2..., (n, N), between these: (n, M).

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


def panels(x: Array, mass: Array, law: ScalarDensities, most: int) -> tuple[Array, Array]:
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
        if total + 2 * np.count_nonzero(split) > most // len(PANEL[0]):
            raise TooNarrow("the transition kernel is far narrower than the posterior")
        left, right = np.concatenate([left[split], middle[split]]), np.concatenate([middle[split], right[split]])
    left, right = (np.concatenate(side)[:, None] for side in zip(*done, strict=True))
    half = 0.5 * (right - left)
    return (left + half * (1 + PANEL[0])).ravel(), (half * PANEL[1]).ravel()
