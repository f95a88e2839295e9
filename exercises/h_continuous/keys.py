"""Keys of set h: white noise on a computer, the Riccati equation and its steady state, a step of the filter.

A key is the function with nothing changed that `..._with` makes; with one thing changed that is a known mistake.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import sympy as sp

from kfcourse import continuous
from kfcourse.checks.question import Answer
from kfcourse.continuous import ContinuousModel, log_likelihood_rate, to_discrete
from kfcourse.exercises.shared import Map
from kfcourse.laws import Array

# -- h1: variances of means over a step


def noise_variances(S_xi: float, N: float, T: float) -> tuple[Array, Array]:
    """Variances of the means of both noises over a step."""
    discrete = to_discrete(ContinuousModel.define("-x", "1", "x", spectral_density=S_xi, noise_density=N), T)
    return discrete.state_noise.cov[0, 0], discrete.meter_noise.cov[0, 0]


# -- h2: a step of a simulation


def simulate_step(x: Array, xi: Array, n: Array, T: float, f: Map, g: Map, S: Map, S_xi: float, N: float) -> tuple[Array, Array]:
    """x after Euler's step, and the measurement averaged over it."""
    return simulation_with()(x, xi, n, T, f, g, S, S_xi, N)


def simulation_with(
    drift: Callable[[Array, float], Array] = lambda f, T: T * f,
    shake: Callable[[float, float], float] = lambda S_xi, T: np.sqrt(S_xi * T / 2),
    noise: Callable[[float, float], float] = lambda N, T: np.sqrt(N / (2 * T)),
    factor: Callable[[Map, Array, Array], Array] = lambda g, x, ahead: g(x),
    seen: Callable[[Array, Array], Array] = lambda x, x_next: x,
    kept: float = 1.0,
) -> Answer:
    """A step with one thing changed."""

    def answer(x: Array, xi: Array, n: Array, T: float, f: Map, g: Map, S: Map, S_xi: float, N: float) -> tuple[Array, Array]:
        size = shake(S_xi, T) * xi
        x_next = kept * x + drift(f(x), T) + factor(g, x, x + T * f(x) + g(x) * size) * size
        return x_next, S(seen(x, x_next)) + noise(N, T) * n

    return answer


# -- h3: the Riccati equation

Rate = Callable[[Array, Array, Array, Array, Array, Array], Array]


def riccati(D: Array, A: Array, G: Array, H: Array, S_xi: Array, N: Array) -> Array:
    """dD/dt = A D + D A^T + G S_xi G^T/2 - 2 D H^T N^-1 H D."""
    return rate_with()(D, A, G, H, S_xi, N)


def rate_with(
    motion: Callable[[Array, Array], Array] = lambda A, D: A @ D + D @ A.T,
    shaken: Callable[[Array, Array], Array] = lambda G, S_xi: G @ S_xi @ G.T / 2,
    learnt: Callable[[Array, Array, Array], Array] = lambda D, H, N: D @ H.T @ np.linalg.solve(N / 2, H @ D),
) -> Rate:
    """dD/dt with one term changed."""
    return lambda D, A, G, H, S_xi, N: motion(A, D) + shaken(G, S_xi) - learnt(D, H, N)


# -- h4: the steady state of dx/dt = -a x + s xi, y = h x + n


def steady_state(a: float, s: float, h: float, S_xi: float, N: float) -> tuple[Array, Array]:
    """D and K at which the covariance stands still."""
    model = ContinuousModel.define("-a*x", "s", "h*x", {"a": a, "s": s, "h": h}, spectral_density=S_xi, noise_density=N)
    D, K = continuous.steady_state(model)
    return D[0, 0], K[0, 0]


# -- h5: a step of the filter


def filter_step(
    z: Array, D: Array, y: Array, T: float, f: Map, f_x: Map, g: Map, S: Map, S_x: Map, S_xi: float, N: float
) -> tuple[Array, Array]:
    """z and D after Euler's step of the filter's equations."""
    return step_with()(z, D, y, T, f, f_x, g, S, S_x, S_xi, N)


def step_with(
    times: Callable[[float], float] = lambda T: T,
    drift: Callable[[Array, Array, Array], Array] = lambda f, f_x, z: f,
    slope: Callable[[Array, Array], Array] = lambda S, S_x: S_x,
    expected: Callable[[Array, Array, Array], Array] = lambda S, S_x, z: S,
    gain: Callable[[Array, Array, float], Array] = lambda D, S_x, N: D * S_x * 2 / N,
    motion: Callable[[Array, Array], Array] = lambda f_x, D: 2 * f_x * D,
    shaken: Callable[[Array, float], Array] = lambda g, S_xi: g**2 * S_xi / 2,
    learnt: Callable[[Array, Array, float], Array] = lambda D, S_x, N: D**2 * S_x**2 * 2 / N,
    order: str = "together",
    sign: float = 1.0,
) -> Answer:
    """Euler's step of both equations with one thing changed.

    order: "together"; "z-first": the rate of D is taken at the new z; "D-first": the gain is made of the new D.
    """

    def answer(
        z: Array, D: Array, y: Array, T: float, f: Map, f_x: Map, g: Map, S: Map, S_x: Map, S_xi: float, N: float
    ) -> tuple[Array, Array]:
        def moved(D: Array) -> Array:
            innovation = sign * (y - expected(S(z), S_x(z), z))
            return z + times(T) * (drift(f(z), f_x(z), z) + gain(D, slope(S(z), S_x(z)), N) * innovation)

        def shrunk(z: Array) -> Array:
            return D + times(T) * (motion(f_x(z), D) + shaken(g(z), S_xi) - learnt(D, slope(S(z), S_x(z)), N))

        D_next = shrunk(moved(D) if order == "z-first" else z)
        return moved(D_next if order == "D-first" else D), D_next

    return answer


# -- h6: derivatives of the log-likelihood


def derivatives(S: sp.Expr, x: sp.Symbol, y: sp.Symbol, N: sp.Symbol) -> tuple[sp.Expr, sp.Expr]:
    """u = dF/dx and U = d2F/dx2 of the rate F of the log-likelihood."""
    F = log_likelihood_rate(sp.Matrix([S]), sp.Matrix([y]), sp.Matrix([N]))
    return F.diff(x), F.diff(x, 2)
