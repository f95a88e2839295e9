"""Sphinx extension: what the theme leaves to the book.

The folding side bar with short titles, the line above a title, descriptions for search engines and
previews, formulas that the keyboard reaches, and a page for addresses that do not exist.
"""

from __future__ import annotations

import html
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import contents
from docutils import nodes
from sphinx.transforms.post_transforms import SphinxPostTransform
from sphinx.writers.html5 import HTML5Translator

from ext.figures import ancestors
from ext.folds import FoldsBelow

BOOK = Path(__file__).resolve().parents[1]
NUMBER = re.compile(r"(?:(?<=>)|^)\s*\d+(\.\d+)*\.\s")  # of a section
SIZE = re.compile(r"width: (\d+)px;(?: height: (\d+)px;)?")
# a figure that answers, and whose place it takes
LIVE = re.compile(r'<div class="kf-(?:live|explore)" data-name="([^"]+)"')


class Captions(SphinxPostTransform):
    """What `kfcourse.pages.table` prints above a table becomes the table's caption."""

    default_priority = 500
    formats = ("html",)

    def run(self, **kwargs) -> None:
        for table in list(self.document.findall(nodes.table)):
            before = table.previous_sibling()
            if isinstance(before, nodes.paragraph) and before.rawsource.startswith(
                '<span class="kf-caption">'
            ):
                before.parent.remove(before)
                table.insert(0, nodes.title("", "", *before.children[1:-1]))
                table["classes"].append("kf-table")


class InPlace(SphinxPostTransform):
    """A figure that answers is read right after its still picture: its script runs before what
    stands below is seen."""

    # cells that are then neighbours have one fold
    default_priority = FoldsBelow.default_priority - 1
    formats = ("html",)

    def run(self, **kwargs) -> None:
        figures = {
            name: figure for figure in self.document.findall(nodes.figure) for name in figure["ids"]
        }
        for live in list(self.document.findall(nodes.raw)):
            if (match := LIVE.search(live.astext())) and match[1] in figures:
                output = live.parent
                output.remove(live)
                figures[match[1]].insert(1, live)
                if not output.children:
                    output.parent.parent.remove(output.parent)


class Translator(HTML5Translator):
    """Pages as Sphinx writes them, but for what the keyboard, a screen reader, and the rules of
    HTML need."""

    def starttag(self, node, tagname, suffix="\n", empty=False, **attributes) -> str:
        # the room that it will take, and none is loaded before the reader comes near
        if tagname == "img":
            if size := SIZE.fullmatch(attributes.get("style", "")):
                attributes |= {"width": size[1], "style": f"--kf-width: {size[1]}px"}
                attributes |= {"height": size[2]} if size[2] else {}
            if node is not self.document.next_node(nodes.image):
                attributes["loading"] = "lazy"
        return super().starttag(node, tagname, suffix, empty, **attributes)

    def visit_title(self, node: nodes.title) -> None:
        if node is self.document.next_node(nodes.title) and (
            words := _above(self.builder.env, self.docnames[0])
        ):
            self.body.append(f'<p class="kf-part">{html.escape(words)}</p>\n')
        super().visit_title(node)

    def add_fignumber(self, node: nodes.Element) -> None:
        """With a full stop behind the number; tables have none."""
        if isinstance(node, nodes.table):
            return
        super().add_fignumber(node)
        if self.body[-3:-2] == ['<span class="caption-number">']:
            self.body[-2:] = [f"{self.body[-2].rstrip()}.", "</span> "]

    def visit_entry(self, node: nodes.entry) -> None:
        """The empty corner of a table is no heading."""
        super().visit_entry(node)
        if self.body[-1].startswith("<th") and not node.astext():
            self.body[-1], self.context[-1] = self.body[-1].replace("<th", "<td", 1), "</td>\n"
            node.clear()

    def visit_citation(self, node: nodes.citation) -> None:
        """Without the roles of a bibliography, which are not those of today's HTML."""
        if not isinstance(node.previous_sibling(), nodes.citation):
            self.body.append('<div class="citation-list">\n')
        self.body.append(self.starttag(node, "div", classes=[node.tagname]))

    # A signature on several lines is no list of definitions.

    def visit_desc_parameterlist(self, node: nodes.Element) -> None:
        with self._instead({"<dl>": ""}):
            super().visit_desc_parameterlist(node)

    def depart_desc_parameterlist(self, node: nodes.Element) -> None:
        with self._instead({"</dl>": ""}):
            super().depart_desc_parameterlist(node)

    def visit_desc_parameter(self, node: nodes.Element) -> None:
        with self._instead({"<dd>": '<span class="sig-line">'}):
            super().visit_desc_parameter(node)

    def depart_desc_parameter(self, node: nodes.Element) -> None:
        with self._instead({"</dd>": "</span>\n"}):
            super().depart_desc_parameter(node)

    @contextmanager
    def _instead(self, tags: Mapping[str, str]) -> Iterator[None]:
        begin = len(self.body)
        yield
        self.body[begin:] = [tags.get(piece.strip(), piece) for piece in self.body[begin:]]


def use_templates(app, config) -> None:
    config.templates_path.insert(0, str(BOOK / "_templates"))


def complete(app, pagename: str, templatename: str, context: dict, doctree) -> None:
    """Everything a page of the book has besides its text."""
    context["kf_parts"] = [
        _part(part, pagename, context["pathto"]) for part in contents.parts(app.env)
    ]
    context["kf_home"] = {
        "href": context["pathto"](app.config.root_doc),
        "current": pagename == app.config.root_doc,
    }
    context["kf_unnumbered"] = lambda toc: NUMBER.sub("", toc)
    for step in ("prev", "next"):
        if context.get(step):
            first = context[step]["link"] == context["pathto"](app.config.root_doc)
            title = "Start here" if first else NUMBER.sub("", context[step]["title"])
            context[step] = {**context[step], "title": title}
    if doctree is None or "body" not in context:
        return
    context["metatags"] = context.get("metatags", "") + _described(app, pagename, context, doctree)


def _above(env, pagename: str) -> str:
    """The words above a title: the part of the book, and the chapter's number."""
    if pagename == env.config.root_doc:
        return "A course companion"
    part, page = contents.page(env, pagename) or (contents.Part("", []), None)
    return f"{part.caption} · {page.number}" if page and page.number else part.caption


def _part(part: contents.Part, pagename: str, pathto) -> dict:
    pages = [
        {"href": pathto(page.name), "title": page.title, "current": page.name == pagename}
        for page in part.pages
    ]
    return {
        "caption": part.caption,
        "pages": pages,
        "current": any(page["current"] for page in pages),
    }


def _described(app, pagename: str, context: dict, doctree) -> str:
    """Title and description of a page for search engines and for previews of links to it."""
    title = (
        app.env.titles[pagename].astext() if pagename in app.env.titles else app.config.html_title
    )
    text = next(
        (
            p.astext()
            for p in doctree.findall(nodes.paragraph)
            if len(p.astext()) > 40 and not _boxed(p)
        ),
        title,
    )
    text = re.sub(r"\s+", " ", text)
    text = text if len(text) <= 200 else text[:197].rsplit(" ", 1)[0] + " ..."
    rows = {
        ("name", "description"): text,
        ("property", "og:title"): title,
        ("property", "og:description"): text,
        ("property", "og:type"): "website" if pagename == app.config.root_doc else "article",
        ("property", "og:site_name"): app.config.html_title,
    }
    return "".join(
        f'\n  <meta {kind}="{name}" content="{html.escape(value)}" />'
        for (kind, name), value in rows.items()
    )


def _boxed(paragraph: nodes.paragraph) -> bool:
    boxes = (nodes.Admonition, nodes.table, nodes.figure, nodes.list_item)
    return any(
        isinstance(node, boxes) or node.get("classes", []) == ["cell"]
        for node in ancestors(paragraph)
    )


def write_not_found(app, exception) -> None:
    """The page that a server shows for an address that does not exist; it needs no other file."""
    if exception or app.builder.format != "html":
        return
    parts = contents.parts(app.env)
    folders = sorted(
        {page.name.split("/")[0] for part in parts for page in part.pages if "/" in page.name}
        | {"_static", "_sources"}
    )
    page = app.builder.templates.render(
        "404.html", {"title": app.config.html_title, "parts": parts, "folders": folders}
    )
    (Path(app.outdir) / "404.html").write_text(page, encoding="utf-8")


def leave_scripts_out(app, exception) -> None:
    """Every icon there is (1.5 MB; _static/icons.css draws the ten that are used), and Bootstrap,
    which would show the titles of five buttons, as browsers do, and the button to the top
    (page.js): no page asks for them (_templates/layout.html)."""
    if not exception and app.builder.format == "html":
        for name in ("fontawesome.js*", "bootstrap.js*"):
            for path in (Path(app.outdir) / "_static" / "scripts").glob(name):
                path.unlink()


def setup(app) -> dict[str, bool]:
    app.set_translator("html", Translator)
    app.add_post_transform(Captions)
    app.add_post_transform(InPlace)
    app.connect("config-inited", use_templates, priority=900)
    app.connect("build-finished", write_not_found)
    app.connect("build-finished", leave_scripts_out)
    # before the theme, which tries the templates
    app.connect("html-page-context", complete, priority=300)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
