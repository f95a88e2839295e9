"""Texts of other people do no harm on a terminal or in a spreadsheet."""

import csv
import io

import pytest

from kfcourse.exercises.checks import Result, sets
from kfcourse.exercises.grading.report import write_report
from kfcourse.exercises.grading.results import Grade, write_table
from kfcourse.exercises.notebooks.course_list import Student, save_assignment
from kfcourse.exercises.notebooks.texts import cautious, clean, plain

# What Excel, LibreOffice or Google's sheets take for formulas: at once, or after they have taken
# away what is before it.
FORMULAS = [
    *("=1+1", "+1+1", "-1+1", "@SUM(A1)", "\t=1+1", "\r=1+1", "\n=1+1", " =1+1"),
    *("\u00a0=1+1", "\ufeff=1+1", "\u200b=1+1", "\uff1d1+1", "\uff0b1", "\uff0d1", "\uff20SUM(A1)"),
    *("\t\uff1d1", "\u3000=1", "'=1+1", "\x00=1"),
]


def test_a_terminal_gets_no_commands():
    assert clean("a\n\x1b[31mb\t\u202e c") == "a [31mb c"
    assert len(clean("x" * 999, 50)) == 50


@pytest.mark.parametrize("text", FORMULAS)
def test_no_text_is_a_formula_and_all_come_back(text):
    assert cautious(text).startswith("'")
    assert plain(cautious(text)) == "".join(" " if ord(c) < 32 else c for c in text)


def dangerous(cell):
    """Whether a spreadsheet may take a cell for a formula, or a terminal a part of it for a command."""
    start = cell.strip(" \t\r\n\u00a0\u3000\ufeff\u200b\x00")[:1]
    return bool(cell) and (start in tuple("=+-@＝＋－＠") or any(ord(c) < 32 for c in cell))


def test_no_table_holds_a_formula(tmp_path):
    """All four tables that the commands write."""
    students = [Student(text + "A", text + "1", text + "53", text + "b") for text in FORMULAS]
    save_assignment(students, tmp_path / "assignment.csv")
    names = [question.name for question in sets()["b"].questions]
    wrong = Result("", "", "wrong", "")
    grades = [
        Grade(f"{t}.ipynb", "graded", "b", t, dict.fromkeys(names, wrong), (t,), (t,), "d", t, t)
        for t in FORMULAS
    ]
    write_table(grades, tmp_path / "grades.csv")
    write_report(grades, None, tmp_path, "")
    for name in ("assignment", "grades", "students", "questions"):
        text = io.StringIO((tmp_path / f"{name}.csv").read_text(encoding="utf-8-sig"))
        rows = list(csv.reader(text))
        assert len(rows) > 5 and not [cell for row in rows for cell in row if dangerous(cell)], name
