"""Values between a notebook's process and the grader: plain JSON, and nothing is executed when it is read.

A value is None, a truth value, a number, a text, a list or tuple, an array of numbers, or a SymPy formula or matrix of formulas.
A formula travels as a list of nodes, each naming one of SymPy's own functions and its arguments by their places.  Anything else
arrives as an empty object that has the name of its type.
"""

from __future__ import annotations

import base64
import numbers
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp
from sympy.core.function import Application

LARGEST = 64 * 2**20  # bytes of a message
NODES = 50_000  # of a formula
DIGITS = 4000  # of a number in a formula
NUMBER = re.compile(rf"[+-]?\d{{1,{DIGITS}}}")
FLOAT = re.compile(rf"[+-]?\d{{1,{DIGITS}}}(\.\d{{0,{DIGITS}}})?(e[+-]?\d{{1,5}})?")

_COMPOSED = (
    sp.Add, sp.Mul, sp.Pow, sp.Tuple, sp.Derivative, sp.Integral, sp.Sum, sp.Product, sp.Subs, sp.Piecewise,
    sp.functions.elementary.piecewise.ExprCondPair,
    sp.Eq, sp.Ne, sp.Lt, sp.Le, sp.Gt, sp.Ge, sp.And, sp.Or, sp.Not,
)  # fmt: skip
_NOT_FORMULAS = (sp.Function, sp.WildFunction)
HEADS: dict[str, type] = {one.__name__: one for one in _COMPOSED} | {
    name: one
    for name, one in vars(sp.functions).items()
    if isinstance(one, type) and issubclass(one, Application) and one not in _NOT_FORMULAS
}
CONSTANTS: dict[str, sp.Basic] = {
    "pi": sp.pi, "E": sp.E, "I": sp.I, "oo": sp.oo, "-oo": -sp.oo, "zoo": sp.zoo, "nan": sp.nan,
    "true": sp.true, "false": sp.false, "EulerGamma": sp.EulerGamma, "GoldenRatio": sp.GoldenRatio,
}  # fmt: skip
_NAMES = {value: name for name, value in CONSTANTS.items()}


class Strange(ValueError):
    """A message is not one of ours: whoever sent it did not mean to be understood."""


class Unsent(ValueError):
    """A value that cannot be sent."""


class Other:
    """What arrives of a value that is none of those above: the name of its type."""


Functions = Callable[[Any], int]  # registers a function that the other side may call: its number
Proxies = Callable[[int], Any]  # the function of a number, as this side calls it


def encode(value: Any, functions: Functions | None = None) -> Any:
    """The value as what `json.dumps` takes.

    Parameters
    ----------
    value
    functions : callable, optional
        Gives a function its number; without it a function is a value of another type.
    """
    if value is None or type(value) in (bool, float, str):
        return value
    if type(value) is int:
        return value if abs(value) < 2**63 else ["int", _digits(value)]
    if type(value) is complex:
        return ["complex", value.real, value.imag]
    if isinstance(value, list | tuple):
        return ["list" if isinstance(value, list) else "tuple", [encode(part, functions) for part in value]]
    if isinstance(value, sp.MatrixBase):
        return ["formulas", value.rows, value.cols, _nodes(list(value))]
    if isinstance(value, sp.Basic):
        return _formula(value)
    if isinstance(value, np.ndarray | np.generic):
        return _array(value, functions)
    if callable(value) and functions is not None:
        return ["function", functions(value)]
    if hasattr(value, "__array__") and not isinstance(value, type):  # of pandas and the like
        return _array(np.asarray(value), functions)
    if isinstance(value, numbers.Real) or type(value).__module__.startswith(("mpmath", "decimal")):
        return float(value)
    return ["other", type(value).__name__]


def _array(value: np.ndarray | np.generic, functions: Functions | None) -> Any:
    array = np.ascontiguousarray(value).reshape(np.shape(value))
    if array.dtype.kind == "O":
        return ["objects", list(array.shape), [encode(entry, functions) for entry in array.ravel().tolist()]]
    if array.dtype.kind not in "biufc":
        return ["other", f"array of {array.dtype.name}"]
    kind = "array" if isinstance(value, np.ndarray) else "scalar"
    data = base64.b64encode(array.astype(array.dtype.newbyteorder("<")).tobytes()).decode()
    return ["matrix" if isinstance(value, np.matrix) else kind, array.dtype.newbyteorder("<").str, list(array.shape), data]


def _formula(value: sp.Basic) -> Any:
    if isinstance(value, sp.MatrixExpr):
        value = value.as_explicit()
        return ["formulas", value.rows, value.cols, _nodes(list(value))]
    if not isinstance(value, sp.Expr):
        return ["other", type(value).__name__]
    try:
        return ["formula", _nodes([value])]
    except Unsent as reason:
        return ["other", str(reason)]


def _digits(value: int) -> str:
    if value.bit_length() > 3.3 * DIGITS:
        raise Unsent(f"a number of more than {DIGITS} digits")
    return str(value)


def _nodes(formulas: Sequence[Any]) -> list[Any]:
    """Nodes, arguments before what uses them, and the places of the formulas."""
    places: dict[Any, int] = {}
    nodes: list[Any] = []
    for formula in formulas:
        waiting: list[tuple[Any, bool]] = [(formula, False)]
        while waiting:
            part, ready = waiting.pop()
            if part in places:
                continue
            if part.args and not ready and not isinstance(part, sp.Symbol):
                waiting += [(part, True), *((argument, False) for argument in part.args)]
                continue
            nodes.append(_node(part, places))
            places[part] = len(nodes) - 1
            if len(nodes) > NODES:
                raise Unsent(f"a formula of more than {NODES} parts")
    return [nodes, [places[formula] for formula in formulas]]


def _node(part: Any, places: Mapping[Any, int]) -> list[Any]:
    if isinstance(part, sp.Symbol):
        given = getattr(part, "_assumptions_orig", part.assumptions0)
        return ["Symbol", part.name, {name: value for name, value in given.items() if value is not None}]
    if (part in _NAMES and not part.is_Number) or part in (sp.oo, -sp.oo, sp.zoo, sp.nan):
        return ["constant", _NAMES[part]]
    if isinstance(part, sp.Rational):
        return ["Rational", _digits(part.p), _digits(part.q)]
    if isinstance(part, sp.Float):
        return ["Float", sp.srepr(part).split("'")[1], part._prec]
    name, arguments = type(part).__name__, getattr(part, "args", ())
    if HEADS.get(name) is not type(part):
        raise Unsent(f"formula with {name}")
    return [name, *(places[argument] for argument in arguments)]


def decode(data: Any, proxies: Proxies | None = None) -> Any:
    """The value of what `encode` made; Strange if it is not that.

    Parameters
    ----------
    data
        From `json.loads`.
    proxies : callable, optional
        Number of a function of the other side to what is called here in its place.
    """
    try:
        return _decoded(data, proxies)
    except Strange:
        raise
    except Exception as error:  # whatever nonsense leads to
        raise Strange(f"{type(error).__name__}: {error}"[:200]) from None


def _decoded(data: Any, proxies: Proxies | None) -> Any:
    if data is None or isinstance(data, bool | int | float | str):
        return data
    kind, *rest = data
    match kind, rest:
        case "int", [str(digits)] if NUMBER.fullmatch(digits):
            return int(digits)
        case "complex", [float() | int() as real, float() | int() as imaginary]:
            return complex(real, imaginary)
        case "list" | "tuple", [list(parts)]:
            made = [_decoded(part, proxies) for part in parts]
            return made if kind == "list" else tuple(made)
        case "array" | "scalar" | "matrix", [str(name), list(shape), str(text)]:
            return _made_array(kind, np.dtype(name), shape, text)
        case "objects", [list(shape), list(parts)]:
            array = np.empty(len(parts), dtype=object)
            for place, part in enumerate(parts):
                array[place] = _decoded(part, proxies)
            return array.reshape(shape)
        case "formula", [[list(nodes), [int(place)]]]:
            return _made_formulas(nodes, [place])[0]
        case "formulas", [int(rows), int(columns), [list(nodes), list(places)]]:
            return sp.ImmutableMatrix(rows, columns, _made_formulas(nodes, places))
        case "function", [int(number)] if proxies is not None:
            return proxies(number)
        case "other", [str(name)]:
            return type(re.sub(r"[^\w .()]", "", name)[:60] or "object", (Other,), {})()
    raise Strange(f"a value of the kind {str(kind)[:40]!r}")


def _made_array(kind: str, dtype: np.dtype, shape: list, text: str) -> Any:
    if dtype.kind not in "biufc" or dtype.hasobject:
        raise Strange(f"an array of {dtype}")
    array = np.frombuffer(base64.b64decode(text, validate=True), dtype=dtype).reshape(shape)
    array = array.astype(dtype.newbyteorder("="))  # a copy, which may be written to
    return array[()] if kind == "scalar" else np.asmatrix(array) if kind == "matrix" else array


def _made_formulas(nodes: list, places: list) -> list[sp.Basic]:
    if len(nodes) > NODES:
        raise Strange("a formula without end")
    made: list[sp.Basic] = []
    for node in nodes:
        made.append(_made_node(node, made))
    return [_at(made, place) for place in places]


def _at(made: list[sp.Basic], place: Any) -> sp.Basic:
    if type(place) is not int or not 0 <= place < len(made):
        raise Strange("a formula that uses what is not there")
    return made[place]


def _made_node(node: list, made: list[sp.Basic]) -> sp.Basic:
    head, *rest = node
    match head, rest:
        case "Symbol", [str(name), dict(assumptions)] if all(type(value) is bool for value in assumptions.values()):
            return sp.Symbol(name, **assumptions)
        case "constant", [str(name)]:
            return CONSTANTS[name]
        case "Rational", [str(p), str(q)] if NUMBER.fullmatch(p) and NUMBER.fullmatch(q):
            return sp.Rational(int(p), int(q))
        case "Float", [str(text), int(precision)] if FLOAT.fullmatch(text) and 0 < precision < 10_000:
            return sp.Float(text, precision=precision)
    if head not in HEADS:
        raise Strange(f"a formula with {str(head)[:40]!r}")
    return HEADS[head](*(_at(made, place) for place in rest))
