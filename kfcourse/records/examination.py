r"""All that a filter says of a record, and whether the record bears it out.

If the filter is right, its innovations nu_k are normal with the covariance F_k that it expects, and
independent of each other:

    size         sum of nu^T F^-1 nu       chi-squared with as many degrees of freedom as there are
                 numbers measured
    mean         sum of s / sqrt(N)        N(0, 1), for the innovations s of one component over
                 their deviations
    neighbours   mean of s_j s_{j+1}       N(0, 1/(N - 1)), each s with the next one measured

A gate lets pass what is small: behind it the size is that of a chi-squared number below the gate's
edge.  None of this needs the
true state.  It is what can be said of a recorded track, beside the likelihood, and what becomes of
measurements held back.
"""

from __future__ import annotations

from itertools import islice
from typing import Any, NamedTuple

import numpy as np
import scipy
from tqdm import tqdm

from kfcourse.errors import expect
from kfcourse.filters.base import Filter, structure_of
from kfcourse.filters.gate import size_of
from kfcourse.filters.looking_back import looked_back
from kfcourse.laws import CONFIDENCE, Array, Gaussian, stacked
from kfcourse.linear.consistency import Innovations
from kfcourse.montecarlo.experiment import measurements, walk
from kfcourse.records.evidence import log_densities

BAR: Any = {"unit": "row", "disable": None, "delay": 2}  # of a long record, on a terminal
TAILS = np.array([(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])


class Examination(NamedTuple):
    """What a filter says of a record.

    Attributes
    ----------
    estimate, smoothed : Gaussian
        Means (steps, runs, n) and covariances (steps, runs, n, n): at each step, and given the
        whole record.
    innovations : Innovations
        nu (steps, runs, p), NaN where nothing was measured, and F (steps, runs, p, p).
    weight : ndarray (steps, runs)
        How much each measurement counted: 1 in full, 0 refused, NaN where there was none.
    log_likelihood : ndarray (steps, runs)
    edge : float
        Probability with which a gate lets pass; 1 without a gate.
    """

    estimate: Gaussian
    smoothed: Gaussian
    innovations: Innovations
    weight: Array
    log_likelihood: Array
    edge: float


class Finding(NamedTuple):
    """A quantity of a record beside the interval in which it lies, with a given probability, if the
    filter is right."""

    name: str
    value: float
    low: float
    high: float

    @property
    def fits(self) -> bool:
        return bool(self.low <= self.value <= self.high)


def examine(filter_: Filter, y: Array) -> Examination:
    """Run a filter over a record, look back, and keep what it expected.  A long record shows its
    progress.

    Parameters
    ----------
    filter_ : Filter
        With structural functions of its own; `gated(...)` too.
    y : ndarray (steps, runs, p)
        As for `run`.

    Raises
    ------
    ValueError
        A filter without structural functions, measurements of another shape, no likelihood
        (`kfcourse.likelihood`), a noise with a negative variance, as sqrt(u) has where an input u
        is negative.
    """
    expect(filter_, Filter, "examine")
    structure, y = structure_of(filter_, "an examination of a record"), measurements(filter_, y)
    visited = list(tqdm(walk(filter_, y), "filter", len(y) + 1, **BAR))
    innovations, F = np.empty(y.shape), np.empty((*y.shape, y.shape[-1]))
    for k, (state, after, now) in enumerate(zip(visited[:-1], visited[1:], y, strict=True)):
        expected = structure.at(k).measure(*state.predicted)
        innovations[k], F[k] = expected.innovation(now), expected.F
        _noise_of(expected.R, expected.F, f"the meter's noise at step {k}")
        if k < len(y) - 1:
            noise = structure.at(k).transition(*after.posterior).Q
            _noise_of(noise, after.predicted.cov, f"the state's noise from step {k} to {k + 1}")
    weight = np.ones(y.shape[:2])
    for k, state in enumerate(visited[1:]):
        weight[k] = getattr(state.memory, "weight", 1.0)
    smoothed = looked_back(filter_, tqdm(visited[1:], "looking back", **BAR), y)
    return Examination(
        stacked([state.posterior for state in visited[1:]]),
        stacked([state.posterior for state in smoothed]),
        Innovations(innovations, F),
        np.where(np.isnan(y).all(axis=-1), np.nan, weight),
        log_densities(filter_, visited, y),
        getattr(visited[-1].memory, "edge", 1.0),
    )


def weights(filter_: Filter, y: Array) -> Array:
    """How much each measurement counted, (steps, runs): 1 in full, 0 refused, NaN where it was
    missing.

    Parameters
    ----------
    filter_ : Filter
        `gated(...)` or `robust(...)`.
    y : ndarray (steps, runs, p)
        As for `run`.

    Raises
    ------
    ValueError
        A filter that weighs nothing, measurements of another shape.
    """
    expect(filter_, Filter, "weights")
    memories = [state.memory for state in islice(walk(filter_, y), 1, None)]
    if not all(hasattr(memory, "weight") for memory in memories):
        raise ValueError(
            f"{filter_.name} takes every measurement as it is: ask "
            "gated(filter) or robust(structure) for weights"
        )
    return np.stack([memory.weight for memory in memories])


def _noise_of(cov: Array, scale: Array, what: str) -> None:
    """ValueError if a variance is negative by more than a rule of quadrature rounds."""
    variance, whole = (np.diagonal(matrix, axis1=-2, axis2=-1) for matrix in (cov, scale))
    if (variance < -1e-6 * np.abs(whole)).any():
        raise ValueError(
            f"{what} has a negative variance, {variance.min():g}: look at its formula and inputs"
        )


def normal_bound() -> float:
    """Within so many standard deviations a normal number is with the confidence of all intervals:
    1.96."""
    return float(scipy.special.ndtri(TAILS[1]))


def findings(examined: Examination, run: int = 0) -> list[Finding]:
    """Size, mean and neighbours of a record's innovations; those that a gate refused are left out.

    That of the size is exact without a gate, and behind one that of a gamma law with the same mean
    and variance; the others are those of normal laws for sums of many terms: thirty measurements
    are enough.  Under weights that are neither 0 nor 1 none of this holds; nothing is found of a
    record that was refused altogether.
    """
    used, z = examined.weight[:, run] > 0, normal_bound()
    if not used.any():
        return []
    value, F = (part[used, run] for part in examined.innovations)
    degrees = (~np.isnan(value)).sum(axis=-1)
    size = size_of(value, F).sum() / degrees.sum()
    mean, variance = _below(degrees, examined.edge)
    scale = variance.sum() / mean.sum()
    low, high = scale * scipy.special.gammaincinv(mean.sum() / scale, TAILS) / degrees.sum()
    result = [Finding("size", float(size), float(low), float(high))]
    p = value.shape[-1]
    for i in range(p):
        measured = ~np.isnan(value[:, i])
        s = value[measured, i] / np.sqrt(F[measured, i, i])
        if len(s) > 2:
            s = s / np.sqrt(np.mean(s**2))
            name = f" of y{i + 1}" if p > 1 else ""
            for kind, terms in (("mean", s), ("neighbours", s[:-1] * s[1:])):
                bound = z / np.sqrt(len(terms))
                result.append(Finding(kind + name, float(terms.mean()), -bound, bound))
    return result


def _below(degrees: Array, edge: float) -> tuple[Array, Array]:
    """Mean and variance of chi-squared numbers, of those that lie below the quantile `edge` of
    their law.

    With the distribution function P_d of d degrees:  M[c; c < g] = d P_{d+2}(g),   M[c^2; c < g] =
    d (d + 2) P_{d+4}(g).
    """
    g = scipy.special.chdtri(degrees, 1 - edge)
    mean = degrees * scipy.special.chdtr(degrees + 2, g) / edge
    return mean, degrees * (degrees + 2) * scipy.special.chdtr(degrees + 4, g) / edge - mean**2
