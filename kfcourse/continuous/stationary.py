"""The steady state of a linear continuous model."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
import sympy as sp

from kfcourse.continuous.model import ContinuousModel
from kfcourse.laws import Array, symmetric
from kfcourse.symbolic.reading import (
    ModelError,
)


class Linear(NamedTuple):
    """Matrices of a linear continuous model: A (n, n), G (n, r), H (p, n)."""

    A: Array
    G: Array
    H: Array


def linear_matrices(model: ContinuousModel) -> Linear:
    """A = df/dx, G = g, H = dS/dx; ModelError if the model is not linear or depends on time."""
    x = sp.Matrix(model.x)
    matrices = [
        m.subs(model.values)
        for m in (model.drift.jacobian(x), model.diffusion, model.signal.jacobian(x))
    ]
    if model.time is not None:
        raise ModelError(
            f"{model} depends on the time t: it has no steady state; follow the covariance with "
            f"extended_kalman_bucy(model, step)"
        )
    if any(matrix.has(*model.x) for matrix in matrices):
        raise ModelError(
            f"{model} is not linear: it has no steady state that holds everywhere; use "
            f"extended_kalman_bucy(model, step)"
        )
    return Linear(*(np.array(matrix, dtype=float) for matrix in matrices))


class Steady(NamedTuple):
    """The stationary Kalman-Bucy filter: covariance (n, n), gain (n, p)."""

    cov: Array
    gain: Array


def steady_state(model: ContinuousModel) -> Steady:
    """Limit of D and of the gain K = D H^T 2 N^-1 of a linear model, from the algebraic Riccati
    equation.

    A D + D A^T + G S_xi G^T / 2 - D H^T 2 N^-1 H D = 0

    Raises
    ------
    ModelError
        The model is not linear.
    ValueError
        There is no limit that the filter reaches from every start.
    """
    A, G, H = linear_matrices(model)
    R = model.noise_density / 2
    try:
        cov = symmetric(
            scipy.linalg.solve_continuous_are(A.T, H.T, G @ model.spectral_density @ G.T / 2, R)
        )
        gain = np.linalg.solve(R, H @ cov).T
        closed = np.linalg.eigvals(A - gain @ H)
        # a root at 0 is found to the square root of rounding
        settles = closed.real.max() < -1e-8 * np.abs(closed).max()
    except (np.linalg.LinAlgError, ValueError):
        settles = False
    if not settles:
        raise ValueError(
            "the Riccati equation has no stabilising solution: a part of the state is neither "
            "seen by the meter nor decays, "
            "or has no noise; follow D with extended_kalman_bucy(model, step)"
        )
    return Steady(cov, gain)
