"""SymPy expressions as NumPy functions over the ensemble, by `sympy.lambdify`: the only place where
formulas become code."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import compress, product
from typing import Any

import numpy as np
import sympy as sp
from sympy.codegen.rewriting import create_expand_pow_optimization

from kfcourse.errors import ModelError
from kfcourse.laws import Array
from kfcourse.symbolic.formula import MAX_DEGREE, NO_NUMBERS

# NumPy takes 50 times as long for x**3 as for x*x*x.
_as_products = create_expand_pow_optimization(MAX_DEGREE)


@dataclass(frozen=True)
class Compiled:
    """A generated function of arrays, and the source of its formulas."""

    function: Callable[..., tuple[Array, ...]]
    source: str


def compile_function(
    name: str,
    arguments: Mapping[str, sp.MatrixBase],
    outputs: Mapping[str, sp.MatrixBase],
    vectors: Sequence[str],
) -> Compiled:
    """Compile expressions into one function of arrays.

    Parameters
    ----------
    name : str
        What the function is called in its source.
    arguments : dict
        Argument name to the matrix of symbols that the argument holds.
    outputs : dict
        Output name to the matrix of expressions; the function returns them as a tuple in this
        order.
    vectors : sequence of str
        Arguments and outputs that are vectors (..., n); the others are matrices (..., r, c).

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
    matrices = (
        tuple((key, sp.ImmutableMatrix(m)) for key, m in given.items())
        for given in (arguments, outputs)
    )
    return _compiled(name, *matrices, tuple(vectors))


# the modes of a model, and models that differ in one noise, share an equation
@lru_cache(maxsize=256)
def _compiled(
    name: str,
    arguments: tuple[tuple[str, sp.ImmutableMatrix], ...],
    outputs: tuple[tuple[str, sp.ImmutableMatrix], ...],
    vectors: tuple[str, ...],
) -> Compiled:
    # Symbols get names of our own, such as z_1 and p_12: no name of a formula reaches the code.
    places: dict[sp.Symbol, tuple[sp.Symbol, int, Any]] = {}
    for number, (key, matrix) in enumerate(arguments):
        for i, j in product(*map(range, matrix.shape)):
            index = (i,) if key in vectors else (i, j)
            text = "".join(str(k + 1) for k in index)
            places.setdefault(matrix[i, j], (sp.Symbol(f"{key}_{text}", real=True), number, index))
    for _, matrix in outputs:
        check_numbers(name, matrix)
        if unknown := matrix.free_symbols - places.keys():
            raise ModelError(
                f"{name}: the symbol {min(map(str, unknown))} is neither an argument nor defined; "
                "give it a value, or make it an argument"
            )
    renamed = {key: place[0] for key, place in places.items()}
    entries = [
        _in_floats(entry.xreplace(renamed))
        for _, matrix in outputs
        for entry in matrix
        if not entry.is_number
    ]
    used = set().union(*(entry.free_symbols for entry in entries))
    taken = [place for place in places.values() if place[0] in used]
    formulas = sp.lambdify(
        [symbol for symbol, *_ in taken], entries, ["scipy", "numpy"], cse=_shared
    )
    assembled = [_assembler(matrix, key in vectors, arguments) for key, matrix in outputs]

    def function(*arrays: Array) -> tuple[Array, ...]:
        values = iter(formulas(*(arrays[number][(..., *index)] for _, number, index in taken)))
        leads = [
            array.shape[: -1 if key in vectors else -2]
            for array, (key, _) in zip(arrays, arguments, strict=True)
        ]
        return tuple(assemble(values, leads) for assemble in assembled)

    return Compiled(function, inspect.getsource(formulas).replace("_lambdifygenerated", name))


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


def check_numbers(name: str, matrix: sp.MatrixBase) -> None:
    """ModelError if expressions hold what is no real number, or a number beyond floats."""
    if matrix.has(*NO_NUMBERS):
        raise ModelError(
            f"{name}: no finite real value, as something is divided by 0, or the root of a "
            "negative number taken; change the parameters, or, if so at the mean of a noise, take "
            "unscented(model) or gauss_hermite(model), or another mean"
        )
    for number in matrix.atoms(sp.Rational, sp.Float):
        if number and not 2.0**-1022 <= abs(number) < 2**1023:
            raise ModelError(
                f"{name}: it holds the number {sp.N(number, 3)!s}, beyond what a float can be; "
                "change the units"
            )


def _assembler(
    matrix: sp.ImmutableMatrix,
    is_vector: bool,
    arguments: tuple[tuple[str, sp.ImmutableMatrix], ...],
) -> Callable[[Any, list[tuple[int, ...]]], Array]:
    """Puts the entries of one output together, the values of those that vary from an iterator."""
    indices = [(i,) if is_vector else (i, j) for i, j in product(*map(range, matrix.shape))]
    constant = np.zeros(matrix.shape[:1] if is_vector else matrix.shape)
    varying = []
    for index, entry in zip(indices, matrix, strict=True):
        if entry.is_number:
            constant[index] = float(entry)
        else:
            varying.append(index)
    enter = [is_vector or bool(m.free_symbols & matrix.free_symbols) for _, m in arguments]

    def assemble(values: Any, leads: list[tuple[int, ...]]) -> Array:
        lead = np.broadcast_shapes(*compress(leads, enter))
        if varying and constant.size == 1:  # no copy of the one component
            value = np.broadcast_to(next(values), lead)
            return value[(..., *(None for _ in constant.shape))]
        result = np.empty(lead + constant.shape)
        result[...] = constant
        for index in varying:
            result[(..., *index)] = next(values)
        return result

    return assemble
