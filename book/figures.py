"""Sphinx extension: no figure without a number, a caption, and a text that says what is seen; neither contradicts the picture.

A warning, and warnings are errors, names every picture that lacks one of them, and each word that `kfcourse.pages.captions` finds
to be wrong.
"""

from __future__ import annotations

from pathlib import Path

import nbformat
from docutils import nodes
from sphinx.util import logging

from kfcourse.pages.captions import contradicted

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


def compare(app, env) -> None:
    """Warn of what the words of a cell's figure say, and its picture does not show."""
    for path in sorted((Path(app.outdir).parent / "jupyter_execute").rglob("*.ipynb")):
        for cell in nbformat.read(path, as_version=4).cells:
            for problem in wrong(cell):
                log.warning("a caption or its alternative text contradicts the picture: %s", problem, location=path.stem)


def wrong(cell) -> list[str]:
    """What is wrong in the words of a cell's figure."""
    about = cell.metadata.get("mystnb", {})
    words = (about.get("figure", {}).get("caption", ""), about.get("image", {}).get("alt", ""))
    pictures = [output.metadata.get("image/png", {}).get("drawn") for output in cell.get("outputs", []) if "metadata" in output]
    return [problem for panels in pictures if panels for text in words for problem in contradicted(text, panels)]


def _ancestors(node: nodes.Node):
    while (node := node.parent) is not None:
        yield node


def setup(app) -> dict[str, bool]:
    app.connect("doctree-resolved", check)
    app.connect("env-updated", compare, priority=900)  # after executed.py has put the outputs there
    return {"parallel_read_safe": True, "parallel_write_safe": True}
