"""Source notebooks of nbgrader: what its validator and its preprocessors ask of them."""

import nbformat
import pytest
from inside import errors, execute_inside, rendered

from kfcourse.exercises.checks import sets
from kfcourse.exercises.checks.question import WEIGHTS
from kfcourse.exercises.grading.weights import possible
from kfcourse.exercises.notebooks.nbgrader import source_notebook


@pytest.mark.parametrize("letter", sets())
def test_every_question_is_a_test_worth_its_points(letter):
    notebook = source_notebook(rendered(letter))
    nbformat.validate(notebook)
    marked = [
        (one, one.metadata["nbgrader"]) for one in notebook.cells if "nbgrader" in one.metadata
    ]
    marks = {mark["grade_id"]: mark for _, mark in marked}
    assert len(marks) == len(marked)
    assert {(mark["schema_version"], mark["task"]) for mark in marks.values()} == {(3, False)}
    tests = {name: mark for name, mark in marks.items() if mark["grade"]}
    assert all(mark["locked"] and not mark["solution"] for mark in tests.values())
    worth = {name: mark["points"] for name, mark in tests.items()}
    assert worth == {one.name: WEIGHTS[one.level] for one in sets()[letter].questions}
    assert sum(worth.values()) == possible(letter)
    # nbgrader refuses a solution outside of a solution cell, and a solution cell in Markdown that
    # is worth nothing
    solutions = [one for one in notebook.cells if "SOLUTION" in one.source]
    assert solutions == [one for one, mark in marked if mark["solution"]]
    assert {one.cell_type for one in solutions} == {"code"}


def test_a_test_fails_with_what_the_check_says():
    notebook = source_notebook(rendered("e"))
    dear = ("compare(", "relative_accuracy(")
    notebook.cells = [one for one in notebook.cells if not any(name in one.source for name in dear)]

    def told():
        failed = errors(execute_inside(notebook))
        tests = [error for one, error in failed if one.metadata.get("nbgrader", {}).get("grade")]
        return [error.evalue for error in tests]

    assert told() == []
    next(
        one for one in notebook.cells if "def error_variance" in one.source
    ).source += "\nerror_variance = lambda x, z: x"
    assert [text.partition(": ")[0] for text in told()] == ["✗ e1 the error variance"]
