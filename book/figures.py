"""Sphinx extension: no figure without a number, a caption, and a text that says what is seen.

A warning, and warnings are errors, names every picture that lacks one of them.
"""

from __future__ import annotations

from docutils import nodes
from sphinx.util import logging

CELL = "use a {figure}, or give the metadata `mystnb` of its cell"
log = logging.getLogger(__name__)


def check(app, doctree, name: str) -> None:
    """Warn of each picture of the page that is no figure, or that nobody who cannot see it would know."""
    if app.builder.format != "html":
        return
    for image in doctree.findall(nodes.image):
        above = list(_ancestors(image))
        place = next((node for node in (image, *above) if node.line), name)
        figure = next((node for node in above if isinstance(node, nodes.figure)), nodes.figure())
        if not any(isinstance(child, nodes.caption) and child.astext().strip() for child in figure):
            log.warning("a picture without a caption: %s `figure: {caption: ..., name: fig-...}`", CELL, location=place)
        if not image.get("alt", "").strip():
            log.warning("a picture without words for those who cannot see it: %s `image: {alt: ...}`", CELL, location=place)


def _ancestors(node: nodes.Node):
    while (node := node.parent) is not None:
        yield node


def setup(app) -> dict[str, bool]:
    app.connect("doctree-resolved", check)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
