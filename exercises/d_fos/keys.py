"""Keys of set d: what an estimate says of the state, and a step of the filters of optimal structure (FOS, MFOS).

A key is the function with nothing changed that `..._with` makes; with one thing changed that is a known mistake.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kfcourse.checks.question import Answer
from kfcourse.checks.steps import full
from kfcourse.exercises.b_aof.keys import correct
from kfcourse.exercises.shared import Fit, regression
from kfcourse.laws import Array

# -- d1: what the estimate says of the state

Condition = Callable[[Array, Array], tuple[Array, Array]]


def condition(x: Array, z: Array) -> tuple[Array, Array]:
    """u = Gamma z + chi and T: what the estimate says of the state."""
    matrix, offset, residual = regression(x, z)
    return z @ matrix.T + offset, residual


# -- d2: one step of the FOS


def _predicting(predict: Callable, mean: Array, cov: Array) -> tuple[Array, Array]:
    """The prediction from one covariance for all trajectories, or from one each."""
    return predict(mean, full(np.asarray(cov), len(mean)))


def fos_step(lam: Array, Psi: Array, x: Array, y: Array, measure: Callable, predict: Callable) -> tuple[Array, ...]:
    """The AOF's z, then the prediction from what z says of the state: u and T."""
    return fos_step_with()(lam, Psi, x, y, measure, predict)


def fos_step_with(
    condition: Condition = condition, choose: Callable[..., tuple[Array, Array]] = lambda u, T, z, p: (u, T)
) -> Answer:
    """One step of the FOS's design, with another condition or another choice of what the prediction starts from."""

    def step(lam: Array, Psi: Array, x: Array, y: Array, measure: Callable, predict: Callable) -> tuple[Array, ...]:
        h, G, F = measure(lam, Psi)
        z, p = correct(lam, Psi, h, G, F, y)
        return z, *_predicting(predict, *choose(*condition(x, z), z, p))

    return step


# -- d3: one step of the MFOS


def mfos_step(
    lam: Array, Psi: Array, x: Array, y: Array, x_next: Array, measure: Callable, predict: Callable
) -> tuple[Array, ...]:
    """The FOS's step, its correction and its prediction each regressed once more."""
    return mfos_step_with()(lam, Psi, x, y, x_next, measure, predict)


def mfos_step_with(
    fit: Fit = regression,
    correction: bool = True,
    prediction: bool = True,
    target: Callable[[Array, Array], Array] = lambda x, lam: x - lam,
    condition: Condition = condition,
    own_variance: bool = False,
) -> Answer:
    """One step of the MFOS's design, with one thing changed."""

    def step(
        lam: Array, Psi: Array, x: Array, y: Array, x_next: Array, measure: Callable, predict: Callable
    ) -> tuple[Array, ...]:
        h, G, F = measure(lam, Psi)
        z, p = correct(lam, Psi, h, G, F, y)
        sigma = z - lam
        if correction:
            H, e, _ = fit(target(x, lam), sigma)
            z = lam + sigma @ H.T + e
        u, T = condition(x, z)
        s, Psi_next = _predicting(predict, u, p if own_variance else T)
        if prediction:
            L, n, _ = fit(x_next, s)
            s = s @ L.T + n
        return z, s, Psi_next

    return step


# -- d4: three arguments


def condition_on_both(x: Array, y: Array, z: Array) -> tuple[Array, Array]:
    """u and T from the measurement and the estimate together."""
    return condition(x, np.concatenate([y, z], axis=1))
