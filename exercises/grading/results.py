"""Grades: one JSON line a notebook, written as soon as it is graded; from the lines a table for
spreadsheets is made."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path

from kfcourse.exercises.checks import Question, Result, sets
from kfcourse.exercises.checks.question import MISSING, PASSED, UNUSABLE, WRONG
from kfcourse.exercises.notebooks.texts import write_csv

# of an answer: an error before it; the grader could not compare it
NOT_RUN, NOT_GRADED = "not run", "not graded"
GRADED, PARTLY, OTHER, FAILED = "graded", "graded in part", "not an exercise notebook", "not graded"
SIGNS = {PASSED: "✓", WRONG: "✗", UNUSABLE: "✗", MISSING: "–", NOT_RUN: "–", NOT_GRADED: "?"}


@dataclass(frozen=True)
class Grade:
    """What came of a notebook.

    Attributes
    ----------
    name : str
        Its path in the folder.
    status : {"graded", "graded in part", "not an exercise notebook", "not graded"}
        In part, if an answer could not be compared for no fault of its own that is known.
    letter, variant : str
        The set as the notebook claims, the variant by which it was marked.
    results : dict
        Question to what was said of the answer; its status is a mark: "passed", "wrong",
        "unusable", "not implemented", "not run" or "not graded".
    notes : sequence of str
        Where it stopped, what the wrong answers look like.
    looks : sequence of str
        What a lecturer should look at.
    digest : str
        Empty if it was not graded, or in part: it is tried again.
    student : str
        Whom the notebook was handed out to, as it says itself.
    work : str
        Hash of the student's code, empty if there is none: the same code has the same.
    """

    name: str
    status: str
    letter: str = ""
    variant: str = ""
    results: Mapping[str, Result] = field(default_factory=dict)
    notes: Sequence[str] = ()
    looks: Sequence[str] = ()
    digest: str = ""
    student: str = ""
    work: str = ""

    @property
    def marks(self) -> dict[str, str]:
        """Question to mark."""
        return {name: result.status for name, result in self.results.items()}

    @property
    def passed(self) -> int:
        return sum(result.passed for result in self.results.values())

    @property
    def note(self) -> str:
        """All notes in a line."""
        return "; ".join([*self.notes, *(f"look: {look}" for look in self.looks)])


def in_words(question: Question, name: str) -> str:
    """What is said of a known mistake; of others the name tells it."""
    says = {mistake.name: mistake.says for mistake in question.mistakes}
    return says.get(name, name.replace("-", " ")).partition(". ")[0].rstrip(".")


def line(grade: Grade) -> str:
    """The grade as a line of JSON."""
    return json.dumps(asdict(grade)) + "\n"


def read_lines(path: Path) -> dict[str, Grade]:
    """Grades of an earlier run, by digest; none if there is no file, nor of a line that was cut."""
    grades = {}
    with suppress(FileNotFoundError):
        for text in path.read_text(encoding="utf-8").splitlines():
            with suppress(ValueError, TypeError, LookupError, AttributeError):
                fields = json.loads(text)
                results = {name: Result(**parts) for name, parts in fields["results"].items()}
                if fields["digest"]:
                    grades[fields["digest"]] = Grade(**fields | {"results": results})
    return grades


def write_table(grades: Iterable[Grade], path: Path) -> None:
    """Write a row for each grade as CSV that spreadsheets open, completely or not at all."""
    questions = [f"q{i + 1}" for i in range(max(len(set_.questions) for set_ in sets().values()))]
    columns = [
        "notebook",
        "status",
        "set",
        "variant",
        *questions,
        "passed",
        "of",
        "note",
        "student",
    ]
    rows = []
    for grade in sorted(grades, key=lambda grade: grade.name):
        row = {
            "notebook": grade.name,
            "status": grade.status,
            "set": grade.letter,
            "variant": grade.variant,
            "note": grade.note,
            "student": grade.student,
        }
        counts = {"passed": grade.passed, "of": len(grade.marks)} if grade.marks else {}
        rows.append(row | dict(zip(questions, grade.marks.values(), strict=False)) | counts)
    write_csv(columns, rows, path)
