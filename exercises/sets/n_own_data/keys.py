"""Keys of set n: intervals, their noise, missing measurements, a gate, held-out measurements,
neighbouring innovations."""

from __future__ import annotations

import numpy as np
import scipy

from kfcourse.laws import Array


def intervals(times: Array) -> Array:
    """From each row to the next; the last as long as the one before."""
    steps = np.diff(times)
    return np.append(steps, steps[-1])


def process_noise(dt: Array, q: float) -> Array:
    """Covariances of what the interval adds, (N, 2, 2)."""
    Q = [[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]
    return q * np.moveaxis(np.array(Q), -1, 0)


def follow(times: Array, y: Array, q: float, r: float, m: Array, P: Array) -> tuple[Array, Array]:
    """Estimates and covariances at the times."""
    steps, means, covs = np.diff(times), [], []
    for k, y_k in enumerate(y):
        missing = np.isnan(y_k)
        if k > 0:
            dt = steps[k - 1]
            A = np.array([[1, dt], [0, 1]])
            m, P = A @ m, A @ P @ A.T + process_noise(np.array([dt]), q)[0]
        if not missing:
            K = P[:, 0] / (P[0, 0] + r)
            m, P = m + K * (y_k - m[0]), P - np.outer(K, P[0])
        means.append(m)
        covs.append(P)
    return np.stack(means), np.stack(covs)


def gate(nu: Array, F: Array, probability: float) -> tuple[Array, float]:
    """nu^T F^-1 nu of each measurement, and the gate's edge."""
    size, degrees = np.sum(nu * np.linalg.solve(F, nu[..., None])[..., 0], axis=-1), nu.shape[-1]
    return size, float(scipy.special.chdtri(degrees, 1 - probability))


def held_out(errors: Array, F: Array) -> tuple[float, float, float]:
    """Root mean square of the errors, of what was claimed, and mean NIS."""
    size = np.sum(errors**2, axis=-1)
    claimed = np.trace(F, axis1=-2, axis2=-1)
    nis = np.sum(errors * np.linalg.solve(F, errors[..., None])[..., 0], axis=-1)
    return float(np.sqrt(size.mean())), float(np.sqrt(claimed.mean())), float(nis.mean())


def neighbours(nu: Array, F: Array) -> tuple[float, float]:
    """Correlation of neighbouring innovations, and its deviation if they are white."""
    white = nu / np.sqrt(F)
    s = white[~np.isnan(white)]
    pairs = s[:-1] * s[1:]
    return float(np.mean(pairs)), 1 / np.sqrt(len(pairs))
