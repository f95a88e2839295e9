"""Marking one returned notebook: what passed, and what the wrong answers look like.

Nothing of a returned notebook is trusted but the student's own cells.  The notebook of its set and variant is made again from the
master, and the student's cells are put into it.  It runs in a process of its own, which has neither keys nor questions: it is
asked for the values of the student's functions, at arguments that nobody has seen before, and this process compares them.
"""

from __future__ import annotations

import ast
import hashlib
import re
from collections.abc import Callable, Container, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from nbformat import NotebookNode

from kfcourse.checks import Attempts, Exercise, Result
from kfcourse.checks.engine import SECONDS as CHECK
from kfcourse.checks.engine import check
from kfcourse.checks.question import NOT_CHECKED, UNUSABLE, WRONG
from kfcourse.limits import OutOfTime, time_limit
from kfcourse.notebooks.grading.asking import salted
from kfcourse.notebooks.grading.assembly import Step, assembled, generated
from kfcourse.notebooks.grading.running import WHOLE, Answer, Ended, Kernel, Killed, Opening, Site, Stopped
from kfcourse.notebooks.grading.staging import opened_elsewhere, personal_numbers
from kfcourse.notebooks.grading.submissions import Cell, Returned, cells_of, claimed, openings, read_document, syntax
from kfcourse.notebooks.grading.table import FAILED, GRADED, NOT_GRADED, NOT_RUN, OTHER, PARTLY, Grade, Told
from kfcourse.notebooks.grading.values import Other
from kfcourse.notebooks.master import opened, read
from kfcourse.notebooks.texts import clean

ENDED = "the process that compares it was ended, or hung: too large an answer, or somebody ended it"
LOOKED_AT = "not graded: your teacher is told"  # what a student reads of it
TELL_US = "the check itself fails, please tell us"
CODE = 4000  # characters of an answer that are kept


@dataclass(frozen=True)
class Setting:
    """Where and how notebooks are graded.

    Attributes
    ----------
    place : Site
    salt : str
        Of the hidden arguments.
    """

    place: Site
    salt: str


Progress = Callable[[str], None]  # is told the question that is compared now, "" while the notebook runs


def grade(
    work: Returned, setting: Setting, skip: Sequence[str] = (), progress: Progress = lambda _: None, start: Any = Kernel
) -> Grade:
    """Grade one notebook; never raises, what went wrong is in the row.

    Parameters
    ----------
    work : Returned
    setting : Setting
    skip : sequence of str
        Questions whose answers earlier processes could not compare: they are not graded.
    progress : callable
    start : type
        Of the notebook's process.
    """
    if work.problem:
        return Grade(work.name, FAILED, note=work.problem)
    try:
        progress("")
        document = read_document(work.path)
        cells = cells_of(document)
        claim = document.get("metadata", {}).get("kfcourse") or _claim(cells)
        if claim is None:
            return Grade(work.name, OTHER, digest=work.digest)
        with suppress(Killed):  # by whom is not known: once more
            return _grade(work, cells, claim, setting, skip, progress, start)
        return _grade(work, cells, claim, setting, skip, progress, start)
    except OutOfTime:
        problem = "the notebook of its variant cannot be made in time"
    except Killed as reason:
        problem = str(reason)
    except Exception as error:  # also of libraries: one notebook must not stop the others
        problem = clean(str(error) or type(error).__name__)
    return Grade(work.name, FAILED, note=problem)


def _claim(cells: Sequence[Cell]) -> dict[str, str] | None:
    """Set and variant that a notebook without metadata opens."""
    for cell in cells:
        for letter, variant in openings(cell.source):
            name = variant.get("name") if isinstance(variant, dict) else variant
            return {"set": str(letter), "variant": str(name or "53")}
    return None


def _grade(
    work: Returned, cells: Sequence[Cell], claim: Any, setting: Setting, skip: Sequence[str], progress: Progress, start: Any
) -> Grade:
    with time_limit(WHOLE * work.seconds):
        exercise, notes = claimed(claim, cells, work.variants_file, work.variant)
        master = generated(read(exercise.letter, work.masters), exercise.letter, opened(exercise))
        elsewhere = opened_elsewhere(call for cell in cells for call in openings(cell.source))
        opening = Opening(exercise.letter, opened(exercise), personal_numbers(exercise, elsewhere))
    steps, own = assembled(master, cells)
    marking = Marking(exercise, setting.salt, skip, progress)
    with start(setting.place, opening, work.seconds) as kernel:
        stopped = marking.run(kernel, steps)
    noted = [*notes, *_noted(kernel.notes), *strange_lines(own, master)]
    notes = [*stopped, *marking.failed(), *marking.errors[:2], *marking.reasons(), *noted]
    code = {question.name: question.function for question in exercise.questions.values()}
    told = {
        name: Told(
            one.message,
            one.diagnosis,
            _code(own, code[name]) if one.status == WRONG and not one.diagnosis else "",
            one.share,
            one.follows,
        )
        for name, one in marking.results.items()
    }
    variant, note = exercise.variant.name, "; ".join(dict.fromkeys(notes))
    whom = clean(str(claim.get("student", ""))) if isinstance(claim, dict) else ""
    done = code_of(own, set(code.values()))
    status, digest = (PARTLY, "") if NOT_GRADED in marking.marks.values() else (GRADED, work.digest)
    return Grade(work.name, status, exercise.letter, variant, marking.marks, note, digest, told, whom, done)


def _noted(notes: Iterable[str]) -> list[str]:
    return [f"look: it {note}" for note in list(dict.fromkeys(notes))[:5]]


def code_of(own: Iterable[Cell], functions: Container[str]) -> str:
    """Hash of the answers as Python reads them, so without comments; empty if there is none but stubs."""
    found = []
    for cell in own:
        for node in (syntax(cell.source) or ast.Module([], [])).body:
            if isinstance(node, ast.FunctionDef) and node.name in functions:
                found.append(ast.dump(node))
    return hashlib.sha256("\n".join(sorted(found)).encode()).hexdigest()[:16] if found else ""


def _code(own: Iterable[Cell], function: str) -> str:
    """The cell in which a student defines a function."""
    found = [cell.source for cell in own if re.search(rf"^(def {function}\b|{function}\s*=)", cell.source, re.MULTILINE)]
    return "\n".join(found)[:CODE]


class Marking:
    """Marks of a notebook while it runs.

    Attributes
    ----------
    marks : dict
        Question to mark.
    results : dict
        Question to what the check said.
    errors : list of str
        Errors of the student's cells; those of stubs are no news.
    """

    def __init__(self, exercise: Exercise, salt: str, skip: Sequence[str], progress: Progress):
        self._exercise, self._salt, self._skip, self._progress = exercise, salt, skip, progress
        self.marks = dict.fromkeys(exercise.questions, NOT_RUN)
        self.results: dict[str, Result] = {}
        self.errors: list[str] = []
        self._reasons: dict[str, list[str]] = {}
        self._failed: dict[str, list[str]] = {}
        self._past = Attempts()

    def run(self, kernel: Kernel, steps: Iterable[Step]) -> list[str]:
        """Run all cells and ask for all answers; says where and why it did not come to its end, if it did not."""
        for step in steps:
            self._progress("")
            try:
                ran = kernel.cell(step.source, step.names)
            except Stopped as reason:
                if isinstance(reason, Ended):  # what would have come is not known
                    self.marks |= {name: NOT_GRADED for name, mark in self.marks.items() if mark == NOT_RUN}
                for name, mark in self.marks.items():
                    if mark == NOT_RUN:
                        self._not_run(name, f"{step.where}: {reason}")
                return [f"{'look: ' * isinstance(reason, Ended)}{step.where}: {reason}"]
            if ran.error and (step.own or "import " in step.source) and ran.error[0] != "NotImplementedError":
                self.errors.append(clean(f"{step.where}: {': '.join(ran.error)}"))
            for name in step.questions:
                if ran.error:
                    self._not_run(name, ": ".join(ran.error))
                    self._reason(": ".join(ran.error), name)
                elif name in ran.answers and name in self.marks:
                    self._check(name, kernel, ran.answers[name])
        return []

    def _check(self, name: str, kernel: Kernel, kind: str) -> None:
        question = self._exercise.questions[name]
        if name in self._skip:
            self._not_graded(name, ENDED)
            return
        self._progress(name)
        answer: Any = type(kind, (Other,), {})() if kind else Answer(kernel, name)
        asked = salted(self._exercise.letter, opened(self._exercise), name, self._salt)
        result = check(question, asked, answer, CHECK, self._past)
        if getattr(answer, "lost", ""):
            self._not_graded(name, answer.lost)
            return
        if result.status == NOT_CHECKED:
            self._not_graded(name, f"{TELL_US}: {result.trouble}")
            return
        if result.trouble:
            self._failed.setdefault(f"the hint is lost, and the mark holds; {TELL_US}: {result.trouble}", []).append(name)
        self.results[name], self.marks[name] = result, result.status
        if result.status == UNUSABLE:
            self._reason(result.message, name)
        elif result.status == WRONG and result.diagnosis:
            self._reason(", ".join(result.diagnosis), name)

    def _not_run(self, name: str, reason: str) -> None:
        """Say in the student's feedback where the notebook stopped."""
        if name in self.marks:
            self.results[name] = Result(name, self._exercise.questions[name].title, NOT_RUN, clean(f"not run. {reason}", 300))

    def _not_graded(self, name: str, reason: str) -> None:
        title = self._exercise.questions[name].title
        self.results[name], self.marks[name] = Result(name, title, NOT_GRADED, LOOKED_AT), NOT_GRADED
        self._failed.setdefault(f"not graded: {reason}", []).append(name)

    def failed(self) -> list[str]:
        """Which answers are not graded, and why."""
        return [clean(f"look: {', '.join(names)} {reason}", 500) for reason, names in self._failed.items()]

    def _reason(self, reason: str, question: str) -> None:
        self._reasons.setdefault(reason, []).append(question)

    def reasons(self) -> list[str]:
        """What the wrong answers look like."""
        return [clean(f"{', '.join(questions)}: {reason}") for reason, questions in self._reasons.items()]


STRANGE = re.compile(
    r"✓|\btask(\.\w+)?\s*=(?!=|\s*exercise\()"  # checks of one's own: here others count
    r"|kfcourse|\.questions\b|\.structures\b|_getframe|currentframe|__code__|__traceback__|\.hidden|__setattr__"
)


def strange_lines(own: Iterable[Cell], master: NotebookNode) -> list[str]:
    """Lines of the student's that reach for more than an exercise needs, such as what the package computes, or print a tick."""
    usual = {line.strip() for cell in master.cells for line in cell.source.splitlines()}
    found = [
        clean(f"look at {cell.name}: {line.strip()}")
        for cell in own
        for line in cell.source.splitlines()
        if STRANGE.search(line) and line.strip() not in usual
    ]
    return found[:2]
