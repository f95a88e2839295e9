"""Text -> tree: a line of a derivation, read without running it.

Characters, length and syntax are those of `symbolic.formula`, and so are numbers; in addition a
power may be typed ^, and there are means: M[...], the variance D[...] = M[...^2] - M[...]^2, and
Cov[..., ...].
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

import sympy as sp

from kfcourse.exercises.derivations.terms import (
    CALL,
    LETTER,
    MEAN,
    NUMBER,
    PRODUCT,
    SUM,
    Node,
    difference,
    mean,
    power,
    product,
)
from kfcourse.symbolic.formula import MAX_EXPONENT, FormulaError, Reader, syntax

FUNCTIONS = ("sin", "cos", "tan", "atan", "exp", "log", "sqrt", "sinh", "cosh", "tanh", "abs")
MEANS = ("M", "D", "Cov")
DEEPEST = 60  # brackets and functions, one in the other
LONGEST = 600  # numbers, letters and operations of a line

_OTHERWISE = re.compile(r"(\^|\blambda\b)")  # no formula of Python's as it stands
_IN_PYTHON = {"^": "**", "lambda": "lambda_"}


def read_line(text: str, name: Callable[[str], str | None] = lambda name: None) -> Node:
    """The tree of one expression.

    Parameters
    ----------
    text : str
    name : callable
        A letter's name -> what is wrong with it, or None.

    Raises
    ------
    FormulaError
        With the problem, the text and a pointer to the column.
    """
    python, columns, end = "", list[int](), 0
    for piece in _OTHERWISE.split(text):
        new = _IN_PYTHON.get(piece, piece)
        python += new
        columns += [end + min(i, len(piece) - 1) for i in range(len(new))]
        end += len(piece)
    columns.append(end)
    try:
        formula, tree, offset = syntax(python)
        return _Lines(formula, offset, name, columns).read(tree)
    except FormulaError as error:
        problem = error.problem.replace("lambda_", "lambda").replace(
            "; write ** for a power (x**2)", ""
        )
        raise FormulaError(text, problem, columns[min(error.column, len(columns) - 1)]) from None


class _Lines(Reader):
    """Turns white-listed syntax nodes into a tree."""

    def __init__(
        self, formula: str, offset: int, known: Callable[[str], str | None], columns: list[int]
    ):
        super().__init__(formula, {}, offset)
        self.known, self.columns = known, columns
        self.depth = self.count = 0

    def read(self, node: ast.expr) -> Node:
        self.depth, self.count = self.depth + 1, self.count + 1
        if self.depth > DEEPEST:
            raise self.fail(
                node, f"brackets stand one in the other more than {DEEPEST} deep; split the step up"
            )
        if self.count > LONGEST:
            raise self.fail(
                node,
                f"the line has more than {LONGEST} numbers, letters and signs; split the step up",
            )
        start, end = self.offset + node.col_offset, self.offset + (node.end_col_offset or 0)
        place = self.columns[start], self.columns[end - 1] + 1
        tree = self._tree(node)
        tree = replace(
            tree,
            span=place,
            parts=tuple(part if part.span else replace(part, span=place) for part in tree.parts),
        )
        self.depth -= 1
        return tree

    def _tree(self, node: ast.expr) -> Node:
        match node:
            case ast.Constant():
                return Node(NUMBER, data=Fraction(str(self.number(node))))
            case ast.Name():
                return self._letter(node)
            case ast.UnaryOp(op=ast.USub()):
                return Node(SUM, (self.read(node.operand),), (-1,))
            case ast.UnaryOp(op=ast.UAdd()):
                return self.read(node.operand)
            case ast.BinOp(op=ast.Add() | ast.Sub()):
                return self._flat(node, (ast.Add, ast.Sub), SUM)
            case ast.BinOp(op=ast.Mult() | ast.Div()):
                return self._flat(node, (ast.Mult, ast.Div), PRODUCT)
            case ast.BinOp(op=ast.Pow()):
                return self._power(node)
            case ast.Subscript(value=ast.Name(id=name), slice=of) if name in MEANS:
                return self._mean(node, name, list(of.elts) if isinstance(of, ast.Tuple) else [of])
            case ast.Call(func=ast.Name(id=name), keywords=[]) if name in MEANS:
                return self._mean(node, name, node.args)
            case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if (
                name in FUNCTIONS
            ):
                inner = self.read(argument)
                return (
                    power(inner, Fraction(1, 2)) if name == "sqrt" else Node(CALL, (inner,), name)
                )
            case ast.Call():
                known = ", ".join((*FUNCTIONS, "M[...]"))
                raise self.fail(
                    node,
                    f"a function that is not known here, or a product without *; known with one "
                    f"argument: {known}",
                )
        raise self.fail(
            node,
            "this has no meaning here; only + - * / ^ numbers, letters, functions and means M[...]",
        )

    def _letter(self, node: ast.Name) -> Node:
        name = "lambda" if node.id == "lambda_" else node.id
        if name in FUNCTIONS:
            raise self.fail(node, f"{name} is a function; write {name}(...)")
        if problem := self.known(name):
            raise self.fail(node, problem)
        return Node(LETTER, data=name)

    def _flat(self, node: ast.expr, operators: tuple[type, ...], kind: str) -> Node:
        """a - b + c and a*b/c as one node each, without recursion along the line."""
        parts: list[tuple[int, ast.expr]] = []
        inner = node
        while isinstance(inner, ast.BinOp) and isinstance(inner.op, operators):
            parts.append((1 if isinstance(inner.op, operators[0]) else -1, inner.right))
            inner = inner.left
        signs: list[int] = []
        trees: list[Node] = []
        minus = False
        for sign, part in [(1, inner), *reversed(parts)]:
            tree = self.read(part)
            negative = tree.kind == SUM and len(tree.parts) == 1
            if negative and kind == SUM:  # -a + b: the sign of a term, not a sum in a sum
                sign, tree = -sign, tree.parts[0]
            elif negative and not trees:  # -a*b is -(a*b)
                minus, tree = True, tree.parts[0]
            signs.append(sign)
            trees.append(tree)
        tree = Node(kind, tuple(trees), tuple(signs))
        return Node(SUM, (tree,), (-1,)) if minus else tree

    def _power(self, node: ast.BinOp) -> Node:
        try:
            exponent = Reader(self.formula, {}, self.offset).read(node.right)
        except FormulaError:
            exponent = sp.nan
        if not exponent.is_Rational:
            raise self.fail(
                node.right, "an exponent must be a plain number; write exp(...) for exponentials"
            )
        if abs(exponent) > MAX_EXPONENT or exponent.q > MAX_EXPONENT:
            raise self.fail(
                node.right, f"the exponent is larger than {MAX_EXPONENT}, or too fine a fraction"
            )
        return power(self.read(node.left), Fraction(str(exponent)))

    def _mean(self, node: ast.expr, name: str, arguments: list[ast.expr]) -> Node:
        if len(arguments) != (2 if name == "Cov" else 1):
            how = "two expressions: Cov[a, b]" if name == "Cov" else f"one expression: {name}[a]"
            raise self.fail(node, f"{name} takes {how}")
        first, second = (self.read(argument) for argument in (arguments[0], arguments[-1]))
        if name == "M":
            return Node(MEAN, (first,))
        if name == "D":
            return difference(mean(power(first, 2)), power(mean(first), 2))
        return difference(mean(product(first, second)), product(mean(first), mean(second)))


def tree_of(formula: sp.Expr) -> Node:
    """The tree of a formula of the package's."""
    return read_line(str(formula).replace("Abs(", "abs("))
