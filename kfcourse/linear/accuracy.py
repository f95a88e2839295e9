"""The accuracy of a Kalman filter in advance, and its limit: no measurement enters a covariance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from kfcourse.laws import Array, Gaussian, correct, gain, symmetric
from kfcourse.linear.system import LinearSystem


class Covariances(NamedTuple):
    """Covariance analysis: predicted (steps, n, n), posterior (steps, n, n), gains (steps, n,
    p)."""

    predicted: Array
    posterior: Array
    gains: Array


def covariances(
    system: LinearSystem, prior_cov: Array, steps: int, gains: Array | None = None
) -> Covariances:
    """Accuracy in advance: covariances of the error, which no measurement enters.

    Parameters
    ----------
    system : LinearSystem
        The *true* matrices.
    prior_cov : ndarray (n, n)
        True covariance of the error before y_0.
    steps : int
    gains : ndarray (steps, n, p) or (n, p), optional
        Gains of another linear filter with the same A and H (one of a wrong model, or constant):
        its true errors are then found, P = (I - K H) P^- (I - K H)^T + K R K^T for any K.  By
        default the optimal gains.

    Raises
    ------
    ValueError
        Shapes that do not fit, or no steps.
    """
    n, p, cov = len(system.A), len(system.H), np.asarray(prior_cov, dtype=float)
    if cov.shape != (n, n) or (gains is not None and np.shape(gains)[-2:] != (n, p)):
        raise ValueError(
            f"expected a covariance ({n}, {n}) and gains ({n}, {p}) or ({steps}, {n}, {p}), got "
            f"{cov.shape} and {None if gains is None else np.shape(gains)}"
        )
    given = None if gains is None else np.broadcast_to(gains, (steps, n, p))
    rows = []
    for k in range(steps):
        F = system.measure(np.zeros(n), cov).F
        K = gain(cov @ system.H.T, F) if given is None else given[k]
        rest = np.eye(n) - K @ system.H
        posterior = symmetric(rest @ cov @ rest.T + K @ system.R @ K.T)
        rows.append((cov, posterior, K))
        cov = symmetric(system.A @ posterior @ system.A.T + system.Q)
    return Covariances(*(np.stack(column) for column in zip(*rows, strict=True)))


class Steady(NamedTuple):
    """The stationary Kalman filter: predicted (n, n), posterior (n, n), gain (n, p)."""

    predicted: Array
    posterior: Array
    gain: Array


def steady_state(system: LinearSystem) -> Steady:
    """Limit of the covariances and of the gain, from the discrete algebraic Riccati equation.

    P = A (P - P H^T (H P H^T + R)^-1 H P) A^T + Q

    Raises
    ------
    ValueError
        There is none with which the filter's errors die out: a part of the state does not decay,
        and is not seen, or neither grows nor has noise.
    """
    A, H, Q, R = system.A, system.H, system.Q, system.R
    try:
        predicted = symmetric(scipy.linalg.solve_discrete_are(A.T, H.T, Q, R))
        measurement = system.measure(np.zeros(len(A)), predicted)
        posterior = correct(Gaussian(np.zeros(len(A)), predicted), measurement, measurement.h).cov
        K = gain(predicted @ H.T, measurement.F)
        # Of what neither grows nor has noise SciPy finds any matrix: its root, at 1, to the square
        # root of rounding
        left = np.abs(A @ posterior @ A.T + Q - predicted).max()
        exact = left <= 100 * np.sqrt(np.finfo(A.dtype).eps) * np.abs(predicted).max()
        settles = exact and np.abs(np.linalg.eigvals(A - A @ K @ H)).max() < 1 - 1e-7
    except (np.linalg.LinAlgError, ValueError):
        settles = False
    if not settles:
        raise ValueError(
            "the Riccati equation has no stabilising solution: a part of the state does not "
            "decay, and is not seen by the meter, "
            "or neither grows nor has noise; use covariances(system, ...) to follow the filter "
            "step by step"
        )
    return Steady(predicted, posterior, K)
