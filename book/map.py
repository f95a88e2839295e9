"""Sphinx extension: the map of the chapters on the front page, `{map}`.

    ```{map}
    only the lab: notation, structural-functions, lab-filters
    theory: notation, stratonovich
    ```

Rows are the parts of the book, boxes its chapters with their reading times; each line of the directive is a route.
"""

from __future__ import annotations

import html

import contents
from docutils import nodes
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective

log = logging.getLogger(__name__)


class chapter_map(nodes.General, nodes.Element):
    """Stands for the map until all pages are known."""


class Map(SphinxDirective):
    has_content = True

    def run(self) -> list[nodes.Node]:
        rows = (row.partition(":") for row in self.content if row.strip())
        node = chapter_map("", routes={name.strip(): [one.strip() for one in names.split(",")] for name, _, names in rows})
        self.set_source_info(node)
        return [node]


def draw(app, doctree, name: str) -> None:
    """Put the map in the place of its directive."""
    for node in list(doctree.findall(chapter_map)):
        routes = node["routes"]
        for page in {page for route in routes.values() for page in route}:
            if contents.page(app.env, page) is None:
                log.warning("no page %r in _toc.yml", page, location=node)
        node.replace_self(nodes.raw("", _html(app, name, routes), format="html"))


def _html(app, name: str, routes: dict[str, list[str]]) -> str:
    chosen = "".join(
        f'<label><input type="radio" name="kf-route" value="{i}"{" checked" if i == 0 else ""}>'
        f'<span class="kf-route kf-route-{i}">{html.escape(route)}</span></label>'
        for i, route in enumerate(["all", *routes])
    )
    rows = []
    for part in contents.parts(app.env):
        on_a_route = [page for page in part.pages if any(page.name in route for route in routes.values())]
        if on_a_route:
            boxes = "".join(
                f"<li>{_box(app, name, page, routes)}</li>" for page in part.pages if part.caption or page in on_a_route
            )
            rows.append(f"<h3>{html.escape(part.caption or 'First')}</h3><ol>{boxes}</ol>")
    return (
        f'<div class="kf-map"><fieldset><legend>Show the way for</legend>{chosen}</fieldset>'
        f'<nav aria-label="Map of the chapters">{"".join(rows)}</nav></div>'
    )


def _box(app, name: str, page: contents.Page, routes: dict[str, list[str]]) -> str:
    on = [(i, route) for i, (route, pages) in enumerate(routes.items(), 1) if page.name in pages]
    bars = "".join(f'<i class="kf-route-{i}"></i>' for i, _ in on)
    minutes = app.env.metadata[page.name].get("minutes")
    names = ", ".join(route for _, route in on)
    number = f"{page.number}. " if page.number else ""
    link = app.builder.get_relative_uri(name, page.name)
    title = html.escape(page.title).replace(" ★", "\u00a0★")  # a star never alone on a line
    text = f"<b>{number}{title}</b><small>{f'{minutes} min' if minutes else '&nbsp;'}</small>"
    classes = " ".join(f"on-{i}" for i, _ in on)
    return f'<a class="{classes}" href="{link}">{text}<span title="{html.escape(names)}">{bars}</span></a>'


def setup(app) -> dict[str, bool]:
    app.add_node(chapter_map)
    app.add_directive("map", Map)
    app.connect("doctree-resolved", draw)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
