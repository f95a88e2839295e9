"""What was returned: the notebooks of a folder, their cells, and the exercise that each claims to
be."""

from __future__ import annotations

import ast
import hashlib
import json
import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any, NamedTuple

from kfcourse.exercises.checks import Exercise, sets
from kfcourse.exercises.grading.owners import owner
from kfcourse.exercises.notebooks.course_list import Student
from kfcourse.exercises.notebooks.texts import clean
from kfcourse.files import package_digest
from kfcourse.lab.variants import VariantError, find_variant

SECONDS = 60.0  # a cell may take
LARGEST = 64 * 2**20  # bytes of a returned file
LINK = "a link, which is not followed: ask for the notebook itself"
ARCHIVE = "an archive: unpack it, or take it away, and grade again"
EXPORT = "no notebook, but perhaps made from one: ask for the .ipynb itself, or take it away"
RENAMED = "a notebook by another name: end its name in .ipynb, and grade again"
NOT_READ = dict.fromkeys(
    (".zip", ".7z", ".rar", ".tar", ".tgz", ".tbz2", ".txz", ".gz", ".bz2", ".xz", ".zst"), ARCHIVE
)
NOT_READ |= dict.fromkeys((".html", ".htm", ".py", ".json"), EXPORT)


class Unreadable(ValueError):
    """A file cannot be graded; the message says why."""


@dataclass(frozen=True)
class Returned:
    """A returned notebook, and how it is to be graded.

    Attributes
    ----------
    path : Path
    name : str
        The path in the folder, with slashes; what is not UTF-8 in it is written as `\\xNN`.
    digest : str
        Of all that its grade depends on: the same digest gives the same grade.
    seconds : float
        Time limit of a cell.
    variants_file : Path or None
    masters : Path or None
    variant : str
        That was given to the student, if that is known; else the notebook says it.
    problem : str
        Why it is not even read.
    """

    path: Path
    name: str
    digest: str = ""
    seconds: float = SECONDS
    variants_file: Path | None = None
    masters: Path | None = None
    variant: str = ""
    problem: str = ""


def returned(
    folder: Path,
    seconds: float = SECONDS,
    variants_file: Path | None = None,
    masters: Path | None = None,
    students: Sequence[Student] = (),
) -> list[Returned]:
    """The notebooks in a folder and the folders in it, and what may be one and cannot be read:
    links, archives, exports.

    `students` are those of the course list: a notebook of theirs is for the variant that they were
    given.
    """
    setting = hashlib.sha256(f"{package_digest()}{seconds}".encode())
    for path in (
        *sorted(masters.glob("*/statement.md") if masters else []),
        *filter(None, [variants_file]),
    ):
        setting.update(path.read_bytes())
    works = []
    for path, problem in sorted(_handed_in(folder)):
        name = os.fsencode(path.relative_to(folder).as_posix()).decode("utf-8", "backslashreplace")
        digest, key, variant = setting.copy(), "", ""
        if not problem:
            with suppress(Unreadable):  # told when it is graded
                whose = owner(name, claim_of(read_document(path)).get("student"), students)
                variant = whose.variant if whose else ""
                digest.update(variant.encode() + b"\n" + _content(path))
                key = digest.hexdigest()
        works.append(Returned(path, name, key, seconds, variants_file, masters, variant, problem))
    return works


def _handed_in(folder: Path) -> Iterator[tuple[Path, str]]:
    """Files and folders in which a student may have handed in something, each with why it is not
    read, if it is not."""
    unread: list[OSError] = []
    for at, folders, files in os.walk(folder, onerror=unread.append):
        for name in folders:
            if (path := Path(at, name)).is_symlink():
                yield path, LINK
        for name in files:
            path = Path(at, name)
            kind = path.suffix.lower()
            if path.parent.name == ".ipynb_checkpoints" or name.startswith("._"):
                continue  # Jupyter's, or a Mac's
            if kind == ".ipynb":
                yield path, _unread(path, path.relative_to(folder))
            elif path.stem.lower().endswith(".ipynb"):
                if kind not in (".bak", ".swp"):
                    yield path, RENAMED
            elif kind in NOT_READ and not path.with_suffix(".ipynb").exists():
                yield path, NOT_READ[kind]
    for error in unread:
        yield Path(error.filename), f"a folder that cannot be read: {error.strerror}"


def _unread(path: Path, inside: PurePath) -> str:
    if path.is_symlink():
        return LINK
    if not path.is_file():
        return "no file, though its name says so"
    hidden = any(part.startswith(".") for part in inside.parts)
    return "hidden by the dot before its name: take that away, and grade again" if hidden else ""


def _content(path: Path) -> bytes:
    """Bytes of a returned file; Unreadable if it has become a link, or is too large to be one."""
    try:
        if path.is_symlink():
            raise Unreadable("not read: it has become a link")
        if path.stat().st_size > LARGEST:
            raise Unreadable(f"not read: larger than {LARGEST // 2**20} MB")
        return path.read_bytes()
    except OSError as error:
        raise Unreadable(error.strerror) from None


class Cell(NamedTuple):
    """A cell of a returned notebook.

    number: its place among all cells, from 1;  answer: name of the function that the master asked
    for here, if still known; code: whether it is one.
    """

    number: int
    id: str
    answer: str
    source: str
    code: bool = True

    @property
    def name(self) -> str:
        return f"cell {self.number}" + (f" ({self.answer})" if self.answer else "")


def read_document(path: Path) -> dict[str, Any]:
    """The notebook as a dict."""
    content = _content(path)
    try:
        document = json.loads(content)
    except (ValueError, RecursionError):
        raise Unreadable(
            "not a notebook: the file is not JSON; was it cut off, or saved as something else?"
        ) from None
    if not isinstance(document, dict):
        raise Unreadable("not a notebook: JSON of something else")
    return document


def claim_of(document: Mapping[str, Any]) -> dict[str, Any]:
    """What a notebook says of itself: set, variant and student."""
    match document:
        case {"metadata": {"kfcourse": dict(claim)}}:
            return claim
    return {}


def cells_of(document: Mapping[str, Any]) -> list[Cell]:
    """Cells that are not empty; what is malformed is left out."""
    cells = document.get("cells")
    if not isinstance(cells, list):
        raise Unreadable(
            "a notebook without cells, or of an old format: open it in Jupyter and save it again"
        )
    read = []
    for number, cell in enumerate(cells, 1):
        if not isinstance(cell, dict):
            continue
        source, answer = cell.get("source", ""), ""
        source = "".join(map(str, source)) if isinstance(source, list) else str(source)
        match cell:
            case {"metadata": {"kfcourse": {"answer": str(mark)}}}:
                answer = mark
        if source.strip():
            read.append(
                Cell(
                    number, str(cell.get("id", "")), answer, source, cell.get("cell_type") == "code"
                )
            )
    return read


def claimed(
    claim: Mapping[str, Any], variants_file: Path | None, given: str = ""
) -> tuple[Exercise, list[str]]:
    """The set that a notebook claims, for the variant that was given, and whether that is another
    one.

    Without a course list the notebook has only a name of a variant to give; a table in it counts
    for nothing.
    """
    letter, name = str(claim.get("set")), str(claim.get("variant"))
    if letter not in sets():
        raise Unreadable(
            f"claims set {letter!r}, variant {name!r}; the sets are {', '.join(sets())}"
        )
    try:
        variant = find_variant(given or name, variants_file)
    except VariantError as error:
        # the advice first: the list may be long, and is cut in the table
        raise Unreadable(
            f"if variant {given or name} is of a file of yours, name that with --variants; {error}"
        ) from None
    marked = f"for variant {name}, and marked as variant {variant.name}, which was given"
    return Exercise(letter, variant), [clean(marked)] if given and name != given else []


def syntax(source: str) -> ast.Module | None:
    """The cell's syntax; None if it is not Python, such as IPython's own commands."""
    try:
        with warnings.catch_warnings(action="ignore"):  # such as "\m" in a text
            return ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return None
