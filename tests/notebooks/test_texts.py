"""Texts of other people do no harm on a terminal, in a folder's name, in a spreadsheet."""

import csv
import io

import pytest

from kfcourse.notebooks.course_list import Student, read_assignment, save_assignment
from kfcourse.notebooks.grading.report import write_report
from kfcourse.notebooks.grading.results import Grade, write_table
from kfcourse.notebooks.texts import cautious, clean, plain

pytestmark = pytest.mark.quick

# What Excel, LibreOffice or Google's sheets take for formulas: at once, or after they have taken
# away what is before it.
FORMULAS = [
    *(
        "=1+1",
        "+1+1",
        "-1+1",
        "@SUM(A1)",
        "\t=1+1",
        "\r=1+1",
        "\n=1+1",
        " =1+1",
        "\u00a0=1+1",
        "\ufeff=1+1",
        "\u200b=1+1",
    ),
    *(
        "\uff1d1+1",
        "\uff0b1",
        "\uff0d1",
        "\uff20SUM(A1)",
        "\t\uff1d1",
        "\u3000=1",
        "'=1+1",
        "\x00=1",
    ),
]


def cells(path):
    return [
        cell
        for row in csv.reader(io.StringIO(path.read_text(encoding="utf-8-sig")))
        for cell in row
    ]


def formulas(path):
    """Cells that a spreadsheet may take for formulas, and what has a control character in it."""
    return [
        one
        for one in cells(path)
        if one.strip(" \t\r\n\u00a0\u3000\ufeff\u200b\x00")[:1] in tuple("=+-@＝＋－＠") and one
    ] + [one for one in cells(path) if any(ord(c) < 32 for c in one)]


def test_a_terminal_gets_no_commands():
    assert clean("a\n\x1b[31mb\t\u202e c") == "a [31mb c"
    assert len(clean("x" * 999, 50)) == 50


@pytest.mark.parametrize("text", FORMULAS)
def test_no_text_is_a_formula_and_all_come_back(text):
    assert cautious(text).startswith("'")
    assert plain(cautious(text)) == "".join(" " if ord(c) < 32 else c for c in text)


@pytest.mark.parametrize("text", FORMULAS)
def test_no_table_holds_a_formula(tmp_path, text):
    """All four tables that the commands write."""
    student = Student(text + "A", text + "1", text + "53", text + "b")
    save_assignment([student], tmp_path / "assignment.csv")
    grade = Grade(
        f"{text}.ipynb", "graded", "b", text, {"b1": "wrong"}, (text,), (text,), "d", {}, text, text
    )
    write_table([grade], tmp_path / "grades.csv")
    write_report([grade], None, tmp_path, "")
    names = ("assignment.csv", "grades.csv", "students.csv", "questions.csv")
    assert {name: found for name in names if (found := formulas(tmp_path / name))} == {}
    assert len(cells(tmp_path / "students.csv")) > 10


def test_guarded_tables_are_read_as_they_were(tmp_path):
    student = Student("=Иванов", "+1", "-53", "a b")
    save_assignment([student], tmp_path / "a.csv")
    assert read_assignment(tmp_path / "a.csv", []) == [student]


@pytest.mark.parametrize("name", ["A\x1b[31m", "A\u202eB", "A\u200bB", "A\x07"])
def test_names_that_cannot_be_seen_are_refused(tmp_path, name):
    (tmp_path / "list.csv").write_text(f"name,group\n{name},1\n", encoding="utf-8")
    with pytest.raises(
        ValueError, match="line 2: a name with characters that cannot be seen"
    ) as error:
        read_assignment(tmp_path / "list.csv", ["1"])
    assert str(error.value).isprintable()
