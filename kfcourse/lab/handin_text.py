"""Pieces of the student's report: laws, numbers and steps in LaTeX; text with $formulas$ for HTML and for LaTeX."""

from __future__ import annotations

import re

import jinja2
import numpy as np

from kfcourse.lab.report import Section, escape_tex, on_one_power, percent
from kfcourse.laws import Gaussian
from kfcourse.montecarlo.statistics import Estimate
from kfcourse.symbolic.markup import mathml


def filled(text: str, **values: object) -> str:
    """The text with {name} replaced by what the name stands for; braces of LaTeX stay."""
    return re.sub("|".join(rf"\{{{name}\}}" for name in values), lambda found: str(values[found[0][1:-1]]), text)


def lines_of(block: str) -> list[str]:
    """The lines of an `aligned` block."""
    return Section.of("", block).lines


def law(given: Gaussian) -> str:
    """N(0, 1); N(mean, covariance) with matrices for vectors."""
    if given.mean.size == 1:
        return rf"\mathcal{{N}}({given.mean.item():g},\; {given.cov.item():g})"
    column = r" \\ ".join(f"{value:g}" for value in given.mean)
    rows = r" \\ ".join(" & ".join(f"{value:g}" for value in row) for row in given.cov)
    return rf"\mathcal{{N}}\left(\begin{{pmatrix}}{column}\end{{pmatrix}},\; \begin{{pmatrix}}{rows}\end{{pmatrix}}\right)"


def power_of_ten(estimate: Estimate) -> str:
    """A value and its standard error on one power of ten: (6.51 ± 0.07)·10^-4."""
    value, error, power = on_one_power(estimate)
    if power is None:
        return f"${value:g}$" if np.isfinite(value) else r"$\infty$"
    return rf"$({value:.3f} \pm {error:.3f})\cdot 10^{{{power}}}$"


def in_percent(estimate: Estimate) -> str:
    """A part and its standard error in per cent, as a formula."""
    return "$" + percent(estimate).replace("±", r"\pm") + "$"


def ranges(steps: list[int]) -> str:
    """1, 3-5, 8: runs of steps joined."""
    parts: list[list[int]] = []
    for k in steps:
        if parts and k == parts[-1][1] + 1:
            parts[-1][1] = k
        else:
            parts.append([k, k])
    return ", ".join(f"${a}$" if a == b else f"${a}$–${b}$" for a, b in parts)


def inline_html(text: str) -> str:
    """Text for HTML: special characters escaped, $formulas$ as MathML."""
    pieces = re.split(r"\$([^$]+)\$", text)
    return "".join(
        mathml(piece, "inline") if i % 2 else str(jinja2.filters.do_forceescape(piece)) for i, piece in enumerate(pieces)
    )


def inline_tex(text: str) -> str:
    """Text for LaTeX: special characters escaped outside of $formulas$."""
    pieces = re.split(r"(\$[^$]+\$)", text)
    return "".join(piece if i % 2 else escape_tex(piece).replace("–", "--").replace("—", "---") for i, piece in enumerate(pieces))
