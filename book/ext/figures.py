"""Sphinx extension: no figure without a caption, an alternative text, and a number of its page.

A picture that lacks a caption or a text is a warning, and warnings are errors.
"""

from __future__ import annotations

from collections.abc import Iterator

from docutils import nodes
from sphinx.util import logging

CELL = "use a {figure}, or give the metadata `mystnb` of its cell"
log = logging.getLogger(__name__)


def check(app, doctree, name: str) -> None:
    """Warn of each picture without a caption, or without a text for those who cannot see it."""
    if app.builder.format != "html":
        return
    for image in doctree.findall(nodes.image):
        above = list(ancestors(image))
        place = next((node for node in (image, *above) if node.line), name)
        figure = next((node for node in above if isinstance(node, nodes.figure)), nodes.figure())
        if not any(isinstance(child, nodes.caption) and child.astext().strip() for child in figure):
            log.warning(
                "a picture without a caption: %s `figure: {caption: ..., name: fig-...}`",
                CELL,
                location=place,
            )
        if not image.get("alt", "").strip():
            log.warning(
                "a picture without words for those who cannot see it: %s `image: {alt: ...}`",
                CELL,
                location=place,
            )


def renumber(app, env) -> None:
    """Count figures of pages without a number from one on each page, not through all such pages."""
    for kinds in env.toc_fignumbers.values():
        for numbers in kinds.values():
            if all(len(number) == 1 for number in numbers.values()):
                numbers.update((name, (place,)) for place, name in enumerate(numbers, 1))


def ancestors(node: nodes.Node) -> Iterator[nodes.Element]:
    """The elements around a node, from the nearest outwards."""
    while (node := node.parent) is not None:
        yield node


def setup(app) -> dict[str, bool]:
    app.connect("doctree-resolved", check)
    app.connect("env-check-consistency", renumber)  # when Sphinx has numbered them
    return {"parallel_read_safe": True, "parallel_write_safe": True}
