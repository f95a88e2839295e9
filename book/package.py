"""The pages of the package, one for each folder, made from the folders themselves.

Into book/package/ go, for every folder, its page: what it is, its files with a sentence each, and
what each file exports; and the table of all folders for book/api.md.
"""

from __future__ import annotations

import ast
import shutil
from pathlib import Path

PAGES = Path(__file__).resolve().parent / "package"
ROOT = Path(__file__).resolve().parent.parent
# The sets are not shown: they are the right answers.
PLACES = {"kfcourse": ROOT / "kfcourse", "kfcourse.exercises": ROOT / "exercises"}
HIDDEN = ROOT / "exercises" / "sets"
ALONE = "The files that stand alone."


def folders() -> dict[str, dict[str, Path]]:
    """The files of each folder by name; `kfcourse` has those without a folder of their own."""
    result: dict[str, dict[str, Path]] = {}
    for package, place in PLACES.items():
        for folder in sorted({path.parent for path in place.rglob("*.py")}):
            if not folder.is_relative_to(HIDDEN):
                name = ".".join([package, *folder.relative_to(place).parts])
                files = [path for path in sorted(folder.glob("*.py")) if path.stem[:2] != "__"]
                result[name] = {f"{name}.{path.stem}": path for path in files}
    return result


def write() -> None:
    """Write the pages, and the table."""
    shutil.rmtree(PAGES, ignore_errors=True)
    PAGES.mkdir(parents=True)
    for folder, files in folders().items():
        (PAGES / f"{folder}.md").write_text(page(folder, files), encoding="utf-8")
    (PAGES / "folders.txt").write_text(table(), encoding="utf-8")


def page(folder: str, files: dict[str, Path]) -> str:
    """A folder's page in MyST Markdown."""
    about = ALONE if folder == "kfcourse" else documented(folder, members=False)
    rows = [f"| {{py:mod}}`~{name}` | {sentence(path)} |" for name, path in files.items()]
    head = [f"# {folder}", "", about, "", "| file | what it is for |", "| --- | --- |", *rows, ""]
    parts = [f"## {name.removeprefix(folder + '.')}\n\n{documented(name)}" for name in files]
    return "\n".join([*head, *parts])


def documented(name: str, members: bool = True) -> str:
    """A module's own text, and that of what it exports."""
    options = ["   :members:"] if members else []
    return "\n".join(["```{eval-rst}", f".. automodule:: {name}", *options, "```", ""])


def sentence(path: Path) -> str:
    """The first sentence of a module's docstring; its dollars are no formulas."""
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return text.partition("\n\n")[0].replace("\n", " ").replace("$", r"\$")


def table() -> str:
    """The folders with a sentence each."""
    about = {
        name: sentence(next(iter(files.values())).with_name("__init__.py"))
        for name, files in folders().items()
    }
    about["kfcourse"] = ALONE
    rows = [f"| {{doc}}`{name} </package/{name}>` | {text} |" for name, text in about.items()]
    return "\n".join(["| folder | what lives there |", "| --- | --- |", *rows, ""])
