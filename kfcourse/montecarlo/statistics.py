"""Means over batches of trajectories, and estimates made of them, with standard errors that respect
pairing.

The trajectories are cut into batches.  What is kept is the sum over each batch.  Every statistic is
a function of means; it is computed from all batches, and again without each of them, and the
scatter of these values tells its standard error (the jackknife; M. Quenouille 1956, J. Tukey 1958).
So differences, ratios and means over steps need no formula of their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import scipy

from kfcourse.laws import CONFIDENCE, Array, normalised_square
from kfcourse.montecarlo import BATCHES


@dataclass(frozen=True)
class Estimate:
    """An estimate, its standard error, and the degrees of freedom of that.

    Attributes
    ----------
    value, standard_error : ndarray, any shape
    freedom : int
        Batches - 1.
    """

    value: Array
    standard_error: Array
    freedom: int

    @classmethod
    def jackknife(cls, replicates: Array) -> Estimate:
        """From a statistic of all batches and without each of them, (..., 1 + batches); NaN without
        a second batch.

        SE^2 = (B - 1) / B sum_b (s_-b - mean s)^2
        """
        without = replicates[..., 1:]
        batches = without.shape[-1]
        if batches < 2:
            return cls(replicates[..., 0], np.full(replicates.shape[:-1], np.nan), 1)
        # an infinite mean (a filter that claims variance 0) has no standard error
        with np.errstate(invalid="ignore"):
            scatter = without.var(axis=-1) * (batches - 1)
        return cls(replicates[..., 0], np.sqrt(scatter), batches - 1)

    def interval(self, confidence: float = CONFIDENCE) -> tuple[Array, Array]:
        """Lower and upper limit of the confidence interval, by Student's law."""
        half = self.half_width(confidence)
        return self.value - half, self.value + half

    def half_width(self, confidence: float = CONFIDENCE) -> Array:
        """Half the length of the interval."""
        if not 0 < confidence < 1:
            raise ValueError(f"a confidence lies between 0 and 1, got {confidence}")
        return np.asarray(
            scipy.special.stdtrit(self.freedom, 0.5 + confidence / 2) * self.standard_error
        )

    def p_value(self) -> Array:
        """Probability of a value at least so far from 0, to either side, if the true one were 0.

        NaN where there is no standard error (of one trajectory, of an infinite mean).
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            t = self.value / self.standard_error
        certain = np.where(self.value == 0, 1.0, 0.0)
        return np.where(
            self.standard_error == 0, certain, 2 * scipy.special.stdtr(self.freedom, -np.abs(t))
        )

    def __getitem__(self, index) -> Estimate:
        """That of some places; an iteration goes over the steps."""
        return Estimate(self.value[index], self.standard_error[index], self.freedom)


def rejected(p: Array, level: float) -> Array:
    """Holm's test of many hypotheses: which (any shape) are rejected so that all rejections are
    right with probability 1 - level.

    The smallest p is compared with level / n, the next with level / (n - 1), ... until one is
    larger (S. Holm, A simple sequentially rejective multiple test procedure, Scand. J. Stat. 6,
    1979).
    """
    order = np.argsort(p, axis=None)
    small = p.ravel()[order] <= level / np.arange(p.size, 0, -1)
    result = np.zeros(p.size, dtype=bool)
    result[order[: p.size if small.all() else int(np.argmin(small))]] = True
    return result.reshape(p.shape)


def ratio(numerator: Array, denominator: Array, of_zero: Array | float) -> Array:
    """numerator / denominator, and `of_zero` where the denominator is not positive."""
    shape = np.broadcast_shapes(np.shape(numerator), np.shape(denominator))
    return np.divide(
        numerator,
        denominator,
        out=np.broadcast_to(of_zero, shape).astype(float),
        where=denominator > 0,
    )


# Sums over batches (last axis):
#
# weight               (batches,) of the weights of the trajectories; their number if all are 1
# size                 (steps, batches) of |x|^2, what rounding errors are to be compared with
# error, square        (filters, steps, n, batches) of e = x - z, and of e^2
# own, normalised      (filters, steps, batches) of the variance that each filter claims, tr p, and
#                      of e^T p^-1 e / n
# largest              (filters, steps, batches) the largest single |e|^2
# distance             (filters, steps, batches) of |z - z_exact|^2, if there is an exact filter; of
#                      itself the squared error that it states
# log_score, crps      (filters, steps, batches) of the scores of each filter's prediction of the
#                      measurement, if they are asked for
Sums: TypeAlias = dict[str, Array]


def claimed(error: Array, cov: Array) -> tuple[Array, Array]:
    """What a filter claims of its errors (runs, n): tr p, and e^T p^-1 e / n, (runs,)."""
    n = error.shape[1]
    own = np.broadcast_to(np.trace(cov, axis1=-2, axis2=-1), len(error))
    if n > 1:
        return own, normalised_square(error, cov) / n
    # a claimed variance of 0 is right for no error, and infinitely wrong for any
    square = error[:, 0] ** 2
    return own, ratio(square, own, np.where(square > 0, np.inf, 0.0))


def means_without_each(values: Array) -> Array:
    """Means of values (runs, ...) over all trajectories, and without each of the batches: (1 +
    batches, ...)."""
    starts = np.linspace(0, len(values), min(BATCHES, len(values)) + 1).astype(int)
    sums = np.add.reduceat(values, starts[:-1], axis=0)
    return np.moveaxis(
        without_each(np.moveaxis(sums, 0, -1)) / without_each(np.diff(starts)), -1, 0
    )


def without_each(sums: Array) -> Array:
    """Sums over all batches (last axis), and without each of them: (..., 1 + batches)."""
    total = sums.sum(axis=-1, keepdims=True)
    if sums.shape[-1] == 1:
        return total
    with np.errstate(invalid="ignore"):  # an infinite sum has no part
        return np.concatenate([total, total - sums], axis=-1)
