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
        (each, each.metadata["nbgrader"]) for each in notebook.cells if "nbgrader" in each.metadata
    ]
    marks = {mark["grade_id"]: mark for _, mark in marked}
    assert len(marks) == len(marked)
    assert {(mark["schema_version"], mark["task"]) for mark in marks.values()} == {(3, False)}
    tests = {name: mark for name, mark in marks.items() if mark["grade"]}
    assert all(mark["locked"] and not mark["solution"] for mark in tests.values())
    worth = {name: mark["points"] for name, mark in tests.items()}
    assert worth == {
        question.name: WEIGHTS[question.level] for question in sets()[letter].questions
    }
    assert sum(worth.values()) == possible(letter)
    # nbgrader refuses a solution outside of a solution cell, and a solution cell in Markdown that
    # is worth nothing
    solutions = [each for each in notebook.cells if "SOLUTION" in each.source]
    assert solutions == [each for each, mark in marked if mark["solution"]]
    assert {each.cell_type for each in solutions} == {"code"}


def test_a_test_fails_with_what_the_check_says():
    notebook = source_notebook(rendered("e"))
    dear = ("compare(", "relative_accuracy(")
    notebook.cells = [
        each for each in notebook.cells if not any(name in each.source for name in dear)
    ]

    def failures():
        failed = errors(execute_inside(notebook))
        tests = [error for each, error in failed if each.metadata.get("nbgrader", {}).get("grade")]
        return [error.evalue for error in tests]

    assert failures() == []
    next(
        each for each in notebook.cells if "def error_variance" in each.source
    ).source += "\nerror_variance = lambda x, z: x"
    assert [text.partition(": ")[0] for text in failures()] == ["✗ e1 the error variance"]
