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


def test_programs_and_examples_stand_as_they_are():
    lines = ["Summary, as in::", "", "    a = run(x, y_)", "", ">>> f(2)", "4", ""]
    assert docstrings.to_restructured(lines) == lines


def test_lines_of_two_columns_are_a_table_that_has_no_lines_to_break():
    """They were a listing, whose columns were lost where its lines were longer than the page."""
    lines = [
        "Summary.",
        "",
        "one_name      what it is;  other: and what this is, which takes more than a line",
        "              (as a line that goes on tells)",
        "`pair(a, b)`, three   what *that* is",
    ]
    assert docstrings.to_restructured(lines)[2:] == [
        ".. list-table::",
        "   :class: kf-names",
        "",
        "   * - ``one_name``",
        "     - what it is;  other: and what this is, which takes more than a line (as a line that goes on tells)",
        "   * - ``pair(a, b), three``",
        r"     - what \*that\* is",
        "",
    ]
