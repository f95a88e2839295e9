"""Values between a notebook's process and the grader: plain JSON, and nothing is executed when it
is read.

A value is None, a truth value, a number, a text, a list or tuple, an array of numbers, or a SymPy
formula or matrix of
formulas.  A formula travels as the text that `sympy.srepr` writes, and is read by Python's parser
and a list of SymPy's own
functions.  Anything else arrives as an empty object that has the name of its type.
"""

from __future__ import annotations

import ast
import base64
import io
import numbers
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import sympy as sp
from sympy.core.function import Application

LARGEST = 64 * 2**20  # bytes of a message
LONGEST = 2**20  # characters of a formula: Python's parser takes some hundred bytes for each

_COMPOSED = (
    *(sp.Add, sp.Mul, sp.Pow, sp.Tuple, sp.Derivative, sp.Integral, sp.Sum, sp.Product, sp.Subs),
    *(sp.Piecewise, sp.functions.elementary.piecewise.ExprCondPair, sp.And, sp.Or, sp.Not),
    *(sp.Eq, sp.Ne, sp.Lt, sp.Le, sp.Gt, sp.Ge),
)
HEADS: dict[str, type] = {kind.__name__: kind for kind in _COMPOSED} | {
    name: kind
    for name, kind in vars(sp.functions).items()
    if isinstance(kind, type)
    and issubclass(kind, Application)
    and kind not in (sp.Function, sp.WildFunction)
}
CONSTANTS: dict[str, sp.Basic] = {
    name: getattr(sp, name)
    for name in ("pi", "E", "I", "oo", "zoo", "nan", "true", "false", "EulerGamma", "GoldenRatio")
}


class ProtocolError(ValueError):
    """A message is not one of ours: whoever sent it did not mean to be understood."""


class Other:
    """What arrives of a value that is none of those above: the name of its type."""


Proxies = Callable[[int], Any]  # the function of a number, as this side calls it


def encode(value: Any, functions: list[Callable] | None = None) -> Any:
    """The value as what `json.dumps` takes.

    Parameters
    ----------
    value
    functions : list, optional
        Takes functions that the other side may call by their numbers in it; without it a function
        is a value of another type.
    """
    if value is None or type(value) in (bool, int, float, str):
        return value
    if isinstance(value, list | tuple):
        return [
            "list" if isinstance(value, list) else "tuple",
            [encode(part, functions) for part in value],
        ]
    if isinstance(value, sp.MatrixExpr):
        value = value.as_explicit()
    if isinstance(value, sp.MatrixBase):
        return ["formulas", value.rows, value.cols, list(map(_text, value))]
    if isinstance(value, sp.Expr):
        return ["formula", _text(value)]
    if callable(value) and functions is not None:
        functions.append(value)
        return ["function", len(functions) - 1]
    # of NumPy, pandas and the like
    if isinstance(value, complex) or (hasattr(value, "__array__") and not isinstance(value, type)):
        return _array(value, functions)
    if isinstance(value, numbers.Real) or type(value).__module__.startswith(("mpmath", "decimal")):
        return float(value)
    return ["other", type(value).__name__]


def _text(formula: sp.Expr) -> str:
    return sp.srepr(formula, order="none")  # to put long sums in order takes minutes


def _array(value: Any, functions: list[Callable] | None) -> Any:
    array = np.asarray(value)
    if array.dtype.kind == "O":
        return encode(array.tolist(), functions)
    if array.dtype.kind not in "biufc":
        return ["other", f"array of {array.dtype.name}"]
    kind = "scalar" if isinstance(value, np.generic | complex) else "array"
    data = io.BytesIO()
    np.save(data, array, allow_pickle=False)
    return [kind, base64.b64encode(data.getvalue()).decode()]


def decode(data: Any, proxies: Proxies | None = None) -> Any:
    """The value of what `encode` made; ProtocolError if it is not that.

    Parameters
    ----------
    data
        From `json.loads`.
    proxies : callable, optional
        Number of a function of the other side to what is called here in its place.
    """
    try:
        match data:
            case None | bool() | int() | float() | str():
                return data
            case ["list" | "tuple" as kind, list(parts)]:
                values = [decode(part, proxies) for part in parts]
                return values if kind == "list" else tuple(values)
            case ["array" | "scalar" as kind, str(text)]:
                content = io.BytesIO(base64.b64decode(text, validate=True))
                array = np.load(content, allow_pickle=False)
                if array.dtype.kind not in "biufc":
                    raise ProtocolError(f"an array of {array.dtype}")
                array = array.astype(array.dtype.newbyteorder("="))  # as calculations give it
                return array[()] if kind == "scalar" else array
            case ["formula", str(text)]:
                return formula(text)
            case ["formulas", int(rows), int(columns), list(texts)]:
                return sp.ImmutableMatrix(rows, columns, list(map(formula, texts)))
            case ["function", int(number)] if proxies is not None:
                return proxies(number)
            case ["other", str(name)]:
                return type(re.sub(r"[^\w .()]", "", name)[:60] or "object", (Other,), {})()
    except ProtocolError:
        raise
    except Exception as error:  # whatever nonsense leads to
        raise ProtocolError(f"{type(error).__name__}: {error}"[:200]) from None
    raise ProtocolError(f"a value of the kind {str(data)[:40]!r}")


def formula(text: str) -> sp.Basic:
    """The formula of a text of `sympy.srepr`; ProtocolError if it has anything but SymPy's own
    functions."""
    if len(text) > LONGEST:
        raise ProtocolError(f"a formula of {len(text)} characters")
    return _read(ast.parse(text, mode="eval").body)


def _read(node: ast.AST) -> sp.Basic:
    match node:
        case ast.Name(id=name) if name in CONSTANTS:
            return CONSTANTS[name]
        case ast.UnaryOp(op=ast.USub(), operand=ast.Name(id="oo")):
            return -sp.oo
        case ast.Call(
            func=ast.Name(id="Symbol"), args=[ast.Constant(value=str(name))], keywords=given
        ):
            return sp.Symbol(
                name,
                **{str(keyword.arg): bool(ast.literal_eval(keyword.value)) for keyword in given},
            )
        case ast.Call(func=ast.Name(id="Integer" | "Rational"), args=parts, keywords=[]):
            return sp.Rational(*(int(ast.literal_eval(part)) for part in parts))
        case ast.Call(
            func=ast.Name(id="Float"), args=[ast.Constant(value=str(digits))], keywords=[precision]
        ):
            return sp.Float(digits, precision=min(int(ast.literal_eval(precision.value)), 10_000))
        case ast.Call(func=ast.Name(id=name), args=parts, keywords=[]) if name in HEADS:
            return HEADS[name](*map(_read, parts))
    raise ProtocolError(f"a formula with {ast.unparse(node)[:40]!r}")
