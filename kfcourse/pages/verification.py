"""Statements that are verified where they are printed: the check is the print, and it raises.

::

    verified((p, Psi - K*S*Psi), where={p: p_k, K: K_k})     equations: printed, and shown to hold
    claim("The gain tends to 0.62.", abs(K - 0.62) < 0.005)   a sentence, printed if it holds
    agree("Formula and filter agree.", a, b, within=1e-12)
        a sentence about numbers that are equal within a tolerance
    typeset((p, p_k))   equations that define something: printed, and said to

A printed equation carries a mark that says how it was verified.  The build of the book counts the
marks and lists them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.symbolic.typesetting import Equation, Side, equation_latex
from kfcourse.symbolic.writing import by_thousands, number_latex

VERIFIED = "application/vnd.kfcourse.verified+json"  # what the build collects
DEFINITION = "definition"
_SEED = 53


class Unverified(AssertionError):
    """A statement of a page does not hold; the message says what is left."""


class Shown:
    """What a cell displays: Markdown with formulas, and the record of what was verified."""

    def __init__(self, markdown: str, record: Mapping[str, Any] | None = None) -> None:
        self.markdown = markdown
        self.record = record

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, Any]:
        shown: dict[str, Any] = {"text/markdown": self.markdown, "text/plain": self.markdown}
        return shown | ({VERIFIED: dict(self.record)} if self.record else {})


def verified(
    *equations: Equation,
    where: Mapping[Any, Any] | None = None,
    digits: int | None = None,
    label: str | None = None,
    how: str | None = None,
    names: Mapping[Any, str] | None = None,
) -> Shown:
    """Equations, printed as they stand, each shown to hold: left - right = 0.

    Parameters
    ----------
    *equations : (left, right, ...)
        Sides that are equal: expressions or matrices of SymPy.  A side that is a string of LaTeX is
        printed and not checked, so at least two others are needed then.  Where all sides print
        alike a string before them must say what they are.  A function that returns the equations,
        `lambda: [(p, Psi - K*S*Psi)]`, has its terms and factors printed in the order in which
        they stand there.
    where : mapping of symbols to expressions
        What printed symbols stand for (a `MatrixSymbol`: its entries); put in before the difference
        is taken, as often as it takes.
    digits : int, optional
        Compare numbers instead, at three points that are drawn, positive for positive symbols, to
        so many digits: for integrals and sums that SymPy does not take.
    label : str, optional
        The equations get a number, and {eq}`label` refers to it.
    how : str, optional
        What the mark says besides, for instance "for every S".
    names : mapping of symbols to LaTeX, optional
        How symbols are printed.

    Raises
    ------
    Unverified
        If a difference does not vanish; the message shows it.
    """
    if not equations:
        raise ValueError("verified() needs an equation: verified((left, right))")
    given = _given(equations)
    for sides in given:
        expressions = [sp.sympify(side) for side in sides if not isinstance(side, str)]
        if len(expressions) < 2:
            raise ValueError(
                f"nothing to verify in {sides}: two sides that are not strings are needed; to "
                f"print a definition, typeset()"
            )
        if "&=" not in equation_latex(sides, names):
            raise ValueError(
                f"the sides of {sides} are printed alike: say what both sides are, in a string "
                f"before them"
            )
        for left, right in pairwise(expressions):
            if digits is None:
                _must_vanish(left, right, where or {})
            else:
                _must_agree(left, right, where or {}, digits)
    evidence = "identity, by SymPy" if digits is None else f"to {digits} digits, at 3 points"
    mark = f"{evidence}; {how}" if how else evidence
    return _shown(given, names, f'verified">✓ {mark}', label=label, how=mark, equations=len(given))


def typeset(
    *equations: Equation | str,
    label: str | None = None,
    names: Mapping[Any, str] | None = None,
    what: str = DEFINITION,
) -> Shown:
    """Equations that are not verified, printed as `verified` prints them; under them stands what
    they are."""
    given = _given(equations)
    return _shown(given, names, f'said">{what}', label=label, how=what, equations=0)


def claim(sentence: str, *conditions: Any) -> Shown:
    """A sentence (Markdown), printed if every condition holds; arrays hold when all their entries
    do.

    Raises
    ------
    Unverified
        If one does not: the sentence, and which condition.
    """
    if not conditions:
        raise ValueError("claim() needs a condition besides its sentence")
    for number, condition in enumerate(conditions, start=1):
        if not np.all(condition):
            raise Unverified(
                f"this does not hold (condition {number} of {len(conditions)}): {sentence}"
            )
    return _holds(sentence)


def agree(
    sentence: str, computed: Any, expected: Any, within: float, relative: bool = True
) -> Shown:
    """A sentence (Markdown), printed if two arrays of numbers agree within a tolerance.

    |`computed` - `expected`| <= `within` * max|`expected`|,   without the last factor if not
    `relative`

    Raises
    ------
    Unverified
        If they do not, or are not finite, or have different shapes: the sentence, and the largest
        difference.
    """
    computed, expected = np.asarray(computed, float), np.asarray(expected, float)
    if computed.shape != expected.shape and 1 not in (computed.size, expected.size):
        raise Unverified(
            f"arrays of shapes {computed.shape} and {expected.shape} are compared: {sentence}"
        )
    difference = np.max(np.abs(computed - expected))
    bound = within * (np.max(np.abs(expected)) if relative else 1)
    if not difference <= bound:  # a NaN is no agreement
        raise Unverified(f"differs by {difference:.3g}, more than {bound:.3g}: {sentence}")
    return _holds(sentence)


_MINUS = re.compile(r"(?<![^\s(])-(?=\d)")
_NO_WORDS = re.compile(r"(\$[^$]*\$|`[^`]*`)")  # formulas and code in a sentence
_POWER_OF_TEN = re.compile(r"(?<![\w.])\d(?:\.\d+)?e[-+]\d+(?!\w)")


def _holds(sentence: str) -> Shown:
    # as the book writes it; Python's format leaves no space
    sentence = re.sub(r"(?<=\d)%", "\u00a0%", sentence)
    parts = _NO_WORDS.split(sentence)
    parts[::2] = (
        by_thousands(
            _POWER_OF_TEN.sub(
                lambda number: f"${number_latex(float(number[0]))}$", _MINUS.sub("−", text)
            )
        )
        for text in parts[::2]
    )
    sentence = "".join(parts)
    return Shown(
        f'{sentence}\u00a0<span class="kf-claim">✓</span>', {"sentence": sentence, "equations": 0}
    )


def _given(equations: Sequence[Any]) -> list[tuple[Side, ...]]:
    if not callable(equations[0]):
        return [(each,) if isinstance(each, str) else tuple(each) for each in equations]
    with sp.evaluate(False):
        return [tuple(map(_as_written, sides)) for sides in equations[0]()]


def _as_written(side: Side) -> Side:
    """Sums of sums are sums, and so are products."""
    if isinstance(side, str):
        return side
    return sp.UnevaluatedExpr(
        side.replace(
            lambda part: part.func in (sp.Add, sp.Mul),
            lambda part: part.func(*sum(map(part.func.make_args, part.args), ())),
        )
    )


def _must_vanish(left: Any, right: Any, where: Mapping[Any, Any]) -> None:
    rest = difference(left, right, where)
    if any(entry != 0 for entry in rest):
        remains = rest[0] if len(rest) == 1 else rest
        raise Unverified(
            f"the two sides differ\n  left:  {left}\n  right: {right}\n  left - right = {remains}"
        )


def _must_agree(left: Any, right: Any, where: Mapping[Any, Any], digits: int) -> None:
    left, right = _substituted(left, where), _substituted(right, where)
    unit = sp.Float(10) ** -digits
    free = sorted((left.free_symbols | right.free_symbols), key=str)
    for point in _points(free):
        first, second = (sp.N(side.subs(point).doit(), digits + 15) for side in (left, right))
        if not (first.is_number and second.is_number):
            raise ValueError(f"at {point} no number is left but {first} and {second}")
        if not abs(first - second) <= unit * max(abs(first), abs(second), unit):
            numbers = f"the left side is {sp.N(first, digits)}, the right {sp.N(second, digits)}"
            raise Unverified(f"at {point} {numbers}\n  left:  {left}\n  right: {right}")


def difference(left: Any, right: Any, where: Mapping[Any, Any] | None = None) -> list[sp.Expr]:
    """left - right, entry by entry, with the symbols of `where` replaced, as simple as SymPy makes
    it."""
    left, right = _substituted(left, where or {}), _substituted(right, where or {})
    if getattr(left, "shape", ()) != getattr(right, "shape", ()):
        raise Unverified(
            f"a side of shape {getattr(left, 'shape', ())} cannot equal one of shape "
            f"{getattr(right, 'shape', ())}"
        )
    rest = left - right
    return [
        _simple(entry) for entry in (rest.as_explicit() if hasattr(rest, "as_explicit") else [rest])
    ]


def _substituted(side: Any, where: Mapping[Any, Any]) -> Any:
    side = sp.sympify(side)
    matrices = {
        name: sp.sympify(value).as_explicit()
        for name, value in where.items()
        if isinstance(name, sp.MatrixSymbol)
    }
    others = {name: value for name, value in where.items() if name not in matrices}
    for _ in range(len(where)):  # definitions may use each other
        # subs takes no matrices all at once
        replaced = side.xreplace(matrices).subs(others, simultaneous=True)
        if replaced == side:
            break
        side = replaced
    return side.doit()


def _simple(expression: sp.Expr) -> sp.Expr:
    """Zero if SymPy can show it; sums of logarithms vanish when the product under them is one."""
    if expression.is_rational_function():
        return sp.cancel(expression)
    rest = sp.expand(expression)
    if rest != 0:
        rest = sp.simplify(rest)
    if rest != 0 and rest.has(sp.log):
        others, logarithms = sp.expand_log(sp.expand(rest), force=True).as_independent(
            sp.log, as_Add=True
        )
        if sp.simplify(sp.exp(2 * logarithms)) == 1:
            rest = sp.simplify(others)
    return rest


def _points(symbols: Sequence[sp.Symbol]) -> list[dict[sp.Symbol, sp.Rational]]:
    draw = np.random.default_rng(_SEED)
    return [
        {
            symbol: sp.Rational(
                int(draw.integers(3, 30)) * (1 if symbol.is_positive else draw.choice([-1, 1])), 16
            )
            for symbol in symbols
        }
        for _ in range(3)
    ]


def _shown(
    given: Sequence[Equation], names: Mapping[Any, str] | None, below: str, **record: Any
) -> Shown:
    lines = " \\\\[3pt]\n".join(equation_latex(sides, names=names) for sides in given)
    block = f"\\begin{{aligned}}\n{lines}\n\\end{{aligned}}"
    number = f" ({label})" if (label := record["label"]) else ""
    return Shown(f'$$\n{block}\n$${number}\n\n<p class="kf-{below}</p>', record | {"latex": block})
