"""The same expressions as JavaScript, by SymPy's printer, for figures that compute in a browser.

::

    loop("predict", {"z": z, "p": p}, {"tau": tau, "Theta": Theta}, constants=parameters)

prints a function that runs over an ensemble kept in arrays of numbers,

::

    predict(n, v, c, a):   for each i < n:
        a.tau[i], a.Theta[i] from a.z[i], a.p[i] and the constants v and c.

What JavaScript does not have is refused when the book is built: else the reader's browser would
find that out.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import sympy as sp
from sympy.printing.jscode import JavascriptCodePrinter

from kfcourse.errors import ModelError
from kfcourse.symbolic.codegen import check_numbers


class inverse(sp.Function):
    """1/x, and 0 of 0: the pseudo-inverse of a variance."""

    is_real = True


# What the printed functions call beside JavaScript's own.
RUNTIME = "const kfInverse = (x) => (x === 0 ? 0 : 1 / x);\n"
OWN = {"inverse": "kfInverse", "expm1": "Math.expm1", "log1p": "Math.log1p"}
_printer = JavascriptCodePrinter({"strict": True, "user_functions": OWN})


def expression(e: sp.Expr, names: Mapping[sp.Symbol, str]) -> str:
    """An expression in numbers; `names` says what symbols are called.

    Raises
    ------
    ModelError
        What JavaScript does not have, a symbol without a name, a number beyond floats.
    """
    check_numbers("a page's formula", e)
    if unknown := e.free_symbols - names.keys():
        raise ModelError(
            f"the symbol {min(map(str, unknown))} is nothing that the pages' JavaScript knows: "
            f"nothing defines it"
        )
    named = {symbol: sp.Symbol(text, real=True) for symbol, text in names.items()}
    try:
        if e.has(sp.Sum, sp.Product):  # SymPy would print its own names
            raise NotImplementedError("sums and products over an index")
        return str(_printer.doprint(e.xreplace(named)))
    except (NotImplementedError, ValueError) as error:
        raise ModelError(f"{e} holds what the pages' JavaScript does not have: {error}") from None


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
        Auxiliary symbols that the outputs and later definitions may use; what nothing uses is not
        printed.
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
