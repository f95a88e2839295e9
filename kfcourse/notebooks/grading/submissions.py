"""What was returned: the notebooks of a folder, their cells, and the exercise that each claims to be."""

from __future__ import annotations

import ast
import hashlib
import json
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from kfcourse.checks import Exercise, sets
from kfcourse.files import package_digest
from kfcourse.lab.variants import find_variant, read_variant

SECONDS = 60.0  # a cell may take
LARGEST = 64 * 2**20  # bytes of a returned file


class Unreadable(ValueError):
    """A file cannot be graded; the message says why."""


@dataclass(frozen=True)
class Returned:
    """A returned notebook, and how it is to be graded.

    Attributes
    ----------
    path : Path
        Absolute, as the others: a worker process may have another working directory.
    name : str
        The path in the folder, with slashes.
    digest : str
        Of the file and of all that its grade depends on; the same digest gives the same grade.
    seconds : float
        Time limit of a cell.
    variants_file : Path or None
    masters : Path or None
    """

    path: Path
    name: str
    digest: str = ""
    seconds: float = SECONDS
    variants_file: Path | None = None
    masters: Path | None = None


def returned(
    folder: Path, seconds: float = SECONDS, variants_file: Path | None = None, masters: Path | None = None
) -> list[Returned]:
    """The notebooks in a folder and the folders in it; hidden ones, such as .ipynb_checkpoints, are left out."""
    folder, masters = folder.absolute(), masters and masters.absolute()
    variants_file = variants_file and variants_file.absolute()
    setting = hashlib.sha256(f"{package_digest()}{seconds}".encode())
    for path in (*sorted(masters.glob("*/statement.md") if masters else []), *([variants_file] if variants_file else [])):
        setting.update(path.read_bytes())
    found = []
    for path in sorted(folder.rglob("*.ipynb")):
        inside = path.relative_to(folder)
        if path.is_file() and not any(part.startswith(".") for part in inside.parts):
            digest = setting.copy()
            with suppress(OSError):  # told when it is graded
                digest.update(path.read_bytes())
            found.append(Returned(path, inside.as_posix(), digest.hexdigest(), seconds, variants_file, masters))
    return found


class Cell(NamedTuple):
    """A code cell of a returned notebook.

    number: its place among all cells, from 1;  answer: name of the function that the master asked for here, if still known.
    """

    number: int
    id: str
    answer: str
    source: str

    @property
    def name(self) -> str:
        return f"cell {self.number}" + (f" ({self.answer})" if self.answer else "")


def read_document(path: Path) -> dict[str, Any]:
    """The notebook as a dict with a dict metadata."""
    if path.stat().st_size > LARGEST:
        raise Unreadable(f"not read: larger than {LARGEST // 2**20} MB")
    try:
        document = json.loads(path.read_bytes())
    except (ValueError, RecursionError):
        raise Unreadable("not a notebook: the file is not JSON; was it cut off, or saved as something else?") from None
    if not isinstance(document, dict) or not isinstance(document.get("metadata", {}), dict):
        raise Unreadable("not a notebook: JSON of something else")
    return document


def cells_of(document: Mapping[str, Any]) -> list[Cell]:
    """Code cells that are not empty; what is malformed is left out."""
    found = []
    cells = document.get("cells")
    if not isinstance(cells, list):
        raise Unreadable("a notebook without cells, or of an old format: open it in Jupyter and save it again")
    for number, cell in enumerate(cells, 1):
        if not isinstance(cell, dict) or cell.get("cell_type") != "code":
            continue
        source = cell.get("source", "")
        source = "".join(map(str, source)) if isinstance(source, list) else str(source)
        metadata = cell.get("metadata")
        mark = metadata.get("kfcourse") if isinstance(metadata, dict) else None
        answer = mark.get("answer") if isinstance(mark, dict) else None
        if source.strip():
            found.append(Cell(number, str(cell.get("id", "")), answer if isinstance(answer, str) else "", source))
    return found


def claimed(claim: Any, cells: Sequence[Cell], variants_file: Path | None) -> tuple[Exercise, list[str]]:
    """The set and variant that a notebook claims, and what is strange about that.

    A variant that is not shipped has its table in the opening cell; a file of variants goes before it.
    """
    letter, name = (str(claim.get(key)) if isinstance(claim, dict) else "" for key in ("set", "variant"))
    if letter not in sets():
        raise Unreadable(f"claims set {letter!r}, variant {name!r}; the sets are {', '.join(sets())}")
    calls = [call for cell in cells for call in openings(cell.source)]
    tables = [table for _, table in calls if isinstance(table, dict) and table.get("name") == name]
    if tables and variants_file is None:
        table = {key: value for key, value in tables[0].items() if key != "name"}
        variant = read_variant(name, table, "the notebook")
        notes = ["its variant is its own table: compare with yours by --variants"]
    else:
        variant, notes = find_variant(name, variants_file), []
    for other, what in calls:
        other_name = what.get("name") if isinstance(what, dict) else what
        if (other, other_name) != (letter, name):
            notes.append(clean(f"opens set {other}, variant {other_name}"))
    return Exercise(letter, variant), notes


def openings(source: str) -> Iterator[tuple[Any, Any]]:
    """Arguments of the calls exercise("a", ...) in a cell, where they are literals."""
    for node in ast.walk(syntax(source) or ast.Module([], [])):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "exercise":
            with suppress(ValueError, TypeError):
                arguments = [ast.literal_eval(argument) for argument in node.args]
                named = {keyword.arg: ast.literal_eval(keyword.value) for keyword in node.keywords}
                letter, variant, *_ = [*arguments, *named.values(), None, None]
                yield letter, variant


def syntax(source: str) -> ast.Module | None:
    """The cell's syntax; None if it is not Python, such as IPython's own commands."""
    try:
        with warnings.catch_warnings(action="ignore"):  # such as "\m" in a text
            return ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return None


def clean(text: str, length: int = 200) -> str:
    """Text of a student's on one line without control characters."""
    line = "".join(c if c.isprintable() else " " for c in text)
    line = " ".join(line.split())
    return line if len(line) <= length else line[: length - 1] + "…"
