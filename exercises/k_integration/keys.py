"""Keys of set k: the error of a slow sensor as the state, its filter and the steady state of that, gaps and biases.

Letters are the book's: Psi and p are the lecture's D with a tilde and D.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import sympy as sp

from kfcourse.exercises.shared import substituted
from kfcourse.laws import Array, Gaussian
from kfcourse.linear.runs import run as run_linear
from kfcourse.linear.system import LinearSystem

# -- k1: the error of the slow sensor as the state


def error_meter(signal: Callable, y: sp.Expr, eps: sp.Expr) -> tuple[sp.Expr, ...]:
    """The receiver's signal as a function of the error eps, and its slope."""
    h = signal(y - eps)
    return h, sp.diff(h, eps)


# -- k2, k4: the steady state

S_XI, S_N = sp.symbols("sigma_xi sigma_n", positive=True)


@lru_cache(maxsize=1)
def _steady() -> sp.ImmutableMatrix:
    """(Psi, p, K): the positive fixed point of Psi = p + sigma_xi^2, K = -Psi/(Psi + sigma_n^2), p = (1 + K) Psi."""
    Psi = sp.Symbol("Psi")
    K = -Psi / (Psi + S_N**2)
    roots = sp.solve(sp.numer(sp.together((1 + K) * Psi + S_XI**2 - Psi)), Psi)
    (found,) = [root for root in roots if root.subs({S_XI: 1, S_N: 1}) > 0]
    return sp.ImmutableMatrix([found, found - S_XI**2, K.subs(Psi, found)])


def steady_state(sigma_xi: sp.Expr, sigma_n: sp.Expr) -> tuple[sp.Expr, ...]:
    """Psi, p, K that a step leaves as they are."""
    return tuple(substituted(_steady(), (S_XI, S_N))(sigma_xi, sigma_n))


def gained(sigma_xi: sp.Expr, sigma_n: sp.Expr, T: sp.Expr) -> tuple[sp.Expr, ...]:
    """How many times surer than the receiver alone, and the time constant in seconds."""
    _, p, K = steady_state(sigma_xi, sigma_n)
    return sigma_n / sp.sqrt(p), -T / sp.log(1 + K)


# -- k3: the filter


def integrate(y_ins: Array, y_sr: Array, sigma_xi: float, sigma_n: float, p0: float) -> tuple[Array, Array]:
    """Velocities less the estimated error, and its variances p."""
    steps, runs, axes = y_ins.shape
    system = LinearSystem(np.eye(1), -np.eye(1), np.array([[sigma_xi**2]]), np.array([[sigma_n**2]]))
    each_axis = (y_sr - y_ins).reshape(steps, runs * axes, 1)  # the axes are independent: so many runs of one filter
    laws = run_linear(system, Gaussian(np.zeros(1), np.array([[p0]])), each_axis).posterior
    return y_ins - laws.mean.reshape(y_ins.shape), laws.cov[:, 0, 0, 0]


# -- k5: the receiver drops out; k6: the receiver is biased


def lost(p: sp.Expr, sigma_xi: sp.Expr, sigma_n: sp.Expr, n: sp.Expr, T: sp.Expr) -> tuple[sp.Expr, ...]:
    """Standard deviation after n periods without receiver, and when it is that of the receiver."""
    return sp.sqrt(p + n * sigma_xi**2), T * (sigma_n**2 - p) / sigma_xi**2


def bias_error(beta: sp.Expr, K: sp.Expr, j: sp.Expr) -> sp.Expr:
    """What of the receiver's bias beta has passed into the estimate after j steps."""
    return beta * (1 - (1 + K) ** j)
