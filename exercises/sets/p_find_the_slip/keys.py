"""Keys of set p: the right formulas; test_references.py holds them against the package's moments,
derivatives, regressions."""

from __future__ import annotations

import sympy as sp

from kfcourse.exercises.sets.shared import regression
from kfcourse.laws import Array


def second_moment(a: sp.Expr, q: sp.Expr, z: sp.Expr, p: sp.Expr) -> sp.Expr:
    """M[x'^2] of x' = a x + sqrt(q) v over x ~ N(z, p)."""
    return a**2 * (z**2 + p) + q


def scaled_meter(gamma: sp.Expr, G: sp.Expr, d: sp.Expr, r: sp.Expr) -> sp.Expr:
    """F of the linearised meter y = gamma (S(x) + w), D[w] = r, where S' = G."""
    return gamma**2 * (G**2 * d + r)


def noise_intensity(z1: sp.Expr, z2: sp.Expr, p11: sp.Expr, p12: sp.Expr, p22: sp.Expr) -> sp.Expr:
    """M[B B^T] in its second row and column, where B = (0, x1)^T and x ~ N(z, p)."""
    return z1**2 + p11


def meter_variance(
    m1: sp.Expr, m2: sp.Expr, d11: sp.Expr, d12: sp.Expr, d22: sp.Expr
) -> sp.ImmutableMatrix:
    """F of y = (x1^2 + w1, x2 + w2) over x ~ N(m, d), D[w] = I."""
    noise, cross = 1, 2 * m1 * d12
    first = 4 * m1**2 * d11 + 2 * d11**2
    return sp.ImmutableMatrix([[first + noise, cross], [cross, d22 + noise]])


def by_angle(E: sp.Expr, kappa: sp.Expr, x2: sp.Expr) -> tuple[sp.Expr, ...]:
    """Derivatives of both accelerometers by the path angle."""
    return E * (-sp.sin(x2) - kappa * sp.cos(x2)), E * (sp.cos(x2) - kappa * sp.sin(x2))


def correction_matrix(error: Array, sigma: Array) -> Array:
    """H that minimises M|error - H sigma - e|^2 over the ensemble; error = x - lambda, (N, n)."""
    return regression(error, sigma)[0]


def coefficients(x_0: Array, x: Array, z: Array) -> tuple[Array, Array, Array]:
    """Gamma, chi and T of step k: the regression of x on z over the ensemble; x_0 is not needed."""
    Gamma, chi, T = regression(x, z)
    return Gamma, chi, T


def moments(x: Array, mode: Array) -> tuple[float, float]:
    """Mean and variance of x over the whole ensemble, whatever the modes are."""
    mean, variance = x.mean(), x.var()
    return mean, variance
