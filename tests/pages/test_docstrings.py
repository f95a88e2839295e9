"""Docstrings as the book shows them: equations in blocks, prose as prose."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "book"))
import docstrings

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(
    ("paragraph", "equation"),
    [
        ("K = P H^T F^-1,   z = x^- + K (y - H x^-)", True),
        ("x ~ N(m, d)                 letters of the law that means are over", True),
        ("(z, p)  ->  (lambda, Psi)", True),
        ("A row is a step.  An empty cell is a missing measurement.", False),  # a quarter of all blocks were such sentences
        ("Who knows it?  Nobody; what is x_{k+1}:  the next state.", False),
        ("Shapes as of `run`.", False),
    ],
)
def test_paragraphs_of_equations_are_set_and_sentences_are_not(paragraph, equation):
    assert (".. equations::" in docstrings.to_restructured(["Summary.", "", paragraph])) == equation


def test_programs_examples_and_tables_of_names_stand_as_they_are():
    lines = [
        "Summary, as in::",
        "",
        "    a = run(x, y_)",
        "",
        ">>> f(2)",
        "4",
        "",
        "one_name    what it is",
        "other       what *that* is",
    ]
    assert docstrings.to_restructured(lines) == [*lines[:7], "::", "", *("    " + row for row in lines[7:]), ""]
