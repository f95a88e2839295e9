"""Marking one returned notebook: what passed, for the instructor's eye.

Nothing of a returned notebook is trusted but the student's own cells.  The notebook of its set and variant is made again from the
master, the student's cells are put into it, it runs in a kernel of its own, and only what the master's check cells report counts.

This keeps honest notebooks from harming one another and notices the usual accidents and shortcuts.  It is no defence against a
student who means harm: the notebooks run with your rights.  A notebook that looks strange is named in the table; look at it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from nbformat import NotebookNode

from kfcourse.checks import Exercise
from kfcourse.checks.question import MIME, UNUSABLE, WRONG
from kfcourse.limits import OutOfTime, time_limit
from kfcourse.notebooks.grading.assembly import assembled, check_cells, generated
from kfcourse.notebooks.grading.running import WHOLE, run
from kfcourse.notebooks.grading.submissions import Cell, Returned, cells_of, claimed, clean, read_document
from kfcourse.notebooks.grading.table import FAILED, GRADED, NOT_RUN, OTHER, SIGNS, Grade
from kfcourse.notebooks.master import opened, read


def grade(work: Returned) -> Grade:
    """Grade one notebook; never raises, what went wrong is in the row."""
    try:
        document = read_document(work.path)
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
        master = generated(read(exercise.letter, work.masters), exercise.letter, opened(exercise))
    notebook, own = assembled(master, cells, exercise)
    executed, stopped = run(notebook, work.seconds)
    marks, reasons = marks_of(executed, exercise, check_cells(master))
    notes = [*([stopped] if stopped else []), *errors_of(executed), *reasons, *notes, *strange_lines(own, master)]
    return Grade(work.name, GRADED, exercise.letter, exercise.variant.name, marks, "; ".join(dict.fromkeys(notes)), work.digest)


# -- what came of it


def marks_of(executed: NotebookNode, exercise: Exercise, checks: Mapping[str, list[str]]) -> tuple[dict[str, str], list[str]]:
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


def errors_of(executed: NotebookNode) -> list[str]:
    """The first errors of the student's cells; those of stubs are no news."""
    found = []
    for cell in executed.cells:
        for output in cell.outputs if cell.id.startswith("returned-") else []:
            if output.output_type == "error" and output.ename != "NotImplementedError":
                found.append(clean(f"{cell.metadata['where']}: {output.ename}: {output.evalue}"))
    return found[:2]


STRANGE = re.compile(r"kfcourse|\.questions\b|\.structures\b|_getframe|__code__|\.hidden")


def strange_lines(own: Iterable[Cell], master: NotebookNode) -> list[str]:
    """Lines of the student's that reach for more than an exercise needs, such as the right answers in the package."""
    usual = {line.strip() for cell in master.cells for line in cell.source.splitlines()}
    found = [
        clean(f"look at {cell.name}: {line.strip()}")
        for cell in own
        for line in cell.source.splitlines()
        if STRANGE.search(line) and line.strip() not in usual
    ]
    return found[:2]
