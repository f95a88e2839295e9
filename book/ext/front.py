"""Sphinx extension: the map under the reader's hand on the front page, `{front} name`, from the
numbers of readme_figure.py."""

from __future__ import annotations

import json
from pathlib import Path

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

from kfcourse.pages.scenes import who_leads

MAP = Path(__file__).resolve().parents[1] / "front-map.json"
FIRST = (2, 0.4)  # step and f/e shown first: variant 53


class Front(SphinxDirective):
    required_arguments = 1  # the id of the figure whose place it takes

    def run(self) -> list[nodes.Node]:
        self.env.note_dependency(str(MAP))
        return [
            nodes.raw(
                "",
                who_leads(self.arguments[0], json.loads(MAP.read_text(encoding="utf-8")), FIRST),
                format="html",
            )
        ]


def setup(app) -> dict[str, bool]:
    app.add_directive("front", Front)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
