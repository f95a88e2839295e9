"""Keys of set i: matrices and noise of the motion, start-up, a step with a known input, a square
root."""

from __future__ import annotations

import numpy as np
import sympy as sp

from kfcourse.laws import Array
from kfcourse.scenarios.pointer import DT, INPUT, SENSITIVITY, START, TRANSITION


def matrices(dt: sp.Expr) -> tuple[sp.ImmutableMatrix, ...]:
    """A, B, H for the state (x, y, vx, vy)."""
    A, B, H = TRANSITION.subs(DT, dt), INPUT.subs(DT, dt), SENSITIVITY
    return A, B, H


def process_noise(dt: sp.Expr, sigma_a: sp.Expr) -> sp.ImmutableMatrix:
    """sigma_a^2 B B^T."""
    B = matrices(dt)[1]
    return sp.ImmutableMatrix(sigma_a**2 * B * B.T)


def start_up(y0: sp.Expr, y1: sp.Expr, y2: sp.Expr, dt: sp.Expr) -> tuple[sp.Expr, ...]:
    """Position, velocity and acceleration at the last of three samples."""
    r, v, a = START.subs(DT, dt) * sp.Matrix([y0, y1, y2])
    return r, v, a


def step(
    z: Array, p: Array, u: Array, y: Array, A: Array, B: Array, H: Array, Q: Array, R: Array
) -> tuple[Array, ...]:
    """lam, Psi, z, p of a step with the known input u."""
    lam, Psi = A @ z + B @ u, A @ p @ A.T + Q
    F = H @ Psi @ H.T + R
    K = np.linalg.solve(F, H @ Psi).T
    return lam, Psi, lam + K @ (y - H @ lam), Psi - K @ H @ Psi


def correct_root(lam: Array, S: Array, y: Array, H: Array, R: Array) -> tuple[Array, Array]:
    """z and the lower triangular root of its covariance, diagonal positive: a QR decomposition of
    the pre-array."""
    p = len(y)
    array = np.block([[np.linalg.cholesky(R), H @ S], [np.zeros((len(S), p)), S]])
    lower = np.asarray(np.linalg.qr(array.T, mode="r")).T
    top, cross, root = lower[:p, :p], lower[p:, :p], lower[p:, p:]
    z = lam + cross @ np.linalg.solve(top, y - H @ lam)
    return z, root * np.sign(np.diag(root))
