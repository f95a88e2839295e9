r"""Plants changes in the relations that the book displays, and counts what nothing notices.

    cd book
    python -m gate.plant                each typed relation of each page, changed in each way it can
                                        be: by chapter and kind
    python -m gate.plant --seed 7       other places of the changes
    python -m gate.plant beyond/grid --show    one chapter, and each change that nothing noticed

A change is a sign, a factor, an index, or a transposition.  It is noticed if the relation no longer
holds, or is no longer what the page's file in book/letters/ says (gate.page).  More than 5 %
unnoticed is a failure.
"""

from __future__ import annotations

import argparse
import ast
import random
import re
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import jupytext
import numpy as np
from equations import BEYOND, COURSE, FOLDERS

from gate.page import Formula, Letters, formulas, letters_of, outside_points
from gate.tex import is_relation, normal, pieces
from kfcourse.pages import Unverified

BOOK = Path(__file__).resolve().parents[1]
MADE = {BOOK / f"{name}.md" for name in (COURSE, BEYOND)}  # by the build
MOST = 0.05
KINDS = ("sign", "factor", "index", "transposition")


def written() -> list[Path]:
    """The pages of the book that somebody has written."""
    return sorted({page for name in ("", *FOLDERS) for page in (BOOK / name).glob("*.md")} - MADE)


class Planted(NamedTuple):
    """A changed relation of a page: where, which, how, and whether it was noticed."""

    page: str
    where: str
    kind: str
    before: str
    after: str
    noticed: bool


def planted(page: Path, chance: random.Random, most: int = 10**9) -> Iterator[Planted]:
    """One change of each kind in each typed relation of a page, in `most` relations of it."""
    letters, text = letters_of(page), page.read_text(encoding="utf-8")
    elsewhere = outside_points(text)
    places = [
        (formula, piece)
        for formula in formulas(text)
        for piece in (
            [normal(formula.latex)] if formula.kind in ("side", "name") else pieces(formula.latex)
        )
        if formula.kind in ("side", "name") or letters.says(piece)
        # what cannot be read is not held
        if formula.kind != "sentence" or letters.judge(formula._replace(latex=piece))
    ]
    for formula, piece in chance.sample(places, min(most, len(places))):
        letters.judge(formula, elsewhere)  # what does not hold before notices everything
        for kind in KINDS:
            changed = change(piece, kind, chance)
            if changed:
                after = formula._replace(latex=changed)
                # What is listed as said and not there fails test_relations.py.
                seen = piece in letters.declared or noticed(letters, after, elsewhere)
                yield Planted(page.stem, formula.kind, kind, piece, changed, seen)


def noticed(letters: Letters, formula: Formula, elsewhere: str = "") -> bool:
    """Does the page's gate stop at this formula?"""
    try:
        with np.errstate(invalid="ignore"):  # a changed sign under a root
            letters.judge(formula, elsewhere)
    except Unverified:
        return True
    return False


def run(chapter: str, changed: str, alone: bool) -> None:
    """Execute the code of a chapter, without what only its figures need, to the cell after the
    change."""
    names: dict[str, Any] = {}
    left: list[str] = []  # cells of figures
    code = [
        cell for cell in jupytext.reads(chapter, fmt="md:myst").cells if cell.cell_type == "code"
    ]
    place = next(i for i, cell in enumerate(code) if changed.strip() in cell.source)
    for i, cell in enumerate(code[: place + 2]):
        if alone and i < place:
            imports = [
                node
                for node in ast.parse(cell.source).body
                if isinstance(node, ast.Import | ast.ImportFrom)
            ]
            exec(compile(ast.Module(imports, []), "imports", "exec"), names)
        elif "figure" in cell.metadata.get("mystnb", {}) and "import" not in cell.source:
            left.append(cell.source)
        else:
            try:
                exec(cell.source, names)
            except NameError:  # it uses what a figure has computed
                for source in [*left, cell.source]:
                    exec(source, names)
                left.clear()


def change(piece: str, kind: str, chance: random.Random) -> str | None:
    """A relation with one sign, factor, index or transposition changed; None if there is no place
    for it."""
    text = piece.split()
    inside = list(_scripts(text))
    ways: list[tuple[int, int, list[str]]] = []  # from, to, what takes the place
    for i, entry in enumerate(text):
        if kind == "sign" and not inside[i] and entry in "+-":
            ways.append((i, i + 1, ["-" if entry == "+" else "+"]))
        if kind == "factor" and not inside[i] and entry.isdigit() and entry != "0":
            ways.append((i, i + 1, [str(int(entry) % 9 + 1)]))
        if kind == "index" and i and text[i - 1] == "_" and re.fullmatch(r"[a-z]", entry):
            ways.append((i, i + 1, ["{", entry, "+", "1", "}"]))
        if (
            kind == "index"
            and inside[i]
            and entry in "+-"
            and i + 1 < len(text)
            and text[i + 1].isdigit()
        ):
            ways.append((i, i + 2, []) if text[i - 1] != "{" else (i, i, []))
        if kind == "transposition" and i and text[i - 1] == "^" and entry == "T":
            ways.append((i - 1, i + 1, []))
    if kind == "sign" and not ways and "=" in text:
        place = text.index("=") + 1
        ways.append((place, place, ["-"]))
    if kind == "factor" and not ways and is_relation(piece) and "=" in text:
        place = text.index("=") + 1
        ways.append((place, place, ["2"]))
    ways = [way for way in ways if way[0] != way[1] or way[2]]
    if not ways:
        return None
    start, stop, new = chance.choice(ways)
    return " ".join([*text[:start], *new, *text[stop:]])


def _scripts(text: list[str]) -> Iterator[bool]:
    """Is each token part of a subscript or a superscript?"""
    depths: list[bool] = []
    for i, entry in enumerate(text):
        if entry == "{":
            depths.append(bool(i) and text[i - 1] in ("_", "^"))
        yield any(depths) or (i > 0 and text[i - 1] in ("_", "^"))
        if entry == "}" and depths:
            depths.pop()


def report(changes: list[Planted]) -> str:
    """Planted and unnoticed changes, by chapter and kind of display: a table."""
    columns = [
        (where, kind)
        for where in ("display", "box", "point", "sentence", "side", "name")
        for kind in KINDS
    ]
    columns = [entry for entry in columns if any((row.where, row.kind) == entry for row in changes)]
    wheres = list(dict.fromkeys(where for where, _ in columns))
    lines = [
        f"{'unnoticed of planted':24}"
        + "".join(f"{where:>12}" for where in wheres)
        + f"{'all':>12}"
    ]
    for page in [*dict.fromkeys(row.page for row in changes), "all chapters"]:
        rows = [row for row in changes if page in (row.page, "all chapters")]
        lines.append(
            f"{page:24}"
            + "".join(
                f"{_share([row for row in rows if row.where == where]):>12}" for where in wheres
            )
            + f"{_share(rows):>12}"
        )
    by_kind = Counter(row.kind for row in changes)
    missed = Counter(row.kind for row in changes if not row.noticed)
    lines.append("; ".join(f"{kind}: {missed[kind]} of {by_kind[kind]}" for kind in KINDS))
    return "\n".join(lines)


def _share(rows: list[Planted]) -> str:
    return f"{sum(not row.noticed for row in rows)}/{len(rows)}" if rows else ""


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=53)
    parser.add_argument(
        "--show", action="store_true", help="print each change that nothing noticed"
    )
    parser.add_argument("pages", nargs="*", help="chapters, all without")
    given = parser.parse_args()
    chance = random.Random(given.seed)
    pages = [BOOK / f"{name}.md" for name in given.pages] or written()
    changes = [entry for page in pages for entry in planted(page, chance)]
    for entry in changes:
        if given.show and not entry.noticed:
            print(f"{entry.page}, {entry.where}, {entry.kind}\n  {entry.before}\n  {entry.after}")
    print(report(changes))
    missed = sum(not entry.noticed for entry in changes)
    print(
        f"{missed} of {len(changes)} changes were not noticed: {missed / max(len(changes), 1):.1%}"
    )
    return missed > MOST * len(changes)


if __name__ == "__main__":
    sys.exit(main())
