"""Keys of set c: structure, design and run of Pugachev's two-step conditionally optimal filter; the regression is in shared.py.

A key is the function with nothing changed that `..._with` makes; with one thing changed that is a known mistake.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kfcourse.checks.question import Answer
from kfcourse.checks.steps import Function, at_step
from kfcourse.exercises.shared import Fit, regression
from kfcourse.laws import Array

# -- c1: the structure


def structure(lam: Array, z: Array, y: Array, a: Callable, b: Callable) -> tuple[Array, Array]:
    """omega = y - b(lam) and alpha = a(z)."""
    return y - b(lam), a(z)


# -- c3: one step of the design


def design_step(lam: Array, x: Array, y: Array, x_next: Array, a: Callable, b: Callable) -> tuple[Array, Array]:
    """z and lam of the next step: the error regressed on omega, the next state on alpha."""
    return duof_step_with()(lam, x, y, x_next, a, b)


def duof_step_with(
    fit: Fit = regression,
    first: Callable[[Array, Array], Array] = lambda x, lam: x - lam,
    base: Callable[[Array], Array] = lambda lam: lam,
    alpha: Callable[[Array, Array, Callable], Array] = lambda z, lam, a: a(z),
) -> Answer:
    """One step of the DUOF's design on an ensemble, with one thing changed."""

    def step(lam: Array, x: Array, y: Array, x_next: Array, a: Callable, b: Callable) -> tuple[Array, Array]:
        omega = y - b(lam)
        H, e, _ = fit(first(x, lam), omega)
        z = base(lam) + omega @ H.T + e
        regressor = alpha(z, lam, a)
        F, g, _ = fit(x_next, regressor)
        return z, regressor @ F.T + g

    return step


# -- c4: coefficients found on one ensemble, used on another


def design_and_run(x: Array, y_design: Array, y: Array, mean: Array, a: Callable, b: Callable) -> Array:
    """Estimates from `y` with coefficients found on x and y_design, step by step."""
    return duof_run_with()(x, y_design, y, mean, a, b)


def duof_run_with(
    without_offset: bool = False,
    one_gain: bool = False,
    predictions: bool = False,
    object_alone: bool = False,
    sign: float = 1.0,
    a_at: Callable[[Function, int], Function] = at_step,
    b_at: Callable[[Function, int], Function] = at_step,
    fit: Fit = regression,
    target: Callable[[Array, Array], Array] = lambda x, lam: x - lam,
    base: Callable[[Array], Array] = lambda lam: lam,
    prediction_offset: bool = True,
) -> Answer:
    """Design over x, y (steps, N, ...), then filter other measurements; with one thing changed.

    a_at, b_at: (function, k) -> the function of which step is taken at step k.
    """

    def run(x: Array, y_design: Array, y: Array, mean: Array, a: Callable, b: Callable) -> Array:
        lam, other = np.tile(mean, (x.shape[1], 1)), np.tile(mean, (y.shape[1], 1))
        estimates, first = [], None
        for k in range(len(x)):
            a_k, b_k = a_at(a, k), b_at(b, k)
            omega = y_design[k] - b_k(lam)
            H, e, _ = fit(target(x[k], lam), omega)
            first = (H, e) if first is None else first
            if one_gain:
                H, e = first
            z = lam + omega @ H.T + e
            if without_offset:
                e = 0 * e
            z_other = base(other) + sign * (y[k] - b_k(other)) @ H.T + e
            estimates.append(other if predictions else z_other)
            if k + 1 < len(x):
                F, g, _ = fit(x[k + 1], a_k(z))
                lam, of_other = a_k(z) @ F.T + g, g if prediction_offset else 0 * g
                other = a_k(z_other) if object_alone else a_k(z_other) @ F.T + of_other
        return np.array(estimates)

    return run
