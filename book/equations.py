"""The page of all displayed equations, each with what it is.

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

PAGE = Path(__file__).resolve().parent / "equations.md"
HEAD = """\
(all-equations)=
# All equations

Each equation says what it is. A ✓ stands beside what was verified when the book was built:
SymPy has shown that the two sides are equal, or numbers have been compared to the digits that are
named. Where the text or a box types a relation, its letters were given numbers, by the package or
by a plain program, and *both sides computed*. If one of these did not hold, there would be no book.
The others are definitions, quotations, and statements without proof; they stand here letter by
letter, and a changed letter stops the build, but nothing shows that they are true.

{total} equations in {chapters} chapters were verified by SymPy, {computed} typed
relations computed, {others} are said to be something else; {claims} statements in words had their
conditions evaluated.
"""


def records(notebook) -> list[dict]:
    """What an executed chapter has verified, in order."""
    outputs = (output for cell in notebook.cells for output in cell.get("outputs", []))
    return [output["data"][VERIFIED] for output in outputs if VERIFIED in output.get("data", {})]


def page(chapters: Iterable[tuple[str, list[dict]]]) -> str:
    """The page in Markdown, from pairs (document, records)."""
    parts, counted = [], Counter()
    for document, made in chapters:
        typed = list(judged(PAGE.parent / f"{document}.md"))
        relations = [
            one for formula, said in typed if formula.kind in ("display", "box") for one in said
        ]
        here = Counter(
            total=sum(one.get("equations", 0) for one in made),
            claims=sum("sentence" in one for one in made),
            computed=sum(one.computed for one in relations),
            others=sum(not one.computed for one in relations)
            + sum("how" in one and not one["equations"] for one in made),
        )
        counted += here + Counter(chapters=bool(here["total"]))
        shown = [
            _entry(one["latex"], one["label"], ("✓ " if one["equations"] else "") + one["how"])
            for one in made
            if "how" in one
        ]
        shown += [
            _entry(formula.latex, formula.label, mark(said))
            for formula, said in typed
            if formula.kind == "display" and said
        ]
        if shown:
            parts += [
                f"({place_of(document)})=\n## {_title(document)}\n\n{_count(here)}: "
                f"{{doc}}`{document}`\n",
                *shown,
            ]
    return (
        HEAD.format(
            **{
                name: counted[name]
                for name in ("total", "chapters", "computed", "others", "claims")
            }
        )
        + "\n"
        + "\n".join(parts)
    )


def place_of(document: str) -> str:
    """Where a chapter's equations stand on the page."""
    return f"equations-of-{document}"


def _title(document: str) -> str:
    text = (PAGE.parent / f"{document}.md").read_text(encoding="utf-8")
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
