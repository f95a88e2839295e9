"""Keys of set b: gain, correction, step and run of the Gaussian approximation of the absolutely
optimal filter.

Arrays are over an ensemble: vectors (N, n), matrices (N, r, c).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kfcourse import laws
from kfcourse.exercises.checks.steps import at_step, full
from kfcourse.laws import Array, apply, transpose


def gain(Psi: Array, G: Array, F: Array) -> Array:
    """K = Psi G^T F^-1."""
    return laws.gain(Psi @ transpose(G), F)


def correct(lam: Array, Psi: Array, h: Array, G: Array, F: Array, y: Array) -> tuple[Array, Array]:
    """z = lam + K (y - h) and p = Psi - K G Psi."""
    K = gain(Psi, G, F)
    return lam + apply(K, y - h), Psi - K @ G @ Psi


def step(
    lam: Array, Psi: Array, y: Array, measure: Callable, predict: Callable
) -> tuple[Array, ...]:
    """z, p corrected by y, then the prediction for the next step from them."""
    h, G, F = measure(lam, Psi)
    z, p = correct(lam, Psi, h, G, F, y)
    return z, p, *predict(z, p)


def run_filter(y: Array, mean: Array, cov: Array, measure: Callable, predict: Callable) -> Array:
    """Estimates z (steps, N, n) over y (steps, N, p); a trajectory whose measurement is missing
    keeps its prediction."""
    lam, Psi = np.tile(mean, (y.shape[1], 1)), full(cov, y.shape[1])
    estimates = []
    for k, y_k in enumerate(y):
        measure_k, predict_k = at_step(measure, k), at_step(predict, k)
        missing = np.isnan(y_k).any(axis=-1)[:, None]
        z, p, *_ = step(lam, Psi, np.where(missing, 0.0, y_k), measure_k, predict_k)
        z, p = np.where(missing, lam, z), np.where(missing[:, None], Psi, p)
        estimates.append(z)
        lam, Psi = predict_k(z, p)
    return np.array(estimates)


def covariance(Psi: Array, G: Array, F: Array, R: Array) -> Array:
    """p as a sum that rounding cannot make negative."""
    K = gain(Psi, G, F)
    rest = np.eye(Psi.shape[-1]) - K @ G
    return rest @ Psi @ transpose(rest) + K @ R @ transpose(K)
