"""Marking one returned notebook: what passed, and what the wrong answers look like.

Nothing of a returned notebook is trusted but the student's own cells.  The notebook of its set and
variant is made again from the master, and the student's cells are put into it.  It runs in a
process of its own, which has neither keys nor questions: it is asked for the values of the
student's functions, at arguments that nobody has seen before, and this process compares them.
"""

from __future__ import annotations

import ast
import hashlib
import io
import re
import tokenize
from collections import defaultdict
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from nbformat import NotebookNode

from kfcourse.exercises.checks import Attempts, Exercise, Result
from kfcourse.exercises.checks.engine import SECONDS as CHECK
from kfcourse.exercises.checks.engine import check
from kfcourse.exercises.checks.question import MISSING, NOT_CHECKED, UNUSABLE, WRONG
from kfcourse.exercises.grading.asking import salted
from kfcourse.exercises.grading.assembly import Step, assembled, generated, lost
from kfcourse.exercises.grading.results import (
    FAILED,
    GRADED,
    NOT_GRADED,
    NOT_RUN,
    OTHER,
    PARTLY,
    Grade,
    in_words,
)
from kfcourse.exercises.grading.running import (
    KILLED,
    WHOLE,
    Kernel,
    Killed,
    Stopped,
)
from kfcourse.exercises.grading.sandbox import Sandbox
from kfcourse.exercises.grading.submissions import (
    EXPORT,
    Cell,
    Returned,
    cells_of,
    claim_of,
    claimed,
    read_document,
    syntax,
)
from kfcourse.exercises.grading.values import Other
from kfcourse.exercises.notebooks.master import opened, read
from kfcourse.exercises.notebooks.texts import clean
from kfcourse.limits import OutOfTime, time_limit

LOOKED_AT = "not graded: your teacher is told"  # what a student reads of it
TELL_US = "the check itself fails, please tell us"


@dataclass(frozen=True)
class Setting:
    """Where and how notebooks are graded.

    Attributes
    ----------
    place : Sandbox
    salt : str
        Of the hidden arguments.
    """

    place: Sandbox
    salt: str


def grade(work: Returned, setting: Setting, start: Any = Kernel) -> Grade:
    """Grade one notebook; never raises, what went wrong is in the row.

    `start` is the type of the notebook's process.
    """
    if work.problem:
        return Grade(work.name, OTHER if work.problem == EXPORT else FAILED, notes=(work.problem,))
    try:
        document = read_document(work.path)
        cells = cells_of(document)
        claim = claim_of(document) or _claim(cells)
        if not claim:
            return Grade(work.name, OTHER, digest=work.digest)
        return _grade(work, cells, claim, setting, start)
    except OutOfTime:
        problem = "the notebook of its variant cannot be made in time"
    except Exception as error:  # also of libraries: one notebook must not stop the others
        problem = str(error) or type(error).__name__
    return Grade(work.name, FAILED, notes=(clean(problem),))


def _claim(cells: Sequence[Cell]) -> dict[str, str] | None:
    """Set and variant, a name or a table's, that a notebook without metadata opens."""
    opening = re.search(
        r"""\bexercise\(\s*["'](\w+)["'](?:,\s*(?:variant=)?(?:{'name':\s*)?["']([^"']+))?""",
        "\n".join(cell.source for cell in cells if cell.code),
    )
    return opening and {"set": opening[1], "variant": opening[2] or "53"}


def _grade(
    work: Returned, cells: Sequence[Cell], claim: Mapping[str, Any], setting: Setting, start: Any
) -> Grade:
    with time_limit(WHOLE * work.seconds):
        exercise, looks = claimed(claim, work.variants_file, work.variant)
        master = generated(read(exercise.letter, work.masters), exercise.letter, opened(exercise))
        starting = start(setting.place, exercise, work.seconds)
    steps, own = assembled(master, cells)
    functions = {question.function: name for name, question in exercise.questions.items()}
    gone = {
        functions[name]: fate for name, fate in lost(master, cells).items() if name in functions
    }
    marking = Marking(exercise, setting.salt, gone)
    with starting as kernel:
        marking.run(kernel, steps)
    partly = any(result.status == NOT_GRADED for result in marking.results.values())
    return Grade(
        work.name,
        PARTLY if partly else GRADED,
        exercise.letter,
        exercise.variant.name,
        marking.results,
        tuple(dict.fromkeys([*marking.notes, *marking.errors[:2], *marking.reasons()])),
        tuple(dict.fromkeys([*looks, *marking.looks(), *strange_lines(own, master)])),
        "" if partly else work.digest,
        clean(str(claim.get("student", ""))),
        code_of(own, functions),
    )


def code_of(own: Iterable[Cell], functions: Container[str]) -> str:
    """Hash of the answers without comments and spaces; empty if there is none but stubs."""
    answers = []
    for cell in own:
        for node in (syntax(cell.source) or ast.Module([], [])).body:
            if isinstance(node, ast.FunctionDef) and node.name in functions:
                lines = io.StringIO(ast.get_source_segment(cell.source, node) or "")
                words = (
                    token.string
                    for token in tokenize.generate_tokens(lines.readline)
                    if token.type != tokenize.COMMENT
                )
                answers.append(" ".join(" ".join(words).split()))
    return hashlib.sha256("\n".join(sorted(answers)).encode()).hexdigest()[:16] if answers else ""


class Marking:
    """Marks of a notebook while it runs.

    Attributes
    ----------
    results : dict
        Question to what the check said, or why nothing was asked.
    notes : list of str
        Where the notebook stopped, if it did, and which answers are gone from it.
    errors : list of str
        Errors of the student's cells; those of stubs are no news.
    """

    def __init__(self, exercise: Exercise, salt: str, gone: Mapping[str, str] | None = None):
        self._exercise, self._salt, self._gone = exercise, salt, gone or {}
        self.results: dict[str, Result] = {}
        for name in exercise.questions:
            self._says(name, NOT_RUN, "not run: is there an error in a cell before it?")
        self.notes = [f"the cell of {name} {fate}" for name, fate in self._gone.items()]
        self.errors: list[str] = []
        self._reasons: dict[str, list[str]] = defaultdict(list)
        self._failed: dict[str, list[str]] = defaultdict(list)
        self._past = Attempts()

    def run(self, kernel: Kernel, steps: Iterable[Step]) -> None:
        """Run all cells and ask for all answers, as far as the notebook goes."""
        for step in steps:
            try:
                ran = kernel.cell(step.source, step.names)
            except Stopped as reason:
                why, killed = f"{step.where}: {reason}", isinstance(reason, Killed)
                for name, result in self.results.items():
                    if result.status == NOT_RUN:
                        # what would have come is not known
                        (self._not_graded if killed else self._not_run)(name, why)
                if not killed:
                    self.notes.append(why)
                return
            if ran.error and not ran.stub and (step.own or "import " in step.source):
                self.errors.append(clean(f"{step.where}: {ran.error}"))
            for name in step.questions:
                if ran.error:
                    self._not_run(name, ran.error)
                    self._reasons[ran.error].append(name)
                elif name in ran.answers:
                    self._check(name, kernel, ran.answers[name])

    def _check(self, name: str, kernel: Kernel, kind: str) -> None:
        question = self._exercise.questions[name]
        answer = type(kind, (Other,), {})() if kind else kernel.answer(name)
        asked = salted(self._exercise.letter, opened(self._exercise), name, self._salt)
        result = check(question, asked, answer, CHECK, self._past)
        if result.message == KILLED or result.status == NOT_CHECKED:
            self._not_graded(name, f"{TELL_US}: {result.trouble}" if result.trouble else KILLED)
            return
        if result.trouble:
            trouble = f"the hint is lost, and the mark holds; {TELL_US}: {result.trouble}"
            self._failed[trouble].append(name)
        if result.status == MISSING and self._gone:
            says = f"{result.message}, or stands on what is not there: the cell of "
            says += ", ".join(self._gone)
            if name in self._gone:
                says = f"its cell {self._gone[name]}"
            result = replace(result, message=says)
        self.results[name] = result
        if result.status == UNUSABLE:
            self._reasons[result.message].append(name)
        elif result.status == WRONG and result.diagnosis:
            words = (in_words(question, mistake) for mistake in result.diagnosis)
            self._reasons[", ".join(words)].append(name)

    def _says(self, name: str, status: str, message: str) -> None:
        self.results[name] = Result(name, self._exercise.questions[name].title, status, message)

    def _not_run(self, name: str, reason: str) -> None:
        """Say in the student's feedback where the notebook stopped."""
        self._says(name, NOT_RUN, clean(f"not run. {reason}", 300))

    def _not_graded(self, name: str, reason: str) -> None:
        self._says(name, NOT_GRADED, LOOKED_AT)
        self._failed[f"not graded: {reason}"].append(name)

    def looks(self) -> list[str]:
        """Which answers are not graded, and why."""
        return [
            clean(f"{', '.join(names)} {reason}", 500) for reason, names in self._failed.items()
        ]

    def reasons(self) -> list[str]:
        """What the wrong answers look like."""
        return [
            clean(f"{', '.join(questions)}: {reason}")
            for reason, questions in self._reasons.items()
        ]


STRANGE = re.compile(
    r"✓|\btask(\.\w+)?\s*=(?!=)|\bexercise\("  # checks of one's own: here others count
    r"|kfcourse|\.questions\b|\.structures\b|_getframe|currentframe|__code__|__traceback__|\.hidden|__setattr__"
)


def strange_lines(own: Iterable[Cell], master: NotebookNode) -> list[str]:
    """Lines of the student's that reach for more than an exercise needs: what the package computes,
    another exercise, or a tick of one's own."""
    usual = {line.strip() for cell in master.cells for line in cell.source.splitlines()}
    strange = [
        clean(f"{cell.name}: {line.strip()}")
        for cell in own
        for line in cell.source.splitlines()
        if STRANGE.search(line) and line.strip() not in usual
    ]
    return strange[:2]
