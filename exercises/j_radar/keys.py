"""Keys of set j: coordinates of a radar, the constant gain, the alpha-beta filter, its lag and the noise that it leaves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, lru_cache

import numpy as np
import scipy
import sympy as sp

from kfcourse.checks.question import Answer
from kfcourse.exercises.shared import substituted
from kfcourse.filters import alphabeta
from kfcourse.filters.alphabeta import steady_beta, tracking_index
from kfcourse.laws import Array
from kfcourse.montecarlo.experiment import run
from kfcourse.scenarios.radar import AZIMUTH, CARTESIAN, ELEVATION, RANGE, SPHERICAL, X, Y, Z, kinematic
from kfcourse.symbolic.model import Model

# -- j1, j2: what the radar measures

MEASURED, POSITION = (RANGE, AZIMUTH, ELEVATION), (X, Y, Z)

_cartesian = substituted(CARTESIAN, MEASURED)


def cartesian(r: sp.Expr, phi: sp.Expr, eps: sp.Expr) -> tuple[sp.Expr, ...]:
    """x, y, z of range, azimuth and elevation."""
    return tuple(_cartesian(r, phi, eps))


def jacobian_of(formulas: sp.Matrix | Sequence[sp.Expr]) -> Answer:
    """Derivatives of the formulas by the position, as a function of it."""
    return derived(lambda: sp.Matrix(formulas).jacobian(POSITION))


def derived(derive: Callable[[], sp.MatrixBase]) -> Answer:
    """What is derived of the position, as a function of it; derived when it is first asked for, not by all who open a set."""
    found = cache(derive)
    return lambda *position: substituted(found(), POSITION)(*position)


def meter_jacobian(x: sp.Expr, y: sp.Expr, z: sp.Expr) -> sp.ImmutableMatrix:
    """Derivatives of range, azimuth and elevation by x, y, z."""
    return jacobian_of(SPHERICAL)(x, y, z)


# -- j3: the constant gain


def steady_gain(alpha: float) -> tuple[float, float]:
    """beta and the tracking index of a stationary Kalman filter with this alpha."""
    return steady_beta(alpha), tracking_index(alpha)


# -- j4: the filter


@lru_cache(maxsize=8)
def _model(T: float, position: tuple[float, ...], velocity: tuple[float, ...]) -> Model:
    """Uniform motion on each axis from a known start."""
    prior = {"mean": np.array(position + velocity), "variance": np.ones(2 * len(position))}
    return kinematic(T, dimensions=len(position), prior=prior)


def alpha_beta(y: Array, T: float, alpha: float, beta: float, r: Array, v: Array) -> tuple[Array, Array]:
    """Estimates of position and velocity, (steps, N, axes) each."""
    laws = run(alphabeta.alpha_beta(_model(T, tuple(r), tuple(v)), alpha, beta, start="prior"), y)
    return laws.mean[..., : len(r)], laws.mean[..., len(r) :]


# -- j5, j6: lag and noise


def closed_loop(T: sp.Expr, alpha: sp.Expr | float, beta: sp.Expr | float) -> tuple[sp.Matrix, sp.Matrix]:
    """(I - K H) and A on an axis."""
    return sp.eye(2) - sp.Matrix([alpha, beta / T]) * sp.Matrix([[1, 0]]), sp.Matrix([[1, T], [0, 1]])


@lru_cache(maxsize=1)
def _lag() -> tuple[tuple[sp.Symbol, ...], sp.Matrix, sp.Matrix]:
    """Lags of position and velocity, after and before a correction: fixed points of the error without noise.

    e <- (I - K H)(A e + (T^2/2, T) a), e the truth less the estimate.
    """
    a, T, alpha, beta = symbols = sp.symbols("a T alpha beta", positive=True)
    rest, A = closed_loop(T, alpha, beta)
    push = a * sp.Matrix([T**2 / 2, T])
    after = sp.simplify((sp.eye(2) - rest * A).LUsolve(rest * push))
    return symbols, after, sp.simplify(A * after + push)


def lag(a: sp.Expr, T: sp.Expr, alpha: sp.Expr, beta: sp.Expr) -> tuple[sp.Expr, ...]:
    """How far position and velocity stay behind at a constant acceleration a."""
    symbols, after, _ = _lag()
    return tuple(substituted(after, symbols)(a, T, alpha, beta))


def _stationary(alpha: float, beta: float) -> tuple[Array, Array]:
    """Covariances of estimate and prediction, noise of the measurements alone, in units of sigma and T."""
    rest, A = (np.array(matrix, dtype=float) for matrix in closed_loop(1, alpha, beta))
    K = np.array([[alpha], [beta]])
    after = scipy.linalg.solve_discrete_lyapunov(rest @ A, K @ K.T)
    return after, A @ after @ A.T


def noise_left(alpha: float, beta: float) -> float:
    """Variance of the estimated position over sigma^2, from the measurements' noise alone."""
    return float(_stationary(alpha, beta)[0][0, 0])
