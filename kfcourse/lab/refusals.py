"""Why a filter was left out, in a sentence of the student's report in its language.

The package's own messages speak to those who program; a report says the cause, with the term in question as a formula.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from kfcourse.symbolic.formula import FormulaError
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import by_name, read
from kfcourse.symbolic.writing import formula_latex

# Key of the sentence in handin.toml, and what the package's message says in that case.
_CAUSES = (
    ("left_no_mean", re.compile(r"knows no closed-form Gaussian mean of the term (?P<term>.+?) in ")),
    ("left_degree", re.compile(r"the degree of .+ is above \d+")),
    ("left_no_slope", re.compile(r"is not differentiable and cannot be linearised")),
    ("left_too_long", re.compile(r"formulas are not derived within (?P<seconds>\S+) s")),
    (
        "left_no_density",
        re.compile(r"the noise enters nonlinearly|without noise there is no likelihood density|depend on one another"),
    ),
    ("left_negative", re.compile(r"step (?P<step>\d+): \S+ failed: a covariance has the variance")),
    ("left_infinite", re.compile(r"step (?P<step>\d+): (the design met|\S+ became) infinite")),
)


def cause(reason: str, model: Model, words: Mapping[str, str]) -> str:
    """The sentence for a message of the package; one that is not known is quoted."""
    for key, pattern in _CAUSES:
        if found := pattern.search(reason):
            parts = found.groupdict()
            term = _formula(parts.pop("term", ""), model)
            key = key if term or "{term}" not in words[key] else key + "_unnamed"
            return words[key].format(**parts, term=term)
    return words["left_other"].format(reason=reason)


def _formula(text: str, model: Model) -> str:
    """A term in LaTeX; empty if it is none that people write."""
    known = by_name(model.x, model.v, model.w, model.known.symbols, tuple(model.values))
    try:
        return formula_latex(read(text, known, "term"), model.x)
    except FormulaError:
        return ""
