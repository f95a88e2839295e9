"""What people write of a model, checked and read: names, numbers, formulas, laws.

`Model` and `ContinuousModel` are built from these; whatever does not fit is a `ModelError` that
says what to change.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from numbers import Real
from typing import Any, TypeAlias

import numpy as np
import sympy as sp

from kfcourse.errors import ModelError
from kfcourse.laws import Array, Gaussian, is_covariance
from kfcourse.symbolic.formula import check_name, parse, symbol

Formula: TypeAlias = str | sp.Expr
Formulas: TypeAlias = Formula | Sequence[Formula] | sp.MatrixBase
Names: TypeAlias = Sequence[str]


def by_name(*groups: Sequence[sp.Symbol]) -> dict[str, sp.Symbol]:
    """Symbols by their names."""
    return {s.name: s for group in groups for s in group}


def numbered(name: str, size: int) -> list[str]:
    """The name itself if it is of one, else with 1, 2, ... behind it."""
    return [name] if size == 1 else [f"{name}{i + 1}" for i in range(size)]


def fresh(name: str, taken: Collection[str]) -> sp.Symbol:
    """A symbol of that name, with underscores if it is taken."""
    while name in taken:
        name += "_"
    return symbol(name)


def normal_symbols(
    n: int, mean: str, cov: str, taken: Collection[str]
) -> tuple[sp.ImmutableMatrix, sp.ImmutableMatrix]:
    """Symbols of a mean (n, 1) and a symmetric covariance (n, n): z, p or z1, z2, ..., p11, p12,
    ..., with underscores if they are taken."""

    def of_pair(i: int, j: int) -> sp.Symbol:
        return fresh(cov if n == 1 else f"{cov}{min(i, j) + 1}{max(i, j) + 1}", taken)

    means = [fresh(name, taken) for name in numbered(mean, n)]
    return sp.ImmutableMatrix(means), sp.ImmutableMatrix(n, n, of_pair)


def parameter_values(given: Mapping[str, Any] | None) -> dict[str, sp.Rational]:
    """Parameters by name, exactly."""
    return {
        check_name(name): exact_number(f"parameter {name}", value)
        for name, value in table("parameters", given).items()
    }


def shown(value: Any) -> str:
    """What people wrote, for a message: not too long, and any number (Python prints none of more
    than 4300 digits)."""
    try:
        text = repr(value)
    except ValueError:
        text = "numbers of thousands of digits"
    return text if len(text) <= 80 else f"{text[:77]}..."


def table(
    what: str, given: Mapping[str, Any] | None, keys: Collection[str] | None = None
) -> dict[str, Any]:
    """A table that may have been left out, with no other keys than these."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise ModelError(f"`{what}` must be a table such as {{'name': value}}, got {shown(given)}")
    if keys is not None and (unknown := sorted(set(given) - {*keys})):
        raise ModelError(f"`{what}` has the keys {', '.join(keys)}, not {', '.join(unknown)}")
    return dict(given)


def exact_number(what: str, value: Any) -> sp.Rational:
    """The decimal number a person typed, exactly: 0.9 is 9/10."""
    number = numbers(value)
    if not isinstance(value, Real) or not (number == 0 or 1e-100 < abs(number) < 1e100):
        raise ModelError(
            f"{what} = {shown(value)}: expected a finite number, of a size from 1e-100 to 1e100; "
            "change the units where it is another"
        )
    return sp.Rational(str(value))


def exact_matrix(array: Array) -> sp.ImmutableMatrix:
    """Decimal numbers as exact rationals; a vector becomes a column."""
    return sp.ImmutableMatrix(np.vectorize(lambda v: sp.Rational(str(v)), otypes=[object])(array))


def formula_list(what: str, formulas: Formulas) -> list[Formula]:
    """One formula or several as a list."""
    several = isinstance(formulas, Sequence | sp.MatrixBase) and not isinstance(formulas, str)
    result = list(formulas) if several else [formulas]
    if not result or not all(isinstance(formula, str | sp.Expr) for formula in result):
        raise ModelError(f"`{what}` must be a formula or a list of formulas, got {shown(formulas)}")
    return result


def read(formula: Formula, known: dict[str, sp.Symbol], what: str) -> sp.Expr:
    """A formula as an expression in the known symbols."""
    if isinstance(formula, str):
        return parse(formula, known)
    # Symbols of the caller are recognised by name, whatever their assumptions.
    unknown = sorted({s.name for s in formula.free_symbols} - set(known))
    if unknown:
        raise ModelError(
            f"the {what} equation {formula} has unknown symbols {', '.join(unknown)}; known: "
            f"{', '.join(known)}"
        )
    return formula.subs({s: known[s.name] for s in formula.free_symbols})


def law(what: str, given: Mapping[str, Any] | None, size: int) -> Gaussian:
    """A Gaussian from {"mean": ..., "variance": ...}; standard normal for what is left out."""
    parts = table(what, given, ("mean", "variance"))
    mean, cov = numbers(parts.get("mean", 0.0)), numbers(parts.get("variance", 1.0))
    try:
        mean = np.broadcast_to(mean, (size,)).copy()
        cov = cov.copy() if cov.ndim == 2 else np.diag(np.broadcast_to(cov, (size,)))
        fits = cov.shape == (size, size) and bool(np.isfinite([mean, *cov]).all())
    except ValueError:
        fits = False
    if not (fits and np.array_equal(cov, cov.T) and is_covariance(cov)):
        raise ModelError(
            f"`{what}`: the mean must be {size} finite number(s), the variance a number, {size} "
            f"numbers or a symmetric {size} x {size} matrix, with no negative variance; got "
            f"{', '.join(f'{key} = {shown(value)}' for key, value in parts.items())}"
        )
    return Gaussian(mean, cov)


def numbers(given: Any) -> Array:
    """Numbers as an array; NaN for what is none.  NumPy would take "1e5" for 100000, and true for
    1."""
    try:
        array = np.asarray(given)
        return array.astype(float) if array.dtype.kind in "iufO" else np.array(np.nan)
    except (TypeError, ValueError, OverflowError):
        return np.array(np.nan)
