"""Notebooks that students have got already, of an earlier version and variant 53: they open, and
are graded, as they did."""

from pathlib import Path

import nbformat
import pytest
from inside import InsideKernel, statuses

from kfcourse.exercises.checks import sets
from kfcourse.exercises.grading import marking, submissions
from kfcourse.exercises.grading.sandbox import Sandbox

FOLDER = Path(__file__).parent / "handed_out"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
assert len(NOTEBOOKS) == 10


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_cell_runs_up_to_the_first_stub(path):
    """What they import and open is there; each question is asked, and answered by nothing but "not
    implemented"."""
    names = [question.name for question in sets()[path.name[0]].questions]
    assert statuses(nbformat.read(path, 4)) == dict.fromkeys(names, "not implemented")


@pytest.mark.parametrize("name", ["b-aof.ipynb", "e-comparison.ipynb"])
def test_they_are_graded(name):
    (work,) = (work for work in submissions.returned(FOLDER) if work.name == name)
    setting = marking.Setting(Sandbox("none", Path("stage")), "salt")
    grade = marking.grade(work, setting, start=InsideKernel)
    assert (grade.status, grade.note, grade.student) == ("graded", "", "Иванов Иван, РТ-1")
    assert set(grade.marks.values()) == {"not implemented"}
