"""Means that are known in part from all trajectories and in part from a part of them, and what the design adds to their error.

Fast filters ran on all N trajectories, slow ones on the first n and on the exceptional ones (`exceptional`).  A quantity is X, of
what ran everywhere, plus Y, of what ran on this slow part.  Of the exceptional ones, a set E, Y is known everywhere, so that with
X' = X + Y on E and X' = X elsewhere, and the part q of trajectories that are not exceptional, n of which are the first ones,

    Z = M_N[X'] + q M_n[Y],    Var(Z) = Var(X') / N + q^2 Var(Y) / n + 2 q Cov(X', Y) / N

Filters with coefficients from an ensemble vary with that ensemble, too.  So they are designed several times, and run on common
trajectories: the variance of their results, less what it would be for equal coefficients, is the variance of the design.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from kfcourse.laws import Array
from kfcourse.montecarlo.statistics import Estimate, Sums, batch_mean

Weights: TypeAlias = Mapping[tuple[str, str], Array | float]  # (field of Sums, filter) -> weight, one for each step or for all


class Terms(NamedTuple):
    """X and Y as weighted sums of the statistics of filters."""

    everywhere: Weights
    on_slow_part: Weights

    def plus(self, other: Terms) -> Terms:
        return Terms(*(_added(mine, theirs) for mine, theirs in zip(self, other, strict=True)))

    def times(self, factor: Array | float) -> Terms:
        return Terms(*({key: weight * factor for key, weight in weights.items()} for weights in self))


def _added(first: Weights, second: Weights) -> Weights:
    result = dict(first)
    for key, weight in second.items():
        result[key] = result.get(key, 0.0) + weight
    return result


@dataclass(frozen=True)
class Replicas:
    """The designed filters, each designed on several ensembles, on the common trajectories.

    Attributes
    ----------
    names : tuple of str
    sums : tuple of Sums
        One for each design, its filters in the order of `names`; the first is the design that the comparison reports.
    """

    names: tuple[str, ...]
    sums: tuple[Sums, ...]

    def variance(self, terms: Terms, total: bool) -> tuple[Array, int]:
        """Variance between designs of the mean of X + Y, and its degrees of freedom.

        The scatter of the designs' means also holds that of the trajectories, which are the same for all; it is subtracted.
        A distance from the exact filter varies as the square of the error does: their difference is that filter's own.
        """
        weights = dict[str, Array | float]()
        for (kind, name), weight in (*terms.everywhere.items(), *terms.on_slow_part.items()):
            if kind in ("square", "distance") and name in self.names:
                weights[name] = weights.get(name, 0.0) + weight
        values = np.stack(
            [batch_sums(sums, self.names, {("square", n): w for n, w in weights.items()}, total) for sums in self.sums]
        )
        designs, weights_of = len(values), self.sums[0].weights
        means = values.sum(axis=-1) / weights_of.sum()
        by_chance = batch_mean(values - values.mean(axis=0), weights_of).standard_error ** 2
        return np.maximum(means.var(axis=0, ddof=1) - by_chance.sum(axis=0) / (designs - 1), 0.0), designs - 1


def batch_sums(sums: Sums, names: tuple[str, ...], weights: Weights, total: bool) -> Array:
    """Weighted sums over batches, (steps, batches), or (batches,) over all steps."""
    steps, batches = sums.normalised.shape[1:]
    result = np.zeros((steps, batches))
    for (kind, name), weight in weights.items():
        values = getattr(sums, kind)[names.index(name)]
        result += np.broadcast_to(weight, steps)[:, None] * (values if values.ndim == 2 else values.sum(axis=1))
    return result.sum(axis=0) if total else result


def estimate(
    full: Array,
    weights: Array,
    x: Array | None = None,
    y: Array | None = None,
    of_first: Array | None = None,
    part: float = 1.0,
) -> Estimate:
    """M_N X + q M_n Y from batch sums of X over all trajectories, and of X and Y over the first ones, if there is a Y.

    `weights` and `of_first` are the weights of the batches, and q is the `part`.
    """
    everywhere = batch_mean(full, weights)
    if x is None or y is None or of_first is None:
        return everywhere
    y = part * y
    correction = batch_mean(y, of_first)
    # Var(x + y) - Var(x - y) = 4 Cov(x, y), each a variance of means over the first n
    plus, minus = (batch_mean(x + sign * y, of_first).standard_error ** 2 for sign in (1, -1))
    covariance = (plus - minus) / 4 * of_first.sum() / weights.sum()
    error = np.sqrt(np.maximum(everywhere.standard_error**2 + correction.standard_error**2 + 2 * covariance, 0.0))
    # third cumulants of sums of nearly independent parts add up
    third = everywhere.skewness * everywhere.standard_error**3 + correction.skewness * correction.standard_error**3
    return Estimate(everywhere.value + correction.value, error, correction.freedom, _over_cube(third, error))


def with_design(one: Estimate, variance: Array, freedom: int) -> Estimate:
    """An estimate whose error varies with the design, too; freedom by Welch and Satterthwaite."""
    trajectories = one.standard_error**2
    error = np.sqrt(trajectories + variance)
    with np.errstate(divide="ignore", invalid="ignore"):
        together = error**4 / (trajectories**2 / one.freedom + variance**2 / freedom)
    skewness = _over_cube(one.skewness * one.standard_error**3, error)
    return Estimate(one.value, error, np.where(variance > 0, together, one.freedom), skewness)


def _over_cube(third: Array, error: Array) -> Array:
    cube = error**3
    return np.divide(third, cube, out=np.zeros(np.shape(error)), where=cube > 0)
