"""Formulas and numbers as people write them: parameters before variables before noises, short terms
before long ones.

SymPy orders by the alphabet and prints f w x^2 + g x; the course writes g x + f x^2 w.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import groupby

import sympy as sp
from sympy.codegen.cfunctions import expm1

from kfcourse.symbolic.typesetting import WIDTH, Printer, printed_lines, symbols


def formula_latex(
    expression: sp.Expr, variables: Sequence[sp.Symbol], noises: Sequence[sp.Symbol] = ()
) -> str:
    """LaTeX of a formula.

    Parameters
    ----------
    expression : sympy expression
    variables : sequence of symbols
        What the formula is a function of, in the order in which factors are written; all other
        symbols are parameters.
    noises : sequence of symbols
        Variables that are written last in a product, and whose terms are written last in a sum.
    """
    return _Writer(variables, noises).doprint(_readable(sp.sympify(expression)))


def formula_lines(
    expression: sp.Expr, variables: Sequence[sp.Symbol], before: str = ""
) -> list[str]:
    """The same in as many lines as a page is wide beside what stands before them; only sums are
    broken."""
    return printed_lines(_Writer(variables), _readable(expression), WIDTH - symbols(before))


def _readable(expression: sp.Expr) -> sp.Expr:
    """Without expm1, which keeps the digits of e^u - 1 in the code: people write the latter; and
    sin^2 u + cos^2 u is 1."""
    if expression.has(expm1):
        expression = sp.expand(expression.replace(expm1, lambda u: sp.exp(u) - 1))
    if not (expression.has(sp.sin) and expression.has(sp.cos)):
        return expression
    ways = (
        expression,
        _by_other(expression, sp.sin, sp.cos),
        _by_other(expression, sp.cos, sp.sin),
    )
    return min(ways, key=lambda way: len(sp.Add.make_args(way)))


def _by_other(expression: sp.Expr, squared: type[sp.Function], other: type[sp.Function]) -> sp.Expr:
    """With 1 - other^2 for the square of one of both functions."""
    return sp.expand(
        expression.replace(
            lambda e: e.is_Pow and e.exp == 2 and e.base.func is squared,
            lambda e: 1 - other(*e.base.args) ** 2,
        )
    )


_LONG = re.compile(r"(?<![\w.,])\d{5,}(?!\w)")


def by_thousands(text: str, comma: str = ",") -> str:
    """The text with commas in whole numbers, and before the point of others, of five digits and
    more: 9999, 10,000."""
    return _LONG.sub(lambda number: f"{int(number[0]):,}".replace(",", comma), text)


def number_latex(value: float) -> str:
    r"""LaTeX of a value: 0.5, 5 \cdot 10^{-5}, or 10^{-6}."""
    digits, _, power = f"{value:g}".partition("e")
    if not power:
        return digits
    factor = digits.removesuffix("1") if digits in ("1", "-1") else rf"{digits} \cdot "
    return f"{factor}10^{{{int(power)}}}"


class _Writer(Printer):
    """Prints sums and products in the course's order."""

    def __init__(self, variables: Sequence[sp.Symbol], noises: Sequence[sp.Symbol] = ()) -> None:
        super().__init__({"order": "none", "fold_func_brackets": True})
        self.rank = {symbol: place for place, symbol in enumerate([*variables, *noises])}
        self.noises = set(noises)

    def _print_Mul(self, expr: sp.Mul) -> str:
        factors = sorted(sp.Mul.make_args(expr), key=self.factor_key)  # a 1/x comes here, too
        return super()._print_Mul(sp.Mul(*factors, evaluate=False))

    def factor_key(self, factor: sp.Expr) -> tuple[bool, bool, int, str]:
        ranks = [self.rank[symbol] for symbol in factor.free_symbols if symbol in self.rank]
        # functions last, or what follows would seem to be in the argument: g cos m d
        last = isinstance(factor.as_base_exp()[0], sp.Function)
        return last, not factor.is_number, max(ranks, default=-1), str(factor)

    def terms(self, total: sp.Add) -> list[sp.Expr]:
        """Terms with the same parameters together: first the group with the shortest, earliest
        term; in it powers fall."""
        ordered = []
        for (noises, parameters), group in groupby(sorted(total.args, key=self.kind), self.kind):
            members = sorted(
                group, key=lambda term: [-self.degree(term, symbol) for symbol in self.rank]
            )
            first = min(
                (term.could_extract_minus_sign(), self.degree(term, *self.rank), self.place(term))
                for term in members
            )
            ordered.append((noises, first, parameters, members))
        return [
            term for *_, members in sorted(ordered, key=lambda item: item[:3]) for term in members
        ]

    def kind(self, term: sp.Expr) -> tuple[int, str]:
        """How many noises are in a term, and its parameters."""
        parameters = [
            factor
            for factor in sp.Mul.make_args(term)
            if not factor.is_number and self.rank.keys().isdisjoint(factor.free_symbols)
        ]
        return len(term.free_symbols & self.noises), str(sp.Mul(*parameters))

    def place(self, term: sp.Expr) -> int:
        return min(
            (self.rank[symbol] for symbol in term.free_symbols if symbol in self.rank),
            default=len(self.rank),
        )

    def degree(self, term: sp.Expr, *symbols: sp.Symbol) -> float:
        """Degree of the term in these variables; a function of them counts as one."""
        factors = sp.Mul.make_args(term)
        return sum(self.power(factor) for factor in factors if factor.has(*symbols))

    def power(self, factor: sp.Expr) -> float:
        exponent = factor.as_base_exp()[1]
        return (
            float(exponent)
            if exponent.is_number and exponent.is_real and not isinstance(factor, sp.exp)
            else 1.0
        )
