"""Is an answer the right one?  Comparison of formulas by value and of numbers to rounding.

A formula counts as equal if it takes the same values, to 30 digits, at several random points of
both signs: any equivalent form passes, and no simplification has to succeed.  Where it has floats,
as 2*np.pi or (1/3)*x, to their digits.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.symbolic.formula import symbol

DIGITS = 60  # of the values of formulas
# relative difference of equal formulas: half of the digits may be lost by cancellation
AGREE = sp.Float(10) ** -30
TYPED = 11  # characters of a decimal; more are not typed but computed
# of formulas with such numbers: 15 digits, of which terms that cancel may take three
FLOATS_AGREE = sp.Float(10) ** -12
POINTS = 6
ROUNDED = 1e-9  # relative size of an imaginary part that rounding explains


Places = Sequence[Mapping[sp.Symbol, sp.Expr]]


class Unusable(Exception):
    """An answer that cannot be compared; the message tells the student what was expected."""


def like(answer: Any, expected: Any) -> Any:
    """The answer in the form of the expected one: a formula, an array, a text, or a tuple of these.

    Raises
    ------
    Unusable
        It has another form; says which, and what was expected.
    """
    if isinstance(expected, tuple):
        if isinstance(answer, np.ndarray | sp.MatrixBase) and np.size(answer) == len(expected):
            # an array, or a column, of numbers or formulas
            answer = [entry for entry in np.ravel(np.asarray(answer))]
        elif isinstance(answer, np.ndarray) and answer.ndim and len(answer) == len(expected):
            answer = list(answer)
        if not isinstance(answer, tuple | list) or len(answer) != len(expected):
            raise Unusable(
                f"expected {len(expected)} results, `return a, b, ...`, got {describe(answer)}"
            )
        parts = []
        for place, (part, wanted) in enumerate(zip(answer, expected, strict=True), 1):
            try:
                parts.append(like(part, wanted))
            except Unusable as reason:
                raise Unusable(f"result {place} of {len(expected)}: {reason}") from None
        return tuple(parts)
    if isinstance(expected, str):
        if not isinstance(answer, str):
            raise Unusable(
                f"expected a text, in three quotes if it has several lines, got {describe(answer)}"
            )
        return str(answer)
    if isinstance(expected, sp.MatrixBase):
        return _formulas(answer, expected)
    if isinstance(expected, sp.Basic):
        return _formula(answer)
    return _array(answer, np.asarray(expected))


def _formula(answer: Any) -> sp.Expr:
    # in brackets of any kind
    if isinstance(answer, sp.MatrixBase | np.ndarray | list | tuple) and np.size(answer) == 1:
        answer = np.ravel(np.array(answer, dtype=object))[0]
    if isinstance(answer, bool | str) or not isinstance(answer, sp.Expr | int | float | np.number):
        raise Unusable(f"expected a formula in the symbols of the exercise, got {describe(answer)}")
    formula = sp.sympify(answer)
    if formula.has(sp.Derivative, sp.Integral):
        formula = formula.doit()
    if formula.has(sp.nan, sp.oo, -sp.oo, sp.zoo):
        raise Unusable("the formula is not finite: it contains NaN or infinity")
    # 0.9 typed for 9/10 is no mistake; 0.333333333333333 is what Python makes of 1/3
    return formula.replace(
        lambda e: e.is_Float and len(str(e).rstrip("0")) < TYPED, lambda e: sp.Rational(str(e))
    )


def _formulas(answer: Any, expected: sp.MatrixBase) -> sp.ImmutableMatrix:
    try:
        matrix = answer if isinstance(answer, sp.MatrixBase) else sp.Matrix(answer)
        # a list is a row as well
        if not isinstance(answer, sp.MatrixBase) and np.ndim(answer) == 1 and expected.rows == 1:
            matrix = matrix.T
    except (TypeError, ValueError, AttributeError):
        raise Unusable(
            f"expected a matrix of formulas with {expected.rows} rows and {expected.cols} "
            f"columns, got {describe(answer)}"
        ) from None
    if matrix.shape != expected.shape:
        raise Unusable(
            f"expected a matrix with {expected.rows} rows and {expected.cols} columns, got "
            f"{matrix.rows} x {matrix.cols}"
        )
    return sp.ImmutableMatrix(matrix.rows, matrix.cols, [_formula(entry) for entry in matrix])


def _array(answer: Any, expected: np.ndarray) -> np.ndarray:
    try:
        if isinstance(answer, bool | np.bool_ | None):
            raise TypeError
        if isinstance(answer, sp.MatrixBase) and expected.ndim < 2:
            answer = list(answer)
        array = np.asarray(answer)
        if array.dtype.kind == "c" and np.isfinite(array).all():
            if np.abs(array.imag).max(initial=0.0) > ROUNDED * np.abs(array).max(initial=0.0):
                raise Unusable("got complex numbers: was a root taken of something negative?")
            array = array.real
        if array.dtype.kind not in "biufO":
            raise TypeError
        array = array.astype(float)
    except (TypeError, ValueError, AttributeError):
        raise Unusable(f"expected {_wanted(expected)}, got {describe(answer)}") from None
    if array.shape != expected.shape:
        raise Unusable(f"expected {_wanted(expected)}, got the shape {array.shape}")
    if not np.isfinite(array[np.isfinite(expected)]).all():
        raise Unusable(
            "the result contains NaN or infinity: was something divided by zero, or a missing "
            "measurement used?"
        )
    return array


def _wanted(expected: np.ndarray) -> str:
    return f"an array of shape {expected.shape}" if expected.ndim else "a number"


def describe(value: Any) -> str:
    """A few words on what came instead."""
    if value is None:
        return "nothing (is `return` missing?)"
    if isinstance(value, np.ndarray):
        return f"an array{' of text' if value.dtype.kind in 'SU' else ''} of shape {value.shape}"
    if isinstance(value, tuple | list):
        return f"{type(value).__name__} of {len(value)}"
    return f"{type(value).__name__}"


def equal(
    first: Any, second: Any, tolerance: float, values: Mapping[sp.Symbol, Any], places: Places = ()
) -> bool:
    """Whether two answers of the same form are equal.

    `tolerance` is relative, for numbers; `values` are the parameters' values, for formulas in which
    they were put in, and `places` values of other symbols that have to be tried, in turn, in the
    place of random ones.
    """
    if isinstance(second, tuple):
        return all(
            equal(a, b, tolerance, values, places) for a, b in zip(first, second, strict=True)
        )
    if isinstance(second, str):
        return bool(first == second)
    if isinstance(second, sp.Basic | sp.MatrixBase):
        return np.shape(first) == np.shape(second) and equal_formulas(
            sp.flatten([first]), sp.flatten([second]), values, places
        )
    return first.shape == second.shape and bool(near(first, second, tolerance).all())


def near(first: np.ndarray, second: np.ndarray, tolerance: float) -> np.ndarray:
    """Where numbers are equal to a tolerance that is relative, also to the largest of all."""
    scale = np.max(np.abs(second[np.isfinite(second)]), initial=0.0)
    return np.isclose(first, second, rtol=tolerance, atol=tolerance * scale, equal_nan=True)


def equal_formulas(
    first: Sequence[sp.Expr],
    second: Sequence[sp.Expr],
    values: Mapping[sp.Symbol, Any],
    places: Places = (),
) -> bool:
    """Whether the formulas agree, pairwise, at random points.

    Symbols are told apart by name only.  Where the second side has no parameter as a symbol, the
    first's get their values. What cannot be evaluated is not equal.
    """
    try:
        sides = [[_renamed(f) for f in formulas] for formulas in (first, second)]
        floats = any(f.has(sp.Float) for side in sides for f in side)
        near = FLOATS_AGREE if floats else AGREE
        parameters = {symbol(s.name): value for s, value in values.items()}
        if parameters and not any(f.free_symbols & set(parameters) for f in sides[1]):
            sides[0] = [with_values(f, parameters) for f in sides[0]]
        signs = {s: -1 if value < 0 else 1 for s, value in parameters.items()}
        known, both = frozenset(signs.items()), all(map(_entire, sides[1]))
        for number in range(max(POINTS, len(places))):
            place = frozenset(places[number % len(places)].items() if places else ())
            for a, b in zip(*sides, strict=True):
                left, right = (_value(f, number, known, both, place) for f in (a, b))
                if not (left.is_number and right.is_number) or not abs(left - right) <= near * (
                    1 + abs(right)
                ):
                    return False
    except Exception:  # SymPy has many ways to stop at a formula that makes no sense
        return False
    return True


def depends(formula: sp.Expr) -> set[str]:
    """Names of the symbols on whose values a formula depends."""

    def changes(s: sp.Symbol) -> bool:  # the root of a square feels the sign alone
        return any(
            not equal_formulas([formula.xreplace({s: other})], [formula], {})
            for other in (s + 1, -s)
        )

    return {s.name for s in formula.free_symbols if changes(s)}


def with_values(formula: sp.Expr, values: Mapping[sp.Symbol, Any]) -> sp.Expr:
    """The formula with numbers in the place of parameters, which are told by their names."""
    numbers = {s.name: value for s, value in values.items()}
    return formula.xreplace(
        {s: sp.sympify(numbers[s.name]) for s in formula.free_symbols if s.name in numbers}
    )


# an answer is compared with many mistakes, and a mistake with many answers
@lru_cache(maxsize=20_000)
def _value(
    formula: sp.Expr,
    number: int,
    signs: frozenset[tuple[sp.Symbol, int]],
    both: bool,
    place: frozenset[tuple[sp.Symbol, sp.Expr]],
) -> sp.Expr:
    """The value at a random point: parameters with their own sign, other symbols of both signs, or
    positive only.

    Floats: powers of fractions would grow without bound.  The symbols of `place` have their values
    from there.
    """
    point = dict(place)  # exact, as Eq(k, 30) tells 30 from 30.0
    for s in formula.free_symbols - set(point):
        source = random.Random(f"{s.name}/{number}")
        sign = dict(signs).get(s, (1, -1, source.choice((1, -1)))[min(number, 2)] if both else 1)
        point[s] = sp.Float(
            sp.Rational(sign * source.randint(101, 397), source.randint(101, 397)), DIGITS
        )
    return sp.N(formula.xreplace(point), DIGITS)


def _entire(formula: sp.Expr) -> bool:
    """Whether a formula has no roots and the like: those differ in form where a variance becomes
    negative."""
    return not formula.has(sp.log, sp.Abs) and all(
        power.exp.is_integer for power in formula.atoms(sp.Pow)
    )


@lru_cache(maxsize=20_000)
def _renamed(formula: sp.Expr) -> sp.Expr:
    return formula.xreplace({s: symbol(s.name) for s in formula.free_symbols})
