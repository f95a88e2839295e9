"""Keys of set c: structure, design and run of Pugachev's two-step conditionally optimal filter.

The regression (c2) is in shared.py.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kfcourse.exercises.checks.steps import at_step
from kfcourse.exercises.sets.shared import regression
from kfcourse.laws import Array


def structure(lam: Array, z: Array, y: Array, a: Callable, b: Callable) -> tuple[Array, Array]:
    """omega = y - b(lam) and alpha = a(z)."""
    return y - b(lam), a(z)


def design_step(
    lam: Array, x: Array, y: Array, x_next: Array, a: Callable, b: Callable
) -> tuple[Array, Array]:
    """z and lam of the next step: the error regressed on omega, the next state on alpha."""
    omega = y - b(lam)
    H, e, _ = regression(x - lam, omega)
    z = lam + omega @ H.T + e
    alpha = a(z)
    F, g, _ = regression(x_next, alpha)
    return z, alpha @ F.T + g


def design_and_run(
    x: Array, y_design: Array, y: Array, mean: Array, a: Callable, b: Callable
) -> Array:
    """Estimates from `y` with coefficients found on x and y_design, step by step."""
    lam, other = np.tile(mean, (x.shape[1], 1)), np.tile(mean, (y.shape[1], 1))
    estimates = []
    for k in range(len(x)):
        a_k, b_k = at_step(a, k), at_step(b, k)
        omega = y_design[k] - b_k(lam)
        H, e, _ = regression(x[k] - lam, omega)
        z = lam + omega @ H.T + e
        own = other + (y[k] - b_k(other)) @ H.T + e
        estimates.append(own)
        if k + 1 < len(x):
            F, g, _ = regression(x[k + 1], a_k(z))
            lam, other = a_k(z) @ F.T + g, a_k(own) @ F.T + g
    return np.array(estimates)
