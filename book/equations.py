"""The pages of all displayed equations, the course's and those beyond, each with what it is.

`verified` and `typeset` (kfcourse.pages) leave a record beside each equation that they print:
LaTeX, how it was verified or what it is, its label.  Equations that a chapter types are judged with
the letters of the page (gate.page).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from gate.page import judged, mark

from kfcourse.pages.verification import VERIFIED

BOOK = Path(__file__).resolve().parent
COURSE, BEYOND = "reference/equations", "reference/equations-beyond"
FOLDERS = "course", "beyond", "reference"  # of chapters
HEAD = """\
(all-equations)=
# All equations

Each equation says what it is. A ✓ stands beside what was verified when the book was built: SymPy
has shown that the two sides are equal, or numbers have been compared to the digits that are
named. Where the text or a box types a relation, its letters were given numbers, by definitions
that say them in another way, and *both sides computed*. If one of these did not hold, there would
be no book. The others are definitions, quotations, and statements without proof; they stand here
letter by letter, and a changed letter stops the build, but nothing shows that they are true.

In the whole book {total} equations in {chapters} chapters were verified by SymPy, {computed} typed
relations computed, {others} are said to be something else; {claims} statements in words had their
conditions evaluated. Here are those of the course; {{doc}}`equations-beyond` has the others.

"""
HEAD_BEYOND = """\
# Equations beyond the course

{{doc}}`equations` says what stands beside each of them.

"""


def records(notebook) -> list[dict]:
    """What an executed chapter has verified, in order."""
    outputs = (output for cell in notebook.cells for output in cell.get("outputs", []))
    return [output["data"][VERIFIED] for output in outputs if VERIFIED in output.get("data", {})]


def page_of(document: str) -> str:
    """The page that has a chapter's equations."""
    return BEYOND if document.startswith("beyond/") else COURSE


def pages(chapters: Iterable[tuple[str, list[dict]]]) -> dict[str, str]:
    """The pages in Markdown by name, from pairs (document, records)."""
    parts: dict[str, list[str]] = {COURSE: [], BEYOND: []}
    counted: Counter = Counter()
    for document, made in chapters:
        typed = list(judged(BOOK / f"{document}.md"))
        relations = [
            relation
            for formula, judged_ in typed
            if formula.kind in ("display", "box")
            for relation in judged_
        ]
        here = Counter(
            total=sum(record.get("equations", 0) for record in made),
            claims=sum("sentence" in record for record in made),
            computed=sum(relation.computed for relation in relations),
            others=sum(not relation.computed for relation in relations)
            + sum("how" in record and not record["equations"] for record in made),
        )
        counted += here + Counter(chapters=bool(here["total"]))
        shown = [
            _entry(
                record["latex"],
                record["label"],
                ("✓ " if record["equations"] else "") + record["how"],
            )
            for record in made
            if "how" in record
        ]
        shown += [
            _entry(formula.latex, formula.label, mark(judged_))
            for formula, judged_ in typed
            if formula.kind == "display" and judged_
        ]
        if shown:
            parts[page_of(document)] += [
                f"({place_of(document)})=\n## {_title(document)}\n\n{_count(here)}: "
                f"{{doc}}`/{document}`\n",
                *shown,
            ]
    heads = {COURSE: HEAD, BEYOND: HEAD_BEYOND}
    return {name: heads[name].format_map(counted) + "\n".join(parts[name]) for name in parts}


def place_of(document: str) -> str:
    """Where a chapter's equations stand on their page."""
    return f"equations-of-{document.rpartition('/')[2]}"


def _title(document: str) -> str:
    text = (BOOK / f"{document}.md").read_text(encoding="utf-8")
    return next(line[2:] for line in text.splitlines() if line.startswith("# "))


def _count(here: Counter) -> str:
    words = {
        "total": ("equation verified", "equations verified"),
        "computed": ("typed relation computed", "typed relations computed"),
        "others": ("definition or the like", "definitions and the like"),
        "claims": ("claim", "claims"),
    }
    return ", ".join(f"{here[name]} {words[name][here[name] > 1]}" for name in words if here[name])


def _entry(latex: str, label: str | None, what: str) -> str:
    place = f"{{eq}}`{label}` · " if label else ""
    kind = "kf-claim" if what.startswith("✓") else "kf-said"
    return f'$$\n{latex.strip()}\n$$\n\n{place}<span class="{kind}">{what}</span>\n'
