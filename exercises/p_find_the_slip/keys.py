"""Keys of set p: what stands in the right formulas, derived by the package's moments, derivatives and regressions.

A statement's solution types the formula; here each comes from the model that it belongs to.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import sympy as sp

from kfcourse.exercises.shared import regression, substituted
from kfcourse.laws import Array
from kfcourse.symbolic.moments import GaussianMoments

A, Q, Z, P = sp.symbols("a q z p", real=True)
GAMMA, SLOPE, D, R = sp.symbols("gamma G d r", real=True)
M1, M2, D11, D12, D22 = sp.symbols("m1 m2 d11 d12 d22", real=True)
Z1, Z2, P11, P12, P22 = sp.symbols("z1 z2 p11 p12 p22", real=True)
FORCE, KAPPA, ANGLE = sp.symbols("E kappa x2", real=True)
_X, _V = sp.symbols("x v", real=True)
_PAIR = sp.symbols("x1 x2", real=True)


def second_moment(a: sp.Expr, q: sp.Expr, z: sp.Expr, p: sp.Expr) -> sp.Expr:
    """M[x'^2] of x' = a x + sqrt(q) v over x ~ N(z, p)."""
    law = GaussianMoments([_X, _V], [Z, 0], sp.diag(P, 1))
    square = sp.expand((A * _X + sp.Symbol("s") * _V) ** 2)
    found = law.mean_of(square).subs(sp.Symbol("s"), sp.sqrt(Q))
    return substituted(sp.Matrix([found]), (A, Q, Z, P))(a, q, z, p)[0]


def scaled_meter(gamma: sp.Expr, G: sp.Expr, d: sp.Expr, r: sp.Expr) -> sp.Expr:
    """F of the linearised meter y = gamma (S(x) + w), D[w] = r, where S' = G."""
    x, w = sp.symbols("x w", real=True)
    y = GAMMA * (SLOPE * x + w)
    law = GaussianMoments([x, w], [0, 0], sp.diag(D, R))
    return substituted(sp.Matrix([law.covariance(y, y)]), (GAMMA, SLOPE, D, R))(gamma, G, d, r)[0]


def noise_intensity(z1: sp.Expr, z2: sp.Expr, p11: sp.Expr, p12: sp.Expr, p22: sp.Expr) -> sp.Expr:
    """M[B B^T] in its second row and column, where B = (0, x1)^T and x ~ N(z, p)."""
    law = GaussianMoments(_PAIR, [Z1, Z2], sp.Matrix([[P11, P12], [P12, P22]]))
    found = sp.Matrix([law.mean_of(_PAIR[0] ** 2)])
    return substituted(found, (Z1, Z2, P11, P12, P22))(z1, z2, p11, p12, p22)[0]


@lru_cache(maxsize=1)
def _F() -> sp.ImmutableMatrix:
    w = sp.symbols("w1 w2", real=True)
    cov = sp.diag(sp.Matrix([[D11, D12], [D12, D22]]), 1, 1)
    law = GaussianMoments([*_PAIR, *w], [M1, M2, 0, 0], cov)
    y = (_PAIR[0] ** 2 + w[0], _PAIR[1] + w[1])
    return sp.ImmutableMatrix(2, 2, lambda i, j: sp.expand(law.covariance(y[i], y[j])))


def meter_variance(m1: sp.Expr, m2: sp.Expr, d11: sp.Expr, d12: sp.Expr, d22: sp.Expr) -> sp.ImmutableMatrix:
    """F of y = (x1^2 + w1, x2 + w2) over x ~ N(m, d), D[w] = I."""
    return substituted(_F(), (M1, M2, D11, D12, D22))(m1, m2, d11, d12, d22)


def by_angle(E: sp.Expr, kappa: sp.Expr, x2: sp.Expr) -> tuple[sp.Expr, ...]:
    """Derivatives of both accelerometers by the path angle."""
    y = sp.Matrix([FORCE * (sp.cos(ANGLE) - KAPPA * sp.sin(ANGLE)), FORCE * (sp.sin(ANGLE) + KAPPA * sp.cos(ANGLE))])
    return tuple(substituted(y.diff(ANGLE), (FORCE, KAPPA, ANGLE))(E, kappa, x2))


def correction_matrix(error: Array, sigma: Array) -> Array:
    """H that minimises M|error - H sigma - e|^2 over the ensemble; error = x - lambda, (N, n)."""
    return regression(error, sigma)[0]


def coefficients(x_0: Array, x: Array, z: Array) -> tuple[Array, Array, Array]:
    """Gamma, chi and T of step k: the regression of x on z over the ensemble; x_0 is not needed."""
    return regression(x, z)


def moments(x: Array, mode: Array) -> tuple[float, float]:
    """Mean and variance of x over the whole ensemble, whatever the modes are."""
    return float(np.mean(x)), float(np.mean((x - np.mean(x)) ** 2))
