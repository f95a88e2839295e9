"""Known mistakes as edits of a key's source, and keys on top of other answers.

A key is a plain function.  It may call other functions of the exercises by their names; an edit may
be in one of these, and another answer may stand in the place of one.  Mistakes that are in no
catalogue are changes of one node of its syntax.
"""

from __future__ import annotations

import ast
import copy
import inspect
from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from types import CodeType, FunctionType
from typing import Any

import numpy as np
import scipy
import sympy as sp

from kfcourse.exercises.checks.question import Answer, Mistake
from kfcourse.exercises.checks.steps import at_step, at_wrong_step

SETS = "kfcourse.exercises.sets."
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
    source = inspect.getsource(function)
    (definition,) = ast.parse(source).body
    first = definition.body[0]  # type: ignore[attr-defined]
    text = ast.get_source_segment(source, first) if function.__doc__ else ""
    return source.replace(str(text), "", 1)


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
    functions: dict[str, FunctionType] = {}
    waiting: list[Callable] = [key]
    while waiting:
        function = waiting.pop(0)
        if not isinstance(function, FunctionType) or function.__name__ in functions:
            continue
        if function is key or function.__module__.startswith(SETS):
            functions[function.__name__] = function
            waiting += [
                function.__globals__[name]
                for name in _names(function.__code__)
                if name in function.__globals__
            ]
    return functions


def uses(key: Answer) -> set[str]:
    """Names that the key and what it calls use, also of functions that are put in only later."""
    return {name for function in pieces(key).values() for name in _names(function.__code__)}


def _names(code: CodeType) -> list[str]:
    inner = [name for part in code.co_consts if isinstance(part, CodeType) for name in _names(part)]
    return [*code.co_names, *inner]


OPERATORS: dict[type, tuple[str, type[ast.operator]]] = {
    ast.Add: ("one-sign-wrong", ast.Sub),
    ast.Sub: ("one-sign-wrong", ast.Add),
    ast.Mult: ("product-for-quotient", ast.Div),
    ast.Div: ("product-for-quotient", ast.Mult),
}
LOST = {
    ast.Add: "term-lost",
    ast.Sub: "term-lost",
    ast.Mult: "factor-lost",
    ast.Div: "factor-lost",
    ast.MatMult: "factor-lost",
    ast.Pow: "power-lost",
}


def changes(node: ast.AST, names: Sequence[str] = ()) -> Iterator[tuple[str, ast.expr]]:
    """Kind of slip, and what would stand in the place of a node; one of these names in that of
    another."""
    match node:
        case ast.Name(id=own) if own in names:
            yield from (("other-letter", ast.Name(name)) for name in names if name != own)
        case ast.BinOp(left=left, op=op, right=right):
            if type(op) in OPERATORS:
                kind, opposite = OPERATORS[type(op)]
                yield kind, ast.BinOp(left, opposite(), right)
            if isinstance(op, ast.MatMult):
                yield "other-order", ast.BinOp(right, op, left)
            if lost := LOST.get(type(op)):
                yield lost, left
                if isinstance(op, ast.Sub):
                    yield lost, ast.UnaryOp(ast.USub(), right)
                elif isinstance(op, ast.Div):
                    yield lost, ast.BinOp(ast.Constant(1), op, right)
                elif not isinstance(op, ast.Pow):
                    yield lost, right
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            yield "one-sign-wrong", operand
        case ast.Attribute(value=value, attr="T"):
            yield "other-order", value
        case ast.Call(func=function, args=[first, second], keywords=[]):
            yield "other-order", ast.Call(function, [second, first], [])
        case ast.Call(args=[only], keywords=[]) if not isinstance(only, ast.Starred):
            yield "function-lost", only
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            for other in (value + 1, value - 1, 2 * value):
                yield "other-number", ast.Constant(other)


def changed_keys(key: Answer) -> Iterator[tuple[str, Answer]]:
    """The key with one node of its source changed, in each way: kind of slip, the key.

    What a change might never end stays as it is: `while`, and what a loop goes through.
    """
    sources = {name: _source(function) for name, function in pieces(key).items()}
    for letters in (False, True):  # of which there are many
        for name, source in sources.items():
            tree = ast.parse("" if "while " in source else source)
            nodes = list(ast.walk(tree))
            names = sorted({node.arg for node in nodes if isinstance(node, ast.arg)})
            fixed = [node.iter for node in nodes if isinstance(node, ast.For | ast.comprehension)]
            left = [node for loop in fixed for node in ast.walk(loop)]
            for node in nodes:
                if isinstance(node, ast.Name) is letters and node not in left:
                    for kind, new in changes(node, names):
                        yield kind, _built(key, {**sources, name: replaced(tree, node, new)})


def replaced(tree: ast.AST, old: ast.AST, new: ast.AST) -> str:
    """The source of a tree with another node in the place of one."""
    return ast.unparse(copy.deepcopy(tree, {id(old): new}))
