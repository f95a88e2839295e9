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

from kfcourse.laws import CONFIDENCE, Array, Gaussian, normalised_square


@dataclass(frozen=True)
class Estimate:
    """A mean over the ensemble, its standard error, and what is known of the law of its error.

    Attributes
    ----------
    value, standard_error : ndarray, any shape
    freedom : int or ndarray
        Degrees of freedom of the standard error (batches - 1; fewer where it was found from few designs).
    skewness : float or ndarray
        Of the error, in units of its third power.  Means of squares are skewed: most samples lack the rare large values.
    """

    value: Array
    standard_error: Array
    freedom: int | Array
    skewness: float | Array = 0.0

    def interval(self, confidence: float = CONFIDENCE) -> tuple[Array, Array]:
        """Lower and upper limit of the confidence interval.

        With the skewness a, t = (mean found - mean) / standard error follows no Student's law, but nearly

            g(t) = t + a t^2 / 3 + a^2 t^3 / 27 + a / 6

        does, so the limits are those where g is the quantile of that law (P. Hall, On the removal of skewness by transformation,
        J. R. Stat. Soc. B 54, 1992).  A mean of few large values then has more room above than below.
        """
        if not 0 < confidence < 1:
            raise ValueError(f"a confidence lies between 0 and 1, got {confidence}")
        quantile = scipy.special.stdtrit(self.freedom, 0.5 + confidence / 2)
        a = np.asarray(self.skewness)
        lower, upper = (self.value - _before_transformation(g, a) * self.standard_error for g in (quantile, -quantile))
        return lower, upper

    def p_value(self) -> Array:
        """Probability of a mean at least so far from 0, to either side, if the true one were 0: by the law of `interval`.

        NaN where there is no standard error (of one trajectory, of an infinite mean).
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            t, a = self.value / self.standard_error, np.asarray(self.skewness)
        g = t + a * t**2 / 3 + a**2 * t**3 / 27 + a / 6
        certain = np.where(self.value == 0, 1.0, 0.0)
        return np.where(self.standard_error == 0, certain, 2 * scipy.special.stdtr(self.freedom, -np.abs(g)))

    def half_width(self, confidence: float = CONFIDENCE) -> Array:
        """Half the length of the interval."""
        lower, upper = self.interval(confidence)
        return 0.5 * (upper - lower)

    def __iter__(self) -> Iterator[Estimate]:
        """Along the first axis: the steps, one after the other."""
        return (self[k] for k in range(len(self.value)))

    def __getitem__(self, index) -> Estimate:
        def part(values):
            return values[index] if isinstance(values, np.ndarray) and values.ndim else values

        return Estimate(self.value[index], self.standard_error[index], part(self.freedom), part(self.skewness))


def _before_transformation(g: Array, a: Array) -> Array:
    """t with t + a t^2 / 3 + a^2 t^3 / 27 + a / 6 = g: 3 / a (cbrt(1 + a (g - a / 6)) - 1)."""
    known = np.abs(a) > 1e-6  # below, rounding would be larger than the correction
    safe = np.where(known, a, 1.0)
    return np.where(known, 3 / safe * (np.cbrt(1 + safe * (g - safe / 6)) - 1), g)


def batch_mean(sums: Array, counts: Array) -> Estimate:
    """Mean, standard error and skewness from sums over batches (last axis) of `counts` trajectories each, or of that weight.

    With N trajectories in B batches of n_b, means m_b and total mean m, and d_b = n_b (m_b - m),
    SE^2 = B / (B - 1) sum_b d_b^2 / N^2, and the skewness of m is sum_b d_b^3 / (sum_b d_b^2)^(3/2).
    """
    total, batches = counts.sum(), len(counts)
    value = sums.sum(axis=-1) / total
    with np.errstate(invalid="ignore"):  # an infinite mean (a filter that claims variance 0) has no standard error
        deviations = sums - counts * value[..., None]
    square = (deviations**2).sum(axis=-1)
    variance = square / total**2 * batches / (batches - 1) if batches > 1 else np.full(value.shape, np.nan)
    cube = np.sqrt(square) ** 3  # may be 0 where its root is not: 1e-300 is a square, no cube
    skewness = np.divide((deviations**3).sum(axis=-1), cube, out=np.zeros(value.shape), where=cube > 0)
    return Estimate(value, np.sqrt(variance), max(batches - 1, 1), skewness)


def rejected(p: Array, level: float) -> Array:
    """Holm's test of many hypotheses: which (any shape) are rejected so that all rejections are right with probability 1 - level.

    The smallest p is compared with level / n, the next with level / (n - 1), ... until one is larger (S. Holm, A simple
    sequentially rejective multiple test procedure, Scand. J. Stat. 6, 1979).
    """
    order = np.argsort(p, axis=None)
    small = p.ravel()[order] <= level / np.arange(p.size, 0, -1)
    found = np.zeros(p.size, dtype=bool)
    found[order[: p.size if small.all() else int(np.argmin(small))]] = True
    return found.reshape(p.shape)


def ratio(numerator: Array, denominator: Array, of_zero: Array | float) -> Array:
    """numerator / denominator, and `of_zero` where the denominator is not positive."""
    shape = np.broadcast_shapes(np.shape(numerator), np.shape(denominator))
    return np.divide(numerator, denominator, out=np.broadcast_to(of_zero, shape).astype(float), where=denominator > 0)


@dataclass(frozen=True)
class Sums:
    """Sums over batches for a tuple of filters.

    Attributes
    ----------
    counts, weights : ndarray (batches,)
        Trajectories, and the sum of their weights: the same if they have none.  Means are sums over sums of weights.
    size, doubt : ndarray (steps, batches)
        Sums of |x|^2, what rounding errors are to be compared with, and of the reference filter's own squared error.
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
    largest, largest_square : ndarray (filters, steps, batches)
        The largest single term of `distance`, and of `square` summed over the components.
    """

    counts: Array
    weights: Array
    size: Array
    doubt: Array
    error: Array
    square: Array
    own: Array
    normalised: Array
    distance: Array
    largest: Array
    largest_square: Array

    @classmethod
    def empty(cls, filters: int, steps: int, n: int, counts: Array) -> Sums:
        """Room for the sums over batches of so many trajectories each."""
        full, plain = (filters, steps, n, len(counts)), (filters, steps, len(counts))
        shapes = (plain[1:],) * 2 + (full,) * 3 + (plain,) * 4
        return cls(counts.astype(float), counts.astype(float), *(np.zeros(shape) for shape in shapes))

    @classmethod
    def concatenate(cls, parts: Sequence[Sums]) -> Sums:
        """Sums over the batches of all parts."""
        return cls(*(np.concatenate([getattr(part, name) for part in parts], axis=-1) for name in cls.__dataclass_fields__))

    def of_filters(self, chosen: slice | list[int]) -> Sums:
        """Those of some of the filters."""
        common = (self.counts, self.weights, self.size, self.doubt)
        return Sums(*common, *(getattr(self, name)[chosen] for name in list(self.__dataclass_fields__)[len(common) :]))

    def of_batches(self, chosen: Array) -> Sums:
        """Those of some of the batches."""
        return Sums(*(getattr(self, name)[..., chosen] for name in self.__dataclass_fields__))

    def times(self, factor: float) -> Sums:
        """The same where every trajectory weighs so many times as much."""
        names = list(self.__dataclass_fields__)[1:]
        return Sums(self.counts, *(factor * getattr(self, name) for name in names))

    def gathered(self, places: Array, batches: int) -> Sums:
        """Sums over other batches, of which each of these goes into the one with the number in `places`."""

        def gather(name: str) -> Array:
            values = np.moveaxis(getattr(self, name), -1, 0)
            result = np.zeros((batches, *values.shape[1:]))
            (np.maximum if name.startswith("largest") else np.add).at(result, places, values)
            return np.moveaxis(result, 0, -1)

        return Sums(*map(gather, self.__dataclass_fields__))

    def record_states(self, step: int, x: Array, weight: Array | None) -> None:
        """Add the true states x (N, n) of a step, and at the first the weights (N,) of the trajectories."""
        if step == 0 and weight is not None:
            self.weigh(weight)
        self.size[step] = self._sums((x * x).sum(axis=1), weight)

    def weigh(self, weight: Array) -> Array:
        """The weights (N,) of the trajectories, added up."""
        self.weights[:] = self._sums(weight, None)
        return weight

    def record(self, filter_index: int, step: int, x: Array, estimate: Gaussian, weight: Array | None = None) -> None:
        """Add one step of one filter: true states x (N, n) and its estimate; with a weight (N,) of each trajectory."""
        mean, cov = estimate
        error = x - mean
        own = np.diagonal(cov, axis1=-2, axis2=-1)
        for i in range(error.shape[1]):
            self.error[filter_index, step, i] = self._sums(error[:, i], weight)
            square = error[:, i] * error[:, i]
            self.square[filter_index, step, i] = self._sums(square, weight)
            self.own[filter_index, step, i] = own[i] * self.weights if own.ndim == 1 else self._sums(own[:, i], weight)
        total = square if error.shape[1] == 1 else (error * error).sum(axis=1)
        self.largest_square[filter_index, step] = np.maximum.reduceat(total if weight is None else total * weight, self.starts)
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

    def of_scalar(self, filter_index: int, steps: slice) -> tuple[Array, ...]:
        """Where what `record` keeps of several steps of one filter of a scalar state has its place, each (steps, batches)."""
        kept = (one[filter_index, steps, 0] for one in (self.error, self.square, self.own))
        return *kept, self.normalised[filter_index, steps], self.largest_square[filter_index, steps]

    def record_distance(
        self, filter_index: int, step: int, mean: Array, reference: tuple[Array, Array], weight: Array | None = None
    ) -> None:
        """Add one step of (z - z_a)^T (z - z_b), z a filter's estimate (N, n), z_a and z_b two of the reference.

        A squared distance if these are the same; else its mean does not hold their errors, if those are independent.
        """
        first, second = reference
        terms = ((mean - first) * (mean - second)).sum(axis=1)
        terms = terms if weight is None else terms * weight
        self.distance[filter_index, step] = self._sums(terms, None)
        self.largest[filter_index, step] = np.maximum.reduceat(terms, self.starts)

    def record_doubt(self, step: int, error: Array, weight: Array | None) -> None:
        """Add the estimated errors (N,) of the reference filter's estimates."""
        self.doubt[step] = self._sums(error * error, weight)

    def _sums(self, values: Array, weight: Array | None) -> Array:
        return np.add.reduceat(values if weight is None else values * weight, self.starts)

    @cached_property
    def starts(self) -> Array:
        """Where the batches begin."""
        return np.concatenate([[0], np.cumsum(self.counts[:-1])]).astype(int)


def _quotient(square: Array, variance: Array) -> Array:
    """square / variance; where the claimed variance is 0, 0 for no error and infinity for any."""
    return ratio(square, variance, np.where(square > 0, np.inf, 0.0))
