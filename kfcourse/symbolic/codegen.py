"""SymPy expressions -> vectorised NumPy over the ensemble.

The only place where expressions become code.  `lower` splits expressions into elementary assignments
(common subexpressions once, small powers as products) that any target could print; `numpy_source`
prints them as NumPy, `javascript.loop` as JavaScript.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, reduce
from typing import Any

import numpy as np
import sympy as sp
from sympy.printing.codeprinter import PrintMethodNotImplementedError
from sympy.printing.numpy import NumPyPrinter
from sympy.printing.precedence import PRECEDENCE

from kfcourse.symbolic.formula import NO_NUMBERS
from kfcourse.symbolic.reading import ModelError

SHORT = 50  # operations of formulas whose common factors are taken out


@dataclass(frozen=True)
class Program:
    """Straight-line code: assignments in order, then the entries of each output.

    Attributes
    ----------
    assignments : list of (Symbol, Expr)
    outputs : dict
        Name to Matrix; a column matrix of a *vector* output has `vectors` containing its name.
    vectors : frozenset of str
        Outputs returned as (..., n); the others are matrices (..., r, c).
    """

    assignments: list[tuple[sp.Symbol, sp.Expr]]
    outputs: dict[str, sp.MatrixBase]
    vectors: frozenset[str]


@dataclass(frozen=True)
class Compiled:
    """A generated function and the source it was compiled from."""

    function: Callable[..., Any]
    source: str


def compile_function(
    name: str,
    arguments: Mapping[str, sp.MatrixBase],
    outputs: Mapping[str, sp.MatrixBase],
    vectors: Sequence[str],
    doc: str = "",
    definitions: Mapping[sp.Symbol, sp.Expr] | None = None,
) -> Compiled:
    """Compile expressions into one function of arrays.

    Parameters
    ----------
    name : str
        Name of the generated function.
    arguments : dict
        Argument name to the matrix of symbols that it holds.
    outputs : dict
        Output name to the matrix of expressions; the function returns them as a tuple in this order.
    vectors : sequence of str
        Arguments and outputs that are vectors (..., n); the others are matrices (..., r, c).
    doc : str
        First line of the generated docstring.
    definitions : dict, optional
        Auxiliary symbols that the outputs may use, and their expressions in the arguments.

    Returns
    -------
    Compiled
        `function(*arrays)`: leading axes broadcast.  A matrix has those of the arguments that enter it, so what is the same for
        every trajectory is found once; and so has an output of one entry, or one that no argument enters.

    Raises
    ------
    ModelError
        No real number, a number beyond floats, a function that NumPy has not, a symbol that is no argument.
    """
    matrices = (tuple((key, sp.ImmutableMatrix(one)) for key, one in given.items()) for given in (arguments, outputs))
    return _compiled(name, *matrices, tuple(vectors), doc, tuple((definitions or {}).items()))


@lru_cache(maxsize=256)  # every filter of a model, and every check, wants the same functions
def _compiled(
    name: str,
    argument_items: tuple[tuple[str, sp.ImmutableMatrix], ...],
    output_items: tuple[tuple[str, sp.ImmutableMatrix], ...],
    vectors: tuple[str, ...],
    doc: str,
    definition_items: tuple[tuple[sp.Symbol, sp.Expr], ...],
) -> Compiled:
    arguments, outputs, definitions = dict(argument_items), dict(output_items), dict(definition_items)
    for expression in (*outputs.values(), *definitions.values()):
        if expression.has(*NO_NUMBERS):
            raise ModelError(
                f"{name}: no finite real value, as at the mean of a noise something is divided by 0, or the root of a negative "
                "number taken; use unscented(model) or gauss_hermite(model), or another mean of the noise"
            )
    try:
        source = printed(lambda program: numpy_source(name, arguments, program, doc), outputs, vectors, definitions)
    except PrintMethodNotImplementedError as error:  # of a solution that SymPy found, with LambertW
        raise ModelError(f"{name}: {str(error).splitlines()[0].rpartition(' ')[2]} is no function of NumPy") from None
    if beyond := re.search(r"\bmath\.(\w+)", source):  # Python has erf and gamma, of numbers and not of arrays
        raise ModelError(f"{name}: {beyond[1]} is no function of NumPy")
    namespace: dict[str, Any] = {"np": np}
    exec(compile(source, f"<generated {name}>", "exec"), namespace)  # our own text: printed from SymPy, no user strings
    return Compiled(namespace[name], source)


class BeyondFloats(ModelError):
    """The functions hold a number that is no float."""


def printed(
    text_of: Callable[[Program], str],
    outputs: Mapping[str, sp.MatrixBase],
    vectors: Sequence[str],
    definitions: Mapping[sp.Symbol, sp.Expr],
) -> str:
    """What a target prints of the functions.  Common factors stay where they are if one of them is beyond what a float can be:

    (x + 1e-99)**4 = 1e-396*(1e99*x + 1)**4
    """
    try:
        return text_of(lower(outputs, vectors, definitions))
    except BeyondFloats:
        return text_of(lower(outputs, vectors, definitions, factor=False))


def lower(
    outputs: Mapping[str, sp.MatrixBase],
    vectors: Sequence[str],
    definitions: Mapping[sp.Symbol, sp.Expr],
    factor: bool = True,
) -> Program:
    """Common subexpressions, with common factors taken out of short formulas, and small integer powers as elementary assignments.

    Of long ones factors would hide more common subexpressions than they save products, and take most of the time.
    """
    everything = [*definitions.values(), *(entry for matrix in outputs.values() for entry in matrix)]
    short = sum(int(sp.count_ops(entry)) for entry in everything) <= SHORT
    matrices = tuple((key, sp.ImmutableMatrix(one)) for key, one in outputs.items())
    return _lowered(matrices, tuple(vectors), tuple(definitions.items()), factor and short)


@lru_cache(maxsize=256)  # modes often have the same object, or the same meter; so have models that differ in one noise
def _lowered(
    output_items: tuple[tuple[str, sp.ImmutableMatrix], ...],
    vectors: tuple[str, ...],
    definition_items: tuple[tuple[sp.Symbol, sp.Expr], ...],
    factor: bool,
) -> Program:
    outputs, definitions = dict(output_items), dict(definition_items)
    names = sp.numbered_symbols("s", cls=sp.Dummy)
    everything = [*definitions.values(), *(sp.Matrix(m) for m in outputs.values())]
    found, reduced = sp.cse(everything, symbols=names, optimizations="basic" if factor else None)
    shared = _in_order([*found, *zip(definitions, reduced[: len(definitions)], strict=True)])
    assignments: list[tuple[sp.Symbol, sp.Expr]] = []
    powers: dict[tuple[sp.Expr, int], sp.Expr] = {}
    aliases: dict[sp.Expr, sp.Expr] = {}

    def power(base: sp.Expr, exponent: int) -> sp.Expr:
        """base**exponent as products; every intermediate power is computed once."""
        if exponent == 1:
            return base
        if (base, exponent) not in powers:
            left, right = (exponent - 1, 1) if exponent % 2 else (exponent // 2, exponent // 2)
            powers[base, exponent] = assign(sp.Mul(power(base, left), power(base, right), evaluate=False))
        return powers[base, exponent]

    def assign(value: sp.Expr) -> sp.Symbol:
        target = next(names)
        assignments.append((target, value))
        return target

    def without_powers(e: sp.Expr) -> sp.Expr:
        if not e.args:
            return aliases.get(e, e)
        arguments = [without_powers(a) for a in e.args]
        if e.is_Pow and e.exp.is_Integer and not e.base.is_number and abs(e.exp) >= 2:
            base = arguments[0] if arguments[0].is_Symbol else assign(arguments[0])
            product = power(base, abs(int(e.exp)))
            return product if e.exp > 0 else sp.Pow(product, -1, evaluate=False)
        if e.is_Pow and e.exp.is_number:
            return sp.Pow(arguments[0], e.exp, evaluate=False)
        return e.func(*arguments, evaluate=False) if e.is_Add or e.is_Mul else e.func(*arguments)

    for target, value in shared:
        reduced_value = without_powers(value)
        if reduced_value.is_Symbol or not reduced_value.free_symbols:  # constants stay where they are used
            aliases[target] = reduced_value
        else:
            assignments.append((target, reduced_value))
    lowered = {
        key: sp.Matrix(*matrix.shape, [without_powers(entry) for entry in matrix])
        for key, matrix in zip(outputs, reduced[len(definitions) :], strict=True)
    }
    return Program(assignments, lowered, frozenset(vectors))


def _in_order(assignments: list[tuple[sp.Symbol, sp.Expr]]) -> list[tuple[sp.Symbol, sp.Expr]]:
    """The assignments with every symbol defined before it is used."""
    waiting, ordered = list(assignments), []
    while waiting:
        undefined = {target for target, _ in waiting}
        ready = [a for a in waiting if not a[1].free_symbols & undefined]
        ordered += ready
        waiting = [a for a in waiting if a not in ready]
    return ordered


def float_text(number: sp.Rational | sp.Float) -> str:
    """The float nearest to a number, as every target prints it; BeyondFloats if there is none."""
    value = float(number) if abs(number) < 2**1023 else np.inf
    if not np.isfinite(value) or (number and not value):
        raise BeyondFloats(
            f"the derived functions hold the number {sp.N(number, 3)!s}, beyond what a float can be; change the units"
        )
    return repr(value)


class NumbersPrinter(NumPyPrinter):
    """NumPy with floats for rational numbers and readable products."""

    _module = "np"

    def __init__(self, rename: Mapping[sp.Symbol, str]):
        super().__init__({"fully_qualified_modules": True})
        self.rename = rename

    def _module_format(self, fqn: str, register: bool = True) -> str:
        return super()._module_format(fqn, register).replace("numpy.", "np.")

    def _print_Symbol(self, expr: sp.Symbol) -> str:
        if expr not in self.rename:
            raise ModelError(f"the symbol {expr} is neither an argument nor defined; give it a value, or make it an argument")
        return self.rename[expr]

    _print_Dummy = _print_Symbol

    def _print_Rational(self, expr: sp.Rational) -> str:
        return float_text(expr)

    _print_Integer = _print_Rational
    _print_Half = _print_Rational
    _print_Float = _print_Rational

    def _print_Mul(self, expr: sp.Mul) -> str:
        rational = sp.Mul(*(a for a in expr.args if a.is_Rational))
        others = [a for a in expr.args if not a.is_Rational]
        denominators = [a for a in others if a.is_Pow and a.exp == -1]
        numerators = [a for a in others if a not in denominators]
        factors = [self.parenthesize(a, PRECEDENCE["Mul"]) for a in numerators]
        if rational not in (1, -1) or not factors:
            factors.insert(0, self._print_Rational(rational))
            rational = sp.S.One
        text = ("-" if rational == -1 else "") + "*".join(factors)
        for d in denominators:
            text += "/" + self.parenthesize(d.base, PRECEDENCE["Pow"])
        return text

    def _print_Max(self, expr: sp.Max) -> str:
        return self._of_two("np.maximum", expr)

    def _print_Min(self, expr: sp.Min) -> str:
        return self._of_two("np.minimum", expr)

    def _of_two(self, function: str, expr: sp.Basic) -> str:
        """A function of two numbers, of all arguments one after the other."""
        return reduce(lambda so_far, one: f"{function}({so_far}, {one})", map(self._print, expr.args))

    def _print_Pow(self, expr: sp.Pow, rational: bool = False) -> str:
        base = self.parenthesize(expr.base, PRECEDENCE["Pow"])
        if expr.exp == -1:
            return f"1.0/{base}"
        if expr.exp == sp.S.Half:
            return f"np.sqrt({self._print(expr.base)})"
        return f"{base}**{self.parenthesize(expr.exp, PRECEDENCE['Pow'])}"


def numpy_source(name: str, arguments: Mapping[str, sp.MatrixBase], program: Program, doc: str) -> str:
    """The program as the text of a NumPy function."""
    used = set().union(
        *(value.free_symbols for _, value in program.assignments), *(m.free_symbols for m in program.outputs.values())
    )
    rename = {target: f"s{i}" for i, (target, _) in enumerate(program.assignments)}
    lines = [f"def {name}({', '.join(arguments)}):", f'    """{doc}"""']
    for argument, entries in arguments.items():
        seen = set()
        for index, entry in enumerate(entries):
            if entry not in used or entry in seen:
                continue
            seen.add(entry)
            row, column = divmod(index, entries.shape[1])
            rename[entry] = f"{argument}_{row + 1}" if argument in program.vectors else f"{argument}_{row + 1}{column + 1}"
            where = f"{row}" if argument in program.vectors else f"{row}, {column}"
            lines.append(f"    {rename[entry]} = {argument}[..., {where}]")
    printer = NumbersPrinter(rename)
    lines += [f"    {rename[target]} = {printer.doprint(value)}" for target, value in program.assignments]
    for output, entries in program.outputs.items():
        is_vector = output in program.vectors
        enter = arguments if is_vector else _entering(entries, arguments, program)
        leads = ", ".join(f"{a}.shape[:{-1 if a in program.vectors else -2}]" for a in enter)
        lines += _assemble(output, entries, is_vector, leads, printer)
    lines.append(f"    return {', '.join(program.outputs)}{',' if len(program.outputs) == 1 else ''}")
    return "\n".join(lines) + "\n"


def _entering(entries: sp.MatrixBase, arguments: Mapping[str, sp.MatrixBase], program: Program) -> list[str]:
    """Names of the arguments that these entries are made of, also by way of assignments."""
    symbols = set(entries.free_symbols)
    for target, value in reversed(program.assignments):  # each uses earlier ones only
        if target in symbols:
            symbols |= value.free_symbols
    return [name for name, matrix in arguments.items() if symbols & matrix.free_symbols]


def _assemble(output: str, entries: sp.MatrixBase, is_vector: bool, leads: str, printer: NumbersPrinter) -> list[str]:
    """Lines that put the entries of one output together; `leads`: shapes of the leading axes that it has."""
    rows, columns = entries.shape
    if not entries.free_symbols:
        texts = [[printer.doprint(entries[i, j]) for j in range(columns)] for i in range(rows)]
        nested = [row[0] for row in texts] if is_vector else ["[" + ", ".join(row) + "]" for row in texts]
        return [f"    {output} = np.array([{', '.join(nested)}])"]
    if len(entries) == 1:
        axes = "None" if is_vector else "None, None"
        text = printer.doprint(entries[0])
        return [f"    {output} = {text if text.isidentifier() else f'({text})'}[..., {axes}]"]
    size = f"({rows},)" if is_vector else f"({rows}, {columns})"
    lines = [f"    {output} = np.empty(np.broadcast_shapes({leads}) + {size})"]
    numbers = [entry.is_number for entry in entries]
    if 2 * sum(numbers) > len(numbers):  # one pass for all of them
        flat = [str(printer.doprint(entry if number else sp.S.Zero)) for entry, number in zip(entries, numbers, strict=True)]
        rest = ["[" + ", ".join(flat[i : i + columns]) + "]" for i in range(0, len(flat), columns)]
        lines.append(f"    {output}[...] = [{', '.join(flat if is_vector else rest)}]")
    else:
        numbers = [False] * len(numbers)
    for index, entry in enumerate(entries):
        if numbers[index]:
            continue
        row, column = divmod(index, columns)
        where = f"{row}" if is_vector else f"{row}, {column}"
        lines.append(f"    {output}[..., {where}] = {printer.doprint(entry)}")
    return lines
