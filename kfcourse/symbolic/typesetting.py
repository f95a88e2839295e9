"""Equations as LaTeX that fits a column: one line an equation where it fits, else broken between
the terms of its sums."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any, TypeAlias

import sympy as sp
from sympy.printing.latex import LatexPrinter

# One side of an equation: an expression, a matrix, or LaTeX that is printed as it stands.
Side: TypeAlias = Any
Equation: TypeAlias = Sequence[Side]

WIDTH = 62  # symbols in a line of the page's column

_OPERATORS = {"+", "-", "=", r"\cdot", r"\approx", r"\le", r"\ge"}  # with the space around them
_TOKEN = re.compile(r"(?s)\\[a-zA-Z]+|\\.|.")
_NAME_BEFORE_A_FACTOR = re.compile(
    r"(\\mathit\{[A-Za-z]+\}(?:\^\{[^{}]*\})?) (?!\\(?:right|cdot)\b)(?=[A-Za-z\\{])"
)
_WORD_BELOW = re.compile(r"_\{([a-z]{4,})(?=[ }])")  # G_{best}: a word, no product of letters
_BRACED = r"[^{}]"
for _ in range(8):  # braces in braces
    _BRACED = rf"(?:[^{{}}]|\{{{_BRACED}*\}})"
_FRACTION = re.compile(rf"\\frac\{{({_BRACED}*)\}}\{{({_BRACED}*)\}}")
_WITHOUT_WIDTH = re.compile(r"\\(?:left|right|mathrm|mathit|operatorname|tilde|hat|[,!])|[{}^_& ]")


def equation_latex(equation: Equation, names: Mapping[Any, str] | None = None) -> str:
    """LaTeX of side = side = ..., with `&` for an aligned environment, in several lines where it is
    long.

    Sides that print alike are printed once.  Transposes are T, derivatives have no brackets, and
    the terms and factors of an `UnevaluatedExpr` stand as they are.
    """

    def side_lines(side: Side) -> list[str]:
        if isinstance(side, str):
            return [side]
        settings = {
            "symbol_names": dict(names or {}),
            "diff_operator": "d",
            "mat_delim": "(",
            "order": "none" if isinstance(side, sp.UnevaluatedExpr) else None,
        }
        return Printer(settings).lines(side, WIDTH - 6)

    first, *others = (side for side, _ in groupby(map(side_lines, equation)))
    left = " ".join(first)
    lines: list[str] = []
    line, room = left + " ", WIDTH - symbols(left)
    for number, side in enumerate(others):
        if number and (len(side) > 1 or symbols(side[0]) + 3 > room):
            lines, line, room = [*lines, line], "", WIDTH - symbols(left)
        line += ("&= " if not number or not line else " = ") + side[0]
        room -= symbols(side[0]) + 3
        for continued in side[1:]:
            lines, line, room = [*lines, line], rf"&\quad {continued}", 0
    return "\\\\\n".join([*lines, line])


def joined(terms: Sequence[str], width: float = WIDTH) -> list[str]:
    """The LaTeX of a sum, from that of its terms, in lines."""
    lines = [""]
    for printed in terms:
        signed = printed if printed.startswith("-") or lines == [""] else "+ " + printed
        if lines[-1] and symbols(lines[-1] + signed) > width:
            lines.append("")
        lines[-1] += (" " if lines[-1] else "") + signed
    return lines


def aligned(lines: Sequence[str]) -> str:
    """A LaTeX `aligned` block."""
    return "\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}"


def with_index(name: str, index: str) -> str:
    """LaTeX of a name with one more index: x_{1,k} for x_{1} and k."""
    own = re.fullmatch(r"(.*)_\{([^{}]*)\}", name)
    return f"{own[1]}_{{{own[2]},{index}}}" if own else f"{{{name}}}_{{{index}}}"


class Printer(LatexPrinter):
    """SymPy's, with one letter for the identity, \\ln, and names of several letters told apart from
    products."""

    def __init__(self, settings: dict[str, Any] | None = None) -> None:
        super().__init__({"ln_notation": True} | (settings or {}))

    def doprint(self, expr: Any) -> str:
        return _NAME_BEFORE_A_FACTOR.sub(r"\1\, ", super().doprint(expr))

    def lines(self, expression: Any, width: float) -> list[str]:
        """An expression as it is printed, in as many lines as it takes; only sums are broken."""
        whole = self.doprint(expression)
        if symbols(whole) <= width or not isinstance(expression, sp.Add):
            return [whole]
        return joined([self.doprint(term) for term in self._as_ordered_terms(expression)], width)

    def _as_ordered_terms(self, expr: sp.Add, order: str | None = None) -> list[sp.Expr]:
        """The terms of a sum in the order in which they are printed."""
        terms = super()._as_ordered_terms(expr)
        return terms if self.order == "none" else _ordered(terms)

    def _print_Symbol(self, expr: sp.Symbol, style: str = "plain") -> str:
        printed = _WORD_BELOW.sub(r"_{\\mathrm{\1}", super()._print_Symbol(expr, style))
        several = len(printed) > 1 and printed.isascii() and printed.isalpha()
        return (
            rf"\mathit{{{printed}}}"
            if several and expr not in self._settings["symbol_names"]
            else printed
        )

    def _print_Identity(self, expr: sp.Identity) -> str:
        return "I"


def _ordered(terms: Sequence[sp.Expr]) -> list[sp.Expr]:
    """Terms in the order people write them: lambda + K(y - S), not K(-S + y) + lambda.

    Negative terms come last; a symbol that is no factor of another term comes first, and so does
    the number of 1 + x^2.
    """

    def rank(term: sp.Expr) -> tuple[bool, bool]:
        bases = {
            factor.as_base_exp()[0]
            for other in terms
            if other != term
            for factor in sp.Mul.make_args(other)
        }
        alone = (term.is_Symbol and term not in bases) or (term.is_Number and len(terms) == 2)
        return term.could_extract_minus_sign(), not alone

    return sorted(terms, key=rank)


def symbols(latex: str) -> float:
    """How wide a formula is, counted in symbols; of a fraction the wider part, of matrices the
    widest row."""
    if fraction := _FRACTION.search(latex):
        wider = max(map(symbols, fraction.groups()))
        return symbols(latex[: fraction.start()]) + wider + symbols(latex[fraction.end() :])
    matrix = re.search(r"\\begin\{(\w*matrix)\}(.*?)\\end\{\1\}", latex, re.DOTALL)
    if matrix:
        widest = max(symbols(row.replace("&", "  ")) for row in matrix[2].split(r"\\"))
        return symbols(latex[: matrix.start()]) + widest + 2 + symbols(latex[matrix.end() :])
    raised = re.findall(r"[\^_]\{([^{}]*)\}", latex)
    flat = re.sub(r"[\^_]\{[^{}]*\}", "", latex)
    return _width(flat) + 0.6 * sum(map(_width, raised))


def _width(flat: str) -> float:
    tokens = [token for token in _TOKEN.findall(flat) if not _WITHOUT_WIDTH.fullmatch(token)]
    return len(tokens) + 1.2 * sum(token in _OPERATORS for token in tokens)
