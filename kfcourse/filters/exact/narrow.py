"""Narrow kernels: a noise that is small, or that vanishes at a state.

Then the sum over the nodes of a posterior is no integral any more, as the kernels of neighbouring nodes do not overlap.  So the
posterior is interpolated, its logarithm by polynomials through 8 nodes, and gets new nodes between the old ones, as many as
the kernels need.
"""

from __future__ import annotations

from math import comb
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from kfcourse.filters.densities import ScalarDensities
from kfcourse.filters.exact.constants import CACHED, LOWEST
from kfcourse.filters.exact.kernels import chunks
from kfcourse.laws import Array

PANEL_STEP = 3.0  # largest distance, in sigmas, that the centres of a panel of new nodes may cover
COARSE = 4  # old nodes' distances in the longest panels
PANEL = legendre.leggauss(8)  # errs by 2e-9 on a normal kernel three sigmas wide
BARYCENTRIC = np.array([(-1) ** i * comb(7, i) for i in range(8)], dtype=float)  # of polynomials through 8 equidistant points
STEEP = 80.0  # change of a logarithm over 8 nodes from which on no polynomial is put through them
LIGHT = 1e-20  # mass of a kernel that may be left out
TINY = 1e-14  # keeps a node's own number from dividing by zero
UNSEEN = 1e-10  # mass of a panel whose kernels need not overlap


class Finer(NamedTuple):
    """Kernels of posteriors on more nodes, those of all trajectories one after the other; (M,) each.

    Attributes
    ----------
    row : ndarray of int
        Ascending numbers of trajectories.
    mu, sigma, mass, even : ndarray
        Kernels, their masses, and the same by interpolation between every second one of the old nodes: these tell its error.
    """

    row: Array
    mu: Array
    sigma: Array
    mass: Array
    even: Array


def refined(x: Array, mass: Array, law: ScalarDensities, most: int) -> Finer:
    """Posteriors of equidistant nodes, (T, N), on panels so short that neighbouring kernels overlap.

    As functions of the node's number, x and log mass are smooth.  Kernels with too little mass to be made to overlap would be
    spikes, that a node of the next posterior may fall upon: at the ends they are widened instead, between two nodes, where the
    noise vanishes, left out.  A trajectory that would need more than `most` nodes is left out.
    """
    with np.errstate(divide="ignore"):
        values = np.stack([x, np.maximum(np.log(mass), -LOWEST)])
    row, i, weight, widest = panels(x, mass, law, most)
    (place, full), (_, even) = interpolated(values, i, row), interpolated(values[:, :, ::2], 0.5 * i, row)
    masses = []
    for logs in (full, even):
        share = weight * np.exp(logs)
        masses.append(share / np.bincount(row, share, len(x))[row])
    kept = np.maximum(*masses) > LIGHT
    mu, sigma = law.kernel(place)
    return Finer(*(array[kept] for array in (row, mu, np.maximum(sigma, widest), *masses)))


def interpolated(values: Array, at: Array, row: Array | int = 0, count: Array | None = None) -> Array:
    """Functions given at the numbers 0, 1, 2..., (n, T, N), between these, each for one trajectory: (n, M).

    By the polynomials through the eight nearest; a second function, a logarithm, by lines where it falls steeply.  If the nodes
    are filled up, `count` (M,) says how many there are.
    """
    result = np.empty((len(values), len(at)))
    flat, size = values.reshape(len(values), -1), values.shape[2]
    for piece in chunks(len(at), len(BARYCENTRIC), CACHED):
        known = size if count is None else count[piece]
        result[:, piece] = _piece(flat, known, at[piece], size * (row if isinstance(row, int) else row[piece]))
    return result


def _piece(flat: Array, count: Array | int, at: Array, begin: Array | int) -> Array:
    points = len(BARYCENTRIC)
    number = at.astype(int)
    near = np.clip(number - points // 2 + 1, 0, count - points) + np.arange(points)[:, None]
    share = BARYCENTRIC[:, None] / (at - near + TINY)
    known = flat[:, near + begin]
    result = (known * share).sum(axis=1) / share.sum(axis=0)
    if len(flat) == 1:
        return result
    left = np.minimum(number, count - 2)
    logs = flat[1]
    steep = known[1].max(axis=0) - known[1].min(axis=0) > STEEP
    line = logs[left + begin] + (at - left) * (logs[left + 1 + begin] - logs[left + begin])
    result[1] = np.where(steep, line, result[1])
    return result


def piece(x: Array, law: ScalarDensities) -> Array:
    """The numbers of the formulas that hold at x: 0 everywhere if the object does not jump."""
    return np.zeros(x.shape) if law.piece is None else law.piece(x)


def panels(x: Array, mass: Array, law: ScalarDensities, most: int) -> tuple[Array, Array, Array, Array]:
    """Gauss nodes and weights over the numbers of the nodes (T, N), on panels halved until kernels overlap.

    Returns rows, numbers, weights, and the sigmas with which kernels overlap on their panel, (M,) each; rows that need more than
    `most` nodes are left out.
    """
    rows, count = x.shape
    borders = np.append(np.arange(0, count - 1, COARSE), count - 1)
    at_border = np.stack([*law.kernel(x[:, borders]), piece(x[:, borders], law), mass[:, borders]])
    row = np.repeat(np.arange(rows), len(borders) - 1)
    left, right = (np.tile(side.astype(float), rows) for side in (borders[:-1], borders[1:]))
    known = [at_border[:, :, :-1].reshape(4, -1), at_border[:, :, 1:].reshape(4, -1)]  # mean, sigma, piece, mass at both ends
    done: list[tuple[Array, ...]] = []
    fits = np.ones(rows, dtype=bool)
    while len(left):
        middle = 0.5 * (left + right)
        at = interpolated(x[None], middle, row)[0]
        there = np.stack([*law.kernel(at), piece(at, law), mass[row, np.round(middle).astype(int)]])
        (a, s, i, m), (b, t, j, n), (c, u, k, o) = known[0], there, known[1]
        covered, room = np.abs(b - a) + np.abs(c - b), PANEL_STEP * np.minimum(np.minimum(s, t), u)
        covered = np.where((i != j) | (j != k), np.maximum(covered, 2 * room), covered)  # a jump, however small
        narrow = covered > room
        split = narrow & ((right - left) * np.maximum(np.maximum(m, n), o) > UNSEEN) & (middle > left) & (middle < right)
        kept = ~(split | narrow & (right - left < 1))
        done.append((row[kept], left[kept], right[kept], covered[kept] / PANEL_STEP))
        total = np.bincount(np.concatenate([*(one[0] for one in done), row[split], row[split]]), minlength=rows)
        fits &= total <= most // len(PANEL[0])
        split &= fits[row]
        row, left, right = (np.concatenate(pair) for pair in ((row, row), (left, middle), (middle, right)))
        known = [np.concatenate([known[0], there], axis=1), np.concatenate([there, known[1]], axis=1)]
        halves = np.concatenate([split, split])
        row, left, right, known = row[halves], left[halves], right[halves], [ends[:, halves] for ends in known]
    row, left, right, widest = (np.concatenate(side) for side in zip(*done, strict=True))
    order = np.flatnonzero(fits[row])
    order = order[np.lexsort((left[order], row[order]))]
    row, left, half = row[order], left[order, None], 0.5 * (right - left)[order, None]
    row, widest = (np.repeat(array, len(PANEL[0])) for array in (row, widest[order]))
    return row, (left + half * (1 + PANEL[0])).ravel(), (half * PANEL[1]).ravel(), widest
