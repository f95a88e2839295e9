"""Keys of set l: two rates, two clocks, a correction of varying dimension, late measurements, what
ignoring a tag costs."""

from __future__ import annotations

import numpy as np
import sympy as sp

from kfcourse.laws import Array


def dimension(steps: int, ratio: int, first: int) -> Array:
    """How many components the measurement has at each step."""
    k = np.arange(steps)
    return np.where((k >= first) & ((k - first) % ratio == 0), 2.0, 1.0)


def own_time(reading: sp.Expr, rate: sp.Expr, shift: sp.Expr) -> sp.Expr:
    """The moment at which a clock shows the reading."""
    return (reading - shift) / rate


def correct(m: Array, P: Array, y: Array, H: Array, R: Array) -> tuple[Array, Array]:
    """The correction by the components that are there; NaN says that one is missing."""
    there = np.isfinite(y)
    y, H, R = y[there], H[there], R[np.ix_(there, there)]
    F = H @ P @ H.T + R
    K = np.linalg.solve(F, H @ P).T
    return m + K @ (y - H @ m), P - K @ H @ P


def move(m: Array, P: Array, dt: float, q: float) -> tuple[Array, Array]:
    """Mean and covariance of position and velocity after dt."""
    A = np.array([[1, dt], [0, 1]])
    Q = q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    return A @ m, A @ P @ A.T + Q


def fuse(
    tags: Array, arrivals: Array, values: Array, m: Array, P: Array, q: float, r: float, now: float
) -> tuple[Array, Array]:
    """The estimate at `now` from what has arrived, each measurement at its tag."""
    time, moments, used = 0.0, tags, arrivals <= now
    for i in np.argsort(tags):
        if used[i]:
            m, P = move(m, P, float(moments[i]) - time, q)
            m, P = correct(m, P, values[i : i + 1], np.array([[1.0, 0.0]]), np.array([[r]]))
            time = float(moments[i])
    return move(m, P, now - time, q)


def cost(V: sp.Expr, a: sp.Expr, tau: sp.Expr) -> tuple[sp.Expr, ...]:
    """Errors of position and velocity when the present is taken to be tau ago."""
    return -V * tau + a * tau**2 / 2, -a * tau


def fit_clock(edges: Array, stamps: Array) -> tuple[float, float]:
    """Rate and shift of the clock from pairs of edges and stamps: the edges fitted on the
    stamps."""
    slope, level = np.polyfit(stamps, edges, 1)
    return 1 / slope, -level / slope
