"""Keys of set d: what an estimate says of the state, and a step of the filters of optimal structure
(FOS, MFOS)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kfcourse.exercises.checks.steps import full
from kfcourse.exercises.sets.b_aof.keys import correct
from kfcourse.exercises.sets.shared import regression
from kfcourse.laws import Array


def condition(x: Array, z: Array) -> tuple[Array, Array]:
    """u = Gamma z + chi and T: what the estimate says of the state."""
    Gamma, chi, T = regression(x, z)
    return z @ Gamma.T + chi, T


def fos_step(
    lam: Array, Psi: Array, x: Array, y: Array, measure: Callable, predict: Callable
) -> tuple[Array, ...]:
    """The AOF's z, then the prediction from what z says of the state: u and T."""
    h, G, F = measure(lam, Psi)
    aof = correct(lam, Psi, h, G, F, y)
    z = aof[0]
    u, T = condition(x, z)
    return z, *predict(u, full(np.asarray(T), len(u)))


def mfos_step(
    lam: Array, Psi: Array, x: Array, y: Array, x_next: Array, measure: Callable, predict: Callable
) -> tuple[Array, ...]:
    """The FOS's step, its correction and its prediction each regressed once more."""
    h, G, F = measure(lam, Psi)
    aof = correct(lam, Psi, h, G, F, y)
    sigma = aof[0] - lam
    H, e, _ = regression(x - lam, sigma)
    z = lam + sigma @ H.T + e
    u, T = condition(x, z)
    s, Psi_next = predict(u, full(np.asarray(T), len(u)))
    L, n, _ = regression(x_next, s)
    return z, s @ L.T + n, Psi_next


def condition_on_both(x: Array, y: Array, z: Array) -> tuple[Array, Array]:
    """u and T from the measurement and the estimate together."""
    return condition(x, np.concatenate([y, z], axis=1))
