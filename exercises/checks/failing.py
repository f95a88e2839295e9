"""One input for which an answer is wrong, and the student's own value there; never the right one.

A student who no hint helps can go through this case by hand, or in a cell of the notebook.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from kfcourse.exercises.checks.case import Case
from kfcourse.exercises.checks.equality import near
from kfcourse.exercises.checks.reference import Posed

NUMBERS = 9  # that are shown of one array
DECIMALS = (1.3, 0.7, 2.1, 0.4, 1.7, 0.9, 2.6, 0.6)  # values of symbols that have none


def shown(case: Case, call: int) -> str:
    """A sentence: for the arguments of this call the answer, or this part of it, gives this.

    Of what is expected only the place where they differ is used.
    """
    answered, expected = case.pairs[call]
    if case.numeric:
        where, value = _of_array(case.posed, call, answered, expected)
    else:
        where, value = _of_formula(case.posed, call, answered)
    if value is None:
        return ""
    yours = f"result {case.name} is" if case.name else "function gives"
    return f"An example{where} your {yours} {_numbers(value)}."


def _of_formula(posed: Posed, call: int, answered: Any) -> tuple[str, np.ndarray | None]:
    """Numbers for the symbols, and the value there; None if it is not real."""
    known = {s.name: value for s, value in posed.values.items()}
    symbols = {
        s for e in (*posed.arguments[call], answered) for s in getattr(e, "free_symbols", ())
    }
    ordered = sorted(symbols, key=lambda s: (s.name in known, s.name))
    point = {
        s: sp.Float(known.get(s.name, DECIMALS[i % len(DECIMALS)]), 6)
        for i, s in enumerate(ordered)
    }
    entries = np.array(answered, dtype=object)
    numbers = [sp.N(entry.xreplace(point), 8) for entry in entries.ravel()]
    where = ", ".join(f"{s} = {float(value):.4g}" for s, value in point.items())
    if not all(number.is_real for number in numbers):
        return "", None
    return f": at {where}", np.array(numbers, dtype=float).reshape(entries.shape)


def _of_array(
    posed: Posed, call: int, answered: np.ndarray, expected: np.ndarray
) -> tuple[str, np.ndarray | None]:
    """The first place that is wrong, with the arguments there, and the value."""
    axes, tolerance = posed.question.axes, posed.question.tolerance
    place: tuple[int, ...] = ()
    if axes and answered.ndim >= len(axes):
        wrong = np.argwhere(~near(answered, expected, tolerance))
        place = tuple(wrong[0, : len(axes)].tolist())
    sizes = expected.shape[: len(place)]
    inputs = []
    for name, value in zip(posed.names, posed.arguments[call], strict=True):
        if callable(value):
            continue
        array = np.asarray(value, dtype=float)
        if len(place) > 1 and array.shape[: len(sizes)] == sizes:
            array = array[: place[0] + 1, place[1]]  # of this trajectory, up to this step
        elif place and array.ndim and array.shape[:1] == sizes[:1]:
            # what is found of a row may need its neighbours, as an interval does
            if axes[0] == "step":
                first, end = max(0, place[0] - 1), min(place[0] + 2, len(array))
                name, array = f"{name}[{first}:{end}]", array[first:end]
            else:
                array = array[place[0]]
        inputs.append(f"{name} = {_numbers(array)}")
    counted = "".join(f", {axis} {i}" for axis, i in zip(axes, place, strict=False))
    counted += " (counted from 0)" * bool(counted)
    return f"{counted}: for {', '.join(inputs)}", answered[place]


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
