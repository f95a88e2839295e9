"""Keys of set i: matrices and noise of the motion, start-up, a step with a known input, a square root; all from the package."""

from __future__ import annotations

import numpy as np
import sympy as sp

from kfcourse.laws import Array, Gaussian
from kfcourse.linear.arithmetic import FORMS, Root, predict_law
from kfcourse.linear.system import LinearSystem
from kfcourse.scenarios.pointer import DT, INPUT, SENSITIVITY, START, TRANSITION

# -- i1, i2: the matrices of uniformly accelerated motion


def matrices(dt: sp.Expr) -> tuple[sp.ImmutableMatrix, ...]:
    """A, B, H for the state (x, y, vx, vy)."""
    return TRANSITION.subs(DT, dt), INPUT.subs(DT, dt), SENSITIVITY


def process_noise(dt: sp.Expr, sigma_a: sp.Expr) -> sp.ImmutableMatrix:
    """sigma_a^2 B B^T."""
    B = INPUT.subs(DT, dt)
    return sp.ImmutableMatrix(sigma_a**2 * B * B.T)


# -- i3: start-up from three samples


def start_up(y0: sp.Expr, y1: sp.Expr, y2: sp.Expr, dt: sp.Expr) -> tuple[sp.Expr, ...]:
    """Position, velocity and acceleration at the last of three samples."""
    return tuple(START.subs(DT, dt) * sp.Matrix([y0, y1, y2]))


# -- i4: one step of the filter with a known input


def step(z: Array, p: Array, u: Array, y: Array, A: Array, B: Array, H: Array, Q: Array, R: Array) -> tuple[Array, ...]:
    """lam, Psi, z, p of a step with the known input u."""
    system = LinearSystem(A, H, Q, R, B)
    before = predict_law(system, Gaussian(z, p), system.input(u))
    return *before, *FORMS["covariance"].correct(system, before, y)


# -- i5: a square root that never forms the covariance


def correct_root(lam: Array, S: Array, y: Array, H: Array, R: Array) -> tuple[Array, Array]:
    """z and the lower triangular root of its covariance, diagonal positive."""
    n = len(lam)
    system = LinearSystem(np.eye(n), H, np.zeros((n, n)), R)
    law = FORMS["square-root"].correct(system, Root(lam, S), y)
    return law.mean, law.root * np.sign(np.diag(law.root))
