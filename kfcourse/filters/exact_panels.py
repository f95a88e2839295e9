"""Panels that are halved until a Gauss-Legendre rule resolves a density on each of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre

from kfcourse.filters.exact_kernels import NEGLIGIBLE, Grid, Unresolved
from kfcourse.laws import Array

SPLITS = 40  # times a panel may be halved
MOST = 20_000  # nodes of a posterior


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


def resolve(borders: Array, log_density: Callable[[Array], Array], too_wide: Callable[[Array, Array], Array], rule: Rule) -> Grid:
    """Nodes and masses of exp(log_density), its panels split until the rule resolves it on each."""
    left, right = borders[:-1], borders[1:]
    x, logs = _evaluate(left, right, log_density, rule)
    for _ in range(SPLITS):
        values = _relative(logs)
        half = 0.5 * (right - left)
        mass = half * (values @ rule.weights)
        total = mass.sum()
        kept = mass > NEGLIGIBLE * total
        if rule.nodes.size * np.count_nonzero(kept) > MOST:
            raise Unresolved(f"the posterior needs more than {MOST:,} nodes")
        unresolved = half * np.abs(values @ rule.tail.T).sum(axis=1) > rule.tolerance * total
        split = kept & (unresolved | (too_wide(left, right) & (mass > rule.tolerance * total)))
        middle = 0.5 * (left + right)
        split &= (middle > left) & (middle < right)
        if not split.any():
            break
        stay = kept & ~split
        a = np.concatenate([left[split], middle[split]])
        b = np.concatenate([middle[split], right[split]])
        new_x, new_logs = _evaluate(a, b, log_density, rule)
        left, right = np.concatenate([left[stay], a]), np.concatenate([right[stay], b])
        x, logs = np.concatenate([x[stay], new_x]), np.concatenate([logs[stay], new_logs])
    values = _relative(logs)
    masses = 0.5 * (right - left)[:, None] * rule.weights * values
    kept = masses.sum(axis=1) > NEGLIGIBLE * masses.sum()
    order = np.argsort(x[kept].ravel())
    total = masses[kept].sum()
    return Grid(*(array[kept].ravel()[order] for array in (x, masses / total, values / total)))


def _relative(logs: Array) -> Array:
    """The density relative to its peak; flat if no value is finite."""
    peak = logs.max()
    return np.exp(logs - peak) if np.isfinite(peak) else np.ones_like(logs)


def _evaluate(left: Array, right: Array, log_density: Callable[[Array], Array], rule: Rule) -> tuple[Array, Array]:
    """Nodes of each panel (panels, q) and the log-density there."""
    x = 0.5 * (left + right)[:, None] + 0.5 * (right - left)[:, None] * rule.nodes
    return x, log_density(x.ravel()).reshape(x.shape)
