"""How good a filter's prediction of the measurement is, doubt and all: proper scores.

    log score  ln p(y_k | y_0, ..., y_{k-1})
    CRPS       Integral (P(y | y_0, ..., y_{k-1}) - [y >= y_k])^2 dy

With a(m, s) = M|u| of u ~ N(m, s^2), which is m (2 Phi(m / s) - 1) + 2 s phi(m / s), the second
of a mixture of N(h_i, s_i^2) with the weights w_i is

    sum w_i a(y - h_i, s_i) - sum w_i w_j a(h_i - h_j, sqrt(s_i^2 + s_j^2)) / 2,

and of a single normal law a(y - h, s) - s / sqrt(pi).  Of any other law it is
M|y - Y| - M|Y - Y'| / 2 with Y and Y' drawn from it: T. Gneiting and A. Raftery (2007); E. Grimit
and others, Q. J. R. Meteorol. Soc. 132 (2006).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import ndtr

from kfcourse.angles import Components, difference
from kfcourse.filters.base import Filter, State
from kfcourse.laws import Array, log_density
from kfcourse.montecarlo.ensemble import Ensemble, foretold
from kfcourse.symbolic.structure import Structure

DRAWS = 16  # of what is neither a normal law nor a mixture: they widen the interval by a tenth


def scored(
    chosen: Filter,
    structure: Structure,
    before: State,
    y: Array,
    after: State,
    batch: Ensemble,
) -> tuple[Array, Array]:
    """Both scores of the measurement y (runs, p) for each trajectory, (runs,), by the filter's own
    structural functions, or these; NaN for the second where the prediction cannot be had.  The
    batch, the first of several, gives what is drawn a seed."""
    unknown = np.full(len(y), np.nan)
    log = chosen.evidence(before, y, after) if chosen.evidence else unknown
    if chosen.drawn:
        expected = _expected(before, batch)
        return log, crps_of_draws(y, expected, batch.model.angles.y)
    if chosen.mixture is not None:
        weights, laws = chosen.mixture(before)
    elif chosen.evidence is not None:
        return log, unknown
    else:
        expects = (chosen.structure or structure).at(before.step).measure
        weights, laws = np.ones((1, 1)), [after.expected or expects(*before.predicted)]
        log = log_density(laws[0], y)
    errors = np.stack([law.innovation(y) for law in laws], axis=-1)
    variances = [np.diagonal(law.F, axis1=-2, axis2=-1) for law in laws]
    deviations = np.sqrt(np.stack(np.broadcast_arrays(y, *variances)[1:], axis=-1))
    return log, crps(errors, deviations, weights[:, None]).sum(axis=-1)


def _expected(before: State, batch: Ensemble) -> Array:
    """Measurements drawn from what a filter expects, (DRAWS, runs, p)."""
    runs, key = len(before.posterior.mean), (*batch.seed.spawn_key, 1, before.step)
    seed = np.random.SeedSequence(batch.seed.entropy, spawn_key=key)
    drawn = None
    if before.step > 0:
        x, mode = before.memory.drawn(DRAWS, np.random.default_rng(seed))
        drawn = x.reshape(-1, x.shape[-1]), mode.ravel()
    y = foretold(replace(batch, runs=DRAWS * runs, seed=seed, wide=None), before.step, drawn)
    return y.reshape(DRAWS, runs, -1)


def crps_of_draws(y: Array, drawn: Array, angles: Components) -> Array:
    """Of a law of which some measurements were drawn, (draws, runs, p): M|y - Y| - M|Y - Y'| / 2
    without bias, Y' the next draw; summed over the components, (runs,)."""
    missed = np.abs(difference(y, drawn, angles))
    apart = np.abs(difference(np.roll(drawn, 1, axis=0), drawn, angles))
    return (missed - apart / 2).mean(axis=0).sum(axis=-1)


def crps(errors: Array, deviations: Array, weights: Array) -> Array:
    """Of a mixture: what came less each mean, deviations, weights, (..., M) -> (...)."""
    value = (weights * mean_size(errors, deviations)).sum(axis=-1)
    for i in range(errors.shape[-1]):
        apart, both = errors[..., i, None] - errors, np.hypot(deviations[..., i, None], deviations)
        value -= (weights * weights[..., i, None] * mean_size(apart, both)).sum(axis=-1) / 2
    return value


def mean_size(mean: Array, deviation: Array) -> Array:
    """M|u| of u ~ N(mean, deviation^2)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.where(deviation > 0, mean / deviation, 0.0)
    height = np.exp(-0.5 * z**2) / np.sqrt(2 * np.pi)
    return np.where(deviation > 0, mean * (2 * ndtr(z) - 1) + 2 * deviation * height, np.abs(mean))
