"""Keys of set g: Jacobian, prediction, correction and run of the extended filter, information form, NEES and NIS.

A key is the function with nothing changed that `..._with` makes; with one thing changed that is a known mistake.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kfcourse import laws
from kfcourse.checks.question import Answer
from kfcourse.checks.steps import Function, at_step, full
from kfcourse.exercises.shared import Map
from kfcourse.laws import Array, Gaussian, Measurement, gain, transpose
from kfcourse.linear.consistency import chi_squared_bounds, normalised_square

# -- g1: a Jacobian by differences


def jacobian(function: Map, x: Array, h: float) -> Array:
    """df/dx by central differences with the step h, (..., rows, n)."""
    return jacobian_with()(function, x, h)


def jacobian_with(
    forward: float = 1.0, backward: float = -1.0, divisor: Callable[[float], float] = lambda step: 2 * step
) -> Answer:
    """Differences of the values at x + forward * step and x + backward * step, in each component."""

    def answer(function: Map, x: Array, step: float) -> Array:
        columns = [function(x + forward * step * e) - function(x + backward * step * e) for e in np.eye(x.shape[-1])]
        return np.stack(columns, axis=-1) / divisor(step)

    return answer


# -- g2: bounds


def bounds(degrees: int, runs: int, confidence: float) -> tuple[float, float]:
    """Bounds of the mean of `runs` chi-squared values."""
    return chi_squared_bounds(degrees, runs, confidence)


# -- g3: the prediction


def predict(z: Array, p: Array, f: Map, Phi: Map, g: Map, D_xi: Array) -> tuple[Array, Array]:
    """lam = f(z), Psi = Phi p Phi^T + g D_xi g^T, at z."""
    return prediction_with()(z, p, f, Phi, g, D_xi)


def spread(Phi: Array, p: Array, g: Array, D_xi: Array) -> Array:
    """Phi p Phi^T + g D_xi g^T."""
    return Phi @ p @ transpose(Phi) + g @ D_xi @ transpose(g)


def prediction_with(
    cov: Callable[[Array, Array, Array, Array], Array] = spread,
    at: Callable[[Array, Map], Array] = lambda z, f: z,
    noise_at: Callable[[Array, Map], Array] = lambda z, f: z,
    mean: Callable[[Array, Map, Map], Array] = lambda z, f, Phi: f(z),
) -> Answer:
    """A prediction with one thing changed: the covariance, the points where Phi and g are taken, or the mean."""

    def answer(z: Array, p: Array, f: Map, Phi: Map, g: Map, D_xi: Array) -> tuple[Array, Array]:
        return mean(z, f, Phi), cov(Phi(at(z, f)), p, g(noise_at(z, f)), D_xi)

    return answer


# -- g4: the correction


def correct(lam: Array, Psi: Array, y: Array, S: Map, H: Map, D_n: Map) -> tuple[Array, Array]:
    """z and p from the innovation y - S(lam), linearised at lam."""
    G, R = H(lam), D_n(lam)
    z, p = laws.correct(Gaussian(lam, Psi), Measurement(S(lam), G, G @ Psi @ transpose(G) + R, R), y)
    return z, full(p, len(lam))


# -- g5: a whole run

Run = tuple[Array, ...]  # z, p, lam, Psi


def run_filter(y: Array, mean: Array, cov: Array, f: Map, Phi: Map, g: Map, D_xi: Array, S: Map, H: Map, D_n: Map) -> Run:
    """z, p, lam, Psi of all steps."""
    return run_with()(y, mean, cov, f, Phi, g, D_xi, S, H, D_n)


def run_with(
    prediction: Answer = predict,
    correction: Answer = correct,
    meter_at: Callable[[Array, Array], Array] = lambda lam, before: lam,
    object_at: Callable[[Array, Array], Array] = lambda z, lam: z,
    frozen: bool = False,
    first: bool = False,
    f_at: Callable[[Function, int], Function] = at_step,
    S_at: Callable[[Function, int], Function] = at_step,
) -> Answer:
    """A run with one thing changed.

    f_at, S_at: (function, k) -> the functions of which step are taken for the object, and for the meter, at step k.

    meter_at: (lam_k, z_{k-1}) -> where H is taken;  object_at: (z_k, lam_k) -> where Phi is taken;
    frozen: Psi is never handed on;  first: predicts before the first measurement.
    """

    def answer(y: Array, mean: Array, cov: Array, f: Map, Phi: Map, g: Map, D_xi: Array, S: Map, H: Map, D_n: Map) -> Run:
        lam, Psi = np.tile(mean, (y.shape[1], 1)), full(cov, y.shape[1])
        if first:
            lam, Psi = prediction(lam, Psi, *(at_step(one, 0) for one in (f, Phi, g)), D_xi)
        before, start, history = lam, Psi, []
        for k, value in enumerate(y):
            (f_k, Phi_k, g_k), (S_k, H_k, D_k) = (f_at(one, k) for one in (f, Phi, g)), (S_at(one, k) for one in (S, H, D_n))
            z, p = correction(lam, Psi, value, S_k, fixed(H_k, meter_at(lam, before)), D_k)
            history.append((z, p, lam, Psi))
            before = z
            lam, Psi = prediction(z, p, f_k, fixed(Phi_k, object_at(z, lam)), g_k, D_xi)
            Psi = start if frozen else Psi
        return tuple(np.array(column) for column in zip(*history, strict=True))

    return answer


def fixed(function: Map, at: Array) -> Map:
    """The function's value at one place, wherever it is asked for."""
    return lambda _: function(at)


# -- g6: NEES and NIS

Normalised = Callable[..., tuple[Array, Array]]  # NEES, NIS


def innovation_covariance(Psi: Array, H: Array, D_n: Array) -> Array:
    """H Psi H^T + D_n."""
    return H @ Psi @ transpose(H) + D_n


def normalised_with(
    square: Callable[[Array, Array], Array] = normalised_square,
    F: Callable[[Array, Array, Array], Array] = innovation_covariance,
    error: Callable[[Array, Array, Array], Array] = lambda x, z, lam: x - z,
    error_cov: Callable[[Array, Array], Array] = lambda p, Psi: p,
    measured_at: Callable[[Array, Array], Array] = lambda z, lam: lam,
    per_component: bool = False,
) -> Normalised:
    """Mean NEES and NIS with one thing changed."""

    def answer(x: Array, z: Array, p: Array, y: Array, lam: Array, Psi: Array, S: Map, H: Map, D_n: Map) -> tuple[Array, Array]:
        state = square(error(x, z, lam), error_cov(p, Psi)).mean(axis=-1)
        measured = square(y - S(measured_at(z, lam)), F(Psi, H(lam), D_n(lam))).mean(axis=-1)
        return (state / x.shape[-1], measured / y.shape[-1]) if per_component else (state, measured)

    return answer


def consistency(x: Array, z: Array, p: Array, y: Array, lam: Array, Psi: Array, S: Map, H: Map, D_n: Map) -> tuple[Array, Array]:
    """NEES and NIS, each the mean over trajectories."""
    return normalised_with()(x, z, p, y, lam, Psi, S, H, D_n)


# -- g7: the information form

Information = Callable[[Array, Array, Array], tuple[Array, Array]]


def information(W: Array, H: Array, D_n: Array) -> tuple[Array, Array]:
    """p = (W + H^T D_n^-1 H)^-1 and K = p H^T D_n^-1."""
    return information_with()(W, H, D_n)


def information_with(
    added: Callable[[Array, Array], Array] = lambda H, D_n: transpose(H) @ np.linalg.solve(D_n, H),
    prior: Map = lambda W: W,
    inverted: bool = True,
    K_of: Callable[[Array, Array, Array, Array], Array] = lambda p, W, H, D_n: gain(p @ transpose(H), D_n),
) -> Information:
    """p and K with one thing changed."""

    def answer(W: Array, H: Array, D_n: Array) -> tuple[Array, Array]:
        total = prior(W) + added(H, D_n)
        p = np.linalg.solve(total, np.broadcast_to(np.eye(W.shape[-1]), W.shape))
        return (p if inverted else total), K_of(p if inverted else total, W, H, D_n)

    return answer
