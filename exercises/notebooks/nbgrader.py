"""The exercise notebooks in nbgrader's format: solutions between its markers, and check cells that
are worth points."""

from __future__ import annotations

import nbformat
from nbformat import NotebookNode

from kfcourse.exercises.checks import sets
from kfcourse.exercises.checks.question import WEIGHTS
from kfcourse.exercises.notebooks.master import BEGIN, CHECK, without_solution

SCHEMA = 3  # version of nbgrader's metadata


def source_notebook(notebook: NotebookNode) -> NotebookNode:
    """What nbgrader calls a source notebook, from the complete one of `render`.

    The masters mark solutions as nbgrader does.  An answer's cell becomes a solution cell; a
    check's cell a locked test, which fails if the answer is wrong and says what kind of mistake it
    looks like.  Solutions in texts are left out.
    """
    result = nbformat.from_dict(notebook)
    levels = {
        question.name: question.level
        for question in sets()[notebook.metadata["kfcourse"]["set"]].questions
    }
    for cell in result.cells:
        asked = CHECK.match(cell.source) if cell.cell_type == "code" else None
        if cell.cell_type != "code":
            cell.source = without_solution(cell.source, code=False)
        elif asked:
            question = asked[2]
            cell.source = f"result = {cell.source.strip()}\nassert result.passed, result"
            cell.metadata["nbgrader"] = _marked(question, True) | {
                "points": WEIGHTS[levels[question]]
            }
        elif BEGIN in cell.source and not without_solution(cell.source, code=True):
            cell.source = ""  # an answer in words
        elif BEGIN in cell.source:
            cell.metadata["nbgrader"] = _marked(f"{cell.id}-answer", False)
    result.cells = [cell for cell in result.cells if cell.source.strip()]
    return result


def _marked(name: str, test: bool) -> dict:
    """nbgrader's metadata of a cell: a locked test, or a solution."""
    return {
        "grade_id": name,
        "schema_version": SCHEMA,
        "grade": test,
        "solution": not test,
        "locked": test,
        "task": False,
    }
