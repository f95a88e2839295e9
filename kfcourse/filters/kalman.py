"""The Kalman filter of a linear-Gaussian model, kept as the readable special case.

    x' = A x + B v,   y = H x + C w      (plus constants)

Every filter of the course must give these numbers on such a model; the tests pin it.
"""

from __future__ import annotations

import numpy as np
import sympy as sp

from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.laws import Array, symmetric
from kfcourse.linear.arithmetic import form
from kfcourse.linear.system import LinearSystem
from kfcourse.symbolic.model import Model, ModelError


def kalman(model: Model, arithmetic: str = "covariance") -> Filter:
    """The Kalman filter of a linear model.

    K = P^- H^T (H P^- H^T + R)^-1,   z = x^- + K (y - H x^-),   P = (I - K H) P^-
    x^- = A z,   P^- = A P A^T + Q                            (covariance (n, n): no trajectory enters)

    Parameters
    ----------
    model : Model
    arithmetic : {"covariance", "symmetrised", "joseph", "square-root"}
        How the covariance is computed; see `kfcourse.linear.arithmetic`.

    Raises
    ------
    ModelError
        The model is not linear.
    """
    system, shift, offset = linear_system(model)
    chosen = form(arithmetic, system)

    def init(runs: int) -> State:
        state = initial_state(model)(runs)
        return state._replace(memory=chosen.start(state.predicted))

    def step(state: State, y: Array) -> State:
        corrected = chosen.correct(system, state.memory, y - offset)
        predicted = chosen.predict(system, corrected, shift)
        return State(state.step + 1, chosen.law(corrected), chosen.law(predicted), predicted)

    return Filter("kalman", model, init, step)


def linear_system(model: Model) -> tuple[LinearSystem, Array, Array]:
    """The matrices of a linear model, and the constants of its object (n,) and meter (p,); ModelError if it is not linear."""
    A, B, a0 = _affine(model.state_equation, model.x, model.v, model)
    H, C, b0 = _affine(model.meter_equation, model.x, model.w, model)
    Q, R = (M @ law.cov @ M.T for M, law in ((B, model.state_noise), (C, model.meter_noise)))
    system = LinearSystem(A, H, symmetric(Q), symmetric(R))
    return system, a0 + B @ model.state_noise.mean, b0 + C @ model.meter_noise.mean


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
