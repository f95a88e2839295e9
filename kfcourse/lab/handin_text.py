"""Pieces of the student's report: laws, numbers and steps in LaTeX; text with $formulas$ for HTML and for LaTeX."""

from __future__ import annotations

import re

import jinja2
import numpy as np

from kfcourse.lab.report import Section, escape_tex, on_one_power, percent
from kfcourse.laws import Array, Gaussian
from kfcourse.montecarlo.statistics import Estimate
from kfcourse.symbolic.markup import mathml
from kfcourse.symbolic.writing import by_thousands, number_latex


def filled(text: str, thousands: str, **values: object) -> str:
    """The text with {name} replaced by what the name stands for; braces of LaTeX stay, `thousands` parts long numbers.

    {name:step/steps} puts a number and the word that goes with it, in Russian one of three: {name:шаг/шага/шагов}.
    """

    def value(found: re.Match[str]) -> str:
        one = values[found["name"]]
        if not isinstance(one, int):
            return str(one)
        return by_thousands(str(one), thousands) + (f" {with_number(one, found['words'].split('/'))}" if found["words"] else "")

    return re.sub(rf"\{{(?P<name>{'|'.join(values)})(:(?P<words>[^{{}}]*))?\}}", value, text)


def with_number(number: int, words: list[str]) -> str:
    """The word that goes with a number: of one and many, or in Russian of 1, 2 and 5, as 21, 22 and 25 have them too."""
    if len(words) == 2:
        return words[number != 1]
    ends, teens = number % 10, number % 100 in range(11, 15)
    return words[2 if teens or ends == 0 or ends > 4 else 0 if ends == 1 else 1]


def lines_of(block: str) -> list[str]:
    """The lines of an `aligned` block."""
    return Section.of("", block).lines


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
    value, error, power = on_one_power(estimate)
    if power is None:
        return f"${value:g}$" if np.isfinite(value) else r"$\infty$"
    return rf"$({value:.3f} \pm {error:.3f})\cdot 10^{{{power}}}$"


def in_percent(estimate: Estimate) -> str:
    """A part and its standard error in per cent, as a formula."""
    found = percent(estimate)
    return found if found == "–" else "$" + found.replace("±", r"\pm") + "$"


def inline_html(text: str) -> str:
    """Text for HTML: special characters escaped, $formulas$ as MathML."""
    pieces = re.split(r"\$([^$]+)\$", text)
    return "".join(
        mathml(piece, "inline") if i % 2 else str(jinja2.filters.do_forceescape(piece)) for i, piece in enumerate(pieces)
    )


def inline_tex(text: str) -> str:
    """Text for LaTeX: special characters escaped outside of $formulas$."""
    pieces = re.split(r"(\$[^$]+\$)", text)
    return "".join(piece if i % 2 else _typeset(escape_tex(piece)) for i, piece in enumerate(pieces))


def _typeset(text: str) -> str:
    return text.replace("–", "--").replace("—", "---").replace("\u202f", r"\,").replace("\u00a0", "~")
