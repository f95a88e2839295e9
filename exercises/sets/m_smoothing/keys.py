"""Keys of set m: a look back, step by step; the likelihood of an innovation, one round of EM; a
gate and a weight."""

from __future__ import annotations

import numpy as np
import sympy as sp

from kfcourse.laws import Array


def gate(beta: float) -> float:
    """The value that chi-squared with two degrees stays below with the probability beta."""
    return -2 * np.log(1 - beta)


def log_likelihood(nu: sp.Expr, F: sp.Expr) -> sp.Expr:
    """ln N(nu; 0, F)."""
    return -(nu**2) / F / 2 - sp.log(2 * sp.pi * F) / 2


def neighbours(p: Array, A: Array, Q: Array) -> tuple[Array, Array]:
    """Cov(x_k, x_{k+1}) and the smoother's gain."""
    cross = p @ A.T
    return cross, cross @ np.linalg.inv(A @ p @ A.T + Q)


def step_back(
    z: Array, p: Array, ahead: Array, Psi: Array, later: Array, later_p: Array, S: Array
) -> tuple[Array, Array]:
    """Mean and covariance given all, from those of the next step."""
    return z + S @ (later - ahead), p + S @ (later_p - Psi) @ S.T


def smooth(z: Array, p: Array, ahead: Array, Psi: Array, A: Array, Q: Array) -> tuple[Array, Array]:
    """All steps, from what a filter left."""
    means, covs = [z[-1]], [p[-1]]
    for k in range(len(z) - 2, -1, -1):
        _, S = neighbours(p[k], A, Q)
        mean, cov = step_back(z[k], p[k], ahead[k + 1], Psi[k + 1], means[-1], covs[-1], S)
        means.append(mean)
        covs.append(cov)
    return np.stack(means[::-1]), np.stack(covs[::-1])


def new_r(y: Array, z: Array, p: Array) -> float:
    """The meter's variance after a round: the mean of what is expected of w^2."""
    there = np.isfinite(y)
    y, z, p = y[there], z[there], p[there]
    return float(np.mean((y - z) ** 2 + p))


def weight(r: Array, R: Array, G: Array, p: Array, s: float) -> float:
    """How much a measurement with this residual counts under Student noise of s degrees."""
    inverse = np.linalg.inv(R)
    size = r @ inverse @ r + np.trace(inverse @ G @ p @ G.T)
    return float((s + len(r)) / (s + size))
