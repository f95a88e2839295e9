"""Pieces of reports: laws, numbers and steps in LaTeX; text with $formulas$ for HTML and for
LaTeX; the AOF's equations with the structural functions of a scalar model put into them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import jinja2
import numpy as np
import sympy as sp

from kfcourse.errors import NotFinite, Reason, Refused
from kfcourse.filters import EQUATIONS
from kfcourse.filters import notation as s
from kfcourse.filters.programs import function_values, scalar
from kfcourse.lab.short_names import operations
from kfcourse.laws import Array, Gaussian
from kfcourse.montecarlo.statistics import Estimate
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.markup import mathml
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import Structure
from kfcourse.symbolic.typesetting import WIDTH, joined, symbols
from kfcourse.symbolic.writing import by_thousands, formula_latex, formula_lines, number_latex

LONGEST = 6_000  # operations in formulas that are printed: some eight pages
SHORT = WIDTH // 3  # symbols of h and G that are put into K and z; longer ones keep their own lines


def filled(text: str, thousands: str, **values: object) -> str:
    """The text with {name} replaced by what the name stands for; braces of LaTeX stay, `thousands`
    parts long numbers.

    {name:step/steps} puts a number and the word that goes with it, in Russian one of three:
    {name:шаг/шага/шагов}.
    """

    def replacement(match: re.Match[str]) -> str:
        value = values[match["name"]]
        if not isinstance(value, int):
            return str(value)
        return by_thousands(str(value), thousands) + (
            f" {with_number(value, match['words'].split('/'))}" if match["words"] else ""
        )

    return re.sub(rf"\{{(?P<name>{'|'.join(values)})(:(?P<words>[^{{}}]*))?\}}", replacement, text)


def with_number(number: int, words: list[str]) -> str:
    """The word that goes with a number: of one and many, or in Russian of 1, 2 and 5, as 21, 22 and
    25 have them too."""
    if len(words) == 2:
        return words[number != 1]
    ends, teens = number % 10, number % 100 in range(11, 15)
    return words[2 if teens or ends == 0 or ends > 4 else 0 if ends == 1 else 1]


def lines_of(block: str) -> list[str]:
    """The lines of an `aligned` block."""
    body = re.sub(r"\\(begin|end)\{aligned\}", "", block)
    return [line.strip() for line in body.split("\\\\\n")]


def printed(structure: Structure) -> list[str] | None:
    """The lines of structural functions; None if they are too long to print."""
    return lines_of(structure.latex()) if operations(structure) <= LONGEST else None


def law(given: Gaussian) -> str:
    """N(0, 1); N(mean, covariance) with matrices for vectors."""
    left, right = ("(", ")") if given.mean.size == 1 else (r"\left(", r"\right)")
    return rf"\mathcal{{N}}{left}{matrix(given.mean[:, None])},\; {matrix(given.cov)}{right}"


def matrix(values: Array) -> str:
    """Numbers (r, c) in brackets; one alone without."""
    if values.size == 1:
        return number_latex(values.item())
    rows = r" \\ ".join(" & ".join(map(number_latex, row)) for row in values)
    return rf"\begin{{pmatrix}}{rows}\end{{pmatrix}}"


def power_of_ten(estimate: Estimate) -> str:
    """A value and its standard error on one power of ten: (6.51 ± 0.07)·10^-4."""
    value, error = float(estimate.value), float(estimate.standard_error)
    if not (np.isfinite(value) and value):
        return f"${value:g}$" if np.isfinite(value) else r"$\infty$"
    power = int(np.floor(np.log10(abs(value))))
    scaled = f"{value / 10.0**power:.3f} \\pm {error / 10.0**power:.3f}"
    return rf"$({scaled})\cdot 10^{{{power}}}$"


def in_percent(part: Estimate) -> str:
    """A part and its standard error in per cent, the latter with two digits: 1.19 ± 0.40; "–" where
    there is none."""
    value, error = 100 * float(part.value), 100 * float(part.standard_error)
    if np.isnan(value):
        return "–"
    exact = not (np.isfinite(error) and error > 0)
    places = 2 if exact else int(np.clip(1 - np.floor(np.log10(error)), 0, 6))
    return rf"${value:.{places}f} \pm {error:.{places}f}$"


def inline_html(text: str) -> str:
    """Text for HTML: special characters escaped, $formulas$ as MathML."""
    pieces = re.split(r"\$([^$]+)\$", text)
    return "".join(
        mathml(piece, "inline") if i % 2 else str(jinja2.filters.do_forceescape(piece))
        for i, piece in enumerate(pieces)
    )


def inline_tex(text: str) -> str:
    """Text for LaTeX: special characters escaped outside of $formulas$."""
    pieces = re.split(r"(\$[^$]+\$)", text)
    return "".join(piece if i % 2 else escape_tex(piece) for i, piece in enumerate(pieces))


def ranges(steps: Sequence[int], form: str = "{}") -> str:
    """1, 3–5, 8: runs of steps joined, each number written by `form`."""
    parts: list[list[int]] = []
    for k in steps:
        if parts and k == parts[-1][1] + 1:
            parts[-1][1] = k
        else:
            parts.append([k, k])
    return ", ".join(
        form.format(a) if a == b else f"{form.format(a)}–{form.format(b)}" for a, b in parts
    )


def escape_tex(text: str) -> str:
    """Plain text for LaTeX."""
    special: dict[str, Any] = {
        "\\": r"\textbackslash{}",
        "^": r"\textasciicircum{}",
        "~": r"\textasciitilde{}",
        "±": r"$\pm$",
        "·": r"$\cdot$",
        "–": "--",
        "—": "---",
        "\u202f": r"\,",
        "\u00a0": "~",
    } | {sign: "\\" + sign for sign in "#$%&_{}"}
    return text.translate(str.maketrans(special))


def cause(reason: Reason, model: Model | JumpModel, words: Mapping[str, str]) -> str:
    """The sentence for an error of a kind, `left_KIND` of the report's words; other messages are
    quoted."""
    if not (isinstance(reason, Refused | NotFinite) and reason.kind):
        return words["left_other"].format(reason=reason)
    parts = {
        name: formula_latex(part, model.x) if name == "term" else part
        for name, part in reason.parts.items()
    }
    return words[f"left_{reason.kind}"].format(**parts)


def scalar_equations(structure: Structure) -> list[tuple[sp.Symbol, sp.Expr]]:
    """K_k, z_k, p_k, lambda_{k+1}, Psi_{k+1}, and before them F_k: name and formula, in the order
    of computing.

    Those of the filter, `kfcourse.filters.EQUATIONS`, with the formulas of the structure; h_k and
    G_k have lines of their own only where they are long.
    """
    values = function_values(structure)
    equations: list[tuple[sp.Symbol, sp.Expr]] = []
    short: dict[sp.Symbol, sp.Expr] = {}
    for equation in EQUATIONS["aof"]:
        name, formula = scalar(equation.lhs), scalar(equation.rhs).xreplace(values).xreplace(short)
        if (
            name in (scalar(s.h), scalar(s.G))
            and symbols(formula_latex(formula, _VARIABLES)) <= SHORT
        ):
            short[name] = formula
        else:
            equations.append((name, formula))
    return equations


def written_lines(structure: Structure) -> list[str]:
    """The same as lines of an `aligned` block."""
    lines = []
    for name, formula in scalar_equations(structure):
        if formula.has(scalar(s.K)):  # lambda + K (y - h): what is corrected comes first
            terms = sorted(sp.Add.make_args(formula), key=lambda term: term.has(scalar(s.K)))
            first, *further = joined([formula_latex(term, _VARIABLES) for term in terms])
        else:
            first, *further = formula_lines(formula, _VARIABLES)
        lines += [f"{sp.latex(name)} &= {first}", *(rf"&\quad {line}" for line in further)]
    return lines


# In the order in which a product is written.
_VARIABLES = [scalar(symbol) for symbol in (s.K, s.lam, s.z, s.Psi, s.P, s.G, s.F, s.y, s.h)]
