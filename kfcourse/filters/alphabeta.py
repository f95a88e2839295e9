r"""The alpha-beta filter: Kalman's prediction and correction with a gain that needs no covariance.

    x^- = A z,   z = x^- + K (y - H x^-),   K = (alpha, beta/T) on each axis

The coefficients that make it the stationary Kalman filter of `kfcourse.scenarios.radar.kinematic`
depend on the tracking index alone,

    Lambda = `noise_sd` T^2 / `measurement_sd`,
    beta = 2 (2 - alpha) - 4 sqrt(1 - alpha) = 2 (1 - sqrt(1 - alpha))^2,
    Lambda = beta / sqrt(1 - alpha)

Kalata (1984); Bar-Shalom, Li, Kirubarajan (2001), section 6.5.  The radar chapter derives them.

The filter starts from its measurements: the first two of each axis give position and velocity; at
the k-th it takes the larger of these coefficients and of those of the least squares line through
all k (a memory that grows; Brookner, 1998, section 1.2.10),

    alpha_k = 2 (2k - 1) / (k (k + 1)),  beta_k = 6 / (k (k + 1))
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kfcourse.angles import difference
from kfcourse.errors import expect_positive
from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.filters.kalman import predict
from kfcourse.laws import Array, Gaussian, any_missing, apply, symmetric, transpose
from kfcourse.linear.system import linear_system
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError


def steady_alpha(index: float) -> float:
    """alpha of the stationary alpha-beta filter with the tracking index Lambda > 0."""
    expect_positive(index=index)
    # s = sqrt(1 - alpha) solves s^2 - (2 + Lambda/2) s + 1 = 0; 1 - s without cancellation
    rest = (np.sqrt(index**2 + 8 * index) - index) / 4
    return float(rest * (2 - rest))


def steady_beta(alpha: float) -> float:
    """beta = 2 (2 - alpha) - 4 sqrt(1 - alpha), of the stationary filter with this alpha."""
    if not 0 < alpha < 1:
        raise ValueError(f"alpha of a stationary filter lies between 0 and 1, got {alpha}")
    return float(2 * (alpha / (1 + np.sqrt(1 - alpha))) ** 2)


def tracking_index(alpha: float) -> float:
    """Lambda = beta / sqrt(1 - alpha), the tracking index that leads to this alpha; the inverse of
    `steady_alpha`."""
    return steady_beta(alpha) / float(np.sqrt(1 - alpha))


class Progress(NamedTuple):
    """How far the start from measurements has come, on each axis.

    Attributes
    ----------
    used : ndarray (..., dimensions)
        Number of measurements used.
    age : ndarray (..., dimensions)
        Seconds since the first measurement; infinite where there was none.
    """

    used: Array
    age: Array


def alpha_beta(model: Model, alpha: float, beta: float) -> Filter:
    """The alpha-beta filter of a model r' = r + T s + noise, s' = s + noise, y = r + noise on each
    axis.

    Parameters
    ----------
    model : Model
        `kfcourse.scenarios.radar.kinematic(...)`, or equal to it in all but the noises.
        Its prior is not used.
    alpha, beta : float
        The gain comes to (alpha, beta/T).

    Returns
    -------
    Filter
        Its covariance is the true one of these gains for the noises of the model,
        (I - K H) P^- (I - K H)^T + K R K^T; a missing component coasts on its axis.

    Raises
    ------
    ModelError
        The model is of another form.
    ValueError
        Coefficients with which the errors grow.
    """
    system, shift, offset = linear_system(model)
    axes = model.p
    T = _interval(model, system.A, system.H)
    if shift.any() or offset.any():
        raise ModelError(
            "the alpha-beta filter has no place for noises with a mean other than 0; take it into "
            "the state or the measurement"
        )
    constant = np.array([alpha, beta / T])
    closed = (np.eye(model.n) - _matrix(constant, axes) @ system.H) @ system.A
    radius = np.abs(np.linalg.eigvals(closed)).max() if np.isfinite(constant).all() else np.inf
    if not radius < 1:
        raise ValueError(
            f"alpha-beta with {alpha, beta} is unstable: its errors grow {radius:.4g} times a "
            "step; take 0 < alpha <= 1 and beta = steady_beta(alpha)"
        )

    def init(runs: int) -> State:
        progress = Progress(np.zeros((1, axes), dtype=int), np.full((1, axes), np.inf))
        return initial_state(model)(runs)._replace(memory=progress)

    def step(state: State, y: Array) -> State:
        used, age = state.memory
        measured = ~np.isnan(y) if any_missing(y) else np.ones((1, axes), dtype=bool)
        K = _matrix(_gains(constant, T, used, age) * measured[..., None], axes)
        prior = state.predicted
        innovation = np.where(
            measured, difference(y, apply(system.H, prior.mean), model.angles.y), 0.0
        )
        rest = np.eye(model.n) - K @ system.H
        cov = symmetric(rest @ prior.cov @ transpose(rest) + K @ system.R @ transpose(K))
        posterior = Gaussian(prior.mean + apply(K, innovation), cov)
        progress = Progress(used + measured, np.where((used == 0) & measured, 0.0, age) + T)
        return State(state.step + 1, posterior, predict(system, posterior), progress)

    return Filter("alpha-beta", model, init, step)


def _gains(constant: Array, T: float, used: Array, age: Array) -> Array:
    """Gains (..., dimensions, 2): a line through the first two measurements, whatever time lies
    between them, then the larger of those that grow and the constant ones."""
    starting = np.stack([np.ones(age.shape), 1 / age], axis=-1)
    k = used + 1.0
    growing = np.stack([2 * (2 * k - 1), 6 / T + 0 * k], axis=-1) / (k * (k + 1))[..., None]
    return np.where((used < 2)[..., None], starting, np.maximum(constant, growing))


def _interval(model: Model, A: Array, H: Array) -> float:
    """T of a kinematic model; ModelError if it is of another form."""
    axes = model.p
    T = float(A[0, axes]) if model.n == 2 * axes else 0.0
    eye = np.eye(axes)
    if not (
        T > 0
        and np.allclose(A, np.kron([[1, T], [0, 1]], eye))
        and np.array_equal(H, np.kron([[1, 0]], eye))
    ):
        raise ModelError(
            f"{model} is not position, velocity on each axis with the position measured; build it "
            f"with kinematic(interval, ...)"
        )
    return T


def _matrix(by_axis: Array, axes: int) -> Array:
    """Gains by axis (..., dimensions, 2), or (2,) for all, as a matrix (..., n, p)."""
    by_axis = np.broadcast_to(by_axis, (*by_axis.shape[:-2], axes, 2))
    # entry [j * axes + i, i] is the gain of derivative j on axis i
    blocks = np.swapaxes(by_axis, -1, -2)[..., None] * np.eye(axes)
    return blocks.reshape(*by_axis.shape[:-2], -1, axes)
