"""Kernels that crowd: where a posterior is sharp, panels put hundreds of nodes within a sigma of the next prediction's kernels.

The kernels of all nodes in a cell, some tenths of a sigma long, have about the same sum as two: those at the Gauss rule of the
nodes' masses.  With the mean m, variance v and third moment s of the nodes of a cell, they lie at x_1 and x_2 and have the shares
w_1 and w_2 of its mass:

    x_1 = m + sqrt(v) (g - r),    x_2 = m + sqrt(v) (g + r),    r = sqrt(1 + g^2),    g = s / (2 v^(3/2)),
    w_1 = (1 + g / r) / 2,    w_2 = (1 - g / r) / 2

Moments up to the third are kept, so what is lost is the fourth derivative of a kernel by its node over a cell.
"""

from __future__ import annotations

import numpy as np

from kfcourse.filters.densities import ScalarDensities
from kfcourse.filters.exact.narrow import Finer
from kfcourse.laws import Array

MANY = 64  # nodes: kernels of fewer are not merged
CELL = 0.4  # sigmas of a cell
MERGED = 0.011 * (CELL / 2) ** 4  # that a density errs by, relative to its height: 2e-5


def merged(x: Array, mass: Array, law: ScalarDensities) -> Finer:
    """Fewer kernels of posteriors on nodes (T, N), with the same sum up to MERGED, those of all trajectories one after the other.

    Where the mean or the variance of a cell's kernels would change by more, in sigmas, as where the state's equation has a kink
    or turns, its nodes stay as they are.
    """
    mu, sigma = law.kernel(x)
    steps = (np.abs(np.diff(mu, axis=1)) + np.abs(np.diff(sigma, axis=1))) / np.minimum(sigma[:, 1:], sigma[:, :-1])
    number = np.floor(np.cumsum(np.fmin(steps / CELL, 1.0), axis=1))
    begins = np.concatenate([np.ones((len(x), 1), dtype=bool), np.diff(number, axis=1, prepend=0.0) != 0], axis=1)
    first, cell = np.flatnonzero(begins), np.cumsum(begins) - 1
    row = first // x.shape[1]
    x, mass, mu, sigma = (array.ravel() for array in (x, mass, mu, sigma))
    total = np.add.reduceat(mass, first)

    def average(values: Array) -> Array:
        return np.add.reduceat(mass * values, first) / np.where(total > 0, total, 1.0)

    mean = x[first] + average(x - x[first][cell])
    away = x - mean[cell]
    spread = np.sqrt(average(away * away))
    with np.errstate(divide="ignore", invalid="ignore"):
        g = np.where(spread > 1e-100, average(away**3) / (2 * spread**3), 0.0)
    root = np.sqrt(1 + g * g)
    share = np.where(spread > 1e-100, 0.5 * (1 + g / root), 1.0)
    share = np.stack([share, 1 - share])
    to, width = law.kernel(mean + spread * (g + np.stack([-root, root])))
    here, there, scale = mu - mu[first][cell], to - mu[first], sigma[first]  # from a cell's first kernel
    shift = (share * there).sum(axis=0) - average(here)
    widening = (share * (there**2 + width**2)).sum(axis=0) - average(here**2 + sigma**2)
    two = (np.abs(shift) <= MERGED * scale) & (np.abs(widening) <= MERGED * scale**2)
    rest = ~two[cell]
    parts = [(row[cell], mu, sigma, mass, rest), *((row, to[i], width[i], share[i] * total, two) for i in range(2))]
    chosen = [[array[which & (weight > 0)] for array in (number, m, s, weight)] for number, m, s, weight, which in parts]
    row, mu, sigma, mass = (np.concatenate(arrays) for arrays in zip(*chosen, strict=True))
    return Finer(row, mu, sigma, mass, mass)
