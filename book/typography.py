"""Sphinx extension: what no line may part: a number and its unit, whether typed or printed by a cell, a formula and its comma."""

from __future__ import annotations

import re

from docutils import nodes
from sphinx.transforms.post_transforms import SphinxPostTransform

from kfcourse.pages.units import UNIT

AFTER_A_NUMBER = re.compile(rf"(?<=\d) (?={UNIT})|(?<=\d) (?=/ {UNIT})|(?<=\d /) (?={UNIT})|(?<=\d) (?=±)|(?<=±) (?=\d)")
AFTER_A_FORMULA = re.compile(rf"^ (?={UNIT})")
UNTOUCHED = (nodes.literal, nodes.literal_block, nodes.math, nodes.math_block)
BETWEEN_TAGS = re.compile(r"(?:^|(?<=>))[^<]+")  # of HTML that cells write themselves
OPENING = re.compile(r"[(\[“‘]+$")
CLOSING = re.compile(rf"^(?:\N{{NO-BREAK SPACE}}{UNIT})?[,.;:!?)\]”’]*")
NO_TEXT = re.compile(r"<(script|style|svg|pre)\b")


class TogetherWithUnits(SphinxPostTransform):
    """No line ends between a number, or a formula, and its unit."""

    default_priority = 500
    formats = ("html",)

    def run(self, **kwargs) -> None:
        for text in list(self.document.findall(nodes.Text)):
            if text.parent is None or isinstance(text.parent, UNTOUCHED):
                continue
            place = text.parent.children.index(text)
            if isinstance(text.parent, nodes.raw):
                found = text if NO_TEXT.search(text) else BETWEEN_TAGS.sub(lambda part: together(part[0]), text)
            else:
                found = together(text)
            if place and isinstance(text.parent[place - 1], nodes.math):
                found = AFTER_A_FORMULA.sub("\N{NO-BREAK SPACE}", found)
            if found != text:
                text.parent.children[place] = nodes.Text(found)


class TogetherWithMarks(SphinxPostTransform):
    """A formula, its unit and its punctuation stay on one line; browsers break lines around the boxes of formulas."""

    default_priority = TogetherWithUnits.default_priority + 1  # which asks what stands before a text
    formats = ("html",)

    def run(self, **kwargs) -> None:
        for formula in list(self.document.findall(nodes.math)):
            parent, place = formula.parent, formula.parent.index(formula)
            opening, closing = _taken(parent, place - 1, OPENING), _taken(parent, place + 1, CLOSING)
            if opening or closing:
                parent[place] = nodes.inline("", "", *opening, formula, *closing, classes=["kf-together"])


def _taken(parent: nodes.Element, place: int, marks: re.Pattern[str]) -> list[nodes.Text]:
    """The marks at this end of a text, which loses them."""
    text = parent[place] if 0 <= place < len(parent) else None
    if not isinstance(text, nodes.Text) or not (found := marks.search(text)) or not found[0]:
        return []
    parent[place] = nodes.Text(marks.sub("", text))
    return [nodes.Text(found[0])]


def together(text: str) -> str:
    return AFTER_A_NUMBER.sub("\N{NO-BREAK SPACE}", text)


def setup(app) -> dict[str, bool]:
    app.add_post_transform(TogetherWithUnits)
    app.add_post_transform(TogetherWithMarks)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
