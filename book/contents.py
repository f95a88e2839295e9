"""The table of contents as the pages show it: parts, and in each its pages with their short titles
and numbers."""

from __future__ import annotations

from typing import NamedTuple

from sphinx import addnodes
from sphinx.environment import BuildEnvironment


class Page(NamedTuple):
    """A page of the book; `number` is the chapter's, None on a page that has none."""

    name: str
    title: str
    number: int | None


class Part(NamedTuple):
    """A part of the book; the pages before the first part stand in one without a caption."""

    caption: str
    pages: list[Page]


def parts(env: BuildEnvironment) -> list[Part]:
    """The parts in the order of `_toc.yml`: a page's title there is its short one; without it, its
    heading."""
    result = []
    for tree in env.get_doctree(env.config.root_doc).findall(addnodes.toctree):
        pages = [
            Page(name, title or env.titles[name].astext(), _number(env, name))
            for title, name in tree["entries"]
        ]
        result.append(Part(tree.get("caption") or "", pages))
    return result


def page(env: BuildEnvironment, name: str) -> tuple[Part, Page] | None:
    """The page of this name and the part it stands in; None if the table of contents does not have
    it."""
    return next(
        ((part, entry) for part in parts(env) for entry in part.pages if entry.name == name), None
    )


def _number(env: BuildEnvironment, name: str) -> int | None:
    numbers = env.toc_secnumbers.get(name, {}).get("")
    return numbers[0] if numbers else None
