"""The plain Kalman filter, kept as the readable special case of a linear-Gaussian model.

    x' = A x + B v,   y = H x + C w      (plus constants)

Every filter of the course must give these numbers on such a model; the tests pin it.
"""

from __future__ import annotations

import numpy as np
import sympy as sp

from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.gaussian import Array, Gaussian, Measurement, apply, correct, gain
from kfcourse.model import Model, ModelError


def kalman(model: Model) -> Filter:
    """The Kalman filter of a linear model; ModelError if the model is not linear.

    K = P^- H^T (H P^- H^T + R)^-1,   z = x^- + K (y - H x^-),   P = (I - K H) P^-
    x^- = A z,   P^- = A P A^T + Q                            (covariance (n, n): no trajectory enters)
    """
    A, B, a0 = _affine(model.state_equation, model.x, model.v, model)
    H, C, b0 = _affine(model.meter_equation, model.x, model.w, model)
    Q, q = B @ model.state_noise.cov @ B.T, a0 + B @ model.state_noise.mean
    R, r = C @ model.meter_noise.cov @ C.T, b0 + C @ model.meter_noise.mean

    def step(state: State, y: Array) -> State:
        mean, cov = state.predicted
        if np.isnan(y).any():  # what is missing differs between trajectories, and so do then the covariances
            z, P = correct(state.predicted, Measurement(apply(H, mean) + r, H, H @ cov @ H.T + R, R), y)
            return State(state.step + 1, Gaussian(z, P), Gaussian(apply(A, z) + q, A @ P @ A.T + Q))
        K = gain(cov @ H.T, H @ cov @ H.T + R)
        z = mean + apply(K, y - (apply(H, mean) + r))
        P = (np.eye(model.n) - K @ H) @ cov
        return State(state.step + 1, Gaussian(z, P), Gaussian(apply(A, z) + q, A @ P @ A.T + Q))

    return Filter("kalman", model, initial_state(model), step)


def _affine(
    equation: sp.MatrixBase, x: tuple[sp.Symbol, ...], noise: tuple[sp.Symbol, ...], model: Model
) -> tuple[Array, Array, Array]:
    """Matrices of equation = A x + B noise + constant."""
    numeric = equation.subs(model.values)
    A, B = numeric.jacobian(sp.Matrix(x)), numeric.jacobian(sp.Matrix(noise))
    if A.has(*x, *noise) or B.has(*x, *noise):
        raise ModelError(f"{list(equation)} is not linear, so the Kalman filter does not apply; use aof(linearised(model))")
    constant = numeric.subs(dict.fromkeys([*x, *noise], 0))
    return np.array(A, dtype=float), np.array(B, dtype=float), np.array(constant, dtype=float)[:, 0]
