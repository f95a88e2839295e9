"""Sphinx extension: what each typed relation is, under its display, and in a word at the end of its
box.

Displays and boxes that a page types are judged by the letters of the page (`gate.page`,
`letters/`).  A relation that does not hold, or of which nothing says what it is, is a warning, and
warnings are errors.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from docutils import nodes
from equations import BEYOND, COURSE
from gate.page import Formula, Letters, Verdict, letters_file, letters_of, mark
from sphinx.util import logging

from ext.figures import ancestors
from kfcourse.pages import Unverified

BOXES = {"algorithm", "definition"}
log = logging.getLogger(__name__)


def say(app, doctree) -> None:
    """Put the words where the reader looks for them."""
    page = Path(app.srcdir, f"{app.env.docname}.md")
    # say so themselves; is given by a task, for any variant
    if app.env.docname in (COURSE, BEYOND) or app.env.docname.startswith("manual/"):
        return
    letters = letters_of(page)
    app.env.note_dependency(str(letters_file(page)))
    for display in list(doctree.findall(nodes.math_block)):
        # what a cell has made says what it is by its own mark
        if not any("cell_output" in node.get("classes", []) for node in ancestors(display)):
            relations = _judged(
                letters, Formula("display", display.astext(), display.get("label") or ""), display
            )
            _below(display, mark(relations))
    for box in list(doctree.findall(nodes.Admonition)):
        if BOXES & set(box.get("classes", [])):
            formulas = (Formula("box", math.astext()) for math in box.findall(nodes.math))
            relations = [
                relation for formula in formulas for relation in _judged(letters, formula, box)
            ]
            if relations:
                box += _words(_counted(relations))


def _judged(letters: Letters, formula: Formula, node: nodes.Node) -> list[Verdict]:
    try:
        return letters.judge(formula)
    except Unverified as reason:
        log.warning("%s", reason, location=node)
        return []


def _below(display: nodes.Element, words: str) -> None:
    if words:
        display.parent.insert(display.parent.index(display) + 1, _words(words))


def _words(words: str) -> nodes.paragraph:
    return nodes.paragraph(
        "", words, classes=["kf-verified" if words.startswith("✓") else "kf-said"]
    )


def _counted(relations: list[Verdict]) -> str:
    """How many relations of a box are computed, and what the others are."""
    computed = sum(relation.computed for relation in relations)
    others = Counter(relation.what for relation in relations if not relation.computed)
    parts = [f"✓ {computed} relations computed"] if computed else []
    return "; ".join([*parts, *(f"{what}: {count}" for what, count in others.items())])


def setup(app) -> dict[str, bool]:
    app.connect("doctree-read", say)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
