"""One input for which an answer is wrong, and the student's own value there; never the right one.

A student who no hint helps can go through this case by hand, or in a cell of the notebook.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.symbolic.formula import symbol

NUMBERS = 9  # that are shown of one array
DECIMALS = (1.3, 0.7, 2.1, 0.4, 1.7, 0.9, 2.6, 0.6)  # values of symbols that have none


def shown(
    names: Sequence[str],
    arguments: Sequence[Any],
    answered: Any,
    expected: Any,
    part: str = "",
    axes: Sequence[str] = (),
    values: Mapping[sp.Symbol, Any] | None = None,
) -> str:
    """A sentence: for these arguments the answer gives this.

    Parameters
    ----------
    names, arguments : sequences
        Of the call.
    answered, expected : formula, matrix or array
        The result, or the part of it, that is wrong there.  Of the expected one only the place
        where they differ is used.
    part : str
        What this part of the result is called.
    axes : sequence of str
        What the leading axes of the result are.
    values : dict, optional
        Of the parameters.
    """
    if isinstance(expected, sp.Basic | sp.MatrixBase):
        return _formula(arguments, answered, part, values or {})
    return _array(names, arguments, np.asarray(answered), np.asarray(expected), part, axes)


def _formula(
    arguments: Sequence[Any], answered: Any, part: str, values: Mapping[sp.Symbol, Any]
) -> str:
    known = {symbol(s.name): value for s, value in values.items()}
    symbols = {
        s for expression in (*arguments, answered) for s in getattr(expression, "free_symbols", ())
    }
    point = {
        s: sp.Float(known.get(symbol(s.name), DECIMALS[i % len(DECIMALS)]), 6)
        for i, s in enumerate(sorted(symbols, key=lambda s: (symbol(s.name) in known, str(s))))
    }
    entries = list(answered) if isinstance(answered, sp.MatrixBase) else [answered]
    numbers = [sp.N(entry.xreplace(point), 8) for entry in entries]
    if not all(number.is_real for number in numbers):
        return ""
    shape = answered.shape if isinstance(answered, sp.MatrixBase) else ()
    result = np.array([float(number) for number in numbers]).reshape(shape)
    where = ", ".join(f"{s} = {float(value):.4g}" for s, value in point.items())
    return f"An example: at {where} {_yours(part, result)}."


def _array(
    names: Sequence[str],
    arguments: Sequence[Any],
    answered: np.ndarray,
    expected: np.ndarray,
    part: str,
    axes: Sequence[str],
) -> str:
    place: tuple[int, ...] = ()
    if axes and answered.ndim >= len(axes):
        scale = np.max(np.abs(expected[np.isfinite(expected)]), initial=0.0)
        wrong = ~np.isclose(answered, expected, rtol=1e-6, atol=1e-6 * scale, equal_nan=True)
        first = np.argwhere(wrong)[0] if wrong.any() else np.zeros(answered.ndim, int)
        place = tuple(int(i) for i in first[: len(axes)])
        answered = answered[place]
    sizes = expected.shape[: len(place)]
    inputs = []
    for name, value in zip(names, arguments, strict=False):
        if callable(value):
            continue
        array = np.asarray(value, dtype=float)
        if place and len(sizes) > 1 and array.shape[: len(sizes)] == sizes:
            array = array[: place[0] + 1, place[1]]  # of this trajectory, up to this step
        elif place and array.ndim and array.shape[:1] == sizes[:1]:
            # what is found of a row may need its neighbours, as an interval does
            if axes[0] == "step":
                first, end = max(0, place[0] - 1), min(place[0] + 2, len(array))
                name, array = f"{name}[{first}:{end}]", array[first:end]
            else:
                array = array[place[0]]
        inputs.append(f"{name} = {_numbers(array)}")
    where = "".join(f", {axis} {i}" for axis, i in zip(axes, place, strict=False))
    return (
        f"An example{where}{' (counted from 0)' if where else ''}: for {', '.join(inputs)} "
        f"{_yours(part, answered)}."
    )


def _yours(part: str, value: np.ndarray) -> str:
    return f"your {f'result {part} is' if part else 'function gives'} {_numbers(value)}"


def _numbers(array: np.ndarray) -> str:
    """A number or an array in a few words."""
    if array.size > NUMBERS:
        first = ", ".join(f"{value:.4g}" for value in array.ravel()[:3])
        return f"[{first}, ...] of shape {array.shape}"
    text = np.array2string(
        array,
        formatter={"float_kind": lambda value: f"{value:.4g}"},
        separator=", ",
        max_line_width=10**6,
    )
    return " ".join(text.split())
