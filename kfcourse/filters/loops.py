"""Loops of the compiled engine in which no formula of a model stands: moments and sums.  Only with numba is this imported."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit

from kfcourse.filters.designed import Scatter
from kfcourse.laws import Array, column

# Sums may be taken in any order, so that the processor adds several terms at once.
_OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "fastmath": {"reassoc", "nsz"}}


@njit("UniTuple(float64, 5)(float64[::1], float64[::1])", **_OPTIONS)
def _moments(target, regressor):
    """Both means, then sums of products of deviations from them."""
    size, t, r = len(target), 0.0, 0.0
    for i in range(size):
        t += target[i]
        r += regressor[i]
    t, r = t / size, r / size
    tt, tr, rr = 0.0, 0.0, 0.0
    for i in range(size):
        dt, dr = target[i] - t, regressor[i] - r
        tt += dt * dt
        tr += dt * dr
        rr += dr * dr
    return t, r, tt, tr, rr


def scatter(target: Array, regressor: Array) -> Scatter:
    """`Scatter.of` a scalar target and a scalar regressor, (N, 1) both."""
    t, r, tt, tr, rr = _moments(column(target), column(regressor))
    return Scatter(len(target), np.array([t, r]), np.array([[tt, tr], [tr, rr]]))


_ARRAYS = ", ".join(["float64[::1]"] * 5 + ["int64[::1]"] + ["float64[::1]"] * 5)


def _record(x, z, p, weight, weights, starts, error, square, own, normalised, largest):
    """What `Sums.record` keeps of a scalar estimate, of batches that begin at `starts`; p may be one for all."""
    for b in range(len(weights)):
        end = starts[b + 1] if b + 1 < len(starts) else len(x)
        e1, e2, claimed, quotient, most = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(starts[b], end):
            e = x[i] - z[i]
            term = weight[i] * e * e
            e1 += weight[i] * e
            e2 += term
            most = term if term > most else most
            if len(p) > 1:
                claimed += weight[i] * p[i]
                quotient += term / p[i] if p[i] != 0 else (np.inf if term > 0 else 0.0)
        if len(p) == 1:
            claimed = p[0] * weights[b]
            quotient = e2 / p[0] if p[0] != 0 else (np.inf if e2 > 0 else 0.0)
        error[b], square[b], own[b], normalised[b], largest[b] = e1, e2, claimed, quotient, most


record: Callable[..., None] = njit(f"void({_ARRAYS})", **_OPTIONS)(_record)
