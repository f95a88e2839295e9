"""Sphinx extension: no figure without a number, a caption, and a text that says what is seen; nothing contradicts the picture.

A warning, and warnings are errors, names every picture that lacks one of them, and each word that `kfcourse.pages.captions` finds
to be wrong, in them and in a paragraph that refers to one figure; and each legend, of the exercise sets too, that is struck.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import manual
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
    """Warn of what is said of the figure of a cell, and its picture does not show."""
    paths = sorted((Path(app.outdir).parent / "jupyter_execute").rglob("*.ipynb"))
    pages = {path.stem: nbformat.read(path, as_version=4).cells for path in paths}
    figures = {name: panels for cells in pages.values() for cell in cells for name, panels in pictures(cell)}
    for page, cells in pages.items():
        for problem in (problem for cell in cells for problem in wrong(cell, figures)):
            log.warning("what is said of a figure contradicts its picture: %s", problem, location=page)
    pages |= {job.letter: nbformat.read(job.target, as_version=4).cells for job in manual.solutions()}
    for page, words in ((page, words) for page, cells in pages.items() for cell in cells for words in struck(cell)):
        log.warning("a curve or a point runs through a legend: %s", words, location=page)


def renumber(app, env) -> None:
    """Figures of pages without a number of their own are counted from one on each page, not through all of these pages."""
    for kinds in env.toc_fignumbers.values():
        for numbers in kinds.values():
            if all(len(number) == 1 for number in numbers.values()):
                numbers.update((name, (place,)) for place, name in enumerate(numbers, 1))


def pictures(cell) -> Iterator[tuple[str, list[dict[str, Any]]]]:
    """The name of a cell's figure, and the panels of its picture."""
    name = cell.metadata.get("mystnb", {}).get("figure", {}).get("name")
    for output in cell.get("outputs", []):
        if name and (panels := output.get("metadata", {}).get("image/png", {}).get("drawn")):
            yield name, panels


def wrong(cell, figures: dict[str, list[dict[str, Any]]]) -> Iterator[str]:
    """What is wrong in the words of a cell's figure, or in the paragraphs of a text that speak of one of these figures."""
    about = cell.metadata.get("mystnb", {})
    for text in (about.get("figure", {}).get("caption", ""), about.get("image", {}).get("alt", "")):
        yield from (problem for _, panels in pictures(cell) for problem in contradicted(text, panels))
    for paragraph in cell.source.split("\n\n") if cell.cell_type == "markdown" else ():
        names = set(re.findall(r"\{numref\}`(fig-[\w-]+)`", paragraph))
        if len(names) == 1 and (panels := figures.get(names.pop())):
            yield from contradicted(paragraph, panels)


def struck(cell) -> list[str]:
    """The words of legends that something runs through in the pictures of a cell (`kfcourse.pages.legends`)."""
    outputs = cell.get("outputs", [])
    return [words for one in outputs for words in one.get("metadata", {}).get("image/png", {}).get("struck", [])]


def _ancestors(node: nodes.Node):
    while (node := node.parent) is not None:
        yield node


def setup(app) -> dict[str, bool]:
    app.connect("doctree-resolved", check)
    app.connect("env-check-consistency", renumber)  # when Sphinx has numbered them
    app.connect("env-updated", compare, priority=900)  # after executed.py has put the outputs there
    return {"parallel_read_safe": True, "parallel_write_safe": True}
