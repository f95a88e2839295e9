"""Sphinx extension: docstrings written to be read with `help()`, as reStructuredText for numpydoc.

Characters with a meaning in reStructuredText are escaped.  A paragraph that is indented, or that
has a relation and ends without a full stop, is an equation and stands as it is, like what follows
"::". Lines of two columns, parted by two spaces or more, are a table of names, which may go on in
lines that are indented.  The sections (Parameters, Returns, ...) are numpydoc's.
"""

from __future__ import annotations

import re

COLUMNS = re.compile(r"[^\s.:;!?] {2,}\S|^ {2,}\S")  # after a full stop they part sentences
PARTED = re.compile(r"(?<=[^\s.:;!?]) {2,}(?=\S)")
RELATION = re.compile(r" (?:[=<>~∝≈]|[<-][->]|[<>]=) ")
APART = re.compile(r",\s*(?![^()]*\))")
INDENT = "    "
SPECIAL = re.compile(r"(?!^\s*\* )([*|\\]|(?<=\w)_(?=\W|$))")
QUOTED = re.compile(r"(`+[^`]+`+)")


def paragraphs(lines: list[str]) -> list[tuple[str, list[str]]]:
    """Each paragraph with its kind: prose, sections, equations, verbatim, names."""
    result: list[tuple[str, list[str]]] = []
    for paragraph in "\n".join(lines).split("\n\n"):
        rows = paragraph.strip("\n").split("\n")
        before, last = result[-1] if result else ("", [""])
        indented = all(row.startswith(INDENT) for row in rows)
        kind = "prose"
        if before == "sections" or (len(rows) > 1 and set(rows[1].strip()) == {"-"}):
            kind = "sections"
        elif rows[0].startswith(">>>") or (
            indented and (before == "verbatim" or last[-1].endswith("::"))
        ):
            kind = "verbatim"
        elif indented or (result and rows[-1][-1:] not in ".:?" and RELATION.search(rows[0])):
            kind = "equations"
        elif result and len(rows) > 1 and all(map(COLUMNS.search, rows)):
            kind = "names"
        result.append((kind, rows))
    return result


def to_restructured(lines: list[str]) -> list[str]:
    """The docstring in reStructuredText."""
    result: list[str] = []
    for kind, rows in paragraphs(lines):
        if kind == "equations":
            result += ["::", "", *(INDENT + row for row in rows), ""]
        elif kind == "names":
            result += table(rows)
        elif kind == "verbatim":
            result += [*rows, ""]
        else:
            result += [*map(escape, rows), ""]
    return result


def table(rows: list[str]) -> list[str]:
    """The table of names: each, and what it is."""
    entries = re.sub(r"\n +", " ", "\n".join(rows)).split("\n")
    result = [".. list-table::", "   :class: kf-names", ""]
    for name, words in (PARTED.split(entry, maxsplit=1) for entry in entries):
        # a line may break between names
        names = (f"``{each}``" for each in APART.split(name.replace("`", "")))
        result += [f"   * - {', '.join(names)}", f"     - {escape(words)}"]
    return [*result, ""]


def escape(row: str) -> str:
    """The row with characters special in reStructuredText escaped; `code` becomes literal."""
    parts = QUOTED.split(row)
    return "".join(
        "``" + part.strip("`") + "``" if i % 2 else SPECIAL.sub(r"\\\1", part)
        for i, part in enumerate(parts)
    )


def process(app, what, name, obj, options, lines) -> None:
    lines[:] = to_restructured(lines)


def skip_tuple_fields(app, what, name, obj, skip, options) -> bool | None:
    """Fields of a NamedTuple are described in its own docstring ("Alias for field number 0" is no
    description)."""
    return True if type(obj).__name__ == "_tuplegetter" else None


def setup(app) -> dict[str, bool]:
    app.connect("autodoc-process-docstring", process, priority=100)  # before numpydoc
    app.connect("autodoc-skip-member", skip_tuple_fields)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
