"""Keys of set m: a look back, step by step; the likelihood of an innovation, one round of EM; a gate and a weight."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy
import sympy as sp

from kfcourse.laws import Array, gain, normalised_square

# -- m1: the gate; m2: the likelihood of one innovation


def gate(beta: float) -> float:
    """The value that chi-squared with two degrees stays below with the probability beta."""
    return float(scipy.special.chdtri(2, 1 - beta))


def log_likelihood(nu: sp.Expr, F: sp.Expr) -> sp.Expr:
    """ln N(nu; 0, F)."""
    return sp.log(sp.exp(-(nu**2) / (2 * F)) / sp.sqrt(2 * sp.pi * F))


# -- m3: neighbours; m4: one step back; m5: a whole record


def neighbours(p: Array, A: Array, Q: Array) -> tuple[Array, Array]:
    """Cov(x_k, x_{k+1}) and the smoother's gain."""
    cross = p @ A.T
    return cross, gain(cross, A @ p @ A.T + Q)


def step_back(z: Array, p: Array, ahead: Array, Psi: Array, later: Array, later_p: Array, S: Array) -> tuple[Array, Array]:
    """Mean and covariance given all, from those of the next step."""
    return z + S @ (later - ahead), p + S @ (later_p - Psi) @ S.T


def smooth(z: Array, p: Array, ahead: Array, Psi: Array, A: Array, Q: Array) -> tuple[Array, Array]:
    """All steps, from what a filter left."""
    return smooth_with(neighbours, step_back)(z, p, ahead, Psi, A, Q)


def smooth_with(neighbours: Callable, step_back: Callable) -> Callable:
    """m5 by these answers to m3 and m4."""

    def answer(z: Array, p: Array, ahead: Array, Psi: Array, A: Array, Q: Array) -> tuple[Array, Array]:
        means, covs = [z[-1]], [p[-1]]
        for k in range(len(z) - 2, -1, -1):
            _, S = neighbours(p[k], A, Q)
            mean, cov = step_back(z[k], p[k], ahead[k + 1], Psi[k + 1], means[-1], covs[-1], S)
            means.append(np.asarray(mean))
            covs.append(np.asarray(cov))
        return np.stack(means[::-1]), np.stack(covs[::-1])

    return answer


# -- m6: a round of EM; m7: a weight


def new_r(y: Array, z: Array, p: Array) -> float:
    """The meter's variance after a round: the mean of what is expected of w^2."""
    there = np.isfinite(y)
    return float(np.mean((y[there] - z[there]) ** 2 + p[there]))


def weight(r: Array, R: Array, G: Array, p: Array, s: float) -> float:
    """How much a measurement with this residual counts under Student noise of s degrees."""
    unsure = np.trace(gain(np.eye(len(R)), R) @ G @ p @ G.T)
    return float((s + len(r)) / (s + normalised_square(r, R) + unsure))
