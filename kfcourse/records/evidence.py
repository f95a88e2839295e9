r"""How likely a record is under a model: the sum of what each measurement added.

    ln p(y_0, ..., y_N) = sum_k ln p(y_k | y_0, ..., y_{k-1}),        p(y_k | y_0, ..., y_{k-1}) = N(y_k; h, F)

A filter knows each term before the measurement comes: its innovation and F.  For a linear model with normal noises the sum is
exact; for others it is as good as the filter's normal laws.  Two models of the same measurements are compared by it, and
`kfcourse.records.estimation` looks for the parameters that make it largest.
"""

from __future__ import annotations

import numpy as np

from kfcourse.filters.base import Evidence, Filter, State, structure_of
from kfcourse.laws import Array, log_density
from kfcourse.montecarlo.experiment import states


def likelihood(one: Filter, y: Array) -> Array:
    """The logarithm of each measurement's density, given all before it: ln p(y_k | y_0, ..., y_{k-1}).

    -1/2 nu^T F^-1 nu - 1/2 ln det(2 pi F),      nu = y - h(lambda, Psi),  F = F(lambda, Psi)

    Parameters
    ----------
    one : Filter
        Whose laws are normal (`aof`, `iterated`, `kalman_filter`), or `imm`, for which it is the modes' mixture.
    y : ndarray (steps, runs, p)
        As for `run`; a missing measurement (NaN) counts 0, a missing component does not enter.

    Returns
    -------
    ndarray (steps, runs)
        Its sum over the steps is the log likelihood of each record; the units are those of y, so only differences mean something.

    Raises
    ------
    ValueError
        A filter that has no density of measurements, a measurement claimed to be known before it comes, or another shape of y.

    Examples
    --------
    >>> from kfcourse.filters import kalman_filter
    >>> from kfcourse.scenarios.benchmarks import local_level, nile
    >>> round(likelihood(kalman_filter(local_level()), nile()).sum().item(), 4)
    -641.5856
    """
    evidence = one.evidence or _normal(one)
    before = states(one, y)[:-1]
    found = np.stack(
        [evidence(state, now) for state, now in zip(before, np.reshape(y, (len(before), -1, one.model.p)), strict=True)]
    )
    if not np.isfinite(found).all():
        k, run = np.argwhere(~np.isfinite(found))[0]
        raise ValueError(
            f"{one.name} has no density for the measurement of step {k}, run {run}: the covariance expected of it is singular, "
            "or the filter left the finite numbers; give every component of the meter a noise, and look at run(one, y) before it"
        )
    return found


def _normal(one: Filter) -> Evidence:
    structure = structure_of(one, "the likelihood")

    def evidence(state: State, y: Array) -> Array:
        return log_density(structure.at(state.step).measure(*state.predicted), y)

    return evidence
