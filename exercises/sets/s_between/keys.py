"""Keys of set s: moment equations, an exact discretisation, a measurement at an instant, the limit
of the gain."""

from __future__ import annotations

import numpy as np

from kfcourse.laws import Array


def moment_rates(
    z: Array, p: Array, a1: float, a3: float, b0: float, b1: float
) -> tuple[Array, Array]:
    """Rates of mean and variance for dx = (a1 x + a3 x^3) dt + (b0 + b1 x) dw and a normal law."""
    cube = z**3 + 3 * z * p
    slope = a1 + 3 * a3 * (z**2 + p)
    pushed = (b0 + b1 * z) ** 2 + b1**2 * p
    return a1 * z + a3 * cube, 2 * slope * p + pushed


def discretised(c: float, q: float, T: float) -> tuple[Array, Array]:
    """F and Q over T for dx1 = x2 dt, dx2 = -c x2 dt + sqrt(q) dw."""
    left = np.exp(-c * T)
    F = np.array([[1, (1 - left) / c], [0, left]])
    q11 = q / c**2 * (T - 2 * (1 - left) / c + (1 - left**2) / (2 * c))
    q12 = q / (2 * c**2) * (1 - left) ** 2
    q22 = q / (2 * c) * (1 - left**2)
    return F, np.array([[q11, q12], [q12, q22]])


def next_estimate(
    z: Array, p: Array, y: Array, tau: Array, a: float, q: float, r: float
) -> tuple[Array, Array]:
    """z and p after the next measurement, tau later, for dx = -a x dt + sqrt(q) dw, y = x + w."""
    left = np.exp(-a * tau)
    mean = left * z
    variance = left**2 * p + q / (2 * a) * (1 - left**2)
    K = variance / (variance + r)
    missing = np.isnan(y)
    K = np.where(missing, 0.0, K)
    return mean + K * (np.where(missing, 0.0, y) - mean), (1 - K) * variance


def gain_rate(a: float, q: float, r: float, T: float) -> tuple[float, float]:
    """The steady p, and K/T, where y is measured every T with the variance r/T."""
    left = np.exp(-2 * a * T)
    R, Q = r / T, q / (2 * a) * (1 - left)
    half = (Q + R * (1 - left)) / 2
    p = (np.sqrt(half**2 + left * Q * R) - half) / left
    K = p / R
    return p, K / T
