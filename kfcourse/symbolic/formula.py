"""Formulas typed by people, read safely.

A variants file may come from anybody, so a formula such as ``"c*x + e*x*v"`` is never evaluated
as Python.  Python's own parser builds the syntax tree (it runs nothing), and each node of a short
white list is turned into SymPy; everything else is an error that points at the place.
"""

from __future__ import annotations

import ast
import keyword
import operator
import re
import unicodedata
import warnings
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import sympy as sp
from sympy.logic.boolalg import Boolean

from kfcourse.errors import ModelError

NAMES = "sin cos tan atan atan2 exp log sqrt tanh sinh cosh Abs sign Heaviside"
FUNCTIONS = {name: getattr(sp, name) for name in NAMES.split()} | {"abs": sp.Abs}
CONSTANTS = {"pi": sp.pi}
OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: operator.pow, ast.USub: operator.neg, ast.UAdd: operator.pos,
}  # fmt: skip
COMPARISONS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Lt: sp.Lt, ast.LtE: sp.Le, ast.Gt: sp.Gt, ast.GtE: sp.Ge, ast.Eq: sp.Eq, ast.NotEq: sp.Ne,
}  # fmt: skip

NO_NUMBERS = (sp.zoo, sp.nan, sp.oo, -sp.oo, sp.I)
MAX_LENGTH = 2000
MAX_EXPONENT = 16
MAX_DEGREE = 24
MAX_NESTED = 5
# bases of numeric powers: nested powers must not exhaust the memory
MAX_NUMBER = sp.Integer(10) ** 16
# arguments of functions that are plain numbers: exp(exp(exp(9))) must not either
MAX_ARGUMENT = 500


class FormulaError(ValueError):
    """A formula cannot be read; the message shows the formula and points at the place."""

    def __init__(self, formula: str, problem: str, column: int = 0):
        line = "".join(c if c.isprintable() else " " for c in formula)
        shown = line if len(line) <= 100 else line[:97] + "..."
        pointer = f"\n    {' ' * column}^" if column < 100 else ""
        super().__init__(f"{problem}\n    {shown}{pointer}")
        self.formula, self.problem, self.column = formula, problem, column


def symbol(name: str) -> sp.Symbol:
    """The real SymPy symbol called `name`: two calls give the same symbol."""
    return sp.Symbol(name, real=True)


def check_name(name: str) -> str:
    """Return `name` if it can name a parameter or variable in a formula; ModelError if not."""
    if (
        not isinstance(name, str)
        or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,30}", name)
        or keyword.iskeyword(name)
        or name in FUNCTIONS | CONSTANTS
    ):
        raise ModelError(
            f"{name!r} cannot name a symbol: use letters, digits and _, a letter first; no word "
            f"that already means something in formulas or in Python"
        )
    return name


def parse(formula: str, symbols: dict[str, sp.Symbol]) -> sp.Expr:
    """Read one formula.

    Parameters
    ----------
    formula : str
        Arithmetic (``+ - * / **``), numbers, the functions of `FUNCTIONS`, ``pi``, the names in
        `symbols`, and choices: ``2 if t < 45 else 0``.
    symbols : dict
        Name to SymPy symbol; any other name is an error.

    Raises
    ------
    FormulaError
        With the problem, the formula and a pointer to the column.

    Examples
    --------
    >>> from kfcourse.symbolic.formula import parse, symbol
    >>> x, v = symbol("x"), symbol("v")
    >>> parse("x - x**2*sin(v)", {"x": x, "v": v})
    -x**2*sin(v) + x
    """
    formula, tree, offset = syntax(formula)
    try:
        expression = Reader(formula, symbols, offset).read(tree)
    except RecursionError:
        raise FormulaError(formula, "the formula is nested too deeply; split it up") from None
    except TypeError:  # SymPy's, where numbers that are not real are compared
        raise FormulaError(formula, "the formula compares what has no real value") from None
    if expression.has(*NO_NUMBERS):
        raise FormulaError(
            formula,
            "the formula has no finite real value (division by zero or root of a negative?)",
        )
    return expression


def syntax(formula: str) -> tuple[str, ast.expr, int]:
    """The formula on one line, its syntax tree, and the column at which that begins; nothing of it
    is run.

    Raises
    ------
    FormulaError
        It is too long, has characters that formulas have not, or is no expression of Python.
    """
    if not isinstance(formula, str) or not formula.strip() or len(formula) > MAX_LENGTH:
        raise FormulaError(
            str(formula), f"a formula is a text, not empty, of at most {MAX_LENGTH} characters"
        )
    formula = re.sub(r"[\t\n\r]", " ", formula)  # of a text over several lines
    _check_characters(formula)
    offset = len(formula) - len(formula.lstrip())
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # Python's, of what it reads in two ways: 1if x
            tree = ast.parse(formula.strip(), mode="eval").body
    except SyntaxError as error:
        column = offset + max((error.offset or 1) - 1, 0)
        hint = (
            "; a product needs *, as in 2*x"
            if re.search(r"[0-9)]\s*[A-Za-z(]|\w\s+\w", formula)
            else ""
        )
        # Python's words of brackets are good; what else it says is for programmers
        words = (
            error.msg
            if re.search("closed|match|nested", error.msg)
            else "something is missing here, or too much"
        )
        raise FormulaError(formula, f"the formula cannot be read: {words}{hint}", column) from None
    except (ValueError, MemoryError, RecursionError):
        raise FormulaError(
            formula, "the formula cannot be read: nested too deeply or has forbidden characters"
        ) from None
    return formula, tree, offset


# Typed for what formulas are made of: signs of printed mathematics, and Cyrillic letters that look
# Latin.
_INSTEAD = {"^": "** for a power (x**2)", "#": "comments elsewhere", "²": "**2", "³": "**3"} | {
    typed: f"{plain} of the English keyboard"
    for typed, plain in zip("асеорхуАВСЕНКМОРТХ−–·×⋅∙÷", "aceopxyABCEHKMOPTX--****/", strict=True)
}


def _check_characters(formula: str) -> None:
    """FormulaError at the first character that formulas have not: Python would take ſ for s, and
    end at #."""
    for column, character in enumerate(formula):
        if not (character.isascii() and character.isprintable()) or character in "^#":
            cure = f"; write {_INSTEAD[character]}" if character in _INSTEAD else ""
            name = unicodedata.name(character, f"U+{ord(character):04X}").lower()
            shown = character if character.isprintable() else "a character"
            raise FormulaError(
                formula, f"{shown} ({name}) has no meaning in a formula{cure}", column
            )


class Reader:
    """Turns white-listed syntax nodes into SymPy; `read` recurses over the tree."""

    def __init__(self, formula: str, symbols: dict[str, sp.Symbol], offset: int):
        self.formula, self.symbols, self.offset = formula, symbols, offset
        self.nested = 0  # function calls around the node being read

    def fail(self, node: ast.expr, problem: str) -> FormulaError:
        return FormulaError(self.formula, problem, self.offset + node.col_offset)

    def read(self, node: ast.expr) -> sp.Expr:
        match node:
            case ast.Constant():
                return self.number(node)
            case ast.Name():
                return self.name(node)
            case ast.UnaryOp() if type(node.op) in OPERATORS:
                return OPERATORS[type(node.op)](self.read(node.operand))
            case ast.BinOp() if type(node.op) in OPERATORS:
                return self.operation(node)
            case ast.Call():
                return self.call(node)
            case ast.IfExp():
                return sp.Piecewise(
                    (self.read(node.body), self.condition(node.test)),
                    (self.read(node.orelse), True),
                )
        raise self.fail(
            node,
            f"{type(node).__name__} is not allowed in a formula; only + - * / ** numbers, names, "
            f"functions",
        )

    def number(self, node: ast.Constant) -> sp.Expr:
        if isinstance(node.value, bool) or not isinstance(node.value, int | float):
            raise self.fail(node, f"{node.value!r} is not a real number")
        written = (ast.get_source_segment(self.formula[self.offset :], node) or "").replace("_", "")
        value = node.value
        # as written: 1e-400 is 0 as a float, and 0e999999999 would take for ever as a fraction
        if value == 0 and (isinstance(value, int) or not re.match("[0.]*[1-9]", written)):
            return sp.S.Zero
        if not 1e-100 < value < 1e100:
            raise self.fail(
                node,
                "the number is too large or too small (1e-100 to 1e100 are read): change the units",
            )
        return sp.Rational(value if isinstance(value, int) else written)

    def name(self, node: ast.Name) -> sp.Expr:
        known = self.symbols | CONSTANTS
        if node.id in known:
            return known[node.id]
        if node.id in FUNCTIONS:
            raise self.fail(node, f"{node.id} is a function; write {node.id}(...)")
        names = ", ".join(sorted(known))
        raise self.fail(
            node,
            f"unknown symbol {node.id!r}; known here: {names}. A parameter needs a value in "
            f"`parameters`",
        )

    def operation(self, node: ast.BinOp) -> sp.Expr:
        left, right = self.read(node.left), self.read(node.right)
        if isinstance(node.op, ast.Pow):
            self.check_power(node, left, right)
        result = OPERATORS[type(node.op)](left, right)
        # now, not at the end: numbers in a power of powers of powers would fill the memory
        if not isinstance(node.op, ast.Add | ast.Sub) and degree(result) > MAX_DEGREE:
            raise self.fail(
                node,
                f"the formula has products of powers above degree {MAX_DEGREE}; simplify it",
            )
        return result

    def check_power(self, node: ast.BinOp, base: sp.Expr, exponent: sp.Expr) -> None:
        if not exponent.is_Rational or abs(exponent) > MAX_EXPONENT:
            raise self.fail(
                node.right,
                f"an exponent must be a plain number, at most {MAX_EXPONENT}; write exp(...) for "
                f"exponentials",
            )
        if base.is_number and base.is_negative and not exponent.is_Integer:
            raise self.fail(node, "a root of a negative number has no real value")
        if base.is_number and base and not 1 / MAX_NUMBER < abs(base) < MAX_NUMBER:
            raise self.fail(node, "the power of this number is too large or too small")

    def condition(self, node: ast.expr) -> Boolean:
        if not isinstance(node, ast.Compare) or any(type(op) not in COMPARISONS for op in node.ops):
            raise self.fail(node, "a condition compares: x < 1, 30 <= t < 45, k == 20")
        sides = pairwise([self.read(side) for side in (node.left, *node.comparators)])
        pairs = zip(node.ops, sides, strict=True)
        return sp.And(*(COMPARISONS[type(op)](*pair) for op, pair in pairs))

    def call(self, node: ast.Call) -> sp.Expr:
        if not isinstance(node.func, ast.Name) or node.func.id not in FUNCTIONS:
            hint = "" if isinstance(node.func, ast.Name) else "; a product needs *"
            raise self.fail(
                node,
                f"{ast.unparse(node.func)[:40]!r} is not a known function{hint}; known: "
                f"{', '.join(sorted(FUNCTIONS))}",
            )
        count = 1 + (node.func.id == "atan2")  # atan2(y, x) is the angle of the point (x, y)
        if node.keywords or len(node.args) != count:
            raise self.fail(node, f"{node.func.id} takes {count} argument{'s' * (count > 1)}")
        if self.nested >= MAX_NESTED:
            raise self.fail(node, f"functions are nested more than {MAX_NESTED} deep")
        self.nested += 1
        arguments = [self.read(argument) for argument in node.args]
        self.nested -= 1
        if any(
            argument.has(*NO_NUMBERS) or (argument.is_number and abs(argument) >= MAX_ARGUMENT)
            for argument in arguments
        ):
            raise self.fail(
                node, f"the argument of {node.func.id} is too large, or has no finite real value"
            )
        return FUNCTIONS[node.func.id](*arguments)


def degree(expression: sp.Expr, variables: Sequence[sp.Symbol] = ()) -> int:
    """A bound on the degree the expression would have if its integer powers were expanded; with
    variables in them, outside exponentials."""
    if variables and (isinstance(expression, sp.exp) or not expression.has(*variables)):
        return 0
    if expression.is_Pow and expression.exp.is_Integer:
        return int(abs(expression.exp)) * degree(expression.base, variables)
    if expression.args:
        each = (degree(argument, variables) for argument in expression.args)
        return sum(each) if expression.is_Mul else max(each)
    return int(bool(expression.free_symbols))
