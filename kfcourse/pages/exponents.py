"""Exponents of normal laws, as the derivations of the theory chapters use them.

A product of normal densities has an exponent that is quadratic in the state; completing its square
gives mean and variance.
"""

from __future__ import annotations

from typing import NamedTuple

import sympy as sp


class Square(NamedTuple):
    """A completed square: exponent = -(x - mean)^2 / (2 variance) + rest."""

    mean: sp.Expr
    variance: sp.Expr
    rest: sp.Expr


def log_normal(value: sp.Expr, mean: sp.Expr, variance: sp.Expr) -> sp.Expr:
    """Logarithm of the normal density N(value; mean, variance)."""
    return -((value - mean) ** 2) / (2 * variance) - sp.log(2 * sp.pi * variance) / 2


def complete_square(exponent: sp.Expr, variable: sp.Symbol) -> Square:
    """The square completed in an exponent b x^2 + a x + d of the variable x.

    `mean` = -a / (2b),   `variance` = -1 / (2b),   `rest` = d - a^2 / (4b)

    Raises
    ------
    ValueError, PolynomialError
        If the exponent is not quadratic in the variable.
    """
    b, a, d = sp.Poly(exponent, variable).all_coeffs()
    return Square(sp.factor(-a / (2 * b)), sp.factor(-1 / (2 * b)), d - sp.factor(a**2 / (4 * b)))


def log_integral(exponent: sp.Expr, variable: sp.Symbol) -> sp.Expr:
    """Logarithm of the integral of exp(exponent) over the variable, in which the exponent is
    quadratic with b < 0.

    ln Integral exp(a x + b x^2 + d) dx = `rest` + ln(2 pi `variance`) / 2
    """
    _, variance, rest = complete_square(exponent, variable)
    return rest + sp.log(2 * sp.pi * variance) / 2
