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

from kfcourse.symbolic.typesetting import WIDTH, Printer, symbols


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
    return _Writer(variables).lines(_readable(expression), WIDTH - symbols(before))


def _readable(expression: sp.Expr) -> sp.Expr:
    """Without expm1, which keeps the digits of e^u - 1 in the code: people write the latter; and
    sin^2 u + cos^2 u is 1."""
    if expression.has(expm1):
        expression = sp.expand(expression.replace(expm1, lambda u: sp.exp(u) - 1))
    ways = [expression]
    for squared, other in ((sp.sin, sp.cos), (sp.cos, sp.sin)):
        if functions := expression.atoms(squared):
            squares = {function**2: 1 - other(*function.args) ** 2 for function in functions}
            ways.append(sp.expand(expression.xreplace(squares)))
    return min(ways, key=lambda way: len(sp.Add.make_args(way)))


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
        # functions last, or what follows would seem to be in the argument: g cos m d
        last = isinstance(factor.as_base_exp()[0], sp.Function)
        return last, not factor.is_number, max(self.ranks(factor), default=-1), str(factor)

    def ranks(self, formula: sp.Expr) -> list[int]:
        return [self.rank[symbol] for symbol in formula.free_symbols if symbol in self.rank]

    def _as_ordered_terms(self, expr: sp.Add, order: str | None = None) -> list[sp.Expr]:
        """Terms with the same parameters together: first the group with the shortest, earliest
        term; in it powers fall."""
        ordered = []
        for (noises, parameters), group in groupby(sorted(expr.args, key=self.kind), self.kind):
            members = sorted(
                group, key=lambda term: [-self.degree(term, symbol) for symbol in self.rank]
            )
            first = min(
                (
                    term.could_extract_minus_sign(),
                    self.degree(term, *self.rank),
                    min(self.ranks(term), default=len(self.rank)),
                )
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

    def degree(self, term: sp.Expr, *symbols: sp.Symbol) -> float:
        """Degree of the term in these variables; a function of them counts as one."""
        factors = (factor for factor in sp.Mul.make_args(term) if factor.has(*symbols))
        powers = (factor.as_base_exp()[1] for factor in factors)
        return sum(float(power) if power.is_Number else 1.0 for power in powers)
