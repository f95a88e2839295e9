"""Sphinx extension: no line ends between a formula and its punctuation."""

from __future__ import annotations

import re

from docutils import nodes
from sphinx.transforms.post_transforms import SphinxPostTransform

OPENING = re.compile(r"[(\[“‘]+$")
CLOSING = re.compile(r"^[,.;:!?)\]”’]+")


class TogetherWithMarks(SphinxPostTransform):
    """A formula and its marks stand in one box; browsers break lines around those of formulas."""

    default_priority = 501
    formats = ("html",)

    def run(self, **kwargs) -> None:
        for formula in list(self.document.findall(nodes.math)):
            parent, place = formula.parent, formula.parent.index(formula)
            opening, closing = (
                _taken(parent, place - 1, OPENING),
                _taken(parent, place + 1, CLOSING),
            )
            if opening or closing:
                parent[place] = nodes.inline(
                    "", "", *opening, formula, *closing, classes=["kf-together"]
                )


def _taken(parent: nodes.Element, place: int, marks: re.Pattern[str]) -> list[nodes.Text]:
    """Take the marks at this end of a text away from it."""
    text = parent[place] if 0 <= place < len(parent) else None
    if not isinstance(text, nodes.Text) or not (match := marks.search(text)):
        return []
    parent[place] = nodes.Text(marks.sub("", text))
    return [nodes.Text(match[0])]


def setup(app) -> dict[str, bool]:
    app.add_post_transform(TogetherWithMarks)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
