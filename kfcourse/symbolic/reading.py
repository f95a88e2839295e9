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


def table(what: str, given: Mapping[str, Any] | None) -> dict[str, Any]:
    """A table that may have been left out."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise ModelError(f"`{what}` must be a table such as {{'name': value}}, got {shown(given)}")
    return dict(given)


def exact_number(what: str, value: Any) -> sp.Rational:
    """The decimal number a person typed, exactly: 0.9 is 9/10."""
    try:
        number = float(value) if isinstance(value, Real) else float("nan")
    except OverflowError:
        number = float("inf")
    if isinstance(value, bool) or not np.isfinite(number):
        raise ModelError(f"{what} = {shown(value)}: expected a finite number")
    if number and not 1e-100 < abs(number) < 1e100:
        raise ModelError(f"{what} = {shown(value)} is too large or too small; change the units")
    return sp.Rational(str(value))


def exact_matrix(array: Array) -> sp.ImmutableMatrix:
    """Decimal numbers as exact rationals; a vector becomes a column."""
    return sp.ImmutableMatrix(np.vectorize(lambda v: sp.Rational(str(v)), otypes=[object])(array))


def formula_list(what: str, formulas: Formulas) -> list[Formula]:
    """One formula or several as a list."""
    several = isinstance(formulas, Sequence | sp.MatrixBase) and not isinstance(formulas, str)
    result = list(formulas) if several else [formulas]
    if not result:
        raise ModelError(f"`{what}` holds no formula")
    for formula in result:
        if not isinstance(formula, str | sp.Expr):
            raise ModelError(
                f"`{what}` must be a formula or a list of formulas, got {shown(formula)}"
            )
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
    parts = table(what, given)
    if set(parts) - {"mean", "variance"}:
        raise ModelError(
            f"`{what}` has the keys mean and variance, not "
            f"{', '.join(sorted(set(parts) - {'mean', 'variance'}))}"
        )
    mean, cov = numbers(parts.get("mean", 0.0)), numbers(parts.get("variance", 1.0))
    try:
        mean = np.broadcast_to(mean, (size,)).copy()
        cov = cov.copy() if cov.ndim == 2 else np.diag(np.broadcast_to(cov, (size,)))
        fits = bool(np.isfinite(mean).all() and np.isfinite(cov).all())
    except ValueError:
        fits = False
    if not fits:
        raise ModelError(
            f"`{what}`: mean and variance must be finite numbers, or lists of {size} numbers "
            f"(variance: or a matrix), "
            f"got {', '.join(f'{key} = {shown(value)}' for key, value in parts.items())}"
        )
    problem = ""
    if cov.shape != (size, size):
        problem = f"the covariance has shape {cov.shape}, expected ({size}, {size})"
    elif not np.array_equal(cov, cov.T):
        problem = "the covariance matrix must be symmetric"
    elif not is_covariance(cov):
        problem = "negative variance"
    if problem:
        raise ModelError(f"`{what}`: {problem}, got {mean} and {cov.tolist()}")
    return Gaussian(mean, cov)


def numbers(given: Any) -> Array:
    """Numbers as an array; NaN for what is none.  NumPy would take "1e5" for 100000, and true for
    1."""

    def plain(part: Any) -> bool:
        if isinstance(part, Sequence) and not isinstance(part, str):
            return all(map(plain, part))
        return not isinstance(part, str | bool | np.bool_)

    try:
        return np.asarray(given if plain(given) else np.nan, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return np.array(np.nan)
