"""Docstrings as the book shows them: equations as they are written, prose as prose."""

from __future__ import annotations

import importlib
import inspect
import re

import package
import pytest
from ext import docstrings

pytestmark = pytest.mark.quick


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


def entries(section, doc):
    """(names, what stands behind the colon) of each entry of a section of a docstring."""
    section_text = re.search(
        rf"^{section}\n-+\n(.*?)(?=^\w[^\n]*\n---|\Z)",
        inspect.cleandoc(doc or ""),
        re.DOTALL | re.MULTILINE,
    )
    rows = [
        row.split(" : ", 1)
        for row in (section_text[1] if section_text else "").split("\n")
        if re.match(r"[\w*`][^:]* : ", row)
    ]
    return [(re.split(r",\s*", names), kind) for names, kind in rows]


def documented():
    """Name and value of each class and function of the package."""
    for module in (
        importlib.import_module(name) for files in package.folders().values() for name in files
    ):
        for name, value in vars(module).items():
            if (
                inspect.isclass(value) or inspect.isfunction(value)
            ) and value.__module__ == module.__name__:
                yield f"{module.__name__}.{name}", value


def test_behind_the_colon_of_an_entry_stands_its_type_and_no_field_is_left_out():
    """`signal : x -> b(x, m_w)` was printed as if b(x, m_w) were a class."""
    wrong, seen = [], 0
    for name, value in documented():
        fields = set(getattr(value, "_fields", ()))
        for section in ("Parameters", "Attributes", "Returns"):
            rows = entries(section, value.__doc__)
            seen += len(rows)
            wrong += [(name, kind) for _, kind in rows if re.search(r"->|;|\.$", kind)]
            if (
                rows
                and section == "Attributes"
                and (missing := fields - {field for names, _ in rows for field in names})
            ):
                wrong.append((name, f"without {missing}"))
    assert wrong == [] and seen > 200
