"""A chapter as a notebook to download: clean, and in Markdown that every Jupyter shows.

The book's Markdown has boxes, references and labels that only the book understands; here they
become plain text.
"""

from __future__ import annotations

import re

import nbformat

BOX = re.compile(
    r"^(?P<fence>`{3,}|:{3,})\{(?P<kind>[\w:-]+)\}[ "
    r"\t]*(?P<title>[^\n]*)\n(?P<body>.*?)^(?P=fence)[ \t]*$",
    re.DOTALL | re.MULTILINE,
)
OPTION = re.compile(r"^:[\w-]+:.*\n?", re.MULTILINE)
ATTRIBUTES = re.compile(r"^(\{[.#][^}]*\}|\([\w-]+\)=)[ \t]*\n", re.MULTILINE)
NUMBERED = re.compile(r"\$\$[ \t]*\(([\w:-]+)\)")
TITLED = re.compile(r"\{(?:doc|ref|numref|term|download)\}`([^`<]+?)\s*<[^`>]*>`")
ROLE = re.compile(r"\{[\w:]+\}`([^`]*)`")
DROPPED = ("chapter", "toctree", "more", "bibliography")


def plain(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """The notebook without outputs, its text readable outside of the book."""
    cells = []
    for cell in notebook.cells:
        if cell.cell_type == "code":
            made = nbformat.v4.new_code_cell(cell.source)
        elif source := text(cell.source).strip():
            made = nbformat.v4.new_markdown_cell(source)
        else:
            continue
        made["id"] = f"cell-{len(cells)}"
        cells.append(made)
    kept = {"kernelspec": dict(display_name="Python 3", language="python", name="python3")}
    return nbformat.v4.new_notebook(cells=cells, metadata=kept)


def text(source: str) -> str:
    """MyST Markdown as plain Markdown: boxes as quotations, references as the words they show."""
    source = BOX.sub(_quoted, source)
    source = ATTRIBUTES.sub("", source)
    source = NUMBERED.sub("$$", source)
    return ROLE.sub(r"*\1*", TITLED.sub(r"*\1*", source))


def _quoted(match: re.Match) -> str:
    kind, title = match["kind"], match["title"].strip()
    if kind in DROPPED:
        return ""
    body = text(OPTION.sub("", match["body"])).strip()
    if kind in ("code-block", "code", "math"):
        return f"$$\n{body}\n$$" if kind == "math" else f"```{title}\n{body}\n```"
    title = "A figure of the book" if kind == "figure" else title
    rows = ([f"**{title}**", ""] if title else []) + body.splitlines()
    return "\n".join(f"> {row}".rstrip() for row in rows)
