"""Keys of set h: white noise on a computer, the Riccati equation and its steady state, a step of
the filter."""

from __future__ import annotations

import numpy as np
import sympy as sp

from kfcourse.exercises.sets.shared import Map
from kfcourse.laws import Array


def noise_variances(S_xi: float, N: float, T: float) -> tuple[float, float]:
    """Variances of the means of both noises over a step."""
    return S_xi / (2 * T), N / (2 * T)


def simulate_step(
    x: Array, xi: Array, n: Array, T: float, f: Map, g: Map, S: Map, S_xi: float, N: float
) -> tuple[Array, Array]:
    """x after Euler's step, and the measurement averaged over it."""
    shaken = np.sqrt(S_xi * T / 2) * xi
    noise = np.sqrt(N / (2 * T)) * n
    x_next = x + T * f(x) + g(x) * shaken
    return x_next, S(x) + noise


def riccati(D: Array, A: Array, G: Array, H: Array, S_xi: Array, N: Array) -> Array:
    """dD/dt = A D + D A^T + G S_xi G^T/2 - 2 D H^T N^-1 H D."""
    learnt = D @ H.T @ np.linalg.solve(N / 2, H @ D)
    return A @ D + D @ A.T + G @ S_xi @ G.T / 2 - learnt


def steady_state(a: float, s: float, h: float, S_xi: float, N: float) -> tuple[float, float]:
    """D and K at which the covariance of dx/dt = -a x + s xi, y = h x + n stands still.

    The root of -2 a D + q - c D^2 = 0.
    """
    q, c = s**2 * S_xi / 2, 2 * h**2 / N
    D = (np.sqrt(a**2 + c * q) - a) / c
    K = 2 * D * h / N
    return D, K


def filter_step(
    z: Array,
    D: Array,
    y: Array,
    T: float,
    f: Map,
    f_x: Map,
    g: Map,
    S: Map,
    S_x: Map,
    S_xi: float,
    N: float,
) -> tuple[Array, Array]:
    """z and D after Euler's step of the filter's equations."""
    K = D * S_x(z) * 2 / N
    learnt = D**2 * S_x(z) ** 2 * 2 / N
    z_next = z + T * (f(z) + K * (y - S(z)))
    D_next = D + T * (2 * f_x(z) * D + g(z) ** 2 * S_xi / 2 - learnt)
    return z_next, D_next


def derivatives(S: sp.Expr, x: sp.Symbol, y: sp.Symbol, N: sp.Symbol) -> tuple[sp.Expr, sp.Expr]:
    """u = dF/dx and U = d2F/dx2 of the rate F of the log-likelihood."""
    S1, S2, k = S.diff(x), S.diff(x, 2), 2 / N
    return k * S1 * (y - S), k * S2 * (y - S) - k * S1**2
