r"""Alpha-beta and alpha-beta-gamma filters: Kalman's prediction and correction with a gain that no
covariance is needed for.

    x^- = A z,   z = x^- + K (y - H x^-),   K = (alpha, beta/T, gamma/(2 T^2)) on each axis

The coefficients that make it the stationary Kalman filter of `kfcourse.scenarios.radar.kinematic`
depend on the tracking index alone,

    Lambda = `noise_sd` T^2 / `measurement_sd`,
    beta = 2 (2 - alpha) - 4 sqrt(1 - alpha) = 2 (1 - sqrt(1 - alpha))^2,
    Lambda = beta / sqrt(1 - alpha)   (alpha-beta)
    the same beta,  gamma = beta^2 / alpha,   Lambda = gamma / (2 sqrt(1 - alpha))   (with gamma)

Kalata (1984); Bar-Shalom, Li, Kirubarajan (2001), section 6.5.  The radar chapter derives them.

A filter that starts from its measurements takes at the k-th of them the larger of these and of the
gains of a least squares polynomial through all k (a memory that grows; Brookner, 1998, section
1.2.10),

    alpha_k = 2 (2k - 1) / (k (k + 1)),  beta_k = 6 / (k (k + 1))   (a line)
    alpha_k = 3 (3k^2 - 3k + 2) / (k (k + 1) (k + 2)),  beta_k = 18 (2k - 1) / (...),
    gamma_k = 120 / (...)   (a parabola)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kfcourse.angles import difference
from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.laws import Array, Gaussian, any_missing, apply, symmetric, transpose
from kfcourse.linear.system import linear_system
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError


def steady_alpha(index: float) -> float:
    """alpha of the stationary alpha-beta filter with the tracking index Lambda > 0."""
    if not (np.isfinite(index) and index > 0):
        raise ValueError(
            f"the tracking index noise_sd T^2 / measurement_sd must be positive and finite, got "
            f"{index}"
        )
    # s = sqrt(1 - alpha) solves s^2 - (2 + Lambda/2) s + 1 = 0; 1 - s without cancellation
    rest = (np.sqrt(index**2 + 8 * index) - index) / 4
    return float(rest * (2 - rest))


def steady_beta(alpha: float) -> float:
    """beta = 2 (2 - alpha) - 4 sqrt(1 - alpha), of the stationary filter with this alpha."""
    return 2 * (_between(alpha) / (1 + np.sqrt(1 - alpha))) ** 2


def tracking_index(alpha: float) -> float:
    """Lambda = beta / sqrt(1 - alpha), the tracking index that leads to this alpha; the inverse of
    `steady_alpha`."""
    return steady_beta(alpha) / float(np.sqrt(1 - alpha))


def _between(alpha: float) -> float:
    if not 0 < alpha < 1:
        raise ValueError(f"alpha of a stationary filter lies between 0 and 1, got {alpha}")
    return float(alpha)


class Progress(NamedTuple):
    """How far the start from measurements has come, on each axis.

    Attributes
    ----------
    used : ndarray (..., dimensions)
        Number of measurements used.
    ages : ndarray (..., dimensions, order)
        Seconds since the first measurements; infinite where there was none.
    """

    used: Array
    ages: Array


def alpha_beta(
    model: Model, alpha: float, beta: float, start: str = "measurements", gains: str | None = None
) -> Filter:
    """The alpha-beta filter of a model r' = r + T s + noise, s' = s + noise, y = r + noise on each
    axis.

    Parameters
    ----------
    model : Model
        `kfcourse.scenarios.radar.kinematic(..., order=1)`, or equal to it in all but the noises.
    alpha, beta : float
        The gain comes to (alpha, beta/T).
    start : {"measurements", "prior"}
        "measurements": the first two of each axis give its position and velocity, whatever the
        model's prior says. "prior": what the model's prior says is predicted and corrected from the
        first measurement on.
    gains : {"growing", "constant"}, optional
        "growing", the default of a start from measurements: alpha_k = max(alpha, 2 (2k - 1) / (k (k
        + 1))) and beta_k = max(beta, 6 / (k (k + 1))) at the k-th measurement of an axis, the line
        through all of them until it forgets more slowly than (alpha, beta).  "constant", the
        default and only choice of a start from the prior.

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
        Coefficients with which the errors grow; another start or other gains than these.
    """
    return _tabulated("alpha-beta", model, (alpha, beta), start, gains)


def alpha_beta_gamma(
    model: Model,
    alpha: float,
    beta: float,
    gamma: float,
    start: str = "measurements",
    gains: str | None = None,
) -> Filter:
    """The alpha-beta-gamma filter, gain (alpha, beta/T, gamma/(2 T^2)), of
    `kinematic(..., order=2)`.

    Arguments, result and errors as of `alpha_beta`; three measurements are needed for the start,
    and a parabola grows.
    """
    return _tabulated("alpha-beta-gamma", model, (alpha, beta, gamma), start, gains)


def growing_memory(k: Array, size: int) -> Array:
    """Coefficients (..., size) of the least squares line (size 2) or parabola (3) through k equally
    spaced measurements (...)."""
    k = np.asarray(k, dtype=float)
    if size == 2:
        return np.stack([2 * (2 * k - 1), 6 + 0 * k], axis=-1) / (k * (k + 1))[..., None]
    return (
        np.stack([3 * (3 * k**2 - 3 * k + 2), 18 * (2 * k - 1), 120 + 0 * k], axis=-1)
        / (k * (k + 1) * (k + 2))[..., None]
    )


def _tabulated(
    name: str, model: Model, coefficients: tuple[float, ...], start: str, gains: str | None
) -> Filter:
    if start not in ("measurements", "prior"):
        raise ValueError(f"start must be 'measurements' or 'prior', got {start!r}")
    gains = gains or ("growing" if start == "measurements" else "constant")
    if gains not in ("growing", "constant") or (gains == "growing" and start == "prior"):
        raise ValueError(
            f"gains must be 'constant', or 'growing' with start='measurements'; got {gains!r} "
            f"with start={start!r}"
        )
    system, shift, offset = linear_system(model)
    size, axes = len(coefficients), model.p
    T = _interval(model, system.A, system.H, size)
    if shift.any() or offset.any():
        raise ModelError(
            f"{name} has no place for noises with a mean other than 0; take it into the state or "
            f"the measurement"
        )
    scale = np.array([1.0, 1.0 / T, 0.5 / T**2])[:size]
    constant = scale * coefficients
    closed = (np.eye(model.n) - _spread(constant, axes) @ system.H) @ system.A
    radius = np.abs(np.linalg.eigvals(closed)).max() if np.isfinite(constant).all() else np.inf
    if not radius < 1:
        raise ValueError(
            f"{name} with {coefficients} is unstable: its errors grow {radius:.4g} times a step; "
            "take 0 < alpha <= 1 and beta = steady_beta(alpha)"
        )

    def init(runs: int) -> State:
        used = np.full((1, axes), 0 if start == "measurements" else size)
        return initial_state(model)(runs)._replace(
            memory=Progress(used, np.full((1, axes, size - 1), np.inf))
        )

    def step(state: State, y: Array) -> State:
        used, ages = state.memory
        measured = ~np.isnan(y) if any_missing(y) else np.ones((1, axes), dtype=bool)
        later = (
            constant
            if gains == "constant"
            else np.maximum(constant, scale * growing_memory(used + 1, size))
        )
        by_axis = (
            np.where((used < size)[..., None], _starting(ages, size), later) * measured[..., None]
        )
        K = _spread(by_axis, axes)
        prior = state.predicted
        innovation = np.where(
            measured, difference(y, apply(system.H, prior.mean), model.angles.y), 0.0
        )
        rest = np.eye(model.n) - K @ system.H
        cov = symmetric(rest @ prior.cov @ transpose(rest) + K @ system.R @ transpose(K))
        posterior = Gaussian(prior.mean + apply(K, innovation), cov)
        # This measurement takes the next free place among those of the start.
        now = (np.arange(size - 1) == used[..., None]) & measured[..., None]
        progress = Progress(used + measured, np.where(now, 0.0, ages) + T)
        predicted = Gaussian(
            apply(system.A, posterior.mean), symmetric(system.A @ cov @ system.A.T + system.Q)
        )
        return State(state.step + 1, posterior, predicted, progress)

    return Filter(name, model, init, step)


def _interval(model: Model, A: Array, H: Array, size: int) -> float:
    """T of a kinematic model; ModelError if it is of another form."""
    axes = model.p
    T = float(A[0, axes]) if model.n == size * axes else 0.0
    expected = np.array([[1, T, T**2 / 2], [0, 1, T], [0, 0, 1]])[:size, :size]
    fits = T > 0 and H.shape == (axes, model.n)
    eye = np.eye(axes)
    if not (
        fits
        and np.allclose(A, np.kron(expected, eye))
        and np.array_equal(H, np.kron(np.eye(1, size), eye))
    ):
        raise ModelError(
            f"{model} is not position, velocity{' and acceleration' if size == 3 else ''} on each "
            f"axis with the position "
            f"measured; build it with kinematic(interval, order={size - 1}, ...)"
        )
    return T


def _starting(ages: Array, size: int) -> Array:
    """Gains that put a polynomial through all measurements of an axis so far, (..., dimensions,
    size).

    The polynomial through the earlier ones changes by innovation * N(t) / N(now), N(t) = product of
    (t - t_j), so the gains are the derivatives of N over N: 1, the sum of 1/age, twice the product.
    An infinite age is a measurement not yet there.
    """
    inverse = 1.0 / ages
    terms = [np.ones(ages.shape[:-1]), inverse.sum(axis=-1), 2 * inverse.prod(axis=-1)]
    return np.stack(terms[:size], axis=-1)


def _spread(by_axis: Array, axes: int) -> Array:
    """Gains by axis (..., dimensions, size), or (size,) for all, as a matrix (..., n, p)."""
    by_axis = np.broadcast_to(by_axis, (*by_axis.shape[:-2], axes, by_axis.shape[-1]))
    # entry [j * axes + i, i] is the gain of derivative j on axis i
    blocks = np.swapaxes(by_axis, -1, -2)[..., None] * np.eye(axes)
    return blocks.reshape(*by_axis.shape[:-2], -1, axes)
