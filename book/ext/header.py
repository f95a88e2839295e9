"""Sphinx extension: the line under a chapter's title, `{chapter}`.

    ```{chapter}
    :needs: stratonovich, notation
    :minutes: 40
    :exercises: b, g
    ```

prints how long the chapter takes, what it needs, its exercise sets, a link that downloads it as a
notebook, and how many equations were verified when it was executed: outputs that verify equations
say so in their data (equations.py).
"""

from __future__ import annotations

import base64
import html
from pathlib import Path
from typing import ClassVar

import contents
import nbformat
from docutils import nodes
from docutils.parsers.rst import directives
from downloads import plain
from equations import page_of, place_of, records
from sphinx import addnodes
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective

from kfcourse.exercises.checks import sets

log = logging.getLogger(__name__)


class chapter_line(nodes.General, nodes.Element):
    """Stands for the line until all pages are known."""


class Chapter(SphinxDirective):
    option_spec: ClassVar = {
        "needs": directives.unchanged,
        "minutes": directives.positive_int,
        "exercises": directives.unchanged,
    }

    def run(self) -> list[nodes.Node]:
        node = chapter_line("", **self.options)
        self.set_source_info(node)
        self.env.metadata[self.env.docname]["minutes"] = self.options.get("minutes")
        return [node]


def behind_the_lead(app, doctree) -> None:
    """The line stands below the sentence under the title, in whatever order they are written."""
    for line in list(doctree.findall(chapter_line)):
        place, siblings = line.parent.index(line), line.parent
        if place + 1 < len(siblings) and "lead" in siblings[place + 1].get("classes", []):
            siblings[place : place + 2] = [siblings[place + 1], line]


def print_line(app, doctree, name: str) -> None:
    """Put the line in the place of its directive."""
    for line in list(doctree.findall(chapter_line)):
        items = [item for item in _items(app, name, line) if item]
        text = "".join(f"<li>{item}</li>" for item in items)
        line.replace_self(
            nodes.raw(
                "",
                f'<ul class="kf-chapter" aria-label="About this chapter">{text}</ul>',
                format="html",
            )
        )


def _items(app, name: str, line: chapter_line):
    if "minutes" in line:
        yield f"{line['minutes']}\N{NO-BREAK SPACE}min"
    needed = [_link(app, name, other, line) for other in _words(line.get("needs", ""))]
    yield needed and f"needs {', '.join(needed)}"
    known = sets()
    letters = _words(line.get("exercises", ""))
    for letter in letters:
        if letter not in known:
            log.warning("no exercise set %r; there are %s", letter, ", ".join(known), location=line)
    chosen = [
        _link(app, name, f"manual/{known[x].name}", line, f"set {x}") for x in letters if x in known
    ]
    yield chosen and f"exercises {', '.join(chosen)}"
    executed = Path(app.outdir).parent / "jupyter_execute" / f"{name}.ipynb"
    if executed.exists():
        notebook = nbformat.read(executed, as_version=4)
        yield embedded(executed.name, nbformat.writes(plain(notebook)).encode(), "↓ notebook")
        count = sum(record["equations"] for record in records(notebook))
        place = f"{app.builder.get_relative_uri(name, page_of(name))}#{place_of(name)}"
        yield (
            count
            and f'<a class="kf-count" href="{place}">✓ {count} equation{"s" * (count > 1)} '
            f"verified</a>"
        )


def _link(app, name: str, other: str, line: chapter_line, text: str = "") -> str:
    place = contents.page(app.env, other)
    if place is None:
        log.warning("no page %r in _toc.yml", other, location=line)
        return html.escape(other)
    address = app.builder.get_relative_uri(name, other)
    return f'<a href="{address}">{html.escape(text or place[1].title)}</a>'


def _words(text: str) -> list[str]:
    return text.replace(",", " ").split()


def embedded(file: str, content: bytes, text: str) -> str:
    """A link that downloads what it carries: from a book opened as files a browser would show a
    linked notebook, not save it."""
    data = base64.b64encode(content).decode()
    return (
        f'<a download="{html.escape(file)}" '
        f'href="data:application/x-ipynb+json;base64,{data}">{html.escape(text)}</a>'
    )


def embed_downloads(app, doctree, name: str) -> None:
    """The students' notebooks, too, come with their pages."""
    for link in list(doctree.findall(addnodes.download_reference)):
        path = Path(app.srcdir, name).parent / link["reftarget"]
        if path.suffix == ".ipynb" and path.exists():
            link.replace_self(
                nodes.raw("", embedded(path.name, path.read_bytes(), link.astext()), format="html")
            )


def setup(app) -> dict[str, bool]:
    app.add_node(chapter_line)
    app.add_directive("chapter", Chapter)
    app.connect("doctree-read", behind_the_lead)
    app.connect("doctree-resolved", print_line)
    app.connect("doctree-resolved", embed_downloads)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
