"""Notebooks that students have got already, of an earlier version and variant 53: they open, and
are graded, as they did."""

import json
from pathlib import Path

import pytest
from inside import InsideKernel, statuses

from kfcourse.checks import sets
from kfcourse.notebooks.grading import marking, submissions
from kfcourse.notebooks.grading.running import Site
from kfcourse.notebooks.grading.sandbox import Sandbox

FOLDER = Path(__file__).parent / "handed_out"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))


def test_there_are_ten():
    assert len(NOTEBOOKS) == 10


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_cell_runs_up_to_the_first_stub(path):
    """What they import and open is there; each question is asked, and answered by nothing but "not
    implemented"."""
    cells = [
        cell
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]
        if cell["cell_type"] == "code"
    ]
    assert statuses(cells) == dict.fromkeys(
        [question.name for question in sets()[path.name[0]].questions], "not implemented"
    )


@pytest.mark.parametrize("name", ["b-aof.ipynb", "e-comparison.ipynb"])
def test_they_are_graded(name):
    (work,) = (work for work in submissions.returned(FOLDER) if work.name == name)
    grade = marking.grade(
        work, marking.Setting(Site(Path("stage"), Sandbox("none")), "salt"), start=InsideKernel
    )
    assert (grade.status, grade.note, grade.student) == ("graded", "", "Иванов Иван, РТ-1")
    assert set(grade.marks.values()) == {"not implemented"}
