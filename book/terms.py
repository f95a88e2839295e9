"""Sphinx extension: the course's terms, from `glossary.toml` alone.

`{terms}` prints them on the page `glossary`.  A page's first use of a term that another page introduces leads there (preview.js
shows what it says).  `disagreements` compares the notes of Russian terms, "the innovation (невязка)", with the glossary: the
build stops where they differ (build.py), and so does a test.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

import contents
import yaml
from docutils import nodes
from sphinx.transforms.post_transforms import SphinxPostTransform
from sphinx.util.docutils import SphinxDirective
from typography import together

HERE = Path(__file__).resolve().parent
PAGE = "glossary"
NOTE = re.compile(r"\(([^()]*[а-яё][^()]*)\)", re.IGNORECASE)
RUSSIAN = re.compile(r"[а-яё]", re.IGNORECASE)
# Of MyST Markdown, what no reader reads: blocks of code, comments, roles that print no words, formulas, emphasis.
SILENT = re.compile(
    r"^```\{code-cell\}.*?^```|<!--.*?-->|\{(?:cite|eq|numref|doc|ref|download)\}`[^`]*`|\$\$.*?\$\$|\$[^$]*\$|\[=.*?=\]|\[%.*?%\]|[*`]",
    re.DOTALL | re.MULTILINE,
)
HEADING = re.compile(r'heading\("\w+", "([^"]*)"\)')  # of a set's question: its title stands elsewhere
CAPTION = re.compile(r"^    caption: \|?(.*?)(?=^    \w|^  \w|^---)", re.DOTALL | re.MULTILINE)  # of a cell's figure
NOT_LINKED = (nodes.reference, nodes.title, nodes.literal, nodes.math, nodes.raw, nodes.caption, nodes.figure, nodes.table)


class Term(NamedTuple):
    """A term: its names, what it is in one sentence, and where to look for it (the head of glossary.toml)."""

    name: str
    ru: tuple[str, ...]
    said: str
    short: str = ""
    also: tuple[str, ...] = ()
    linked: tuple[str, ...] | None = None
    page: str = ""

    @property
    def identity(self) -> str:
        return "term-" + re.sub(r"[^a-z]+", "-", self.name.casefold().replace("'", "")).strip("-")

    @cache  # noqa: B019 -- of values, which stay
    def forms(self) -> set[str]:
        """All that a note may call it, in both languages."""
        return {bare(form) for form in (self.name, self.short, *self.also, *self.ru) if form}

    def uses(self) -> tuple[str, ...]:
        """What a use of it looks like on a page."""
        if self.linked is not None:
            return self.linked
        plural = self.name[:-1] + "ies" if self.name.endswith("y") else self.name + "s"
        return tuple(form for form in (self.name, plural, self.short) if form)


class Disagreement(ValueError):
    """Pages and glossary differ: which note, and what the glossary says."""


@cache
def terms() -> tuple[Term, ...]:
    """The terms, in the order of the glossary."""
    read = tomllib.loads((HERE / "glossary.toml").read_text(encoding="utf-8"))
    return tuple(
        Term(name, said=entry.pop("is"), **{key: _fixed(value) for key, value in entry.items()}) for name, entry in read.items()
    )


def _fixed(value: str | list[str]) -> str | tuple[str, ...]:
    return value if isinstance(value, str) else tuple(value)


def bare(text: str) -> str:
    """Without stress marks and capitals, one space between words, apostrophes as they are typed."""
    return " ".join(text.replace("\N{COMBINING ACUTE ACCENT}", "").replace("’", "'").casefold().split())


def notes(markdown: str) -> Iterator[tuple[str, list[str]]]:
    """Each note with a Russian word in it: the words before its parenthesis, and its own, separated by commas."""
    captions = "\n\n".join(found[1] for found in CAPTION.finditer(markdown))
    text = " ".join(SILENT.sub(" ", part) for part in (markdown, captions))
    text = " ".join(text.split())
    for note in NOTE.finditer(text):
        yield text[max(0, note.start() - 80) : note.start()].rstrip(" ,:."), re.split(r"\s*[,;]\s*", note[1].strip())


def meant(before: str, inside: list[str]) -> list[Term]:
    """The terms that a note may belong to: the words before it end with one, or it has one itself."""
    own = {bare(part) for part in inside if not RUSSIAN.search(part)}
    ends = bare(before)
    words = {
        ends[start:] for start in range(len(ends)) if start == 0 or not (ends[start - 1].isalnum() or ends[start - 1] in "-_")
    }
    return [term for term in terms() if (own | words) & term.forms()]


def agrees(term: Term, inside: list[str]) -> bool:
    return {bare(part) for part in inside if RUSSIAN.search(part)} <= term.forms()


def disagreements(markdown: str) -> Iterator[str]:
    """What the notes of a page say that the glossary does not."""
    for before, inside in notes(markdown):
        found = meant(before, inside)
        if not any(agrees(term, inside) for term in found):
            note = f"“...{before[-50:]} ({', '.join(inside)})”"
            known = "; ".join(f"{term.name}: {', '.join(term.ru)}" for term in found)
            yield f"{note}: {f'the glossary has {known}' if known else 'no term of the glossary ends the words before it'}"


def introduced(sources: Mapping[str, str]) -> dict[str, str]:
    """The page that introduces each term: the one that it names, else the first, in the order of `sources`, with a note.

    Raises
    ------
    Disagreement
        If there is none, or it lacks the term.
    """
    first: dict[str, str] = {}
    for page, markdown in sources.items():
        for before, inside in notes(markdown):
            for term in meant(before, inside):
                if agrees(term, inside):
                    first.setdefault(term.name, page)
    for term in terms():
        page = term.page or first.get(term.name, "")
        if not any(form in bare(sources.get(page, "")) for form in term.forms()):
            raise Disagreement(f"{term.name}: no page has a note of it, and {page or 'none that glossary.toml names'} lacks it")
        first[term.name] = page
    return first


def sources() -> dict[str, str]:
    """Markdown of the chapters in the order of the book, then of the sets' statements, by page."""
    toc = yaml.safe_load((HERE / "_toc.yml").read_text(encoding="utf-8"))
    pages = [chapter["file"] for part in toc["parts"] for chapter in part["chapters"]]
    files = {page: HERE / f"{page}.md" for page in pages if page not in (PAGE, "equations") and "/" not in page}
    statements = sorted((HERE.parent / "exercises").glob("*/statement.md"))
    files |= {f"manual/{path.parent.name.replace('_', '-')}": path for path in statements}
    return {page: path.read_text(encoding="utf-8") for page, path in files.items()}


def check() -> None:
    """Stop if a note and the glossary differ."""
    pages = sources()
    found = [f"{page}: {one}" for page, markdown in pages.items() for one in disagreements(markdown)]
    known = {form for term in terms() for form in term.forms()}
    headings = [(name, words) for name, markdown in pages.items() for words in HEADING.findall(markdown)]
    found += [f"{name}: no term of the glossary is called “{words}”" for name, words in headings if bare(words) not in known]
    if found:
        raise Disagreement("\n".join(["glossary.toml and the pages differ:", *found]))
    introduced(pages)


class terms_here(nodes.General, nodes.Element):
    """Stands for the glossary, or its Russian index, until all pages are known."""


class Terms(SphinxDirective):
    """`{terms}`, or `{terms} Russian`: an index by the Russian terms."""

    optional_arguments = 1

    def run(self) -> list[nodes.Node]:
        return [terms_here("", russian=bool(self.arguments))]


def begin(app) -> None:
    app.env.kf_introduced = introduced(sources())


def fill(app, doctree, name: str) -> None:
    """Put the terms in the place of the directive."""
    for place in list(doctree.findall(terms_here)):
        place.replace_self(_index() if place["russian"] else _list(app, name))


def _list(app, name: str) -> nodes.definition_list:
    found = nodes.definition_list(classes=["kf-terms"])
    for term in terms():
        head = nodes.term("", term.name.replace("'", "’"), ids=[term.identity])
        if term.short and term.short != term.name:
            head += nodes.Text(f" ({term.short})")
        head += [nodes.Text(" "), nodes.inline("", ", ".join(term.ru), classes=["kf-ru", "language-ru"])]
        page = app.env.kf_introduced[term.name]
        number = contents.page(app.env, page)[1].number
        title = contents.page(app.env, page)[1].title.replace(" ★", "")
        where = nodes.reference("", f"{number}. {title}" if number else title, internal=True)
        where["refuri"] = app.builder.get_relative_uri(name, page) + ("" if term.page else f"#first-{term.identity}")
        meaning = nodes.paragraph("", f"{together(term.said)} ", nodes.inline("", "", where, classes=["kf-where"]))
        found += nodes.definition_list_item("", head, nodes.definition("", meaning))
    return found


def _index() -> nodes.bullet_list:
    rows = sorted((bare(russian), russian, term) for term in terms() for russian in term.ru)
    found = nodes.bullet_list(classes=["kf-russian"])
    for _, russian, term in rows:
        link = nodes.reference("", term.name.replace("'", "’"), refid=term.identity, internal=True)
        found += nodes.list_item(
            "", nodes.paragraph("", "", nodes.inline("", russian, classes=["language-ru"]), nodes.Text(" — "), link)
        )
    return found


@cache
def _looks() -> tuple[re.Pattern, dict[str, Term]]:
    """A pattern that finds every use of a term, the longest first, and whose they are; abbreviations keep their capitals."""
    known = {use if use.isupper() else bare(use): term for term in terms() for use in term.uses()}
    uses = sorted(known, key=len, reverse=True)
    either = "|".join(re.escape(use) if use.isupper() else f"(?i:{re.escape(use)})" for use in uses)
    return re.compile(rf"(?<![\w-])(?:{either})(?![\w-])".replace("'", "['’]")), known


class FirstUses(SphinxPostTransform):
    """The first use of a term on a page is a link to the glossary, unless the page introduces the term."""

    default_priority = 600
    formats = ("html",)

    def run(self, **kwargs) -> None:
        page = self.env.docname
        if page in (PAGE, "equations", "references", self.config.root_doc) or page.startswith(("package/", "api")):
            return
        own = {term for term in terms() if self.env.kf_introduced[term.name] == page}
        done = set(own)
        pattern, known = _looks()
        for text in [one for one in self.document.findall(nodes.Text) if _running(one)]:
            pieces, at = [], 0
            for found in pattern.finditer(text):
                term = known[found[0] if found[0].isupper() else bare(found[0])]
                if term in done:
                    continue
                done.add(term)
                link = nodes.reference("", found[0], internal=True, classes=["kf-term"])
                link["refuri"] = self.app.builder.get_relative_uri(page, PAGE) + f"#{term.identity}"
                pieces += [nodes.Text(text[at : found.start()]), link]
                at = found.end()
            if pieces:
                text.parent.replace(text, [*(one for one in pieces if one.astext()), nodes.Text(text[at:])])
        self._mark(own)

    def _mark(self, own: set[Term]) -> None:
        """Where the page introduces its terms."""
        for text in [one for one in self.document.findall(nodes.Text) if one.parent is not None]:
            said = bare(text)
            russian = {term: [bare(name) for name in term.forms() if RUSSIAN.search(name)] for term in own}
            for term in [term for term, names in russian.items() if any(name in said for name in names)]:
                own.discard(term)
                text.parent.insert(text.parent.index(text), nodes.target("", "", ids=[f"first-{term.identity}"]))


def _running(text: nodes.Text) -> bool:
    """In a sentence of the page, not in a heading, a caption, a lead, the objectives, or what a cell prints."""
    node, sentence = text.parent, False
    while node is not None:
        classes = node.get("classes", [])
        if isinstance(node, NOT_LINKED) or {"lead", "objectives", "cell_output", "kf-chapter"} & set(classes):
            return False
        sentence = sentence or isinstance(node, nodes.paragraph)
        node = node.parent
    return sentence


def setup(app) -> dict[str, bool]:
    app.add_node(terms_here)
    app.add_directive("terms", Terms)
    app.add_post_transform(FirstUses)
    app.connect("builder-inited", begin)
    app.connect("doctree-resolved", fill, priority=50)  # before the search takes its text (finding.py)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
