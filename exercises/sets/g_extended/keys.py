"""Keys of set g: Jacobian, prediction, correction and run of the extended filter, information form,
NEES and NIS."""

from __future__ import annotations

import numpy as np
import scipy

from kfcourse.exercises.checks.steps import at_step, full
from kfcourse.exercises.sets.shared import Map
from kfcourse.laws import Array, apply, gain, transpose

Run = tuple[Array, ...]  # z, p, lam, Psi


def jacobian(function: Map, x: Array, h: float) -> Array:
    """df/dx by central differences with the step h, (..., rows, n)."""
    columns = [(function(x + h * e) - function(x - h * e)) / (2 * h) for e in np.eye(x.shape[-1])]
    return np.stack(columns, axis=-1)


def bounds(degrees: int, runs: int, confidence: float) -> tuple[float, float]:
    """Bounds of the mean of `runs` chi-squared values."""
    total, outside = degrees * runs, (1 - confidence) / 2
    low, high = scipy.special.chdtri(total, [1 - outside, outside])
    return low / runs, high / runs


def predict(z: Array, p: Array, f: Map, Phi: Map, g: Map, D_xi: Array) -> tuple[Array, Array]:
    """lam = f(z), Psi = Phi p Phi^T + g D_xi g^T, at z."""
    A, B = Phi(z), g(z)
    return f(z), A @ p @ transpose(A) + B @ D_xi @ transpose(B)


def correct(lam: Array, Psi: Array, y: Array, S: Map, H: Map, D_n: Map) -> tuple[Array, Array]:
    """z and p from the innovation y - S(lam), linearised at lam."""
    G, R = H(lam), D_n(lam)
    K = gain(Psi @ transpose(G), G @ Psi @ transpose(G) + R)
    return lam + apply(K, y - S(lam)), Psi - K @ G @ Psi


def run_filter(
    y: Array,
    mean: Array,
    cov: Array,
    f: Map,
    Phi: Map,
    g: Map,
    D_xi: Array,
    S: Map,
    H: Map,
    D_n: Map,
) -> Run:
    """z, p, lam, Psi of all steps."""
    lam, Psi = np.tile(mean, (y.shape[1], 1)), full(cov, y.shape[1])
    history = []
    for k, y_k in enumerate(y):
        f_k, Phi_k, g_k = (at_step(function, k) for function in (f, Phi, g))
        S_k, H_k, D_k = (at_step(function, k) for function in (S, H, D_n))
        z, p = correct(lam, Psi, y_k, S_k, H_k, D_k)
        history.append((z, p, lam, Psi))
        lam, Psi = predict(z, p, f_k, Phi_k, g_k, D_xi)
    return tuple(np.array(column) for column in zip(*history, strict=True))


def square(vector: Array, cov: Array) -> Array:
    """vector^T cov^-1 vector."""
    return np.sum(vector * np.linalg.solve(cov, vector[..., None])[..., 0], axis=-1)


def consistency(
    x: Array, z: Array, p: Array, y: Array, lam: Array, Psi: Array, S: Map, H: Map, D_n: Map
) -> tuple[Array, Array]:
    """NEES and NIS, each the mean over trajectories."""
    G, R = H(lam), D_n(lam)
    F = G @ Psi @ transpose(G) + R
    return square(x - z, p).mean(axis=-1), square(y - S(lam), F).mean(axis=-1)


def information(W: Array, H: Array, D_n: Array) -> tuple[Array, Array]:
    """p = (W + H^T D_n^-1 H)^-1 and K = p H^T D_n^-1."""
    total = W + transpose(H) @ np.linalg.solve(D_n, H)
    p = np.linalg.inv(total)
    return p, gain(p @ transpose(H), D_n)
