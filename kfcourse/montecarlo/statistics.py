"""Running statistics of estimation errors, with standard errors that respect pairing.

The ensemble is cut into batches of trajectories; what is kept is the sum over each batch.  Standard
errors come from the scatter of batch means, so they hold for any difference or ratio of filters on
common trajectories and any average over steps, and nothing is kept per trajectory.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from kfcourse.laws import Array, Gaussian, normalised_square

BATCHES = 128  # standard errors from 128 batches are themselves good to 6 %


@dataclass(frozen=True)
class Estimate:
    """A mean over the ensemble, its standard error, and the freedom of that error's estimate.

    Attributes
    ----------
    value, standard_error : ndarray, any shape
    freedom : int or ndarray
        Degrees of freedom of the standard error (batches - 1; fewer where it was found from few designs).
    """

    value: Array
    standard_error: Array
    freedom: int | Array

    def interval(self, confidence: float = 0.95) -> tuple[Array, Array]:
        """Lower and upper limit of the confidence interval (Student's t)."""
        half = self.half_width(confidence)
        return self.value - half, self.value + half

    def half_width(self, confidence: float = 0.95) -> Array:
        if not 0 < confidence < 1:
            raise ValueError(f"a confidence lies between 0 and 1, got {confidence}")
        return scipy.special.stdtrit(self.freedom, 0.5 + confidence / 2) * self.standard_error

    def __iter__(self) -> Iterator[Estimate]:
        """Along the first axis: the steps, one after the other."""
        return (self[k] for k in range(len(self.value)))

    def __getitem__(self, index) -> Estimate:
        freedom = self.freedom[index] if isinstance(self.freedom, np.ndarray) and self.freedom.ndim else self.freedom
        return Estimate(self.value[index], self.standard_error[index], freedom)


def batch_mean(sums: Array, counts: Array) -> Estimate:
    """Mean and standard error from sums over batches (last axis) of `counts` trajectories each.

    With N trajectories in B batches of n_b, means m_b and total mean m,
    SE^2 = B / (B - 1) sum_b n_b^2 (m_b - m)^2 / N^2.
    """
    total, batches = counts.sum(), len(counts)
    value = sums.sum(axis=-1) / total
    with np.errstate(invalid="ignore"):  # an infinite mean (a filter that claims variance 0) has no standard error
        deviations = sums - counts * value[..., None]
    variance = (deviations**2).sum(axis=-1) / total**2 * batches / (batches - 1) if batches > 1 else np.full(value.shape, np.nan)
    return Estimate(value, np.sqrt(variance), max(batches - 1, 1))


def ratio(numerator: Array, denominator: Array, of_zero: Array | float) -> Array:
    """numerator / denominator, and `of_zero` where the denominator is not positive."""
    shape = np.broadcast_shapes(np.shape(numerator), np.shape(denominator))
    return np.divide(numerator, denominator, out=np.broadcast_to(of_zero, shape).astype(float), where=denominator > 0)


@dataclass(frozen=True)
class Sums:
    """Sums over batches for a tuple of filters.

    Attributes
    ----------
    counts : ndarray (batches,)
    error : ndarray (filters, steps, n, batches)
        Sums of e = x - z.
    square : ndarray (filters, steps, n, batches)
        Sums of e^2.
    own : ndarray (filters, steps, n, batches)
        Sums of the variances each filter claims (diagonal of its covariance).
    normalised : ndarray (filters, steps, batches)
        Sums of e^T p^-1 e / n.
    distance : ndarray (filters, steps, batches)
        Sums of |z - z_reference|^2, if there is a reference filter, else 0.
    """

    counts: Array
    error: Array
    square: Array
    own: Array
    normalised: Array
    distance: Array

    @classmethod
    def empty(cls, filters: int, steps: int, n: int, runs: int, batches: int) -> Sums:
        """Room for `runs` trajectories in about `batches` batches of nearly equal size."""
        edges = np.linspace(0, runs, min(batches, runs) + 1).astype(int)
        size = len(edges) - 1
        full, plain = (filters, steps, n, size), (filters, steps, size)
        return cls(np.diff(edges).astype(float), np.zeros(full), np.zeros(full), np.zeros(full), np.zeros(plain), np.zeros(plain))

    @classmethod
    def concatenate(cls, parts: Sequence[Sums]) -> Sums:
        """Sums over the batches of all parts."""
        return cls(*(np.concatenate([getattr(part, name) for part in parts], axis=-1) for name in cls.__dataclass_fields__))

    def of_filters(self, chosen: slice | list[int]) -> Sums:
        """Those of some of the filters."""
        return Sums(self.counts, *(getattr(self, name)[chosen] for name in list(self.__dataclass_fields__)[1:]))

    def record(self, filter_index: int, step: int, x: Array, estimate: Gaussian, weight: Array | None = None) -> None:
        """Add one step of one filter: true states x (N, n) and its estimate; with a weight (N,) of each trajectory."""
        mean, cov = estimate
        error = x - mean
        own = np.diagonal(cov, axis1=-2, axis2=-1)
        for i in range(error.shape[1]):
            self.error[filter_index, step, i] = self._sums(error[:, i], weight)
            square = error[:, i] * error[:, i]
            self.square[filter_index, step, i] = self._sums(square, weight)
            alike = own.ndim == 1 and weight is None
            self.own[filter_index, step, i] = own[i] * self.counts if alike else self._sums(_spread(own, len(x))[:, i], weight)
        if error.shape[1] > 1:
            self.normalised[filter_index, step] = self._sums(normalised_square(error, cov), weight) / error.shape[1]
        elif own.ndim == 2:
            with np.errstate(divide="ignore", invalid="ignore"):
                quotients = self._sums(square / own[:, 0], weight)
            if np.isnan(quotients).any():
                quotients = self._sums(_quotient(square, own[:, 0]), weight)
            self.normalised[filter_index, step] = quotients
        else:  # one variance for the whole ensemble: the sums of squares are there already
            self.normalised[filter_index, step] = _quotient(self.square[filter_index, step, 0], own)

    def record_distance(
        self, filter_index: int, step: int, mean: Array, reference: tuple[Array, Array], weight: Array | None = None
    ) -> None:
        """Add one step of (z - z_a)^T (z - z_b), z a filter's estimate (N, n), z_a and z_b two of the reference.

        A squared distance if these are the same; else its mean does not hold their errors, if those are independent.
        """
        first, second = reference
        self.distance[filter_index, step] = self._sums(((mean - first) * (mean - second)).sum(axis=1), weight)

    def _sums(self, values: Array, weight: Array | None) -> Array:
        return np.add.reduceat(values if weight is None else values * weight, self._starts)

    @cached_property
    def _starts(self) -> Array:
        return np.concatenate([[0], np.cumsum(self.counts[:-1])]).astype(int)


def _spread(own: Array, runs: int) -> Array:
    return np.broadcast_to(own, (runs, own.shape[-1]))


def _quotient(square: Array, variance: Array) -> Array:
    """square / variance; where the claimed variance is 0, 0 for no error and infinity for any."""
    return ratio(square, variance, np.where(square > 0, np.inf, 0.0))
