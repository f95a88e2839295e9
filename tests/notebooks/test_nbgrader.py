"""Source notebooks of nbgrader: what its validator and its preprocessors ask of them."""

import nbformat
import pytest
from inside import execute_inside

from kfcourse.checks import exercise, sets
from kfcourse.notebooks.grading.weights import WEIGHTS, possible
from kfcourse.notebooks.master import read, render
from kfcourse.notebooks.nbgrader import source_notebook


def made(letter):
    return source_notebook(render(read(letter), exercise(letter, "53")))


@pytest.mark.parametrize("letter", sets())
def test_every_question_is_a_test_worth_its_points(letter):
    notebook = made(letter)
    nbformat.validate(notebook)
    marked = [
        (cell, cell.metadata["nbgrader"]) for cell in notebook.cells if "nbgrader" in cell.metadata
    ]
    names = [mark["grade_id"] for _, mark in marked]
    assert len(set(names)) == len(names)
    tests = {mark["grade_id"]: mark["points"] for _, mark in marked if mark["grade"]}
    assert tests == {one.name: WEIGHTS[one.level] for one in sets()[letter].questions}
    assert sum(tests.values()) == possible(letter)
    assert all(mark["locked"] and not mark["solution"] for _, mark in marked if mark["grade"])
    # nbgrader refuses a solution outside of a solution cell, and a solution cell in Markdown that
    # is worth nothing
    solutions = [cell for cell in notebook.cells if "SOLUTION" in cell.source]
    assert solutions == [cell for cell, mark in marked if mark["solution"]]
    assert {cell.cell_type for cell in solutions} == {"code"}
    assert {(mark["schema_version"], mark["task"]) for _, mark in marked} == {(3, False)}


def errors(notebook):
    tests = [
        cell
        for cell in execute_inside(notebook).cells
        if cell.metadata.get("nbgrader", {}).get("grade")
    ]
    return [
        output.evalue for cell in tests for output in cell.outputs if output.output_type == "error"
    ]


def test_a_test_fails_with_what_the_check_says():
    notebook = made("e")
    notebook.cells = [
        cell
        for cell in notebook.cells
        if "compare(" not in cell.source and "relative_accuracy(" not in cell.source
    ]
    assert errors(notebook) == []
    first = next(cell for cell in notebook.cells if "def error_variance" in cell.source)
    first.source += "\nerror_variance = lambda x, z: x"
    (told,) = errors(notebook)
    assert told.startswith("✗ e1 the error variance: ")
