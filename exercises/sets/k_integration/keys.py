"""Keys of set k: the error of a slow sensor as the state, its filter and the steady state of that,
gaps and biases.

Letters are the book's: Psi and p are the lecture's D with a tilde and D.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import sympy as sp

from kfcourse.laws import Array


def error_meter(signal: Callable, y: sp.Expr, eps: sp.Expr) -> tuple[sp.Expr, ...]:
    """The receiver's signal as a function of the error eps, and its slope."""
    h = signal(y - eps)
    return h, sp.diff(h, eps)


def steady_state(sigma_xi: sp.Expr, sigma_n: sp.Expr) -> tuple[sp.Expr, ...]:
    """Psi, p, K that a step leaves as they are.

    The positive fixed point of Psi = p + sigma_xi^2, K = -Psi/(Psi + sigma_n^2), p = (1 + K) Psi.
    """
    Psi = (sigma_xi**2 + sp.sqrt(sigma_xi**4 + 4 * sigma_xi**2 * sigma_n**2)) / 2
    p = Psi - sigma_xi**2
    K = -Psi / (Psi + sigma_n**2)
    return Psi, p, K


def gained(sigma_xi: sp.Expr, sigma_n: sp.Expr, T: sp.Expr) -> tuple[sp.Expr, ...]:
    """How many times surer than the receiver alone, and the time constant in seconds."""
    _, p, K = steady_state(sigma_xi, sigma_n)
    return sigma_n / sp.sqrt(p), -T / sp.log(1 + K)


def integrate(
    y_ins: Array, y_sr: Array, sigma_xi: float, sigma_n: float, p0: float
) -> tuple[Array, Array]:
    """Velocities less the estimated error, and its variances p."""
    eps, Psi = np.zeros(y_ins.shape[1:]), p0
    velocities, variances = [], []
    for ins, sr in zip(y_ins, y_sr, strict=True):
        lost = np.isnan(sr).any()
        K = 0 if lost else -Psi / (Psi + sigma_n**2)
        eps = eps if lost else eps + K * (sr - (ins - eps))
        p = (1 + K) * Psi
        velocities.append(ins - eps)
        variances.append(p)
        Psi = p + sigma_xi**2
    return np.array(velocities), np.array(variances)


def lost(
    p: sp.Expr, sigma_xi: sp.Expr, sigma_n: sp.Expr, n: sp.Expr, T: sp.Expr
) -> tuple[sp.Expr, ...]:
    """Standard deviation after n periods without receiver, and when it is that of the receiver."""
    return sp.sqrt(p + n * sigma_xi**2), T * (sigma_n**2 - p) / sigma_xi**2


def bias_error(beta: sp.Expr, K: sp.Expr, j: sp.Expr) -> sp.Expr:
    """What of the receiver's bias beta has passed into the estimate after j steps."""
    return beta * (1 - (1 + K) ** j)
