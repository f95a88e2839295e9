"""Keys of set r: a tracking loop from its log-likelihood, its characteristic, slips by a double
integral.

The carrier is y = A cos(theta + phi) + n, D[n] = D, with the known phase theta.
"""

from __future__ import annotations

import numpy as np
import sympy as sp

from kfcourse.laws import Array

POINTS = 512  # of a period


def discriminator(lam: Array, y: Array, theta: Array, A: float, sigma: float) -> Array:
    """u at the prediction lam of the phase, (N,): the slope of the log-likelihood."""
    expected, slope = A * np.cos(theta + lam), -A * np.sin(theta + lam)
    return slope * (y - expected) / sigma**2


def characteristic(Delta: sp.Expr, A: sp.Expr, D: sp.Expr) -> tuple[sp.Expr, ...]:
    """U(Delta), its slope at zero, and the variance of the equivalent noise: u averaged over a
    period."""
    slope = A**2 / (2 * D)
    return slope * sp.sin(Delta), slope, 1 / slope


def steady(q: sp.Expr, r: sp.Expr) -> tuple[sp.Expr, ...]:
    """Variances of the phase before and after a correction."""
    Psi = (q + sp.sqrt(q**2 + 4 * q * r)) / 2
    return Psi, Psi - q


def lock_in(p: sp.Expr, A: sp.Expr, D: sp.Expr, T: sp.Expr) -> sp.Expr:
    """The frequency offset, Hz, that the loop can just follow: p U(pi/2) a step."""
    return p * A**2 / (2 * D) / (2 * sp.pi * T)


def mean_time(variance: Array, q: float) -> Array:
    """Mean number of steps to a slip, for each variance of the phase: both integrals over a period
    by sums."""
    x = 2 * np.pi * np.arange(POINTS) / POINTS
    V = (1 - np.cos(x)) / np.asarray(variance)[:, None]
    up, down = np.exp(V).mean(axis=1), np.exp(-V).mean(axis=1)
    return 2 * np.pi**2 / q * up * down


def slips(error: Array) -> tuple[Array, Array]:
    """Whole cycles by which each run is off at the end, (N,), and the mean time to a first slip."""
    cycles = np.round(error[-1] / (2 * np.pi))
    away = np.abs(error) >= 2 * np.pi
    slipped = away.any(axis=0)
    first = np.where(slipped, away.argmax(axis=0), len(error))
    return cycles, first.sum() / slipped.sum()
