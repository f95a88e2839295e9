"""Sphinx extension: the course's terms, from `glossary.toml` alone.

`{terms}` prints them on the page `glossary`.  A page's first use of a term that another page
introduces leads there (preview.js shows what it says).
"""

from __future__ import annotations

import re
import tomllib
from functools import cache
from pathlib import Path
from typing import NamedTuple

import contents
from docutils import nodes
from equations import BEYOND, COURSE
from sphinx.transforms.post_transforms import SphinxPostTransform
from sphinx.util.docutils import SphinxDirective

from ext.figures import ancestors

PAGE = "reference/glossary"
GLOSSARY = Path(__file__).resolve().parents[1] / "glossary.toml"
RUSSIAN = re.compile(r"[а-яё]", re.IGNORECASE)
NOT_LINKED = (
    nodes.reference, nodes.title, nodes.literal, nodes.math, nodes.raw, nodes.caption, nodes.figure,
    nodes.table,
)  # fmt: skip


class Term(NamedTuple):
    """A term: its names, what it is in one sentence, and the page that introduces it."""

    name: str
    ru: list[str]
    meaning: str
    page: str
    short: str = ""
    also: list[str] | tuple[()] = ()
    linked: list[str] | None = None

    @property
    def identity(self) -> str:
        words = self.name.casefold().replace("'", "")
        return "term-" + re.sub(r"[^a-z]+", "-", words).strip("-")

    def forms(self) -> set[str]:
        """All that a page may call it, in both languages."""
        return {bare(form) for form in (self.name, self.short, *self.also, *self.ru) if form}

    def uses(self) -> list[str]:
        """What a use of it looks like on a page."""
        if self.linked is not None:
            return self.linked
        plural = self.name[:-1] + "ies" if self.name.endswith("y") else self.name + "s"
        return [form for form in (self.name, plural, self.short) if form]


@cache
def terms() -> tuple[Term, ...]:
    """The terms, in the order of the glossary."""
    entries = tomllib.loads(GLOSSARY.read_text(encoding="utf-8"))
    return tuple(Term(name, meaning=entry.pop("is"), **entry) for name, entry in entries.items())


def bare(text: str) -> str:
    """Without stress marks and capitals, one space between words, apostrophes as they are typed."""
    plain = text.replace("\N{COMBINING ACUTE ACCENT}", "").replace("’", "'")
    return " ".join(plain.casefold().split())


class terms_here(nodes.General, nodes.Element):
    """Stands for the glossary, or its Russian index, until all pages are known."""


class Terms(SphinxDirective):
    """`{terms}`, or `{terms} Russian`: an index by the Russian terms."""

    optional_arguments = 1

    def run(self) -> list[nodes.Node]:
        return [terms_here("", russian=bool(self.arguments))]


def fill(app, doctree, name: str) -> None:
    """Put the terms in the place of the directive."""
    for place in list(doctree.findall(terms_here)):
        place.replace_self(_index() if place["russian"] else [_letters(), _list(app, name)])


def _letters() -> nodes.paragraph:
    """A link to the first term with each letter."""
    first = {term.name[0].upper(): term.identity for term in reversed(terms())}
    links = [
        nodes.reference("", letter, refid=first[letter], internal=True) for letter in sorted(first)
    ]
    return nodes.paragraph("", "", *links, classes=["kf-letters"])


def _list(app, name: str) -> nodes.definition_list:
    result = nodes.definition_list(classes=["kf-terms"])
    for term in terms():
        head = nodes.term("", term.name.replace("'", "’"), ids=[term.identity])
        if term.short and term.short != term.name:
            head += nodes.Text(f" ({term.short})")
        russian = nodes.inline("", ", ".join(term.ru), classes=["kf-ru", "language-ru"])
        head += [nodes.Text(" "), russian]
        known = contents.page(app.env, term.page)
        title, number = (known[1].title, known[1].number) if known else (term.page, None)
        where = nodes.reference("", f"{number}. {title}" if number else title, internal=True)
        where["refuri"] = app.builder.get_relative_uri(name, term.page) + f"#first-{term.identity}"
        place = nodes.inline("", "", where, classes=["kf-where"])
        meaning = nodes.paragraph("", f"{term.meaning} ", place)
        result += nodes.definition_list_item("", head, nodes.definition("", meaning))
    return result


def _index() -> nodes.bullet_list:
    result = nodes.bullet_list(classes=["kf-russian"])
    rows = [(bare(russian), russian, term) for term in terms() for russian in term.ru]
    for _, russian, term in sorted(rows):
        link = nodes.reference("", term.name.replace("'", "’"), refid=term.identity, internal=True)
        name = nodes.inline("", russian, classes=["language-ru"])
        result += nodes.list_item("", nodes.paragraph("", "", name, nodes.Text(" — "), link))
    return result


@cache
def _looks() -> tuple[re.Pattern, dict[str, Term]]:
    """A pattern of all uses of terms, the longest first, and whose they are; NIS keeps its
    capitals."""
    known = {use if use.isupper() else bare(use): term for term in terms() for use in term.uses()}
    uses = sorted(known, key=len, reverse=True)
    either = "|".join(re.escape(use) if use.isupper() else f"(?i:{re.escape(use)})" for use in uses)
    return re.compile(rf"(?<![\w-])(?:{either})(?![\w-])".replace("'", "['’]")), known


class FirstUses(SphinxPostTransform):
    """The first use of a term on a page is a link to the glossary, unless the page introduces the
    term."""

    default_priority = 600
    formats = ("html",)

    def run(self, **kwargs) -> None:
        page = self.env.docname
        without = (PAGE, COURSE, BEYOND, "reference/references", self.config.root_doc)
        if page in without or page.startswith(("package/", "reference/api")):
            return
        own = [term for term in terms() if term.page == page]
        linked = {term.name for term in own}
        pattern, known = _looks()
        for text in [text for text in self.document.findall(nodes.Text) if _running(text)]:
            pieces, at = [], 0
            for match in pattern.finditer(text):
                term = known[match[0] if match[0].isupper() else bare(match[0])]
                if term.name not in linked:
                    linked.add(term.name)
                    link = nodes.reference("", match[0], internal=True, classes=["kf-term"])
                    place = self.app.builder.get_relative_uri(page, PAGE)
                    link["refuri"] = f"{place}#{term.identity}"
                    pieces += [nodes.Text(text[at : match.start()]), link]
                    at = match.end()
            if pieces:
                pieces.append(nodes.Text(text[at:]))
                text.parent.replace(text, [piece for piece in pieces if piece.astext()])
        self._mark(own)

    def _mark(self, own: list[Term]) -> None:
        """Give the first text with a Russian name of each own term a target."""
        russian = {term.identity: set(filter(RUSSIAN.search, term.forms())) for term in own}
        for text in [text for text in self.document.findall(nodes.Text) if text.parent is not None]:
            words = bare(text)
            for identity, names in list(russian.items()):
                if any(name in words for name in names):
                    del russian[identity]
                    place = text.parent.index(text)
                    text.parent.insert(place, nodes.target("", "", ids=[f"first-{identity}"]))


def _running(text: nodes.Text) -> bool:
    """In a sentence of the page, not in a heading, a caption, a lead, the objectives, or what a
    cell prints."""
    around = list(ancestors(text))
    without = {"lead", "objectives", "cell_output", "kf-chapter"}
    return any(isinstance(node, nodes.paragraph) for node in around) and not any(
        isinstance(node, NOT_LINKED) or without & set(node.get("classes", [])) for node in around
    )


def setup(app) -> dict[str, bool]:
    app.add_node(terms_here)
    app.add_directive("terms", Terms)
    app.add_post_transform(FirstUses)
    # before the search takes its text (finding.py)
    app.connect("doctree-resolved", fill, priority=50)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
