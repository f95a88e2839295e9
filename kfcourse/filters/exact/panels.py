"""Panels that are halved until a Gauss-Legendre rule resolves densities on each of them, for many trajectories at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre

from kfcourse.filters.exact.constants import NEGLIGIBLE
from kfcourse.filters.exact.kernels import Grid, Unresolved
from kfcourse.laws import Array

SPLITS = 40  # times a panel may be halved
PANEL_NODES = 20_000  # nodes of a posterior


@dataclass(frozen=True)
class Rule:
    """A Gauss-Legendre rule on [-1, 1] that knows whether it resolves a function.

    Attributes
    ----------
    nodes, weights : ndarray (q,)
    tail : ndarray (2, q)
        Gives the two last Legendre coefficients of a function from its values at the nodes.
    tolerance : float
        Largest tail, relative to the mass of all panels, of a resolved panel.
    """

    nodes: Array
    weights: Array
    tail: Array
    tolerance: float

    @classmethod
    def of_order(cls, q: int, tolerance: float) -> Rule:
        nodes, weights = legendre.leggauss(q)
        vander = legendre.legvander(nodes, q - 1)
        scale = (2 * np.arange(q) + 1) / 2
        return cls(nodes, weights, (vander * weights[:, None] * scale).T[-2:], tolerance)


def resolve(
    borders: Array, log_density: Callable[[Array, Array], Array], too_wide: Callable[[Array, Array], Array], rule: Rule
) -> list[tuple[Grid, float]]:
    """Nodes and masses of exp(log_density), panels split until the rule resolves the density on each.

    Parameters
    ----------
    borders : ndarray (T, B)
        Of the first panels of each trajectory, ascending; equal ones have no panel between them.
    log_density : function of x (R, N) and trajectories (R,), to (R, N)
    too_wide : function of left and right (P,), to (P,)
        Panels to be split whatever the density.

    Returns
    -------
    list of (Grid, float)
        Each with the part of the mass that is in the last two Legendre coefficients: as large as the error where the density
        has kinks, and far larger where it is smooth, as a rule of q nodes integrates 2 q coefficients exactly.
    """
    panels = _Panels(len(borders), log_density, rule)
    first, place = np.nonzero(borders[:, 1:] > borders[:, :-1])
    panels.add(first, borders[first, place], borders[first, place + 1])
    for _ in range(SPLITS):
        mass, unresolved = panels.masses()
        total = np.bincount(panels.row, mass, len(borders))[panels.row]
        kept = mass > NEGLIGIBLE * total
        if rule.nodes.size * np.bincount(panels.row[kept], minlength=1).max() > PANEL_NODES:
            raise Unresolved(f"the posterior needs more than {PANEL_NODES:,} nodes")
        middle = 0.5 * (panels.left + panels.right)
        split = kept & (unresolved > rule.tolerance * total)
        split |= kept & (mass > rule.tolerance * total) & too_wide(panels.left, panels.right)
        split &= (middle > panels.left) & (middle < panels.right) & panels.seen()
        row, left, middle, right = (array[split] for array in (panels.row, panels.left, middle, panels.right))
        panels.keep(kept & ~split)
        if not len(row):
            break
        panels.add(np.concatenate([row, row]), np.concatenate([left, middle]), np.concatenate([middle, right]))
    return panels.grids()


class _Panels:
    """Panels of all trajectories: row, left and right end (P,), nodes and log-densities (P, q)."""

    def __init__(self, rows: int, log_density: Callable[[Array, Array], Array], rule: Rule):
        self.rows, self.log_density, self.rule = rows, log_density, rule
        self.peak = np.full(rows, -np.inf)  # the highest log-density of each trajectory
        self.row: Array = np.empty(0, dtype=int)
        self.left: Array = np.empty(0)
        self.right: Array = np.empty(0)
        self.x, self.logs = np.empty((2, 0, len(rule.nodes)))

    def add(self, row: Array, left: Array, right: Array) -> None:
        """Further ones, in any order; log-densities of all trajectories are asked for at once."""
        if not len(row):
            return
        x = 0.5 * (left + right)[:, None] + 0.5 * (right - left)[:, None] * self.rule.nodes
        some, place, count = np.unique(row, return_inverse=True, return_counts=True)
        order = np.argsort(place, kind="stable")
        slot = np.empty(len(row), dtype=int)
        slot[order] = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
        asked = np.repeat(x[order[np.cumsum(count) - 1]][:, None], count.max(), axis=1)  # filled up with the last panel
        asked[place, slot] = x
        logs = self.log_density(asked.reshape(len(some), -1), some).reshape(asked.shape)[place, slot]
        np.maximum.at(self.peak, row, logs.max(axis=1))
        for name, new in (("row", row), ("left", left), ("right", right), ("x", x), ("logs", logs)):
            setattr(self, name, np.concatenate([getattr(self, name), new]))

    def keep(self, chosen: Array) -> None:
        for name in ("row", "left", "right", "x", "logs"):
            setattr(self, name, getattr(self, name)[chosen])

    def seen(self) -> Array:
        """Panels of trajectories whose density is a number anywhere."""
        return np.isfinite(self.peak)[self.row]

    def values(self) -> Array:
        """Densities (P, q) relative to the highest of each trajectory; flat where nothing is seen."""
        with np.errstate(invalid="ignore"):
            return np.where(self.seen()[:, None], np.exp(self.logs - self.peak[self.row, None]), 1.0)

    def masses(self) -> tuple[Array, Array]:
        """The mass of each panel (P,), and that in its last two Legendre coefficients."""
        values, half = self.values(), 0.5 * (self.right - self.left)
        return half * (values @ self.rule.weights), half * np.abs(values @ self.rule.tail.T).sum(axis=1)

    def grids(self) -> list[tuple[Grid, float]]:
        values, (mass, unresolved) = self.values(), self.masses()
        masses = 0.5 * (self.right - self.left)[:, None] * self.rule.weights * values
        total, left_over = (np.bincount(self.row, one, self.rows) for one in (mass, unresolved))
        order = np.lexsort((self.left, self.row))
        order = order[mass[order] > NEGLIGIBLE * total[self.row[order]]]
        ends = np.cumsum(np.bincount(self.row[order], minlength=self.rows))
        found = []
        for i, chosen in enumerate(np.split(order, ends[:-1])):
            x, m, density = (array[chosen].ravel() for array in (self.x, masses, values))
            whole = m.sum()
            found.append((Grid(x, m / whole, density / whole), float(left_over[i] / whole)))
        return found
