"""A scalar model's laws, of all its modes, printed as one small function that `panels` calls by its
address.

::

    law(which, points, y, c, x, mean, deviation)

fills mean and deviation at so many states x.  `which` is 2 j for the next state in mode j, 2 j + 1
for the measurement y, 2 J for the first state, and -1 - (i J + j) for the probability, in the place
of a mean, of a transition that depends on the state.  Parameters are read from c: the same formulas
with other numbers are compiled once.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from functools import lru_cache
from hashlib import sha256
from importlib.util import module_from_spec, spec_from_file_location
from itertools import count
from pathlib import Path
from textwrap import indent
from typing import Any

import numpy as np
import sympy as sp
from sympy.printing.pycode import PythonCodePrinter

from kfcourse.files import save
from kfcourse.filters.densities import Y, scalar_formulas
from kfcourse.laws import Array
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model

SHARPEST = 1e-7  # deviation of a prior without variance, in units of its mean, or of 1
HEADER = '''"""Printed by kfcourse.filters.exact.laws; it may be removed at any time."""

from math import *

from numba import cfunc

VALUES = "float64[::1]"
SIGNATURE = "void(int64, int64, float64, {0}, {0}, {0}, {0})".format(VALUES)


@cfunc(SIGNATURE, cache=True, error_model="numpy")
def law(which, points, y, c, x, mean, deviation):
'''


def modes_of(model: Model | JumpModel) -> Sequence[Model]:
    """The models of all modes: the model itself if it has none."""
    return model.modes if isinstance(model, JumpModel) else (model,)


def constants(model: Model | JumpModel, k: int) -> Array:
    """The array c of step k: the prior's mean and deviation, of each mode its parameters and what
    is known of the step, then the chain's."""
    (mean,), ((variance,),) = model.prior
    parts = [[mean, max(np.sqrt(variance), SHARPEST * max(abs(mean), 1.0))]]
    parts += [[*map(float, mode.values.values()), *mode.known.at(k)] for mode in modes_of(model)]
    if isinstance(model, JumpModel):
        parts.append([*model.known.at(k)])
    return np.array([value for part in parts for value in part])


def printed(model: Model | JumpModel) -> str:
    """The function's text; ModelError for a model that has no densities."""
    modes, entries = modes_of(model), count(2)
    cases: list[tuple[int, Sequence[sp.Expr]]] = [(2 * len(modes), sp.symbols("c[0] c[1]"))]

    def names(letters: Iterable[sp.Symbol]) -> dict[sp.Symbol, sp.Symbol]:
        """Symbols that are called as the next entries of c."""
        return {letter: _real(f"c[{next(entries)}]") for letter in letters}

    fixed = {modes[0].x[0]: _real("x[i]"), Y: _real("y")}
    of_modes = [fixed | names([*mode.values, *mode.known.symbols]) for mode in modes]
    for j, (mode, own) in enumerate(zip(modes, of_modes, strict=True)):
        mean, deviation, meter, meter_deviation = (
            part.xreplace(own) for part in scalar_formulas(mode)
        )
        cases += [(2 * j, [mean, deviation]), (2 * j + 1, [meter, meter_deviation])]
    if isinstance(model, JumpModel) and model.by_state:
        own = of_modes[0] | names(model.known.symbols)
        cases += [(-1 - i, [entry.xreplace(own), sp.S.Zero]) for i, entry in enumerate(model.chain)]
    return HEADER + "".join(_case(which, outputs) for which, outputs in cases)


def _real(name: str) -> sp.Symbol:
    return sp.Symbol(name, real=True)


def _case(which: int, outputs: Sequence[sp.Expr]) -> str:
    """One number at a time, of functions that numba knows."""
    printer = PythonCodePrinter({"fully_qualified_modules": False})
    branches = [part.rewrite((sp.sign, sp.Heaviside), sp.Piecewise) for part in outputs]
    shared, (mean, deviation) = sp.cse(branches, symbols=sp.numbered_symbols("s"))
    lines = [f"{name} = {printer.doprint(value)}" for name, value in shared]
    lines += [f"mean[i] = {printer.doprint(mean)}", f"deviation[i] = {printer.doprint(deviation)}"]
    body = indent("\n".join(lines), 12 * " ")
    return f"    if which == {which}:\n        for i in range(points):\n{body}\n"


@lru_cache(maxsize=256)
def load(text: str) -> Any:
    """The compiled function of a printed model, or what an earlier session has kept of it on the
    disk."""
    import numba
    from platformdirs import user_cache_path

    name = f"law_{sha256((text + numba.__version__).encode()).hexdigest()[:20]}"
    place = Path(user_cache_path("kfcourse")) / "compiled" / f"{name}.py"
    if not place.exists():
        place.parent.mkdir(parents=True, exist_ok=True)
        save(text, place)
    spec = spec_from_file_location(name, place)
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module  # numba finds what it has kept by the module's name
    spec.loader.exec_module(module)
    return module.law
