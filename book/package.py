"""The pages of the package, one for each folder, made from the folders themselves.

Into book/package/ go, for every folder, its page: what it says of itself, its files with a sentence each, and then what each
file exports; and the table of all folders for book/api.md.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from kfcourse.pages.house import LAYERS, layer, modules, sentence

PAGES = Path(__file__).resolve().parent / "package"
TOP = "kfcourse"
ALONE = "The files that stand alone."


def folders() -> dict[str, dict[str, Path]]:
    """The files of each folder, from the top floor down, by name; those without a folder belong to `kfcourse` itself."""
    found: dict[str, dict[str, Path]] = {}
    for name, path in sorted(modules(), key=lambda row: (LAYERS.index(layer(row[0])), row[0])):
        if layer(name) != "exercises":
            folder = name if path.name == "__init__.py" else name.rpartition(".")[0]
            found.setdefault(f"{TOP}.{folder}" if folder else TOP, {})[f"{TOP}.{name}"] = path
    return found


def write() -> None:
    """Write the pages, and the table."""
    shutil.rmtree(PAGES, ignore_errors=True)
    PAGES.mkdir(parents=True)
    for folder, files in folders().items():
        (PAGES / f"{folder}.md").write_text(page(folder, files), encoding="utf-8")
    (PAGES / "folders.txt").write_text(table(), encoding="utf-8")


def page(folder: str, files: dict[str, Path]) -> str:
    """A folder's page in MyST Markdown."""
    inside = {name: path for name, path in files.items() if name != folder}
    said = [documented(folder, members=False)] if folder in files else [ALONE, ""]
    rows = [f"| {{py:mod}}`~{name}` | {without_formulas(sentence(path))} |" for name, path in inside.items()]
    parts = [line for name in inside for line in (f"## {name.removeprefix(folder + '.')}", "", documented(name))]
    return "\n".join([f"# {folder}", "", *said, "| file | what it is for |", "| --- | --- |", *rows, "", *parts])


def without_formulas(text: str) -> str:
    """A sentence of a docstring, whose dollars are no formulas."""
    return text.replace("$", r"\$")


def documented(name: str, members: bool = True) -> str:
    """A module's own text, and that of what it exports."""
    return "\n".join(["```{eval-rst}", f".. automodule:: {name}", *["   :members:"] * members, "```", ""])


def table() -> str:
    """The folders with a sentence each."""
    said = {name: sentence(files[name]) if name in files else ALONE for name, files in folders().items()}
    rows = [f"| {{doc}}`{name} <package/{name}>` | {text} |" for name, text in said.items()]
    return "\n".join(["| folder | what lives there |", "| --- | --- |", *rows, ""])
