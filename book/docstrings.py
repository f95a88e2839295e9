"""Sphinx extension: docstrings written to be read with `help()`, shown well in the book.

They are plain text with equations such as `x**2` or `K (y - h)` on lines of their own.  Before numpydoc reads
them, paragraphs of equations become literal blocks and characters with a meaning in reStructuredText are escaped;
the sections (Parameters, Returns, ...) are numpydoc's.
"""

from __future__ import annotations

import re

EQUATION = re.compile(r"^\s{2,}\S|\s=\s|[^\s.:;!?] {2,}\S|->")  # two spaces after a full stop are between sentences
SPECIAL = re.compile(r"(?!^\s*\* )([*|\\]|(?<=\w)_(?=\W|$))")
QUOTED = re.compile(r"(`+[^`]+`+)")


def to_restructured(lines: list[str]) -> list[str]:
    """Paragraphs of the docstring, equations literal and prose escaped."""
    result: list[str] = []
    in_sections = False
    for paragraph in "\n".join(lines).split("\n\n"):
        rows = paragraph.strip("\n").split("\n")
        in_sections = in_sections or (len(rows) > 1 and set(rows[1].strip()) == {"-"})
        if result and not in_sections and all(EQUATION.search(row) for row in rows):
            result += ["::", "", *("    " + row for row in rows), ""]
        else:
            result += [*map(escape, rows), ""]
    return result


def escape(row: str) -> str:
    """The row with characters special in reStructuredText escaped; `code` becomes literal."""
    parts = QUOTED.split(row)
    return "".join("``" + part.strip("`") + "``" if i % 2 else SPECIAL.sub(r"\\\1", part) for i, part in enumerate(parts))


def process(app, what, name, obj, options, lines) -> None:
    lines[:] = to_restructured(lines)


def skip_tuple_fields(app, what, name, obj, skip, options) -> bool | None:
    """Fields of a NamedTuple are described in its own docstring ("Alias for field number 0" is no description)."""
    return True if type(obj).__name__ == "_tuplegetter" else None


def setup(app) -> dict[str, bool]:
    app.connect("autodoc-process-docstring", process, priority=100)  # before numpydoc
    app.connect("autodoc-skip-member", skip_tuple_fields)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
