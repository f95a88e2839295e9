"""Keys of set r: a tracking loop from its log-likelihood, its characteristic by integration, slips by a double integral.

The carrier is y = A cos(theta + phi) + n, D[n] = D, with the known phase theta.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import sympy as sp

from kfcourse.exercises.shared import substituted
from kfcourse.laws import Array

DELTA, THETA, PHI, Y = sp.symbols("Delta theta phi y", real=True)
A, D, Q, R, P, T = sp.symbols("A D q r p T", positive=True)
AMPLITUDE, NOISE, PERIOD = A, D, T  # where an argument has the same name
POINTS = 512  # of a period


@lru_cache(maxsize=1)
def _score() -> sp.Expr:
    """The derivative of the log-likelihood by phi."""
    return sp.diff(-((Y - A * sp.cos(THETA + PHI)) ** 2) / (2 * D), PHI)


@lru_cache(maxsize=1)
def _lambdified() -> Callable[..., Array]:
    return sp.lambdify((PHI, Y, THETA, A, D), _score())


def discriminator(lam: Array, y: Array, theta: Array, A: float, sigma: float) -> Array:
    """u at the prediction lam of the phase, (N,)."""
    return _lambdified()(lam, y, theta, A, sigma**2)


@lru_cache(maxsize=1)
def _characteristic() -> sp.ImmutableMatrix:
    """U, its slope at zero and the noise that is equivalent to it: the mean of u over a period of theta."""
    u = _score().subs({Y: A * sp.cos(THETA + DELTA), PHI: 0})
    U = sp.simplify(sp.integrate(sp.expand(sp.expand_trig(u)), (THETA, 0, 2 * sp.pi)) / (2 * sp.pi))
    slope = U.diff(DELTA).subs(DELTA, 0)
    return sp.ImmutableMatrix([U, slope, 1 / slope])


def characteristic(Delta: sp.Expr, A: sp.Expr, D: sp.Expr) -> tuple[sp.Expr, ...]:
    """U(Delta), its slope at zero, and the variance of the equivalent noise."""
    return tuple(substituted(_characteristic(), (DELTA, AMPLITUDE, NOISE))(Delta, A, D))


@lru_cache(maxsize=1)
def _steady() -> sp.ImmutableMatrix:
    """(Psi, p) that the filter's step leaves as they are."""
    Psi = sp.Symbol("Psi")
    roots = sp.solve(sp.numer(sp.together(Psi * R / (Psi + R) + Q - Psi)), Psi)
    (found,) = [root for root in roots if root.subs({Q: 1, R: 1}) > 0]
    return sp.ImmutableMatrix([found, found - Q])


def steady(q: sp.Expr, r: sp.Expr) -> tuple[sp.Expr, ...]:
    """Variances of the phase before and after a correction."""
    return tuple(substituted(_steady(), (Q, R))(q, r))


def lock_in(p: sp.Expr, A: sp.Expr, D: sp.Expr, T: sp.Expr) -> sp.Expr:
    """The frequency offset, Hz, that the loop can just follow."""
    largest = _characteristic()[0].subs(DELTA, sp.pi / 2)
    found = sp.Matrix([P * largest / (2 * sp.pi * PERIOD)])
    return substituted(found, (P, AMPLITUDE, NOISE, PERIOD))(p, A, D, T)[0]


def mean_time(variance: Array, q: float) -> Array:
    """Mean number of steps to a slip, for each variance of the phase: both integrals over a period by sums."""
    V = (1 - np.cos(2 * np.pi * np.arange(POINTS) / POINTS)) / np.asarray(variance)[:, None]
    return 2 * np.pi**2 / q * np.exp(V).mean(axis=1) * np.exp(-V).mean(axis=1)


def slips(error: Array) -> tuple[Array, Array]:
    """Whole cycles by which each run is off at the end, (N,), and the mean time to a first slip."""
    away = np.abs(error) >= 2 * np.pi
    first = np.where(away.any(axis=0), away.argmax(axis=0), len(error))
    return np.round(error[-1] / (2 * np.pi)), first.sum() / away.any(axis=0).sum()
