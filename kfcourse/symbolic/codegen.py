"""SymPy expressions as NumPy functions over the ensemble, by `sympy.lambdify`: the only place where
formulas become code."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
import sympy as sp
from sympy.codegen.rewriting import create_expand_pow_optimization

from kfcourse.errors import ModelError
from kfcourse.laws import Array
from kfcourse.symbolic.formula import MAX_DEGREE, NO_NUMBERS

# NumPy takes 50 times as long for x**3 as for x*x*x.
_as_products = create_expand_pow_optimization(MAX_DEGREE)


# A vector's entries, or a matrix.
Entries: TypeAlias = Sequence[sp.Expr] | sp.MatrixBase | sp.NDimArray


@dataclass(frozen=True)
class Compiled:
    """A generated function of arrays, and the source of its formulas."""

    function: Callable[..., tuple[Array, ...]]
    source: str


def compile_function(
    name: str, arguments: Mapping[str, Entries], outputs: Mapping[str, Entries]
) -> Compiled:
    """Compile expressions into one function of arrays.

    Parameters
    ----------
    name : str
        What the function is called in its source.
    arguments : dict
        Argument name to the symbols that the argument holds: a list of them is a vector (..., n), a
        matrix is (..., r, c).
    outputs : dict
        Output name to its expressions, likewise; the function returns arrays as a tuple in this
        order.

    Returns
    -------
    Compiled
        `function(*arrays)`: leading axes broadcast.  A vector has those of all arguments, a matrix
        those of the arguments that enter the matrix, and what no argument enters has none.

    Raises
    ------
    ModelError
        No real number, a number beyond floats, a symbol that is no argument.
    """
    given, wanted = (
        tuple((key, sp.ImmutableDenseNDimArray(formulas)) for key, formulas in of.items())
        for of in (arguments, outputs)
    )
    return _compiled(name, given, wanted)


# the modes of a model, and models that differ in one noise, share an equation
@lru_cache(maxsize=256)
def _compiled(
    name: str,
    arguments: tuple[tuple[str, sp.ImmutableDenseNDimArray], ...],
    outputs: tuple[tuple[str, sp.ImmutableDenseNDimArray], ...],
) -> Compiled:
    # Symbols get names of our own, such as z_1 and p_12: no name of a formula reaches the code.
    places: dict[sp.Symbol, tuple[sp.Symbol, int, Any]] = {}
    for number, (key, formulas) in enumerate(arguments):
        for index in np.ndindex(*formulas.shape):
            own = sp.Symbol(f"{key}_{''.join(str(i + 1) for i in index)}", real=True)
            places.setdefault(formulas[index], (own, number, index))
    renamed = {symbol: place[0] for symbol, place in places.items()}
    entries, parts = [], []
    for _, formulas in outputs:
        check_numbers(name, formulas)
        if unknown := formulas.free_symbols - places.keys():
            raise ModelError(
                f"{name}: the symbol {min(map(str, unknown))} is neither an argument nor defined; "
                "give it a value, or make it an argument"
            )
        constant, varying = np.zeros(tuple(map(int, formulas.shape))), []
        for index in np.ndindex(*constant.shape):
            if formulas[index].is_number:
                constant[index] = float(formulas[index])
            else:
                varying.append(index)
                entries.append(_in_floats(formulas[index].xreplace(renamed)))
        parts.append((constant, varying))
    numeric = sp.lambdify([*renamed.values()], entries, ["scipy", "numpy"], cse=_shared)

    def function(*arrays: Array) -> tuple[Array, ...]:
        values = iter(numeric(*(arrays[i][(..., *index)] for _, i, index in places.values())))
        leads = [
            array.shape[: array.ndim - len(formulas.shape)]
            for array, (_, formulas) in zip(arrays, arguments, strict=True)
        ]
        return tuple(_assembled(*part, values, leads) for part in parts)

    return Compiled(function, inspect.getsource(numeric).replace("_lambdifygenerated", name))


def _assembled(
    constant: Array,
    varying: list[tuple[int, ...]],
    values: Iterator[Array],
    leads: list[tuple[int, ...]],
) -> Array:
    """An output, its entries that vary from the iterator: a vector has the leading axes of all
    arguments, a matrix those of its entries."""
    entries = [next(values) for _ in varying]
    lead = np.broadcast_shapes(*(leads if constant.ndim == 1 else map(np.shape, entries)))
    if entries and constant.size == 1:  # no copy of the one component
        return np.broadcast_to(entries[0], lead)[(..., *(None for _ in constant.shape))]
    result = np.empty(lead + constant.shape)
    result[...] = constant
    for index, entry in zip(varying, entries, strict=True):
        result[(..., *index)] = entry
    return result


def _in_floats(expression: sp.Expr) -> sp.Expr:
    """With floats for fractions of numbers that a 64-bit integer does not hold: NumPy would take
    these for objects."""
    large = [
        number for number in expression.atoms(sp.Rational) if max(abs(number.p), number.q) > 2**53
    ]
    return expression.xreplace({number: sp.Float(number, 17) for number in large})


def _shared(
    expressions: Sequence[sp.Expr],
) -> tuple[list[tuple[sp.Symbol, sp.Expr]], list[sp.Expr]]:
    """Common subexpressions, and small integer powers as products."""
    assignments, reduced = sp.cse(expressions, symbols=sp.numbered_symbols("s"), list=False)
    return [(name, _as_products(e)) for name, e in assignments], [_as_products(e) for e in reduced]


def check_numbers(name: str, formulas: sp.Basic) -> None:
    """ModelError if expressions hold what is no real number, or a number beyond floats."""
    if formulas.has(*NO_NUMBERS):
        raise ModelError(
            f"{name}: no finite real value, as something is divided by 0, or the root of a "
            "negative number taken; change the parameters, or, if so at the mean of a noise, take "
            "unscented(model) or gauss_hermite(model), or another mean"
        )
    for number in formulas.atoms(sp.Rational, sp.Float):
        if number and not 2.0**-1022 <= abs(number) < 2**1023:
            raise ModelError(
                f"{name}: it holds the number {sp.N(number, 3)!s}, beyond what a float can be; "
                "change the units"
            )
