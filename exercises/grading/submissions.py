"""What was returned: the notebooks of a folder, their cells, and the exercise that each claims to
be."""

from __future__ import annotations

import ast
import errno
import hashlib
import json
import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any, NamedTuple

from kfcourse.exercises.checks import Exercise, sets
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
        Absolute, as the others: another process may have another working directory.
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
    given: Callable[[str, Path], str] = lambda name, path: "",
) -> list[Returned]:
    """The notebooks in a folder and the folders in it, and what may be one and cannot be read:
    links, archives, exports.

    `given` says which variant the student of a notebook was given, from its name and path.
    """
    folder, masters = folder.absolute(), masters and masters.absolute()
    variants_file = variants_file and variants_file.absolute()
    setting = hashlib.sha256(f"{package_digest()}{seconds}".encode())
    for path in (
        *sorted(masters.glob("*/statement.md") if masters else []),
        *filter(None, [variants_file]),
    ):
        setting.update(path.read_bytes())
    works = []
    for path, problem in sorted(_handed_in(folder)):
        name = os.fsencode(path.relative_to(folder).as_posix()).decode("utf-8", "backslashreplace")
        variant = "" if problem else given(name, path)
        digest = setting.copy()
        digest.update(f"{variant}\n".encode())
        with suppress(OSError):  # told when it is graded
            digest.update(b"" if problem else _content(path))
        key = "" if problem else digest.hexdigest()
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
            notebook = path.with_name(
                path.name[: len(path.name) - len(kind)].removesuffix(".ipynb") + ".ipynb"
            )
            if path.parent.name == ".ipynb_checkpoints" or name.startswith("._"):
                continue  # Jupyter's, or a Mac's
            if kind == ".ipynb":
                yield path, _unread(path, path.relative_to(folder))
            elif path.stem.lower().endswith(".ipynb"):
                if kind not in (".bak", ".swp"):
                    yield path, RENAMED
            elif kind in NOT_READ and not notebook.exists():
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
    """Bytes of a returned file; OSError if it has become a link, or is too large to be one."""
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0))
    with os.fdopen(handle, "rb") as file:
        if os.fstat(handle).st_size > LARGEST:
            raise OSError(errno.EFBIG, f"not read: larger than {LARGEST // 2**20} MB")
        return file.read()


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
    """The notebook as a dict with a dict metadata."""
    try:
        document = json.loads(_content(path))
    except OSError as error:
        raise Unreadable(error.strerror or str(error)) from None
    except (ValueError, RecursionError):
        raise Unreadable(
            "not a notebook: the file is not JSON; was it cut off, or saved as something else?"
        ) from None
    if not isinstance(document, dict) or not isinstance(document.get("metadata", {}), dict):
        raise Unreadable("not a notebook: JSON of something else")
    return document


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
        source, metadata = cell.get("source", ""), cell.get("metadata")
        source = "".join(map(str, source)) if isinstance(source, list) else str(source)
        mark = metadata.get("kfcourse") if isinstance(metadata, dict) else None
        answer = mark.get("answer") if isinstance(mark, dict) else None
        answer = answer if isinstance(answer, str) else ""
        if source.strip():
            read.append(
                Cell(
                    number, str(cell.get("id", "")), answer, source, cell.get("cell_type") == "code"
                )
            )
    return read


def claimed(claim: Any, variants_file: Path | None, given: str = "") -> tuple[Exercise, list[str]]:
    """The set that a notebook claims, for the variant that was given, and whether that is another
    one.

    Without a course list the notebook has only a name of a variant to give; a table in it counts
    for nothing.
    """
    letter, name = (
        str(claim.get(key)) if isinstance(claim, dict) else "" for key in ("set", "variant")
    )
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
