"""The same expressions as JavaScript, by SymPy's printer, for figures that compute in a browser.

::

    loop("predict", {"z": z, "p": p}, {"tau": tau, "Theta": Theta}, constants=parameters)

prints a function that runs over an ensemble kept in arrays of numbers,

::

    predict(n, v, c, a):   for each i < n:
        a.tau[i], a.Theta[i] from a.z[i], a.p[i] and the constants v and c.

Only what stands in `FUNCTIONS` is printed.  Anything else is refused in words when the book is
built: SymPy's printer writes what JavaScript does not have (`Sum`, `I`, `erf`) as if JavaScript had
it, and the reader's browser would find that out.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import sympy as sp
from sympy.codegen.cfunctions import expm1, log1p
from sympy.core.relational import Relational
from sympy.functions.elementary.piecewise import ExprCondPair
from sympy.printing.jscode import JavascriptCodePrinter

from kfcourse.errors import ModelError
from kfcourse.symbolic.codegen import check_numbers


class inverse(sp.Function):
    """1/x, and 0 of 0: the pseudo-inverse of a variance."""

    is_real = True


NAMES = "exp log sin cos tan asin acos atan atan2 sinh cosh tanh Abs sign Min Max"
FUNCTIONS = (*(getattr(sp, name) for name in NAMES.split()), expm1, log1p, inverse)
_NUMBERS = (sp.Symbol, sp.Number, type(sp.pi), type(sp.E))
_OTHERS = (*_NUMBERS, sp.Add, sp.Mul, sp.Pow, sp.Piecewise, ExprCondPair)
_KNOWN = (*FUNCTIONS, *_OTHERS, Relational, sp.And, sp.Or, type(sp.true))
# What the printed functions call beside JavaScript's own.
RUNTIME = "const kfInverse = (x) => (x === 0 ? 0 : 1 / x);\n"
_printer = JavascriptCodePrinter(
    {"user_functions": {"inverse": "kfInverse", "expm1": "Math.expm1", "log1p": "Math.log1p"}}
)


def expression(e: sp.Basic, names: Mapping[sp.Symbol, str]) -> str:
    """An expression in numbers; `names` says what symbols are called.

    Raises
    ------
    ModelError
        A function or a symbol that is not on the list, a number beyond floats.
    """
    check_numbers("a page's formula", sp.Matrix([e]))
    for node in sp.preorder_traversal(e):
        if not isinstance(node, _KNOWN) or (
            isinstance(node, sp.Piecewise) and node.args[-1].cond != sp.true
        ):
            listed = ", ".join(sorted(function.__name__ for function in FUNCTIONS))
            raise ModelError(
                f"{type(node).__name__}, in {sp.sstr(node)}, is nothing that the pages' "
                f"JavaScript knows; "
                f"it has {listed}, and powers"
            )
    if unknown := e.free_symbols - names.keys():
        raise ModelError(
            f"the symbol {min(map(str, unknown))} is nothing that the pages' JavaScript knows: "
            f"nothing defines it"
        )
    return str(
        _printer.doprint(
            e.xreplace({symbol: sp.Symbol(text, real=True) for symbol, text in names.items()})
        )
    )


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
        Name of an array to the matrix of symbols that it holds, entry by entry, trajectory after
        trajectory.
    outputs : dict
        Name of an array to the matrix of expressions that is written into it.
    definitions : dict, optional
        Auxiliary symbols that the outputs and later definitions may use.
    constants : collection of Symbol
        Parameters of the model: numbers `v.<name>`, the same for all trajectories.
    coefficients : dict, optional
        Further numbers that are the same for all, by symbol: `c.<name>`.

    Raises
    ------
    ModelError
        Expressions that are no real numbers, or hold what JavaScript does not have.
    """
    names = {symbol: f"v.{symbol.name}" for symbol in constants}
    names |= {symbol: f"c.{key}" for symbol, key in (coefficients or {}).items()}
    for argument, matrix in arguments.items():
        for place, symbol in reversed(list(enumerate(matrix))):
            names[symbol] = f"a.{argument}[{_index(len(matrix), place)}]"
    inner: dict[sp.Symbol, sp.Expr] = {}
    for symbol, value in (definitions or {}).items():
        inner[symbol] = value.xreplace(inner)
    assignments, reduced = sp.cse(
        [entry.xreplace(inner) for matrix in outputs.values() for entry in matrix]
    )
    lines = []
    for number, (symbol, value) in enumerate(assignments):
        lines.append(f"const s{number} = {expression(value, names)};")
        names[symbol] = f"s{number}"
    places = [
        f"a.{output}[{_index(len(matrix), i)}]"
        for output, matrix in outputs.items()
        for i in range(len(matrix))
    ]
    # All is read before anything is written: an output may stand in the place of an argument.
    lines += [
        f"const o{number} = {expression(value, names)};" for number, value in enumerate(reduced)
    ]
    lines += [f"{place} = o{number};" for number, place in enumerate(places)]
    return "\n".join(
        [
            f"function {name}(n, v, c, a) {{",
            "  for (let i = 0; i < n; i++) {",
            *(f"    {x}" for x in lines),
            "  }",
            "}",
            "",
        ]
    )


def _index(size: int, place: int) -> str:
    return "i" if size == 1 else f"{size} * i + {place}"
