"""The third printer: the straight-line programs of `codegen.lower` as loops that numba compiles (`pip install kfcourse[fast]`).

::

    loop("step", {"y": y, "z": z}, Pass({"next": a*z + g*y}, [a, g]))

prints a function of one pass over an ensemble of scalars,

::

    step(c, y, z, next):    for each i:  next[i] from y[i], z[i] and the constants c,

where NumPy needs a pass for each operation.  The text is kept as a module in the user's cache, where numba keeps the machine
code beside it: a function made in memory would be compiled anew by every process.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from hashlib import sha256
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from textwrap import indent
from types import ModuleType
from typing import NamedTuple

import sympy as sp
from sympy.core.relational import Relational

from kfcourse.files import save
from kfcourse.symbolic.codegen_old import NumbersPrinter, Program, printed
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model

REMEDY = "compiled=True needs numba: pip install 'kfcourse[fast]', or leave it out"
NAN = sp.Symbol("nan")  # what a formula gives where it has no value
_CALLED = '@njit("void({})", cache=True, nogil=True, error_model="numpy")'  # by Python
_PASSED = '@cfunc("void({})", cache=True, error_model="numpy")'  # by compiled functions, which get its address
_HEADER = '''"""Printed by kfcourse.symbolic.compiled; it may be removed at any time."""

import numpy as np
from numba import cfunc, njit

nan = np.nan
'''


def is_scalar(model: Model | JumpModel) -> bool:
    """Whether loops over numbers are all that a model needs: one state, one measurement, no angles, no step, no modes."""
    return isinstance(model, Model) and model.n == model.p == 1 and not model.timed and not (model.angles.x or model.angles.y)


class _Printer(NumbersPrinter):
    """One number at a time: cases and comparisons as Python has them."""

    def _print_Piecewise(self, expr: sp.Piecewise) -> str:
        *cases, last = expr.args
        text = "".join(f"{self._print(one.expr)} if {self._print(one.cond)} else " for one in cases)
        return f"({text}{self._print(last.expr) if last.cond == sp.true else 'nan'})"

    def _print_Relational(self, expr: Relational) -> str:
        return f"({self._print(expr.lhs)} {expr.rel_op} {self._print(expr.rhs)})"

    def _print_And(self, expr: sp.And) -> str:
        return "(" + " and ".join(map(self._print, expr.args)) + ")"

    def _print_Or(self, expr: sp.Or) -> str:
        return "(" + " or ".join(map(self._print, expr.args)) + ")"

    def _print_Max(self, expr: sp.Max) -> str:
        return f"max({', '.join(map(self._print, expr.args))})"

    def _print_Min(self, expr: sp.Min) -> str:
        return f"min({', '.join(map(self._print, expr.args))})"


class Pass(NamedTuple):
    """What one pass over arrays makes.

    Attributes
    ----------
    made : dict
        Name of an array, (N,), to the expression that is written into it, which may be an array that is given.
    constants : sequence of Symbol
        Numbers that are the same for all entries: the first of the array c, in this order.
    definitions : dict
        Auxiliary symbols that the expressions may use.
    """

    made: Mapping[str, sp.Expr]
    constants: Sequence[sp.Symbol]
    definitions: Mapping[sp.Symbol, sp.Expr] = {}


def loop(name: str, given: Mapping[str, sp.Symbol], one: Pass) -> str:
    """A function `name(c, given arrays, made arrays)` of one loop over their entries, as text.

    Parameters
    ----------
    name : str
    given : dict
        Name of an array, (N,), to the symbol of its entries.
    one : Pass
    """
    return _function(name, ["c", *{**given, **one.made}], _CALLED) + _body(given, one)


def choice(name: str, given: Mapping[str, sp.Symbol], made: Sequence[str], passes: Sequence[Pass]) -> str:
    """A function `name(number, c, given arrays, made arrays)` of several loops, for others to call; the number says which.

    A pass need not make all arrays that are made, and may make given ones anew.  One function for all compiles faster than
    one for each.
    """
    cases = "".join(f"    if number == {i}:\n{indent(_body(given, one), '    ')}" for i, one in enumerate(passes))
    return _function(name, ["number", "c", *given, *made], _PASSED) + cases


def _function(name: str, arguments: Sequence[str], decorator: str) -> str:
    signature = ", ".join("int64" if one == "number" else "float64[::1]" for one in arguments)
    return f"\n\n{decorator.format(signature)}\ndef {name}({', '.join(arguments)}):\n"


def _body(given: Mapping[str, sp.Symbol], one: Pass) -> str:
    outputs = {made: sp.ImmutableMatrix([value]) for made, value in one.made.items()}
    return printed(lambda program: _text(given, program, one.constants), outputs, (), one.definitions)


def _text(given: Mapping[str, sp.Symbol], program: Program, constants: Sequence[sp.Symbol]) -> str:
    used, assignments, values = _assignments(program, constants, {f"{array}_i": entry for array, entry in given.items()})
    lines = [f"    c{i} = c[{i}]  # {letter}" for i, letter in enumerate(constants) if letter in used]
    lines += [f"    for i in range(len({next(iter(given))})):"]
    lines += [f"        {array}_i = {array}[i]" for array, entry in given.items() if entry in used]
    lines += [f"        {line}" for line in assignments]
    lines += [f"        {output}[i] = {value}" for output, value in values.items()]
    return "\n".join([*lines, ""])


def _assignments(
    program: Program, constants: Sequence[sp.Symbol], given: Mapping[str, sp.Symbol]
) -> tuple[set[sp.Basic], list[str], dict[str, str]]:
    """The symbols that a program uses, its lines, and the text of each output."""
    entries = {output: matrix[0] for output, matrix in program.outputs.items()}
    used = set().union(*(e.free_symbols for e in (*(value for _, value in program.assignments), *entries.values())))
    names = {target: f"s{i}" for i, (target, _) in enumerate(program.assignments)} | {NAN: "nan"}
    names |= {one: f"c{i}" for i, one in enumerate(constants)} | {one: name for name, one in given.items()}
    printer = _Printer(names)
    lines = [f"{names[target]} = {printer.doprint(value)}" for target, value in program.assignments]
    return used, lines, {output: printer.doprint(entry) for output, entry in entries.items()}


@lru_cache(maxsize=256)
def load(*functions: str) -> ModuleType:
    """The module of these functions, compiled, or read from the user's cache if they have been compiled before.

    Raises
    ------
    ImportError
        There is no numba.
    """
    import numba
    from platformdirs import user_cache_path

    text = _HEADER + "".join(functions)
    name = f"kfcourse_{sha256((text + numba.__version__).encode()).hexdigest()[:20]}"
    place = Path(user_cache_path("kfcourse")) / "compiled" / f"{name}.py"
    if not place.exists():
        place.parent.mkdir(parents=True, exist_ok=True)
        save(text, place)
    spec = spec_from_file_location(name, place)
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module  # numba finds what it has kept by the module's name
    spec.loader.exec_module(module)
    return module


@contextmanager
def no_collection() -> Iterator[None]:
    """While compiling: few of the many new objects are garbage, and the collector would look through all of SymPy's, too."""
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()
