"""The Kalman filter that tracks a flight in the radar chapters: its start, and a control made of
the last three measurements.

lambda_{k+1} = A z_k + B u_k,   u_k = (y_k - 2 y_{k-1} + y_{k-2}) / T^2,   B = (T^2/2, T) on each
axis
"""

from __future__ import annotations

import numpy as np

from kfcourse.laws import Array, Gaussian
from kfcourse.linear.runs import run
from kfcourse.linear.system import LinearSystem
from kfcourse.scenarios.pointer import acceleration_from, uniform_acceleration


def roughly_known(
    system: LinearSystem,
    first_gain: float,
    state: Array,
    runs: int,
    seed: int | np.random.Generator,
) -> Gaussian:
    """A law of the first state with which the filter's first gain of the position is `first_gain`.

    One measurement gave the position, something else the speed, known to sigma_s on each axis; then
    one prediction, Psi_0 = A diag(sigma^2, sigma_s^2) A^T + Q.

    Parameters
    ----------
    system : LinearSystem
        Of `kfcourse.scenarios.radar.kinematic(...)`.
    first_gain : float
        Psi_11 / (Psi_11 + sigma^2), between 1/2 and 1.
    state : ndarray (n,)
        The true first state; the means are drawn around it with the covariance Psi_0.
    runs : int
    seed : int or numpy.random.Generator

    Returns
    -------
    Gaussian
        Mean (runs, n), cov (n, n).

    Raises
    ------
    ValueError
        No speed is known so well that the first gain is so small; or it is not below one.  A system
        of another order.
    """
    axes = len(system.H)
    if np.shape(state) != (len(system.A),) or len(system.A) != 2 * axes:
        raise ValueError(
            f"expected positions and speeds of {axes} axes, kinematic(...), and a state "
            f"({2 * axes},); "
            f"got a system of {len(system.A)} components and a state {np.shape(state)}"
        )
    T, variance = system.A[0, axes], system.R[0, 0]
    least = 1 - variance / (2 * variance + system.Q[0, 0])  # with a speed that is known exactly
    if not least <= first_gain < 1:
        raise ValueError(
            f"after one measurement the first gain lies between {least:.4g} and 1, got {first_gain}"
        )
    position = variance * first_gain / (1 - first_gain)
    speed = (position - variance - system.Q[0, 0]) / T**2
    known = np.diag([variance] * axes + [speed] * axes)
    cov = system.A @ known @ system.A.T + system.Q
    draw = np.random.default_rng(seed).standard_normal((runs, len(cov)))
    return Gaussian(state + draw @ np.linalg.cholesky(cov).T, cov)


def kalman_positions(
    y: Array,
    interval: float,
    noise_sd: float,
    measurement_sd: float,
    start: Gaussian,
    control: bool = False,
) -> Array:
    """Positions (steps, runs, 3) by the Kalman filter of `kinematic`, with the control u_k of the
    measurements or without.

    Parameters
    ----------
    y : ndarray (steps, runs, 3)
        Measured positions, m.
    interval : float
        T, s.
    noise_sd, measurement_sd : float
        As of `kinematic`, m/s^2 and m.
    start : Gaussian
        Law of the first state, before y_0.
    control : bool
        The first two steps have none, nor has one with a missing measurement among its last three.
    """
    system = uniform_acceleration(interval, noise_sd, measurement_sd, axes=3)
    u = np.nan_to_num(acceleration_from(y, interval)) if control else None
    return run(system, start, y, u).posterior.mean[..., :3]
