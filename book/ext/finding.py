"""Sphinx extension: what the search page searches, the text of every section.

Sphinx's own index knows words and pages, no text; and a page read from a file cannot load another
to show some.  So beside the scripts of search/ this writes sections.js, a list of [address,
page, section, text], which search.js searches and quotes.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import contents
from docutils import nodes
from equations import BEYOND, COURSE
from sphinx import addnodes

# not in _static, whose scripts every page loads
SCRIPTS = Path(__file__).resolve().parent / "search"
SILENT = (
    nodes.raw,
    nodes.math_block,
    nodes.comment,
    nodes.title,
    nodes.image,
    nodes.classifier,
    addnodes.toctree,
)
# code and what it prints; terms, which have rows of their own
REPEATED = {"cell", "kf-terms", "kf-russian"}
SILENT += (addnodes.desc_parameterlist, addnodes.desc_returns)
READABLE = re.compile(r"[\w+=-]{1,3}|[a-z]_[0-9k]|[a-z]_\{(k [+-] 1)\}")  # without TeX


def collect(app, doctree, name: str) -> None:
    """Address, titles of page and section, and text of each section of a page, of the first without
    a title; and of each term."""
    if name in (COURSE, BEYOND):  # repeat what stands on other pages
        return
    known = contents.page(app.env, name)
    page = known[1].title if known else app.env.titles[name].astext()
    for i, section in enumerate(doctree.findall(nodes.section)):
        title = section[section.first_child_matching_class(nodes.title)].astext()
        anchor = f"#{section['ids'][0]}" if i else ""
        row = (
            app.builder.get_target_uri(name) + anchor,
            page,
            title if i else "",
            " ".join("".join(_said(section)).split()),
        )
        app.env.kf_sections.append(row)
    for item in doctree.findall(nodes.definition_list_item):
        if "kf-terms" in item.parent["classes"]:
            term, meaning = item.children
            row = (
                f"{app.builder.get_target_uri(name)}#{term['ids'][0]}",
                page,
                term.astext(),
                meaning.astext(),
            )
            app.env.kf_sections.append(row)


def _said(node: nodes.Element) -> Iterator[str]:
    """The words of a node, without those of sections in it, of long formulas, and of cells: their
    code and what they print."""
    for child in node.children:
        if isinstance(child, nodes.Text):
            yield child.astext()
        elif isinstance(child, nodes.math):
            yield text if READABLE.fullmatch(text := child.astext()) else "…"
        elif not (
            isinstance(child, (*SILENT, nodes.section))
            or REPEATED.intersection(child.get("classes", []))
        ):
            yield from _said(child)
            yield (
                ""
                if isinstance(child, nodes.Inline)
                and not isinstance(child, addnodes.desc_signature)
                else " "
            )


def begin(app) -> None:
    app.env.kf_sections = []


def write(app, exception: Exception | None) -> None:
    if exception is None and app.builder.format == "html":
        text = json.dumps(sorted(app.env.kf_sections), ensure_ascii=False, separators=(",", ":"))
        folder = Path(app.outdir, "_static", "search")
        shutil.copytree(SCRIPTS, folder)
        (folder / "sections.js").write_text(f"window.SECTIONS={text}", encoding="utf-8")


def setup(app) -> dict[str, bool]:
    app.connect("builder-inited", begin)
    app.connect("doctree-resolved", collect, priority=100)  # before pages become HTML in part
    app.connect("build-finished", write)
    return {"parallel_read_safe": True, "parallel_write_safe": False}
