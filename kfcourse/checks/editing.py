"""Known mistakes as edits of a key's source, and keys on top of other answers.

A key is a plain function.  It may call other functions of the exercises by their names; an edit may
be in one of these, and another answer may stand in the place of one.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable
from functools import cache, partial
from types import CodeType, FunctionType
from typing import Any

import numpy as np
import scipy
import sympy as sp

from kfcourse.checks.question import Answer, Mistake
from kfcourse.checks.steps import at_step, at_wrong_step

SETS = "kfcourse.exercises."
# for what an edit writes
NAMES = {"np": np, "sp": sp, "scipy": scipy, "at_step": at_step, "at_wrong_step": at_wrong_step}


def edits(key: Answer, *rows: tuple[str, ...]) -> tuple[Mistake, ...]:
    """Known mistakes from rows of name, what to say, old text and new text; further pairs of texts
    may follow."""
    return tuple(
        Mistake(name, says, partial(_call, key, tuple(texts))) for name, says, *texts in rows
    )


def _call(key: Answer, texts: tuple[str, ...], *values: Any) -> Any:
    return edited(key, *texts)(*values)


@cache
def edited(key: Answer, *texts: str) -> Answer:
    """The key with each old text replaced by the new one after it, in its source or in that of what
    it calls.

    Raises
    ------
    ValueError
        A text does not stand in exactly one place.
    """
    sources = {name: _source(function) for name, function in pieces(key).items()}
    for old, new in zip(texts[::2], texts[1::2], strict=True):
        where = [name for name, source in sources.items() if old in source]
        if (
            not where
            or (where[0] != key.__name__ and len(where) > 1)
            or sources[where[0]].count(old) > 1
        ):
            raise ValueError(
                f"an edit of {key.__name__}: {old!r} stands in {where or 'no place'}; it has to "
                f"stand in one"
            )
        sources[where[0]] = sources[where[0]].replace(old, new)
    return _built(key, sources)


def rebound(key: Answer, answers: dict[str, Answer]) -> Answer:
    """The key with other answers in the place of functions that it calls."""
    return _built(key, {name: _source(function) for name, function in pieces(key).items()}, answers)


def _source(function: FunctionType) -> str:
    """The source without the docstring, whose formulas look like the code."""
    lines = inspect.getsource(function).splitlines(keepends=True)
    (definition,) = ast.parse("".join(lines)).body
    first = definition.body[0]  # type: ignore[attr-defined]
    return (
        "".join(lines[: first.lineno - 1] + lines[first.end_lineno :])
        if inspect.getdoc(function)
        else "".join(lines)
    )


def _built(
    key: Answer, sources: dict[str, str], answers: dict[str, Answer] | None = None
) -> Answer:
    space: dict[str, Any] = dict(NAMES)
    for function in reversed(pieces(key).values()):
        space |= function.__globals__
    for source in sources.values():
        exec(source, space)
    space |= answers or {}
    return space[key.__name__]


@cache
def pieces(key: Answer) -> dict[str, FunctionType]:
    """The key, if it is a plain function, and the functions of the exercises that it calls, by
    name; the key is the first."""
    found: dict[str, FunctionType] = {}
    waiting: list[Callable] = [key]
    while waiting:
        function = waiting.pop(0)
        if not isinstance(function, FunctionType) or function.__name__ in found:
            continue
        if function is key or function.__module__.startswith(SETS):
            found[function.__name__] = function
            waiting += [
                function.__globals__[name]
                for name in _names(function.__code__)
                if name in function.__globals__
            ]
    return found


def uses(key: Answer) -> set[str]:
    """Names that the key and what it calls use, also of functions that are put in only later."""
    return {name for function in pieces(key).values() for name in _names(function.__code__)}


def _names(code: CodeType) -> list[str]:
    inner = [name for part in code.co_consts if isinstance(part, CodeType) for name in _names(part)]
    return [*code.co_names, *inner]
