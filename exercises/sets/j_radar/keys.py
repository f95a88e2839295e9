"""Keys of set j: coordinates of a radar, the constant gain, the alpha-beta filter, its lag and the
noise that it leaves."""

from __future__ import annotations

import numpy as np
import scipy
import sympy as sp

from kfcourse.laws import Array
from kfcourse.scenarios.radar import AZIMUTH, CARTESIAN, ELEVATION, RANGE, SPHERICAL, X, Y, Z

MEASURED, POSITION = (RANGE, AZIMUTH, ELEVATION), (X, Y, Z)


def cartesian(r: sp.Expr, phi: sp.Expr, eps: sp.Expr) -> tuple[sp.Expr, ...]:
    """x, y, z of range, azimuth and elevation."""
    return tuple(CARTESIAN.subs(dict(zip(MEASURED, (r, phi, eps), strict=True)), simultaneous=True))


def meter_jacobian(x: sp.Expr, y: sp.Expr, z: sp.Expr) -> sp.ImmutableMatrix:
    """Derivatives of range, azimuth and elevation by x, y, z."""
    r, phi, eps = SPHERICAL
    slopes = sp.Matrix([r, phi, eps]).jacobian(POSITION)
    return sp.ImmutableMatrix(slopes.subs({X: x, Y: y, Z: z}, simultaneous=True))


def steady_gain(alpha: float) -> tuple[float, float]:
    """beta and the tracking index of a stationary Kalman filter with this alpha."""
    beta = 2 * (2 - alpha) - 4 * np.sqrt(1 - alpha)
    return beta, beta / np.sqrt(1 - alpha)


def alpha_beta(
    y: Array, T: float, alpha: float, beta: float, r: Array, v: Array
) -> tuple[Array, Array]:
    """Estimates of position and velocity, (steps, N, axes) each."""
    r, v = np.broadcast_to(r, y.shape[1:]), np.broadcast_to(v, y.shape[1:])
    positions, velocities = [], []
    for y_k in y:
        nu = y_k - r
        z, u = r + alpha * nu, v + beta / T * nu
        positions.append(z)
        velocities.append(u)
        r, v = z + T * u, u
    return np.array(positions), np.array(velocities)


def lag(a: sp.Expr, T: sp.Expr, alpha: sp.Expr, beta: sp.Expr) -> tuple[sp.Expr, ...]:
    """How far position and velocity stay behind at a constant acceleration a.

    The fixed point of the error without noise, e <- (I - K H)(A e + (T^2/2, T) a), e the truth less
    the estimate.
    """
    rest = sp.eye(2) - sp.Matrix([alpha, beta / T]) * sp.Matrix([[1, 0]])
    A, push = sp.Matrix([[1, T], [0, 1]]), a * sp.Matrix([T**2 / 2, T])
    r, v = (sp.eye(2) - rest * A).LUsolve(rest * push)
    return sp.simplify(r), sp.simplify(v)


def noise_left(alpha: float, beta: float) -> float:
    """Variance of the estimated position over sigma^2, from the measurements' noise alone."""
    K, A = np.array([[alpha], [beta]]), np.array([[1, 1], [0, 1]])
    M = A - K @ A[:1]
    P = scipy.linalg.solve_discrete_lyapunov(M, K @ K.T)
    return float(P[0, 0])
