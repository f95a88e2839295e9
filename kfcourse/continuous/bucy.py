"""The extended Kalman-Bucy filter as a filter of means over steps."""

from __future__ import annotations

import numpy as np
import sympy as sp

from kfcourse.continuous.equations import filter_equations, without_noise
from kfcourse.continuous.model import ContinuousModel, compiled, to_discrete
from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.laws import Array, Gaussian, Measurement, correct, product, symmetric, transpose
from kfcourse.montecarlo.designing import NotFinite
from kfcourse.symbolic.reading import exact_matrix


def extended_kalman_bucy(
    model: ContinuousModel, step: float, second_derivatives: bool = False
) -> Filter:
    """The extended Kalman filter in continuous time, as a filter of the means y_k over steps of
    length T.

    dz/dt = f + K (y - S),                        K = D H^T 2 N^-1
    dD/dt = A D + D A^T + Q - K H D  [+ D W D],   W = U + H^T 2 N^-1 H

    are integrated by Euler's scheme, except that the term -K H D is taken implicitly, so that no
    step is too long for it:

        B  = (D^-1 + T H^T 2 N^-1 H)^-1
        z' = z + T (f + B H^T 2 N^-1 (y - S))
        D' = (M + T A) B (M + T A)^T + T Q,   M = (I + T B V / 8)^-1 (I + T B W / 2),
        V = T M[W B W]

    D' is never negative.  Without second derivatives M = I; with them W contains white noise of the
    size 1 / sqrt(T), so (T B W)^2 is of the order T, and V makes Mean[M B M^T] = B to that order,
    as Ito's sense demands.

    Parameters
    ----------
    model : ContinuousModel
    step : float
        T, the interval over which every y_k is the mean of y(t).
    second_derivatives : bool
        Keep the term D W D with the second derivatives of S.

    Returns
    -------
    Filter
        For `run`, `compare`, and `predictions(filter, y)`, which gives z and D at the times 0, T, 2
        T, ... Its `model` is `to_discrete(model, step)`.  A run whose y has a NaN does without the
        missing components and without W.

    Raises
    ------
    NotFinite
        While running: an estimate became infinite.
    """
    discrete = to_discrete(model, step)
    name = "kalman-bucy" + "-second" * second_derivatives
    equations = filter_equations(model, second_derivatives)
    z, D, y = equations.z, equations.D, equations.y
    parts = [list(equations.f), equations.A, equations.Q, list(equations.S), equations.H]
    linear = compiled(model, [list(z)], parts)
    W = equations.U - without_noise(equations.U, y, equations.S)
    intensity = exact_matrix(model.noise_density) / 2
    slopes = [W.diff(component) for component in y]  # W is linear in y
    V = sum(
        (intensity[i, j] * a * D * b for i, a in enumerate(slopes) for j, b in enumerate(slopes)),
        sp.zeros(*D.shape),
    )
    second = compiled(model, [list(z), D, list(y)], [W, V]) if second_derivatives else None
    identity, R = np.eye(model.n), model.noise_density / (2 * step)

    def step_forward(state: State, y: Array) -> State:
        # what becomes infinite is reported below
        with np.errstate(over="ignore", invalid="ignore"):
            z, D = state.predicted
            t = state.step * step
            f, A, Q, S, H = linear(t, z)
            measurement = Measurement(S, H, symmetric(product(product(H, D), transpose(H))) + R, R)
            mean, B = correct(state.predicted, measurement, y)
            M, cov = identity, B
            if second is not None:
                missing: Array = np.asarray(np.isnan(y).any(axis=-1))
                W, V = second(t, z, B, np.where(missing[:, None], 0.0, y))
                W, V = (np.where(missing[:, None, None], 0.0, matrix) for matrix in (W, V))
                M = _solve(identity + step / 8 * product(B, V), identity + step / 2 * product(B, W))
                cov = _propagated(M, B, 0.0)
            predicted = Gaussian(mean + step * f, _propagated(M + step * A, B, step * Q))
        _check_law(name, state.step, step, predicted)
        return State(state.step + 1, Gaussian(mean, cov), predicted)

    return Filter(name, discrete, initial_state(discrete), step_forward)


def _solve(left: Array, right: Array) -> Array:
    return right / left if left.shape[-1] == 1 else np.linalg.solve(left, right)


def _propagated(M: Array, cov: Array, added: Array | float) -> Array:
    """M cov M^T + added."""
    return symmetric(product(product(M, cov), transpose(M)) + added)


def _check_law(name: str, k: int, step: float, law: Gaussian) -> None:
    lost = ~np.asarray(np.isfinite(law.mean).all(axis=-1) & np.isfinite(law.cov).all(axis=(-2, -1)))
    if lost.any():
        raise NotFinite(
            f"step {k}, time {(k + 1) * step:g}: {name} became infinite in "
            f"{np.count_nonzero(lost)} of {len(law.mean)} runs; take a smaller step than {step:g}"
            + (
                ", and if that does not help, leave out the second derivatives"
                if "-" in name[7:]
                else ""
            )
        )
