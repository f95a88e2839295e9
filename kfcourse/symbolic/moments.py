r"""Exact moments of functions of Gaussian variables.

A function that is a sum of terms

    c q(x) exp(a^T x)        c a number, q a monomial (sines and cosines are complex exponentials)

has Gaussian moments in closed form, in any dimension, because an exponential only shifts the mean:

    M[q(x) exp(a^T x)] = exp(a^T m + a^T P a / 2) M[q(m + P a + delta)],   delta ~ N(0, P)

and the moments of a Gaussian follow one from another (Stein's lemma, `_polynomial_mean`).
Covariances are assembled term by term from differences that vanish symbolically, never as M[fg] -
M[f] M[g]: a
large mean or a small variance then loses no digits in floating point.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import sympy as sp
from sympy.codegen.cfunctions import expm1

from kfcourse.errors import NoClosedForm
from kfcourse.symbolic.formula import degree

MAX_DEGREE = 40


class Term(NamedTuple):
    """coefficient * polynomial(x) * exp(rate^T x), with free parameters as symbols."""

    polynomial: sp.Expr
    rate: tuple[sp.Expr, ...]


class GaussianMoments:
    """Exact means, covariances and mean derivatives over x ~ N(m, P).

    Parameters
    ----------
    variables : sequence of Symbol
        The Gaussian variables x, n of them.  Any other symbol in a function is a constant.
    mean : sequence of Expr
        Their means m, in any symbols or numbers.
    cov : Matrix
        Their covariance P, n x n, symmetric, in any symbols or numbers.

    Raises
    ------
    ValueError
        Sizes that differ, a covariance that is not symmetric; from its methods, a symbol with a
        variable's name that is another.

    Examples
    --------
    >>> import sympy as sp
    >>> from kfcourse import GaussianMoments
    >>> x, m = sp.symbols("x m", real=True)
    >>> d = sp.Symbol("d", positive=True)
    >>> law = GaussianMoments([x], [m], sp.Matrix([[d]]))
    >>> law.mean_of(x**4)
    3*d**2 + 6*d*m**2 + m**4
    >>> law.covariance(x**2, x**2)
    2*d**2 + 4*d*m**2
    >>> law.mean_of(sp.sin(x))
    exp(-d/2)*sin(m)
    """

    def __init__(self, variables: Sequence[sp.Symbol], mean: Sequence[sp.Expr], cov: sp.MatrixBase):
        self.variables = tuple(variables)
        self.mean = sp.Matrix(mean)
        self.cov = sp.Matrix(cov)
        n = len(self.variables)
        if len(self.mean) != n or self.cov.shape != (n, n) or not self.cov.is_symmetric():
            got = f"got {self.mean.T} and {self.cov}"
            raise ValueError(
                f"{n} variable(s) need as many means, and a symmetric covariance {n} x {n}; {got}"
            )

    def mean_of(self, function: sp.Expr) -> sp.Expr:
        """M[function(x)]; NoClosedForm names the term if there is none."""
        return _real(
            sum(
                (
                    self._scale(term.rate) * self._polynomial_mean(*term)
                    for term in decompose(function, self.variables)
                ),
                sp.S.Zero,
            )
        )

    def covariance(self, left: sp.Expr, right: sp.Expr) -> sp.Expr:
        """Cov(left(x), right(x)) = M[left right] - M[left] M[right], without cancellation."""
        total = sp.S.Zero
        for s in decompose(left, self.variables):
            for t in decompose(right, self.variables):
                total += self._covariance_of_terms(s, t)
        return _real(total)

    def _covariance_of_terms(self, s: Term, t: Term) -> sp.Expr:
        # M[s t] - M[s] M[t] = scale(s) scale(t) (e^{a^T P b} Q_st - Q_s Q_t)
        #                    = scale(s) scale(t) ((e^{a^T P b} - 1) Q_st + (Q_st - Q_s Q_t))
        both = tuple(a + b for a, b in zip(s.rate, t.rate, strict=True))
        q_st = self._polynomial_mean(s.polynomial * t.polynomial, both)
        q_s, q_t = self._polynomial_mean(*s), self._polynomial_mean(*t)
        exponent = sp.expand((sp.Matrix(s.rate).T * self.cov * sp.Matrix(t.rate))[0])
        difference = sp.expand(q_st - q_s * q_t)
        return (
            self._scale(s.rate)
            * self._scale(t.rate)
            * (_exp_minus_one(exponent) * q_st + difference)
        )

    def _scale(self, rate: tuple[sp.Expr, ...]) -> sp.Expr:
        """exp(a^T m + a^T P a / 2), the imaginary part of the exponent as cosine and sine."""
        a = sp.Matrix(rate)
        return _cis(sp.expand((a.T * self.mean + a.T * self.cov * a / 2)[0]))

    def _polynomial_mean(self, polynomial: sp.Expr, rate: tuple[sp.Expr, ...]) -> sp.Expr:
        """M[polynomial(x)], x ~ N(s, P), s = m + P a, by Stein's lemma: M[x_i f] = s_i M[f] + sum_j
        P_ij M[df/dx_j]."""
        shift = self.mean + self.cov * sp.Matrix(rate)

        @cache
        def moment(powers: tuple[int, ...]) -> sp.Expr:
            if not any(powers):
                return sp.S.One
            first = next(i for i, power in enumerate(powers) if power)
            rest = list(powers)
            rest[first] -= 1
            total = shift[first] * moment(tuple(rest))
            for j, power in enumerate(rest):
                if power and self.cov[first, j] != 0:
                    rest[j] -= 1
                    total += power * self.cov[first, j] * moment(tuple(rest))
                    rest[j] += 1
            return sp.expand(total)

        terms = sp.Poly(polynomial, *self.variables).terms()
        return sp.expand(
            sum((coefficient * moment(powers) for powers, coefficient in terms), sp.S.Zero)
        )


def decompose(function: sp.Expr, variables: Sequence[sp.Symbol]) -> list[Term]:
    """Split a function into terms polynomial(x) exp(rate^T x); terms of equal rate are collected.

    Raises
    ------
    NoClosedForm
        For a term that is not a polynomial times exponentials, sines and cosines of linear
        arguments: none other is looked for, though some have a closed form (exp(-x**2), abs(x)).
    """

    names = {x.name for x in variables}
    if strange := [
        symbol
        for symbol in sp.sympify(function).free_symbols - {*variables}
        if symbol.name in names
    ]:
        raise ValueError(
            f"{strange[0]} in {function} is not the variable of that name: make both alike, such "
            f"as real=True"
        )

    # Hyperbolic and trigonometric functions of x become exponentials; those of parameters stay.
    def with_variables(e: sp.Basic) -> bool:
        return isinstance(e, sp.sin | sp.cos | sp.sinh | sp.cosh) and e.has(*variables)

    rewritten = sp.sympify(function).replace(with_variables, lambda e: e.rewrite(sp.exp))
    if degree(rewritten, variables) > MAX_DEGREE:
        raise NoClosedForm(
            f"the degree of {function} is above {MAX_DEGREE}: its exact moments would be too long; "
            "use a numerical structure, unscented(model) or gauss_hermite(model)",
            "degree",
        )
    # Sums of parameters in a denominator are one symbol while the products are multiplied out.
    quotients: dict[sp.Basic, sp.Symbol] = {}
    rewritten = rewritten.replace(
        lambda e: isinstance(e, sp.Pow) and isinstance(e.base, sp.Add) and not e.has(*variables),
        lambda e: quotients.setdefault(e, sp.Dummy(real=True)),
    )
    originals = {symbol: quotient for quotient, symbol in quotients.items()}
    expanded = sp.expand(rewritten)
    collected: dict[tuple[sp.Expr, ...], sp.Expr] = {}
    for term in sp.Add.make_args(expanded):
        polynomial, exponent = sp.S.One, sp.S.Zero
        for factor in sp.Mul.make_args(term):
            if isinstance(factor, sp.exp) and factor.has(*variables):
                exponent += factor.exp
            elif factor.is_polynomial(*variables):
                polynomial *= factor
            else:
                raise _no_closed_form(factor, function)
        rate = tuple(sp.expand(sp.diff(exponent, x)) for x in variables)
        constant = sp.expand(
            exponent - sum((r * x for r, x in zip(rate, variables, strict=True)), sp.S.Zero)
        )
        # the constant of atan2(x, x), whose slope is zero
        if any(part.has(*variables) for part in (*rate, constant)):
            raise _no_closed_form(sp.exp(exponent), function)
        collected[rate] = collected.get(rate, sp.S.Zero) + polynomial * _cis(constant)
    return [
        Term(polynomial.xreplace(originals), tuple(part.xreplace(originals) for part in rate))
        for rate, polynomial in collected.items()
    ]


def _no_closed_form(factor: sp.Expr, function: sp.Expr) -> NoClosedForm:
    return NoClosedForm(
        f"the package knows no closed-form Gaussian mean of the term {factor} in {function}; "
        "use linearised(model), or a numerical structure: unscented(model) or gauss_hermite(model)",
        "no_mean",
        term=factor,
    )


def _cis(exponent: sp.Expr) -> sp.Expr:
    """exp of a constant complex exponent, its imaginary part as cosine and sine."""
    re, im = exponent.as_real_imag()
    return sp.exp(re) * (sp.cos(im) + sp.I * sp.sin(im))


def _exp_minus_one(exponent: sp.Expr) -> sp.Expr:
    """exp(u + iv) - 1 = expm1(u) cos v - 2 sin(v/2)^2 + i e^u sin v, exact for small u and v
    too."""
    re, im = exponent.as_real_imag()
    real = (expm1(re) if re != 0 else sp.S.Zero) * sp.cos(im) - 2 * sp.sin(im / 2) ** 2
    return real + sp.I * sp.exp(re) * sp.sin(im)


def _real(expression: sp.Expr) -> sp.Expr:
    """The real part; the imaginary parts of conjugate terms cancel by construction."""
    real = sp.expand(
        expression if not expression.has(sp.I) else sp.expand(expression).as_real_imag()[0]
    )
    return real.replace(lambda e: e.is_Mul and e.has(expm1), _bounded)


def _bounded(term: sp.Mul) -> sp.Expr:
    """exp(-u) expm1(u) as -expm1(-u): equal, but neither factor can overflow for a large variance
    u."""
    for factor in term.args:
        inverse = sp.exp(-factor.args[0]) if isinstance(factor, expm1) else None
        if inverse in term.args:
            return -term / (factor * inverse) * expm1(-factor.args[0])
    return term
