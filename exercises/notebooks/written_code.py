"""Python that a student could have written, printed from derived formulas: for solutions that
differ from variant to variant."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from sympy.printing.str import StrPrinter

from kfcourse.exercises.checks import Exercise
from kfcourse.exercises.derivations.worked import without_expm1
from kfcourse.symbolic.sides import Side, plain

COLUMNS = 70  # of the page's 78, less the indents of a function and of its brackets


@dataclass(frozen=True)
class Solutions:
    """Lines of Python that compute a derived formula, for the solution cells of masters."""

    exercise: Exercise

    def functions(self, kind: str, side: str) -> str:
        """Body of a function of (z, p) or (m, d) that returns (tau, Theta) or (h, G, F)."""
        structure = self.exercise.closed(kind)
        names = ("tau", "Theta") if side == "object" else ("h", "G", "F")
        return self._body(side, {name: structure[name] for name in names})

    def jacobians(self, side: str) -> str:
        """Body of a function of the mean that returns the Jacobians by state and by noise."""
        part = Side.of(self.exercise.model, side)
        names = ("a_x", "a_v") if side == "object" else ("b_x", "b_w")
        return self._body(
            side, dict(zip(names, (plain(part.A), plain(part.B)), strict=True)), cov=False
        )

    def unexplained(self) -> str:
        """Body of a function of (m, d) that returns R = F - G d G^T of the Gaussian functions."""
        return self._body("meter", {"R": self.exercise.closed("gaussian")["R"]})

    def derivation(self, name: str) -> str:
        """Body of a function that returns a right derivation: the answer to the question of that
        name."""
        text = self.exercise.questions[name].answer(self.exercise)()
        return "\n".join(
            [
                'return """',
                *(part for line in text.splitlines() for part in _continued(line)),
                '"""',
            ]
        )

    def meter_is_silent(self) -> bool:
        """Whether the meter's noise, at the start and at the prior mean, leaves a combination of
        measurements exactly known."""
        model, known = self.exercise.model, (0,) if self.exercise.model.timed else ()
        measure, _ = self.exercise.functions("linearised", *known)
        F = measure(model.prior.mean[None], np.zeros((1, model.n, model.n)))[2][0]
        return bool(np.linalg.matrix_rank(F) < model.p)

    def _body(self, side: str, formulas: Mapping[str, Any], cov: bool = True) -> str:
        part = Side.of(self.exercise.model, side)
        mean_name, cov_name = ("z", "p") if side == "object" else ("m", "d")
        lines = []
        if self.exercise.model.n > 1:
            lines.append(f"{', '.join(map(str, part.mean))} = {mean_name}")
            if cov:
                n = self.exercise.model.n
                upper = [(i, j) for i in range(n) for j in range(i, n)]
                entries = ", ".join(f"{cov_name}[{i}, {j}]" for i, j in upper)
                lines.append(f"{', '.join(str(part.cov[i, j]) for i, j in upper)} = {entries}")
        if len(formulas) == 1:
            values = [folded(python(*formulas.values()))]
        else:
            values = [folded(f"{python(formula)},  # {name}") for name, formula in formulas.items()]
        return "\n".join([*lines, *returned([line for value in values for line in value])])


def _continued(line: str) -> list[str]:
    """A line of a text in three quotes, in lines that fit the page: a backslash at the end of a
    line joins them."""
    if line.startswith("#") or len(line) <= COLUMNS:
        return [line]
    lines = _wrapped(line, COLUMNS - 4)
    return [f"{part} \\" for part in lines[:-1]] + lines[-1:]


def _wrapped(text: str, columns: int) -> list[str]:
    return textwrap.wrap(
        text, columns, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False
    )


def returned(lines: Sequence[str]) -> list[str]:
    """A return statement, in brackets where it takes several lines."""
    if len(lines) == 1:
        return [f"return {lines[0]}"]
    return ["return (", *("    " + line for line in lines), ")"]


def folded(code: str) -> list[str]:
    """Code that stands in brackets, in lines that fit the page; a comment at its end gets a line of
    its own above."""
    if len(code) <= COLUMNS:
        return [code]
    code, *comment = code.split("  # ")
    return ["# " + name for name in comment] + _wrapped(code, COLUMNS)


def python(formula: Any) -> str:
    """A formula as Python code that a student could have written: sp.sin(x), sp.Rational(1, 2)."""
    if isinstance(formula, sp.MatrixBase):
        rows = ", ".join(
            "[" + ", ".join(python(entry) for entry in row) + "]" for row in formula.tolist()
        )
        return f"sp.Matrix([{rows}])"
    return str(_Printer().doprint(without_expm1(sp.sympify(formula))))


class _Printer(StrPrinter):
    """SymPy's own text, with `sp.` before functions and constants, and exact fractions."""

    def _print_Function(self, expr: sp.Function) -> str:
        return f"sp.{expr.func.__name__}({self.stringify(expr.args, ', ')})"

    def _print_Rational(self, expr: sp.Rational) -> str:
        return f"sp.Rational({expr.p}, {expr.q})"

    def _print_Pow(self, expr: sp.Pow, rational: bool = False) -> str:
        if abs(expr.exp) == sp.Rational(1, 2):
            return ("" if expr.exp > 0 else "1/") + f"sp.sqrt({self._print(expr.base)})"
        return super()._print_Pow(expr, rational)

    def _print_Pi(self, expr: sp.Expr) -> str:
        return f"sp.{expr}"

    _print_Exp1 = _print_Pi
