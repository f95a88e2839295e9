"""Docstrings as the book shows them: equations as they are written, prose as prose."""

import pytest
from ext import docstrings


@pytest.mark.parametrize(
    ("paragraph", "equation"),
    [
        ("K = P H^T F^-1,   z = x^- + K (y - H x^-)", True),
        ("x ~ N(m, d)                 letters of the law that means are over", True),
        ("(z, p)  ->  (lambda, Psi)", True),
        # a quarter of all blocks were such sentences
        ("A row is a step.  An empty cell is a missing measurement.", False),
        ("Who knows it?  Nobody; what is x_{k+1}:  the next state.", False),
        ("Shapes as of `run`.", False),
    ],
)
def test_paragraphs_of_equations_stand_as_they_are_and_sentences_do_not(paragraph, equation):
    assert ("::" in docstrings.to_restructured(["Summary.", "", paragraph])) == equation
