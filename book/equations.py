"""The page of all verified equations, made from the outputs of the executed chapters.

`verified` (kfcourse.pages) leaves a record beside each equation that it prints: LaTeX, how it was verified, its label.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from kfcourse.pages.verification import VERIFIED

PAGE = Path(__file__).resolve().parent / "equations.md"
HEAD = """\
(all-equations)=
# All equations of this book

Each equation on this page was verified when the book was built. Where its chapter prints it, SymPy has shown that the two
sides are equal, or numbers have been compared to the digits that are named. If one did not hold, there would be no book.

{total} equations in {chapters} chapters, and {claims} statements in words whose conditions were evaluated.
"""


def records(notebook) -> list[dict]:
    """What an executed chapter has verified, in order."""
    outputs = (output for cell in notebook.cells for output in cell.get("outputs", []))
    return [output["data"][VERIFIED] for output in outputs if VERIFIED in output.get("data", {})]


def page(chapters: Iterable[tuple[str, list[dict]]]) -> str:
    """The page in Markdown, from pairs (document, records)."""
    found = [(document, [one for one in made if one["equations"]], made) for document, made in chapters if made]
    parts = []
    for document, equations, made in found:
        if equations:
            parts.append(f"## {_title(document)}\n\n{_count(equations, made)}: {{doc}}`{document}`\n")
            parts += [_entry(one) for one in equations]
    total = sum(one["equations"] for _, equations, _ in found for one in equations)
    claims = sum(len(made) - len(equations) for _, equations, made in found)
    chapters_with = sum(bool(equations) for _, equations, _ in found)
    return HEAD.format(total=total, chapters=chapters_with, claims=claims) + "\n" + "\n".join(parts)


def _title(document: str) -> str:
    text = (PAGE.parent / f"{document}.md").read_text(encoding="utf-8")
    return next(line[2:] for line in text.splitlines() if line.startswith("# "))


def _count(equations: list[dict], made: list[dict]) -> str:
    number, others = sum(one["equations"] for one in equations), len(made) - len(equations)
    return f"{number} equations" + (f" and {others} statements in words" if others else "")


def _entry(one: dict) -> str:
    place = f"{{eq}}`{one['label']}` · " if one["label"] else ""
    return f'$$\n{one["latex"]}\n$$\n\n{place}<span class="kf-claim">✓ {one["how"]}</span>\n'
