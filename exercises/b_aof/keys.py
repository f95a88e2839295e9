"""Keys of set b: gain, correction, step and run of the Gaussian approximation of the absolutely optimal filter.

They call `kfcourse.laws`.  Arrays are over an ensemble: vectors (N, n), matrices (N, r, c).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kfcourse import laws
from kfcourse.checks.question import Answer
from kfcourse.checks.steps import Function, at_step, full
from kfcourse.laws import Array, Gaussian, Measurement, transpose

# -- b1: the gain

Gain = Callable[[Array, Array, Array], Array]


def gain(Psi: Array, G: Array, F: Array) -> Array:
    """K = Psi G^T F^-1."""
    return laws.gain(Psi @ transpose(G), F)


# -- b2: the correction


def correct(lam: Array, Psi: Array, h: Array, G: Array, F: Array, y: Array) -> tuple[Array, Array]:
    """z = lam + K (y - h) and p = Psi - K G Psi."""
    z, p = laws.correct(Gaussian(lam, Psi), Measurement(h, G, F, F - G @ Psi @ transpose(G)), y)
    return z, full(p, len(lam))


# -- b3: a whole step


def step(lam: Array, Psi: Array, y: Array, measure: Callable, predict: Callable) -> tuple[Array, ...]:
    """z, p corrected by y, then the prediction for the next step from them."""
    h, G, F = measure(lam, Psi)
    z, p = correct(lam, Psi, h, G, F, y)
    return z, p, *predict(z, p)


# -- b4: a whole run, with measurements missing


def run_filter(y: Array, mean: Array, cov: Array, measure: Callable, predict: Callable) -> Array:
    """Estimates z (steps, N, n) of the filter; it starts with a correction."""
    return run_with(step, y, mean, cov, measure, predict)


AtStep = Callable[[Function, int], Function]


def run_with(
    step: Answer,
    y: Array,
    mean: Array,
    cov: Array,
    measure: Callable,
    predict: Callable,
    measure_at: AtStep = at_step,
    predict_at: AtStep = at_step,
) -> Array:
    """Estimates of a filter over y (steps, N, p); a trajectory whose measurement is missing keeps its prediction.

    measure_at, predict_at: (function, k) -> the function of which step is taken at step k.
    """
    lam, Psi = np.tile(mean, (y.shape[1], 1)), full(cov, y.shape[1])
    estimates = []
    for k, measurement_k in enumerate(y):
        meter, object_ = measure_at(measure, k), predict_at(predict, k)
        missing = np.isnan(measurement_k).any(axis=-1)
        z, p, *_ = step(lam, Psi, np.where(missing[:, None], 0.0, measurement_k), meter, object_)
        z, p = np.where(missing[:, None], lam, z), np.where(missing[:, None, None], Psi, p)
        estimates.append(z)
        lam, Psi = object_(z, p)
    return np.array(estimates)


# -- b5: a covariance that rounding cannot make negative


def covariance(Psi: Array, G: Array, F: Array, R: Array) -> Array:
    """p as a sum that rounding cannot make negative."""
    at = Gaussian(np.zeros(Psi.shape[:-1]), Psi)
    zero = np.zeros(F.shape[:-1])
    return full(laws.correct(at, Measurement(zero, G, F, R), zero).cov, len(Psi))
