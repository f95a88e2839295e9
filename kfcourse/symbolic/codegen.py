"""SymPy expressions as NumPy functions over the ensemble, by `sympy.lambdify`: the only place where
formulas become code."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
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


# A list is a vector's entries.
Entries: TypeAlias = Sequence[sp.Expr] | sp.MatrixBase | sp.NDimArray
Compiled: TypeAlias = Callable[..., tuple[Array, ...]]


def compile_function(arguments: Sequence[Entries], outputs: Sequence[Entries]) -> Compiled:
    """Compile expressions into one function of arrays.

    Parameters
    ----------
    arguments : sequence
        The symbols that each argument holds: a list of them is a vector (..., n), a matrix is (...,
        r, c).
    outputs : sequence
        The expressions of each output, likewise; the function returns arrays as a tuple.

    Returns
    -------
    callable
        Leading axes of its arrays broadcast.  A vector has those of all arguments, a matrix those
        of the arguments that enter the matrix, and what no argument enters has none.

    Raises
    ------
    ModelError
        No real number, a number beyond floats, a symbol that is no argument.
    """
    return _compiled(
        *(tuple(map(sp.ImmutableDenseNDimArray, each)) for each in (arguments, outputs))
    )


# the modes of a model, and models that differ in one noise, share an equation
@lru_cache(maxsize=256)
def _compiled(arguments: tuple[sp.NDimArray, ...], outputs: tuple[sp.NDimArray, ...]) -> Compiled:
    places = [
        (number, index)
        for number, symbols in enumerate(arguments)
        for index in np.ndindex(*symbols.shape)
    ]
    # Names of our own: no name of a formula reaches the code.  SymPy sorts by them, and sums are
    # rounded in that order: covariances before means, noises before states.
    names = [sp.Symbol(f"a{i:04}", real=True) for i in range(len(places), 0, -1)]
    renamed = {
        arguments[number][index]: name for (number, index), name in zip(places, names, strict=True)
    }
    entries, parts = [], []
    for output in outputs:
        check_numbers("a generated function", output)
        if unknown := output.free_symbols - renamed.keys():
            raise ModelError(
                f"the symbol {min(map(str, unknown))} is neither an argument nor defined; give it "
                f"a value, or make it an argument"
            )
        constant, varying = np.zeros(tuple(map(int, output.shape))), []
        for index in np.ndindex(*constant.shape):
            if output[index].is_number:
                constant[index] = float(output[index])
            else:
                varying.append(index)
                entries.append(_in_floats(output[index].xreplace(renamed)))
        parts.append((constant, varying))
    numeric = sp.lambdify(names, entries, ["scipy", "numpy"], cse=_shared)

    def function(*arrays: Array) -> tuple[Array, ...]:
        columns = (arrays[number][(..., *index)] for number, index in places)
        values = iter(numeric(*columns))
        leads = [
            array.shape[: array.ndim - len(symbols.shape)]
            for array, symbols in zip(arrays, arguments, strict=True)
        ]
        return tuple(_assembled(*part, values, leads) for part in parts)

    return function


def _assembled(
    constant: Array,
    varying: list[Any],
    values: Iterator[Array],
    leads: list[tuple[int, ...]],
) -> Array:
    """An output, its entries that vary from the iterator: a vector has the leading axes of all
    arguments, a matrix those of its entries."""
    entries = [next(values) for _ in varying]
    lead = np.broadcast_shapes(*(leads if constant.ndim == 1 else map(np.shape, entries)))
    if entries and constant.size == 1:  # no copy of the one component
        return np.broadcast_to(entries[0], lead)[(..., *(None for _ in constant.shape))]
    result = np.empty((*lead, *constant.shape))
    result[...] = constant
    for index, entry in zip(varying, entries, strict=True):
        result[..., *index] = entry
    return result


def _in_floats(expression: sp.Expr) -> sp.Expr:
    """With floats for fractions of numbers that a 64-bit integer does not hold: NumPy would take
    these for objects."""
    numbers = expression.atoms(sp.Rational)
    return expression.xreplace({n: sp.Float(n, 17) for n in numbers if max(abs(n.p), n.q) > 2**53})


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
            f"{name}: no finite real value, as after a division by 0 or a root of a negative "
            "number; change the parameters, or, if so at the mean of a noise, take "
            "unscented(model) or gauss_hermite(model), or another mean"
        )
    for number in formulas.atoms(sp.Rational, sp.Float):
        if number and not 2.0**-1022 <= abs(number) < 2**1023:
            raise ModelError(
                f"{name}: it holds the number {sp.N(number, 3)!s}, beyond what a float can be; "
                "change the units"
            )
