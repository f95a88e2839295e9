"""Grading a folder of returned notebooks: what passed, for the instructor's eye.

Nothing of a returned notebook is trusted but the student's own cells.  The notebook of its set and variant is made again from the
master, the student's cells are put into it, it runs in a kernel of its own, and only what the master's check cells report counts.

This keeps honest notebooks from harming one another and notices the usual accidents and shortcuts.  It is no defence against a
student who means harm: the notebooks run with your rights.  A notebook that looks strange is named in the table; look at it.
"""

from __future__ import annotations

import ast
import asyncio
import csv
import hashlib
import io
import json
import logging
import os
import re
import shutil
import signal
import site
import subprocess
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellTimeoutError, DeadKernelError
from nbformat import NotebookNode

from kfcourse.checks import Exercise, exercise, sets
from kfcourse.checks.question import MIME, MISSING, PASSED, UNUSABLE, WRONG
from kfcourse.lab.variants import find_variant, read_variant
from kfcourse.limits import OutOfTime, time_limit
from kfcourse.notebooks.course import package_digest, save
from kfcourse.notebooks.master import opened, read, render, student

SECONDS = 60.0  # a cell may take
WHOLE = 5  # times as long may a notebook take
MEMORY = 4 * 2**30  # bytes of a kernel
OUTPUT = 10 * 2**20  # characters that a notebook may print, pictures included
LARGEST = 64 * 2**20  # bytes of a returned file
NOT_RUN = "not run"
GRADED, OTHER, FAILED = "graded", "not an exercise notebook", "not graded"
SIGNS = {PASSED: "✓", WRONG: "✗", UNUSABLE: "✗", MISSING: "–", NOT_RUN: "–"}


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


@dataclass(frozen=True)
class Grade:
    """A row of the table.

    Attributes
    ----------
    name : str
        Of the notebook: its path in the folder.
    status : {"graded", "not an exercise notebook", "not graded"}
    letter, variant : str
        As the notebook claims.
    marks : dict
        Question to "passed", "wrong", "unusable", "not implemented" or "not run".
    note : str
        Where it stopped, what the wrong answers look like, what to look at.
    digest : str
        Empty if it was not graded.
    """

    name: str
    status: str
    letter: str = ""
    variant: str = ""
    marks: Mapping[str, str] = field(default_factory=dict)
    note: str = ""
    digest: str = ""

    @property
    def passed(self) -> int:
        return sum(mark == PASSED for mark in self.marks.values())


# -- the folder


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


def grade(work: Returned) -> Grade:
    """Grade one notebook; never raises, what went wrong is in the row."""
    try:
        document = _document(work.path)
        claim = document.get("metadata", {}).get("kfcourse")
        if claim is None:
            return Grade(work.name, OTHER, digest=work.digest)
        return _grade(work, cells_of(document), claim)
    except OutOfTime:
        problem = "the notebook of its variant cannot be made in time"
    except Exception as error:  # also of libraries: one notebook must not stop the others
        problem = clean(str(error) or type(error).__name__)
    return Grade(work.name, FAILED, note=problem)


def _grade(work: Returned, cells: Sequence[Cell], claim: Any) -> Grade:
    with time_limit(WHOLE * work.seconds):
        exercise, notes = claimed(claim, cells, work.variants_file)
        master = _generated(read(exercise.letter, work.masters), exercise.letter, opened(exercise))
    notebook, own = assembled(master, cells, exercise)
    executed, stopped = run(notebook, work.seconds)
    marks, reasons = _marks(executed, exercise, check_cells(master))
    notes = [*([stopped] if stopped else []), *_errors(executed), *reasons, *notes, *_strange(own, master)]
    return Grade(work.name, GRADED, exercise.letter, exercise.variant.name, marks, "; ".join(dict.fromkeys(notes)), work.digest)


# -- what was returned


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


def _document(path: Path) -> dict[str, Any]:
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
    calls = [call for cell in cells for call in _opened(cell.source)]
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


def _opened(source: str) -> Iterator[tuple[Any, Any]]:
    """Arguments of the calls exercise("a", ...) in a cell, where they are literals."""
    for node in ast.walk(_tree(source) or ast.Module([], [])):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "exercise":
            with suppress(ValueError, TypeError):
                arguments = [ast.literal_eval(argument) for argument in node.args]
                named = {keyword.arg: ast.literal_eval(keyword.value) for keyword in node.keywords}
                letter, variant, *_ = [*arguments, *named.values(), None, None]
                yield letter, variant


# -- the notebook that is run


@lru_cache(maxsize=64)
def _generated(text: str, letter: str, opening: str) -> NotebookNode:
    """The student's notebook as it was handed out.  Not to be changed."""
    return student(render(text, exercise(letter, ast.literal_eval(opening))), {})


def check_cells(master: NotebookNode) -> dict[str, list[str]]:
    """Id of a check cell to the questions it asks."""
    return {cell.id: _asked(cell.source) for cell in master.cells if cell.cell_type == "code" and _asked(cell.source)}


CHECK = re.compile(r"""(\w+)\.check\(\s*["'](\w+)["']""")


def _asked(source: str) -> list[str]:
    return [question for _, question in CHECK.findall(source)]


def assembled(master: NotebookNode, cells: Sequence[Cell], exercise: Exercise) -> tuple[NotebookNode, list[Cell]]:
    """The master's notebook with the student's cells in it, and those cells.

    A cell that defines an asked function takes the place of its stub, wherever it stands; a changed cell of the master, known by
    its id, takes that cell's place; other cells follow what they followed in the returned notebook.  The master's check cells
    stay, and get the exercise as it was handed out.
    """
    code = [(index, cell) for index, cell in enumerate(master.cells) if cell.cell_type == "code"]
    checks = check_cells(master)
    place = _places(code, checks, cells)
    ordered = []  # (place, number, cell)
    for index, cell in code:
        source = cell.source
        if cell.id in checks:
            names = dict.fromkeys(name for name, _ in CHECK.findall(source))
            source = "".join(f"{name} = kfcourse_watch()\n" for name in names) + source
        elif index in place.taken:
            continue
        ordered.append((index, 0, _cell(cell.id, source, f"the master's cell {cell.id}")))
    own = [cell for cell in cells if cell.number in place.of]
    for cell in own:
        ordered.append((place.of[cell.number], cell.number, _cell(f"returned-{cell.number}", cell.source, cell.name)))
    opening = (
        "from kfcourse.notebooks.grading.watch import Watch\n"
        f"kfcourse_watch = Watch({exercise.letter!r}, {opened(exercise)}, memory={MEMORY})"
    )
    ordered.sort(key=lambda row: row[:2])
    return nbformat.v4.new_notebook(cells=[_cell("watch", opening, "the first cell"), *(cell for *_, cell in ordered)]), own


def _cell(name: str, source: str, where: str) -> NotebookNode:
    return nbformat.v4.new_code_cell(source, id=name, metadata={"where": where})


class Places(NamedTuple):
    """of: number of a student's cell to the index of the master's cell that it replaces or follows;  taken: those replaced."""

    of: dict[int, int]
    taken: set[int]


def _places(code: Sequence[tuple[int, NotebookNode]], checks: Mapping[str, list[str]], cells: Sequence[Cell]) -> Places:
    by_id = {cell.id: index for index, cell in code}
    answers = {cell.metadata["kfcourse"]["answer"]: index for index, cell in code if "kfcourse" in cell.metadata}
    asked_at = {question: by_id[name] for name, questions in checks.items() for question in questions}
    unchanged = {_plain(cell.source): index for index, cell in reversed(code)}
    of: dict[int, int] = {}
    taken: set[int] = set()

    mine = [cell for cell in cells if _plain(cell.source) not in unchanged and not _only_checks(cell.source)]
    defines = {cell.number: _defined(cell.source) & set(answers) for cell in mine}
    for name, index in answers.items():
        candidates = [cell for cell in mine if name in defines[cell.number]]
        if candidates:
            best = min(candidates, key=lambda cell: (by_id.get(cell.id) != index, cell.answer != name, cell.number))
            of[best.number] = min(index, of.get(best.number, index))
            taken.add(index)
    for cell in mine:
        index = answers.get(cell.answer, by_id.get(cell.id, -1))
        if cell.number not in of and not defines[cell.number] and index not in taken | set(asked_at.values()) | {-1}:
            of[cell.number] = index
            taken.add(index)

    last = -1
    kept = {cell.number for cell in mine}
    for cell in cells:
        if cell.number in of:
            last = of[cell.number]
        elif cell.number in kept:
            of[cell.number] = last
        else:  # a cell of the master's, as it was
            asked = [asked_at[question] for question in _asked(cell.source) if question in asked_at]
            last = asked[-1] if asked else unchanged.get(_plain(cell.source), last)
    return Places(of, taken)


def _plain(source: str) -> str:
    return "\n".join(line.rstrip() for line in source.strip().splitlines())


def _tree(source: str) -> ast.Module | None:
    """The cell's syntax; None if it is not Python, such as IPython's own commands."""
    try:
        with warnings.catch_warnings(action="ignore"):  # such as "\m" in a text
            return ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return None


def _only_checks(source: str) -> bool:
    """Whether a cell does nothing but call checks."""
    tree = _tree(source)
    return tree is not None and all(
        isinstance(line, ast.Expr)
        and isinstance(line.value, ast.Call)
        and isinstance(line.value.func, ast.Attribute)
        and line.value.func.attr == "check"
        for line in tree.body
    )


def _defined(source: str) -> set[str]:
    """Names that a cell defines at top level; roughly, if it is not Python."""
    tree = _tree(source)
    if tree is None:
        return {a or b for a, b in re.findall(r"^(?:def\s+(\w+)|(\w+)\s*=(?!=))", source, re.MULTILINE)}
    names = set()
    for line in tree.body:
        if isinstance(line, ast.FunctionDef | ast.ClassDef):
            names.add(line.name)
        elif isinstance(line, ast.Assign):
            names |= {target.id for target in line.targets if isinstance(target, ast.Name)}
    return names


# -- running it


class _Client(NotebookClient):
    """Executes a notebook as far as it goes; remembers where it is, and stops one that prints without end."""

    def __init__(self, notebook: NotebookNode, seconds: float):
        self.at = 0
        self.group = 0
        self.printed = 0
        self.deadline: float | None = None
        super().__init__(
            notebook,
            kernel_name="python3",
            timeout_func=lambda _: self._left(seconds),
            allow_errors=True,
            record_timing=False,
            shutdown_kernel="immediate",
            extra_arguments=["--log-level=CRITICAL"],
            on_notebook_start=self._started,
            on_cell_start=self._reached,
        )
        self.log = logging.getLogger("kfcourse.grade")  # what it would log is told in the table
        self.log.setLevel(logging.CRITICAL + 1)

    def _left(self, seconds: float) -> int:
        if self.deadline is None:
            self.deadline = time.monotonic() + WHOLE * seconds
        return max(1, round(min(seconds, self.deadline - time.monotonic())))

    def _started(self, notebook: NotebookNode) -> None:
        assert self.km is not None
        self.group = getattr(self.km.provisioner, "pgid", None) or 0

    def _reached(self, cell: NotebookNode, cell_index: int) -> None:
        self.at = cell_index

    def process_message(self, msg: dict[str, Any], cell: NotebookNode, cell_index: int) -> NotebookNode | None:
        self.printed += len(str(msg["content"]))
        if self.printed > OUTPUT:
            kill(self.group)
            return None
        return super().process_message(msg, cell, cell_index)


def run(notebook: NotebookNode, seconds: float = SECONDS) -> tuple[NotebookNode, str]:
    """Run a notebook in a new kernel and an empty folder, errors kept as outputs.

    Parameters
    ----------
    notebook : NotebookNode
        Its outputs are filled in.
    seconds : float
        Time limit of each cell; the notebook's is five times that.

    Returns
    -------
    notebook, stopped : NotebookNode, str
        `stopped` says where and why it did not come to its end; empty if it did.

    Raises
    ------
    RuntimeError
        No kernel starts.
    """
    client = _Client(notebook, seconds)
    reason = ""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        work = Path(folder) / "work"
        work.mkdir()
        try:
            asyncio.run(
                client.async_execute(
                    cwd=str(work), env=environment(Path(folder)), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
                )
            )
        except CellTimeoutError:
            late = client.deadline is not None and time.monotonic() > client.deadline - 1
            reason = f"the notebook takes longer than {WHOLE * seconds:g} s" if late else f"still running after {seconds:g} s"
        except DeadKernelError:
            reason = "the kernel died (out of memory, or ended by the notebook itself)"
        finally:
            kill(client.group)  # what it may have left running
        if client.printed > OUTPUT:
            reason = f"printed more than {OUTPUT // 2**20} MB"
    return notebook, f"{notebook.cells[client.at].metadata['where']}: {reason}" if reason else ""


def kill(group: int) -> None:
    """End all processes of a kernel's group."""
    if group and hasattr(os, "killpg"):
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(group, signal.SIGKILL)


KEPT = re.compile(
    r"PATH|LANG|LC_\w+|TZ|VIRTUAL_ENV|CONDA_PREFIX|\w*LD_LIBRARY_PATH|SYSTEMROOT|WINDIR|COMSPEC|PATHEXT", re.IGNORECASE
)


def environment(folder: Path) -> dict[str, str]:
    """Environment variables of a kernel: few of ours, and a home of its own."""
    fonts = folder / "matplotlib"
    fonts.mkdir()
    for path in Path(matplotlib.get_cachedir()).glob("fontlist*.json"):  # otherwise each kernel searches for fonts again
        shutil.copy(path, fonts)
    packages = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    return {name: value for name, value in os.environ.items() if KEPT.fullmatch(name)} | {
        "PYTHONPATH": os.pathsep.join(os.path.abspath(path) for path in packages if path),
        "HOME": str(folder),
        "USERPROFILE": str(folder),
        "IPYTHONDIR": str(folder / "ipython"),
        "MPLCONFIGDIR": str(fonts),
        "TMPDIR": str(folder),
        "TEMP": str(folder),
        "PYTHONUSERBASE": site.getuserbase(),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }


# -- what came of it


def _marks(executed: NotebookNode, exercise: Exercise, checks: Mapping[str, list[str]]) -> tuple[dict[str, str], list[str]]:
    """Question to mark, and what the wrong answers look like."""
    marks = dict.fromkeys(exercise.questions, NOT_RUN)
    reasons: dict[str, list[str]] = {}
    for cell in executed.cells:
        for question in checks.get(cell.id, []):
            found, reason = _result(cell, question)
            marks[question] = found or NOT_RUN
            if reason:
                reasons.setdefault(reason, []).append(question)
    return marks, [clean(f"{', '.join(questions)}: {reason}") for reason, questions in reasons.items()]


def _result(cell: NotebookNode, question: str) -> tuple[str | None, str]:
    """Status of a question in its check cell, and what to say of it.

    What the student's function shows by itself is display_data; the check's result is the cell's value.
    """
    values = [output.data[MIME] for output in cell.outputs if output.output_type == "execute_result" and MIME in output.data]
    errors = [output for output in cell.outputs if output.output_type == "error"]
    if errors:
        return None, f"{errors[-1].ename}: {errors[-1].evalue}"
    if not values:
        return None, ""
    value = values[0] if len(values) == 1 and isinstance(values[0], dict) else {}
    status = value.get("status")
    if value.get("question") != question or status not in SIGNS:
        return None, "the check's result was tampered with"
    if status == UNUSABLE:
        return status, str(value.get("message", ""))
    diagnosis = value.get("diagnosis")
    return status, ", ".join(map(str, diagnosis)) if status == WRONG and isinstance(diagnosis, list) else ""


def _errors(executed: NotebookNode) -> list[str]:
    """The first errors of the student's cells; those of stubs are no news."""
    found = []
    for cell in executed.cells:
        for output in cell.outputs if cell.id.startswith("returned-") else []:
            if output.output_type == "error" and output.ename != "NotImplementedError":
                found.append(clean(f"{cell.metadata['where']}: {output.ename}: {output.evalue}"))
    return found[:2]


STRANGE = re.compile(r"kfcourse|\.questions\b|\.structures\b|_getframe|__code__|\.hidden")


def _strange(own: Iterable[Cell], master: NotebookNode) -> list[str]:
    """Lines of the student's that reach for more than an exercise needs, such as the right answers in the package."""
    usual = {line.strip() for cell in master.cells for line in cell.source.splitlines()}
    found = [
        clean(f"look at {cell.name}: {line.strip()}")
        for cell in own
        for line in cell.source.splitlines()
        if STRANGE.search(line) and line.strip() not in usual
    ]
    return found[:2]


def clean(text: str, length: int = 200) -> str:
    """Text of a student's on one line without control characters."""
    line = "".join(c if c.isprintable() else " " for c in text)
    line = " ".join(line.split())
    return line if len(line) <= length else line[: length - 1] + "…"


# -- the table

FIRST = ("notebook", "status", "set", "variant")
LAST = ("passed", "of", "note", "digest")


def columns() -> list[str]:
    most = max(len(one.questions) for one in sets().values())
    return [*FIRST, *(f"q{i + 1}" for i in range(most)), *LAST]


def write_table(grades: Iterable[Grade], path: Path) -> None:
    """Write the table as CSV that spreadsheets open, completely or not at all."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns(), restval="", lineterminator="\n")
    writer.writeheader()
    for one in sorted(grades, key=lambda one: one.name):
        row: dict[str, Any] = dict(zip(FIRST, (_cautious(one.name), one.status, one.letter, _cautious(one.variant)), strict=True))
        row |= {f"q{i + 1}": mark for i, mark in enumerate(one.marks.values())}
        count = (one.passed, len(one.marks)) if one.status == GRADED else ("", "")
        writer.writerow(row | dict(zip(LAST, (*count, _cautious(one.note), one.digest), strict=True)))
    save("\ufeff" + text.getvalue(), path)


def _cautious(text: str) -> str:
    """A spreadsheet takes what begins so for a formula."""
    return f" {text}" if text[:1] in ("=", "+", "-", "@") else text


def read_table(path: Path) -> dict[str, Grade]:
    """Rows of an earlier table, by digest; none if there is no file.

    Raises
    ------
    ValueError
        The file is not such a table, and would be lost.
    """
    try:
        rows = list(csv.DictReader(io.StringIO(path.read_text(encoding="utf-8-sig"))))
    except FileNotFoundError:
        return {}
    except (UnicodeDecodeError, csv.Error):
        rows = [{}]
    found = {}
    for row in rows:
        if not set((*FIRST, *LAST)) <= set(row):
            raise ValueError(
                f"{path} is not a table of grades (or a spreadsheet has changed it); move it, or choose another --out"
            )
        values = {key: (row[key] or "").strip() for key in (*FIRST, *LAST)}
        letter = values["set"]
        questions = [question.name for question in sets()[letter].questions] if letter in sets() else []
        marks = {name: row.get(f"q{i + 1}") or "" for i, name in enumerate(questions)}
        if values["digest"] and all(mark in SIGNS for mark in marks.values()):
            name, status, _, variant = (values[key] for key in FIRST)
            found[values["digest"]] = Grade(name, status, letter, variant, marks, values["note"], values["digest"])
    return found


def unchanged(work: Sequence[Returned], table: Mapping[str, Grade]) -> tuple[list[Grade], list[Returned]]:
    """Rows that hold still, under the notebooks' present names, and the notebooks that have to be graded."""
    old, new = [], []
    for one in work:
        row = table.get(one.digest)
        if row is None:
            new.append(one)
        else:
            old.append(replace(row, name=one.name))
    return old, new


def grade_all(
    work: Sequence[Returned], path: Path, again: bool, run_all: Callable[[Sequence[Returned]], Iterable[Grade]]
) -> tuple[list[Grade], int]:
    """Grade what is new, and write the table after each notebook, so that an interrupted run goes on where it was.

    Returns
    -------
    grades, old : list of Grade, int
        By name; how many were taken from the earlier table.
    """
    table = read_table(path)
    grades, new = unchanged(work, {} if again else table)
    old = len(grades)
    for one in run_all(new):
        grades.append(one)
        write_table(grades, path)
    write_table(grades, path)
    return sorted(grades, key=lambda one: one.name), old
