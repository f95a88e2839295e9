r"""How likely a record is under a model: the sum of what each measurement added.

    ln p(y_0, ..., y_N) = sum_k ln p(y_k | y_0, ..., y_{k-1}),
    p(y_k | y_0, ..., y_{k-1}) = N(y_k; h, F)

A filter knows each term before the measurement comes: its innovation and F.  For a linear model
with normal noises the sum is exact; for others it is as good as the filter's normal laws.  The
exact filter's terms are the constants of Bayes' rule themselves, those of particles estimates of
them by the mean of their weights.  Two models of the same measurements are compared by it, and
`kfcourse.records.estimation` looks for the parameters that make it largest.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np

from kfcourse.errors import expect
from kfcourse.filters.base import Evidence, Filter, State, structure_of
from kfcourse.laws import Array, log_density
from kfcourse.montecarlo.experiment import measurements, walk


class NoDensity(ValueError):
    """A filter has no density for the measurement of a `step`: its covariance is singular, or no
    finite number."""

    def __init__(self, name: str, step: int, run: int) -> None:
        super().__init__(
            f"{name} has no density for the measurement of step {step}, run {run}: the covariance "
            f"expected of it is singular, "
            "or the filter left the finite numbers; give every component of the meter a noise, "
            "and look at run(filter, y) before it"
        )
        self.step = step


def likelihood(filter_: Filter, y: Array) -> Array:
    """The logarithm of each measurement's density, given all before it: ln p(y_k | y_0, ...,
    y_{k-1}).

    -1/2 nu^T F^-1 nu - 1/2 ln det(2 pi F),      nu = y - h(lambda, Psi),  F = F(lambda, Psi)

    Parameters
    ----------
    filter_ : Filter
        Whose laws are normal (`aof`, `iterated`, `kalman_filter`); `imm`, for which it is the
        modes' mixture; `pointmass`, for which it is exact; `particle`.
    y : ndarray (steps, runs, p)
        As for `run`; a missing measurement (NaN) counts 0, a missing component does not enter.

    Returns
    -------
    ndarray (steps, runs)
        Its sum over the steps is the log likelihood of each record; the units are those of y, so
        only differences mean something.

    Raises
    ------
    ValueError
        A filter that has no density of measurements (`NoDensity`: of one of them), a measurement
        claimed to be known before it comes, or another shape of y.

    Examples
    --------
    >>> from kfcourse import likelihood
    >>> from kfcourse.filters import kalman_filter
    >>> from kfcourse.scenarios.benchmarks import local_level, nile
    >>> round(likelihood(kalman_filter(local_level()), nile()).sum().item(), 4)
    -641.5856
    """
    expect(filter_, Filter, "likelihood")
    y = measurements(filter_, y)
    return log_densities(filter_, walk(filter_, y), y)


def log_densities(filter_: Filter, visited: Iterable[State], y: Array) -> Array:
    """As `likelihood`, from the filter's states: before the first measurement (steps, runs, p), and
    after each."""
    evidence = filter_.evidence or _normal(filter_)
    terms = np.stack(
        [
            evidence(before, now, after)
            for (before, after), now in zip(pairwise(visited), y, strict=True)
        ]
    )
    if not np.isfinite(terms).all():
        raise NoDensity(filter_.name, *np.argwhere(~np.isfinite(terms))[0])
    return terms


def _normal(filter_: Filter) -> Evidence:
    structure = structure_of(filter_, "the likelihood")

    def evidence(before: State, y: Array, after: State) -> Array:
        known = after.expected
        return log_density(
            structure.at(before.step).measure(*before.predicted) if known is None else known, y
        )

    return evidence
