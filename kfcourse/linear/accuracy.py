"""The accuracy of a Kalman filter in advance, and its limit: no measurement enters a covariance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from kfcourse.laws import Array, Gaussian, correct, gain, symmetric
from kfcourse.linear.system import LinearSystem


class Covariances(NamedTuple):
    """Covariance analysis: predicted (steps, n, n), posterior (steps, n, n), gains (steps, n, p)."""

    predicted: Array
    posterior: Array
    gains: Array


def covariances(system: LinearSystem, prior_cov: Array, steps: int, gains: Array | None = None) -> Covariances:
    """Accuracy in advance: covariances of the error, which no measurement enters.

    Parameters
    ----------
    system : LinearSystem
        The *true* matrices.
    prior_cov : ndarray (n, n)
        True covariance of the error before y_0.
    steps : int
    gains : ndarray (steps, n, p) or (n, p), optional
        Gains of another linear filter with the same A and H (one of a wrong model, or constant): its true errors are then
        found, P = (I - K H) P^- (I - K H)^T + K R K^T for any K.  By default the optimal gains.
    """
    given = None if gains is None else np.broadcast_to(gains, (steps, len(system.A), len(system.H)))
    cov = np.asarray(prior_cov, dtype=float)
    rows = []
    for k in range(steps):
        K = gain(cov @ system.H.T, system.measure(np.zeros(len(cov)), cov).F) if given is None else given[k]
        rest = np.eye(len(cov)) - K @ system.H
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
        There is no limit that the filter reaches from every start: a part of the state is neither seen nor decays, or has
        no noise.
    """
    try:
        predicted = scipy.linalg.solve_discrete_are(system.A.T, system.H.T, system.Q, system.R)
    except (np.linalg.LinAlgError, ValueError):
        raise ValueError(
            "the Riccati equation has no stabilising solution: a part of the state is neither seen by the meter nor decays, "
            "or has no noise; use covariances(system, ...) to follow the filter step by step"
        ) from None
    law = Gaussian(np.zeros(len(system.A)), symmetric(predicted))
    measurement = system.measure(*law)
    return Steady(law.cov, correct(law, measurement, measurement.h).cov, gain(law.cov @ system.H.T, measurement.F))
