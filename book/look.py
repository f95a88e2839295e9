"""Sphinx extension: what the theme leaves to the book.

The folding side bar with short titles, the line above a title, descriptions for search engines and previews, formulas
that the keyboard reaches, small stars, and a page for addresses that do not exist.
"""

from __future__ import annotations

import html
import re
from pathlib import Path

import contents
from docutils import nodes

HERE = Path(__file__).resolve().parent
STAR = re.compile(r"(<h\d[^>]*>(?:<span[^>]*>[^<]*</span>)?|<a[^>]*>(?:<span[^>]*>)?)\s*★\s*")
FORMULA = re.compile(r'<div class="math notranslate nohighlight"( id="[^"]*")?>\s*(<span class="eqno">\(([^)]*)\))?')
CAPTION = re.compile(
    r'<p><span class="kf-caption">(.*?)</span></p>\s*(<div class="pst-scrollable-table-container">)?\s*<table class="([^"]*)">'
)
NUMBER = re.compile(r"(?:(?<=>)|^)\s*\d+(\.\d+)*\.\s")  # of a section
PARAMETERS = re.compile(r"<dl>\s*(<dd><em class=\"sig-param.*?)</dl>", re.DOTALL)  # of a long signature: no list of definitions
NO_MEANING = re.compile(r"</dt>\s*</dl>")  # of a parameter, say
ROLES = re.compile(r' role="(?:list|doc-biblioentry)"')  # of a bibliography, not those of today's HTML
FIGURE = re.compile(r'(<span class="caption-number">[^<]*\d) </span>')
EMPTY_HEAD = re.compile(r'<th( class="head[^"]*")><p></p></th>')  # the corner of a table is no heading
TICK = re.compile(r'(<p class="kf-claim">)\s*✓')
SMALL_TICK = r'\1<span class="kf-tick">✓</span>'
SMALL_STAR = '\\1<span class="kf-star">★</span>\u00a0'  # never alone at the end of a line


def use_templates(app, config) -> None:
    config.templates_path.insert(0, str(HERE / "_templates"))


def complete(app, pagename: str, templatename: str, context: dict, doctree) -> None:
    """Everything a page of the book has besides its text."""
    context["kf_parts"] = [_part(part, pagename, context["pathto"]) for part in contents.parts(app.env)]
    context["kf_home"] = {"href": context["pathto"](app.config.root_doc), "current": pagename == app.config.root_doc}
    context["kf_small_stars"] = lambda toc: NUMBER.sub("", toc).replace("★", '<span class="kf-star">★</span>')
    for step in ("prev", "next"):
        if context.get(step):
            first = context[step]["link"] == context["pathto"](app.config.root_doc)
            title = "Start here" if first else NUMBER.sub("", context[step]["title"])
            context[step] = {**context[step], "title": title}
    if doctree is None or "body" not in context:
        return
    body = context["body"]
    for pattern, replacement in (
        (FORMULA, _reachable),
        (FIGURE, r"\1.</span> "),
        (CAPTION, r'\2<table class="kf-table \3"><caption>\1</caption>'),
        (TICK, SMALL_TICK),
        (EMPTY_HEAD, r"<td\1></td>"),
        (PARAMETERS, _lines),
        (NO_MEANING, "</dt><dd></dd></dl>"),
        (ROLES, ""),
        (STAR, SMALL_STAR),
    ):
        body = pattern.sub(replacement, body)
    if above := _above(app, pagename):
        body = body.replace("<h1>", f'<p class="kf-part">{html.escape(above)}</p>\n<h1>', 1)
    context["body"] = body
    context["metatags"] = context.get("metatags", "") + _described(app, pagename, context, doctree)


def _above(app, pagename: str) -> str:
    """The words above a title: the part of the book, and the chapter's number."""
    if pagename == app.config.root_doc:
        return "A course companion"
    part, page = contents.page(app.env, pagename) or (contents.Part("", []), None)
    return f"{part.caption} · {page.number}" if page and page.number else part.caption


def _part(part: contents.Part, pagename: str, pathto) -> dict:
    pages = [{"href": pathto(page.name), "title": page.title, "current": page.name == pagename} for page in part.pages]
    return {"caption": part.caption, "pages": pages, "current": any(page["current"] for page in pages)}


def _reachable(match: re.Match) -> str:
    """A displayed formula takes the focus and has a name (page.js hands both to the box that MathJax makes)."""
    identity, number = match[1] or "", match[2] or ""
    name = f"Formula {match[3]}" if match[3] else "Formula"
    return f'<div class="math notranslate nohighlight"{identity} tabindex="0" role="group" aria-label="{name}">\n{number}'


def _lines(match: re.Match) -> str:
    return match[1].replace("<dd>", '<span class="sig-line">').replace("</dd>", "</span>")


def _described(app, pagename: str, context: dict, doctree) -> str:
    """Title and description of a page for search engines and for previews of links to it."""
    title = app.env.titles[pagename].astext() if pagename in app.env.titles else app.config.html_title
    text = next((p.astext() for p in doctree.findall(nodes.paragraph) if len(p.astext()) > 40 and not _boxed(p)), title)
    text = re.sub(r"\s+", " ", text)
    text = text if len(text) <= 200 else text[:197].rsplit(" ", 1)[0] + " ..."
    rows = {
        ("name", "description"): text,
        ("property", "og:title"): title,
        ("property", "og:description"): text,
        ("property", "og:type"): "website" if pagename == app.config.root_doc else "article",
        ("property", "og:site_name"): app.config.html_title,
    }
    return "".join(f'\n  <meta {kind}="{name}" content="{html.escape(value)}" />' for (kind, name), value in rows.items())


def _boxed(node: nodes.Node) -> bool:
    while node is not None:
        if isinstance(node, (nodes.Admonition, nodes.table, nodes.figure, nodes.list_item)) or node.get("classes", []) == [
            "cell"
        ]:
            return True
        node = node.parent
    return False


def only_where_needed(app, pagename: str, templatename: str, context: dict, doctree) -> None:
    """Sphinx takes the front page for one with formulas because its contents lead to such pages."""
    if 'class="math' not in context.get("body", ""):
        scripts = context.get("script_files", [])
        context["script_files"] = [one for one in scripts if "mathjax" not in f"{one.filename} {one.attributes}".lower()]


def write_not_found(app, exception) -> None:
    """The page that a server shows for an address that does not exist; it needs no other file."""
    if exception or app.builder.format != "html":
        return
    parts = contents.parts(app.env)
    folders = sorted(
        {page.name.split("/")[0] for part in parts for page in part.pages if "/" in page.name} | {"_static", "_sources"}
    )
    page = app.builder.templates.render("404.html", {"title": app.config.html_title, "parts": parts, "folders": folders})
    (Path(app.outdir) / "404.html").write_text(page, encoding="utf-8")


def leave_icons_out(app, exception) -> None:
    """The theme loads a script of 1.5 MB, every icon there is, on each page; _static/icons.css draws the ten that are used."""
    if not exception and app.builder.format == "html":
        for path in (Path(app.outdir) / "_static" / "scripts").glob("fontawesome.js*"):
            path.unlink()
        (Path(app.outdir) / "_static" / "scripts" / "fontawesome.js").write_text("", encoding="utf-8")


def setup(app) -> dict[str, bool]:
    app.connect("config-inited", use_templates, priority=900)
    app.connect("html-page-context", only_where_needed, priority=950)
    app.connect("build-finished", write_not_found)
    app.connect("build-finished", leave_icons_out)
    app.connect("html-page-context", complete, priority=300)  # before the theme, which tries the templates
    return {"parallel_read_safe": True, "parallel_write_safe": True}
