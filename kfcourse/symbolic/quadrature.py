"""Structural functions by quadrature over a normal law, for models without a closed form."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product as cartesian

import numpy as np

from kfcourse.laws import Array, Gaussian, Measurement, gain, square_root, symmetric, transpose
from kfcourse.symbolic.equations import compile_model
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.structure import Structure


def unscented(model: Model, kappa: float | None = None) -> Structure:
    """Structural functions by the unscented transform over (x, v) and (x, w).

    2 s + 1 points at distance sqrt(s + kappa), s the joint dimension; exact for quadratic functions.

    Parameters
    ----------
    kappa : float, optional
        Spread; 3 - s by default (Julier and Uhlmann), but not below 0, so that no weight is negative.
    """

    def rule(size: int) -> tuple[Array, Array]:
        k = max(3.0 - size, 0.0) if kappa is None else float(kappa)
        if not size + k > 0:
            raise ModelError(f"kappa = {kappa} is too small: {size} + kappa must be positive")
        axes = np.sqrt(size + k) * np.eye(size)
        weights = np.full(2 * size + 1, 0.5 / (size + k))
        weights[0] = k / (size + k)
        return np.concatenate([np.zeros((1, size)), axes, -axes]), weights

    return _quadrature(model, "unscented", rule)


def gauss_hermite(model: Model, order: int = 5) -> Structure:
    """Structural functions by the Gauss-Hermite product rule; exact for polynomials below degree 2*order.

    `order` points an axis, so order**(n + number of noises) evaluations.
    """
    if order < 2:
        raise ModelError(f"Gauss-Hermite quadrature needs an order of at least 2, got {order}")

    def rule(size: int) -> tuple[Array, Array]:
        if order**size > 100_000:
            raise ModelError(f"{order} points on each of {size} axes are too many; lower the order or use unscented(model)")
        nodes, weights = np.polynomial.hermite_e.hermegauss(order)
        weights = weights / weights.sum()
        points = np.array(list(cartesian(nodes, repeat=size)))
        return points, np.array([np.prod(c) for c in cartesian(weights, repeat=size)])

    return _quadrature(model, "gauss-hermite", rule)


def _quadrature(model: Model, name: str, rule: Callable[[int], tuple[Array, Array]]) -> Structure:
    """A structure from standard normal points and weights: rule(size) -> (points (q, size), weights (q,))."""
    n = model.n
    state, meter = compile_model(model)

    def propagate(function, size, mean, cov, law: Gaussian, points: Array):
        x = mean[..., None, :] + points[:, :n] @ transpose(square_root(cov))
        noise = law.mean + points[:, n:] @ square_root(law.cov).T
        values = function(x, np.broadcast_to(noise, x.shape[:-1] + noise.shape[-1:]))
        return x, np.broadcast_to(values, (*x.shape[:-1], size))

    state_points, state_weights = rule(n + len(model.v))
    meter_points, meter_weights = rule(n + len(model.w))

    def predict(z: Array, p: Array) -> Gaussian:
        _, following = propagate(state, n, z, p, model.state_noise, state_points)
        tau = state_weights @ following
        return Gaussian(tau, _weighted(state_weights, following - tau[..., None, :]))

    def measure(m: Array, d: Array) -> Measurement:
        x, y = propagate(meter, model.p, m, d, model.meter_noise, meter_points)
        h = meter_weights @ y
        deviation = y - h[..., None, :]
        cross = transpose(deviation * meter_weights[:, None]) @ (x - m[..., None, :])
        G, F = gain(cross, np.broadcast_to(d, (*m.shape, n))), _weighted(meter_weights, deviation)
        # The part of y that is not linear in x: no difference of nearly equal matrices.
        unexplained = deviation - (x - m[..., None, :]) @ transpose(G)
        return Measurement(h, G, F, _weighted(meter_weights, unexplained))

    return Structure(name, model, predict, measure)


def _weighted(weights: Array, deviation: Array) -> Array:
    return symmetric(transpose(deviation * weights[:, None]) @ deviation)
