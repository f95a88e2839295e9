"""Grades and their table: one row a notebook, written after each, so that an interrupted run goes on where it was."""

from __future__ import annotations

import csv
import io
import json
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from kfcourse.checks import sets
from kfcourse.checks.question import MISSING, PASSED, UNUSABLE, WRONG
from kfcourse.notebooks.grading.submissions import Returned
from kfcourse.notebooks.texts import plain, write_csv

NOT_RUN, NOT_GRADED = "not run", "not graded"  # of an answer: an error before it; the grader could not compare it
GRADED, PARTLY, OTHER, FAILED = "graded", "graded in part", "not an exercise notebook", "not graded"
WAITING, RUNNING = "the run ended before its turn", "the run ended while this one was graded"
SIGNS = {PASSED: "✓", WRONG: "✗", UNUSABLE: "✗", MISSING: "–", NOT_RUN: "–", NOT_GRADED: "?"}


@dataclass(frozen=True)
class Told:
    """What was said of an answer.

    Attributes
    ----------
    says : str
    mistakes : tuple of str
        Their names.
    code : str
        If the mistake has no name.
    share : float
        Of its results that are right.
    follows : tuple of str
        The earlier questions on whose wrong answers it is right.
    """

    says: str
    mistakes: tuple[str, ...] = ()
    code: str = ""
    share: float = 0.0
    follows: tuple[str, ...] = ()


@dataclass(frozen=True)
class Grade:
    """A row of the table.

    Attributes
    ----------
    name : str
        Of the notebook: its path in the folder.
    status : {"graded", "graded in part", "not an exercise notebook", "not graded"}
        In part, if an answer could not be compared for no fault of its own that is known.
    letter, variant : str
        The set as the notebook claims, the variant by which it was marked.
    marks : dict
        Question to "passed", "wrong", "unusable", "not implemented", "not run" or "not graded".
    note : str
        Where it stopped, what the wrong answers look like, what to look at.
    digest : str
        Empty if it was not graded, or in part: it is tried again.
    told : dict
        Question to what was said of the answer.
    student : str
        Whom the notebook was handed out to, as it says itself.
    work : str
        Hash of the student's code, empty if there is none: the same code has the same.
    """

    name: str
    status: str
    letter: str = ""
    variant: str = ""
    marks: Mapping[str, str] = field(default_factory=dict)
    note: str = ""
    digest: str = ""
    told: Mapping[str, Told] = field(default_factory=dict)
    student: str = ""
    work: str = ""

    @property
    def passed(self) -> int:
        return sum(mark == PASSED for mark in self.marks.values())


FIRST = ("notebook", "status", "set", "variant")
LAST = ("passed", "of", "note", "digest", "student", "work", "details")


def columns() -> list[str]:
    most = max(len(one.questions) for one in sets().values())
    return [*FIRST, *(f"q{i + 1}" for i in range(most)), *LAST]


def write_table(grades: Iterable[Grade], path: Path) -> None:
    """Write the table as CSV that spreadsheets open, completely or not at all."""
    rows = []
    for one in sorted(grades, key=lambda one: one.name):
        row: dict[str, Any] = dict(zip(FIRST, (one.name, one.status, one.letter, one.variant), strict=True))
        row |= {f"q{i + 1}": mark for i, mark in enumerate(one.marks.values())}
        passed, of = (one.passed, len(one.marks)) if one.marks else ("", "")
        last = (passed, of, one.note, one.digest, one.student, one.work, details(one.told))
        rows.append(row | dict(zip(LAST, last, strict=True)))
    write_csv(columns(), rows, path)


def details(told: Mapping[str, Told]) -> str:
    """What was said of all answers, as one cell of the table."""
    rows = {name: [one.says, one.mistakes, one.code, round(one.share, 4), one.follows] for name, one in told.items()}
    return json.dumps(rows, ensure_ascii=False) if rows else ""


def _told(text: str) -> dict[str, Told]:
    rows = json.loads(text or "{}").items()
    return {name: Told(says, tuple(mistakes), code, share, tuple(on)) for name, (says, mistakes, code, share, on) in rows}


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
        if not {*FIRST, "passed", "of", "note", "digest"} <= set(row):
            raise ValueError(
                f"{path} is not a table of grades (or a spreadsheet has changed it); move it, or choose another --out"
            )
        values = {key: plain((row.get(key) or "").strip()) for key in (*FIRST, *LAST)}
        letter = values["set"]
        questions = [question.name for question in sets()[letter].questions] if letter in sets() else []
        marks = {name: row.get(f"q{i + 1}") or "" for i, name in enumerate(questions)}
        if values["digest"] and all(mark in SIGNS for mark in marks.values()):
            name, status, _, variant = (values[key] for key in FIRST)
            with suppress(ValueError, TypeError, AttributeError):  # a spreadsheet has cut it: graded again
                told = _told(values["details"])
                more = (values["note"], values["digest"], told, values["student"], values["work"])
                found[values["digest"]] = Grade(name, status, letter, variant, marks, *more)
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


Started = Callable[[Returned], None]
RunAll = Callable[[Sequence[Returned], Started], Iterable[Grade]]


def grade_all(work: Sequence[Returned], path: Path, again: bool, run_all: RunAll) -> tuple[list[Grade], int, dict[str, str]]:
    """Grade what is new, and write the table after each notebook, so that an interrupted run goes on where it was.

    What is still to be graded stands in the table too: if the run is ended, it says which notebooks were in it.  A notebook
    that was graded, and that this run cannot grade (of a variant that another `--variants` has, say), keeps its row.

    Returns
    -------
    grades, old, kept : list of Grade, int, dict
        By name; how many were taken from the earlier table; name of a notebook that keeps its row to why it was not graded.
    """
    table = read_table(path)
    grades, new = unchanged(work, {} if again else table)
    old, kept = len(grades), dict[str, str]()
    by_file = {_file(one): one for one in table.values()}
    before = {one.name: replace(by_file[_file(one)], name=one.name) for one in new if _file(one) in by_file}
    waiting = {one.name: before.get(one.name) or Grade(one.name, FAILED, note=WAITING) for one in new}
    lock = threading.Lock()

    def started(one: Returned) -> None:
        with lock:
            if one.name in waiting:  # word of it may come late, from far
                waiting[one.name] = Grade(one.name, FAILED, note=RUNNING)
            write_table([*grades, *waiting.values()], path)

    for one in run_all(new, started):
        with lock:
            if one.status == FAILED and one.name in before:
                kept[one.name], one = one.note, before[one.name]
            grades.append(one)
            waiting.pop(one.name, None)
            write_table([*grades, *waiting.values()], path)
    write_table(grades, path)
    return sorted(grades, key=lambda one: one.name), old, kept


def _file(one: Grade | Returned) -> str:
    """What its digest says of the file and the variant given alone."""
    return one.digest.rpartition("-")[2]
