"""The second printer: the straight-line programs of `codegen.lower` as JavaScript, for figures that compute in a browser.

::

    loop("predict", {"z": z, "p": p}, {"tau": tau, "Theta": Theta}, constants=parameters)

prints a function that runs over an ensemble kept in arrays of numbers,

::

    predict(n, v, c, a):    for each i < n:  a.tau[i], a.Theta[i] from a.z[i], a.p[i] and the constants v and c.

Only what stands in `FUNCTIONS` is printed.  Anything else is refused in words when the book is built: SymPy's own printer
writes what JavaScript does not have (`Sum`, `I`, `erf`) as if it had it, and the reader's browser would find that out.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import reduce

import sympy as sp
from sympy.codegen.cfunctions import expm1, log1p
from sympy.core.relational import Relational

from kfcourse.symbolic.codegen import Program, float_text, printed
from kfcourse.symbolic.formula import NO_NUMBERS
from kfcourse.symbolic.reading import ModelError


class inverse(sp.Function):
    """1/x, and 0 of 0: the pseudo-inverse of a variance."""

    is_real = True


# Of each function of SymPy that may appear, the text that its printed arguments are put into.
FUNCTIONS: dict[type, str] = {
    sp.exp: "Math.exp({})",
    sp.log: "Math.log({})",
    expm1: "Math.expm1({})",
    log1p: "Math.log1p({})",
    sp.sin: "Math.sin({})",
    sp.cos: "Math.cos({})",
    sp.tan: "Math.tan({})",
    sp.asin: "Math.asin({})",
    sp.acos: "Math.acos({})",
    sp.atan: "Math.atan({})",
    sp.atan2: "Math.atan2({}, {})",
    sp.sinh: "Math.sinh({})",
    sp.cosh: "Math.cosh({})",
    sp.tanh: "Math.tanh({})",
    sp.Abs: "Math.abs({})",
    sp.sign: "Math.sign({})",
    sp.Min: "Math.min({})",
    sp.Max: "Math.max({})",
    inverse: "kfInverse({})",
}
_MANY = (sp.Min, sp.Max)
_RELATIONS = {sp.Lt: "<", sp.Le: "<=", sp.Gt: ">", sp.Ge: ">=", sp.Eq: "===", sp.Ne: "!=="}
_CONSTANTS = {sp.pi: "Math.PI", sp.E: "Math.E"}
# What the printed functions call beside JavaScript's own.
RUNTIME = "const kfInverse = (x) => (x === 0 ? 0 : 1 / x);\n"


def expression(e: sp.Basic, names: Mapping[sp.Basic, str]) -> str:
    """An expression in numbers; `names` says what symbols are called.

    Raises
    ------
    ModelError
        A function or a symbol that is not on the list, a number beyond floats.
    """

    def text(e: sp.Basic) -> str:
        if e in names:
            return names[e]
        if e in _CONSTANTS:
            return _CONSTANTS[e]
        if isinstance(e, sp.Rational | sp.Float):
            return float_text(e) if e >= 0 else f"({float_text(e)})"
        if isinstance(e, sp.Add):
            return "(" + " + ".join(map(text, e.args)) + ")"
        if isinstance(e, sp.Mul):
            return _product(e)
        if isinstance(e, sp.Pow):
            return _power(e)
        if isinstance(e, sp.Piecewise) and e.args[-1].cond == sp.true:
            *cases, last = e.args
            return "(" + "".join(f"{text(one.cond)} ? {text(one.expr)} : " for one in cases) + text(last.expr) + ")"
        if isinstance(e, Relational) and e.func in _RELATIONS:
            return f"({text(e.lhs)} {_RELATIONS[e.func]} {text(e.rhs)})"
        if isinstance(e, sp.And | sp.Or):
            return "(" + (" && " if isinstance(e, sp.And) else " || ").join(map(text, e.args)) + ")"
        if e.func in FUNCTIONS:
            arguments = [text(one) for one in e.args]
            return FUNCTIONS[e.func].format(*([", ".join(arguments)] if e.func in _MANY else arguments))
        what = f"the symbol {e}, which nothing defines," if e.is_Symbol else f"{e.func.__name__}, in {sp.sstr(e)},"
        listed = ", ".join(sorted(one.__name__ for one in FUNCTIONS))
        raise ModelError(f"{what} is nothing that the pages' JavaScript knows; it has {listed}, and powers")

    def _product(e: sp.Mul) -> str:
        below = [one.base for one in e.args if isinstance(one, sp.Pow) and one.exp == -1]
        above = [one for one in e.args if not (isinstance(one, sp.Pow) and one.exp == -1)]
        printed = " * ".join(map(text, above)) or "1"
        return "(" + reduce(lambda so_far, one: f"{so_far} / {text(one)}", below, printed) + ")"

    def _power(e: sp.Pow) -> str:
        if e.exp == -1:
            return f"(1 / {text(e.base)})"
        if e.exp == sp.S.Half:
            return f"Math.sqrt({text(e.base)})"
        return f"Math.pow({text(e.base)}, {text(e.exp)})"

    return text(e)


def loop(
    name: str,
    arguments: Mapping[str, sp.MatrixBase],
    outputs: Mapping[str, sp.MatrixBase],
    definitions: Mapping[sp.Symbol, sp.Expr] | None = None,
    constants: Collection[sp.Symbol] = (),
    coefficients: Mapping[sp.Symbol, str] | None = None,
) -> str:
    """A function that computes the outputs for every trajectory of an ensemble, as text.

    Parameters
    ----------
    name : str
        What the function is called.
    arguments : dict
        Name of an array to the matrix of symbols that it holds, entry by entry, trajectory after trajectory.
    outputs : dict
        Name of an array to the matrix of expressions that is written into it.
    definitions : dict, optional
        Auxiliary symbols that the outputs may use.
    constants : collection of Symbol
        Parameters of the model: numbers `v.<name>`, the same for all trajectories.
    coefficients : dict, optional
        Further numbers that are the same for all, by symbol: `c.<name>`.

    Raises
    ------
    ModelError
        Expressions that are no real numbers, or hold what JavaScript does not have.
    """
    matrices = {key: sp.ImmutableMatrix(matrix) for key, matrix in outputs.items()}
    for entry in (*(definitions or {}).values(), *matrices.values()):
        if entry.has(*NO_NUMBERS):
            raise ModelError(f"{name}: no finite real value, so there is nothing for a page to compute: {sp.sstr(entry)}")
    return printed(
        lambda program: _text(name, arguments, program, constants, coefficients or {}), matrices, (), definitions or {}
    )


def _text(
    name: str,
    arguments: Mapping[str, sp.MatrixBase],
    program: Program,
    constants: Collection[sp.Symbol],
    coefficients: Mapping[sp.Symbol, str],
) -> str:
    entries = [entry for matrix in program.outputs.values() for entry in matrix]
    used = set().union(*(e.free_symbols for e in (*(value for _, value in program.assignments), *entries)))
    names: dict[sp.Basic, str] = {target: f"s{i}" for i, (target, _) in enumerate(program.assignments)}
    before, each = [], []
    for source, prefix, called in [("v", "v_", {one: one.name for one in constants}), ("c", "c_", dict(coefficients))]:
        for one, key in called.items():
            if one in used:
                names[one] = f"{prefix}{key}"
                before.append(f"  const {prefix}{key} = {source}.{key};")
    for argument, matrix in arguments.items():
        taken = {entry: place for place, entry in reversed(list(enumerate(matrix))) if entry in used}
        if taken:
            before.append(f"  const a_{argument} = a.{argument};")
        for entry, place in taken.items():
            names[entry] = f"{argument}_{place}"
            each.append(f"    const {argument}_{place} = a_{argument}[{_index(len(matrix), place)}];")
    each += [f"    const {names[target]} = {expression(value, names)};" for target, value in program.assignments]
    for output, matrix in program.outputs.items():
        if output not in arguments or f"  const a_{output} = a.{output};" not in before:
            before.append(f"  const a_{output} = a.{output};")
        each += [f"    a_{output}[{_index(len(matrix), i)}] = {expression(e, names)};" for i, e in enumerate(matrix)]
    return "\n".join([f"function {name}(n, v, c, a) {{", *before, "  for (let i = 0; i < n; i++) {", *each, "  }", "}", ""])


def _index(size: int, place: int) -> str:
    return "i" if size == 1 else f"{size} * i + {place}"
