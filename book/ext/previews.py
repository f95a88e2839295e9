"""Sphinx extension: what a link to another page leads to, printed into the page itself.

A page read from a file cannot load another one.  So each page carries, for every equation, figure
and term of another page that it refers to, what preview.js shows: a formula, a figure as its
caption and the address of its picture, a term with its
sentence.  Only what the page refers to: some hundred bytes each.
"""

from __future__ import annotations

import json
import posixpath
import re
from functools import cache
from pathlib import Path
from urllib.parse import unquote

from bs4 import BeautifulSoup
from equations import BEYOND, COURSE

REPEAT = tuple(f"{name}.html" for name in (COURSE, BEYOND))  # show what they refer to
LINK = re.compile(r'<a [^>]*class="[^"]*\breference internal\b[^"]*"[^>]*>')
PLACE = re.compile(r'href="([^"#]+\.html)#([^"]+)"')


def write(app, exception: Exception | None) -> None:
    """Add to each page what it refers to."""
    if exception or app.builder.format != "html":
        return
    root = Path(app.outdir)
    read = cache(lambda name: (root / name).read_text(encoding="utf-8"))
    for path in sorted(root.rglob("*.html")):
        name, text = path.relative_to(root).as_posix(), path.read_text(encoding="utf-8")
        here, previews = posixpath.dirname(name) or ".", {}
        for place in (PLACE.search(link[0]) for link in LINK.finditer(text) if name not in REPEAT):
            target = place and posixpath.normpath(posixpath.join(here, place[1]))
            if not target or not (root / target).exists():
                continue
            shown = preview(
                read(target),
                unquote(place[2]),
                posixpath.relpath(posixpath.dirname(target) or ".", here),
            )
            if shown:
                previews[f"{place[1]}#{place[2]}"] = shown
        if previews:
            data = json.dumps(previews, ensure_ascii=False, separators=(",", ":")).replace(
                "<", "\\u003c"
            )
            script = f'<script type="application/json" id="kf-previews">{data}</script>\n</body>'
            path.write_text(text.replace("</body>", script), encoding="utf-8")


def preview(page: str, identity: str, way: str) -> str:
    """The figure, formula or term that stands at a place of a page, as HTML; nothing for anything
    else.

    `way` leads from the page that shows it to the folder of its own.
    """
    begin = page.rfind("<", 0, max(page.find(f' id="{identity}"'), 0))
    if not page.startswith(("<figure", "<div", "<dt"), begin):
        return ""
    shown = BeautifulSoup(element(page, begin), "html.parser")
    target = shown.find()
    if target.name == "dt" and (russian := target.find(class_="kf-ru")):
        meaning = BeautifulSoup(element(page, page.index("<dd", begin)), "html.parser").dd
        shown = BeautifulSoup(
            f"<p><b>{target.find(string=True)}</b> {russian}</p>{meaning.decode_contents()}",
            "html.parser",
        )
    elif target.name != "figure" and "math" not in target.get("class", []):
        return ""
    for image in shown.select("[src]"):
        image["src"] = posixpath.normpath(f"{way}/{image['src']}")
    return str(shown).strip()


def element(page: str, begin: int) -> str:
    """The source of the element that begins there: a whole page is large, and parsed slowly."""
    name, depth = re.compile(r"<([\w-]+)").match(page, begin)[1], 0
    for tag in re.compile(rf"<(/?){name}\b").finditer(page, begin):
        depth += -1 if tag[1] else 1
        if not depth:
            return page[begin : page.index(">", tag.start()) + 1]
    raise ValueError(f"<{name}> at {begin} has no end")


def setup(app) -> dict[str, bool]:
    app.connect("build-finished", write, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
