"""Whose notebook it is, what it is worth, and the pages for students and lecturers."""

import csv
import io
import re
from dataclasses import replace

import markupsafe
import pytest

from kfcourse.exercises.checks import Result, sets
from kfcourse.exercises.checks.question import MISSING, PASSED, UNUSABLE, WEIGHTS, WRONG
from kfcourse.exercises.grading.owners import Person, owner, people, same_code
from kfcourse.exercises.grading.report import feedback, student_rows, write_report
from kfcourse.exercises.grading.results import NOT_RUN, Grade
from kfcourse.exercises.grading.weights import USUAL, Credit, points, possible
from kfcourse.exercises.notebooks.course_list import Student, read_assignment, save_assignment

IVANOV = Student("Иванов Иван", "РТ-1", "53", "b c")
PETROVA = Student("Петрова Анна", "РТ-1", "20", "b c")
OTHER = Student("Иванов Иван", "РТ-2", "7", "b c")
LONG = Student("Иванов Иван Петрович", "РТ-2", "7", "b")
COURSE = [IVANOV, PETROVA, OTHER]
SIGN = next(
    mistake.says.partition(". ")[0].rstrip(".")
    for question in sets()["b"].questions
    for mistake in question.mistakes
    if (question.name, mistake.name) == ("b2", "innovation-sign")
)
EVERYTHING = [question.name for question in sets()["b"].questions]


def outcome(mark, message="", diagnosis=(), **more):
    return Result("", "", mark, message, diagnosis, **more)


def wrong(message="no", *diagnosis, **more):
    return outcome(WRONG, message, diagnosis, **more)


def graded(name, letter="b", variant="53", passed=(), student="", work="w", looks=(), **wrong):
    results = {question.name: outcome(NOT_RUN) for question in sets()[letter].questions}
    results |= dict.fromkeys(passed, outcome(PASSED)) | wrong
    return Grade(name, "graded", letter, variant, results, (), looks, name, student, work)


@pytest.mark.parametrize(
    ("name", "student", "course", "expected"),
    [
        ("РТ-1/Иванов-Иван/b-aof.ipynb", "", COURSE, IVANOV),
        ("РТ-2/Иванов-Иван/b-aof.ipynb", "", COURSE, OTHER),
        # two of that name, and no group
        ("rt/Иван Иванов_1234_assignsubmission_file_/x.ipynb", "", COURSE, None),
        ("Анна ПЕТРОВА_77_assignsubmission_file_/x.ipynb", "", COURSE, PETROVA),
        ("b-Петрова-Анна.ipynb", "", COURSE, PETROVA),
        ("b-aof.ipynb", "Петрова Анна, РТ-1", COURSE, PETROVA),
        ("Петрова/b.ipynb", "", COURSE, None),
        ("b-aof.ipynb", "Nobody, РТ-1", COURSE, None),
        # the group in a path tells more than a longer name
        ("РТ-1/Иванов Иван Петрович/b.ipynb", "", [LONG, IVANOV], IVANOV),
        ("РТ-2/Иванов Иван Петрович/b.ipynb", "", [IVANOV, LONG], LONG),
        ("Иванов Иван Петрович/b.ipynb", "", [IVANOV, LONG], LONG),
    ],
)
def test_whose_notebook(name, student, course, expected):
    assert owner(graded(name, student=student), course) == expected


def test_what_to_look_at():
    looks = ("cell 3: import os; look: x", "b2 not graded: the check fails")
    petrova = {"variant": "20", "work": "x", "student": "Иванов Иван, РТ-1", "looks": looks}
    grades = [
        graded("РТ-1/Иванов Иван/b.ipynb", work="x"),
        graded("РТ-1/Петрова Анна/b.ipynb", **petrova),
        graded("РТ-1/Петрова Анна/c.ipynb", "c", variant="20", passed=["c1"], work="y"),
        graded("РТ-1/Петрова Анна/c (1).ipynb", "c", variant="20", passed=["c1", "c2"], work="z"),
        Grade("РТ-2/Иванов Иван/b.ipynb", "not graded", notes=("it killed its process",)),
        Grade("РТ-2/Иванов Иван/c.ipynb", "graded", "c", results={"c1": outcome(MISSING)}),
        Grade("x.ipynb", "not graded", notes=("not JSON",)),
        Grade("notes.ipynb", "not an exercise notebook"),
    ]
    persons, strangers = people(grades, COURSE)
    assert [person.flags for person in persons] == [
        ["missing: c"],
        [
            "set b: the notebook was handed out to Иванов Иван, РТ-1",
            *(f"set b: {look}" for look in looks),
            "set c: came back more than once, the best counts",
        ],
        [
            "РТ-2/Иванов Иван/b.ipynb: not graded: it killed its process",
            "set c: came back empty",
            "missing: b",
        ],
    ]
    assert points([persons[1].grades["c"]], USUAL) == 3
    assert same_code(persons) == [("b", ["Иванов Иван", "Петрова Анна"])]
    assert [grade.name for grade in strangers] == ["x.ipynb"]


def test_without_a_list_a_folder_is_a_student():
    grades = [graded("РТ-1/A/b.ipynb"), graded("РТ-1/A/c.ipynb", "c"), graded("B.ipynb")]
    persons, strangers = people([*grades, Grade("n.ipynb", "not an exercise notebook")])
    rows = [(person.student[:2], sorted(person.grades), person.flags) for person in persons]
    assert rows == [(("B", ""), ["b"], ["missing: c"]), (("A", "РТ-1"), ["b", "c"], [])]
    assert strangers == []


def test_points_are_the_weights_of_the_levels():
    assert possible("abc") == sum(possible("abc", level) for level in WEIGHTS)
    assert points([graded("x", passed=EVERYTHING)], USUAL) == possible("b")
    grade = graded("x", passed=EVERYTHING, b1=wrong(), b2=outcome(UNUSABLE))
    assert points([grade], USUAL) == possible("b") - WEIGHTS["warm-up"] - WEIGHTS["core"]


@pytest.mark.parametrize(
    ("credit", "expected"),
    [
        (Credit(0.0, 0.0), 0),
        (Credit(1.0, 0.0), 2 / 3 + 2 / 4),
        (Credit(1.0, 0.5), 2 / 3 + 1 + 1),
        (Credit(0.5, 1.0), 1 / 3 + 2 + 2),
    ],
)
def test_what_a_wrong_answer_is_worth_is_the_teachers_choice(credit, expected):
    """b2 has a third of its results right, b3 is right on top of the wrong b1, b4 both."""
    grade = graded(
        "x",
        b1=wrong(),
        b2=wrong(share=1 / 3),
        b3=wrong(follows=("b1",)),
        b4=wrong(share=0.25, follows=("b2",)),
    )
    assert points([grade], credit) == pytest.approx(expected, abs=0.01)
    assert points([grade], credit, "core") == points([grade], credit)
    (row,) = student_rows([Person(IVANOV, {"b": grade})], "b", credit)
    assert row["set b"] == row["points"] == pytest.approx(expected, abs=0.01)
    half = f"{credit.parts * 2 / 3:.2f}".rstrip("0").rstrip(".")
    assert f"{half}/2" in feedback(Person(IVANOV, {"b": grade}), "b", credit)
    unusable = replace(grade, results=dict.fromkeys(grade.results, outcome(UNUSABLE, share=0.5)))
    assert points([unusable], credit) == 0  # only what is wrong has right parts


def table(path):
    return list(csv.DictReader(io.StringIO(path.read_text(encoding="utf-8-sig"))))


def test_tables_and_pages(tmp_path):
    sign = wrong("not right. The `sign`: <b>look</b>", "innovation-sign")
    grades = [
        graded("РТ-1/Иванов Иван/b.ipynb", passed=["b1", "b5"], b2=sign, b3=wrong()),
        graded("РТ-1/Петрова Анна/b.ipynb", variant="20", passed=["b1"], b2=sign),
    ]
    persons = write_report(grades, COURSE, tmp_path, "bubblewrap")
    rows = table(tmp_path / "students.csv")
    columns = ("name", "set b", "warm-up", "core", "stretch", "points", "of")
    assert [tuple(row[column] for column in columns) for row in rows] == [
        ("Иванов Иван", "4", "1", "0", "3", "4", "17"),
        ("Петрова Анна", "1", "1", "0", "0", "1", "17"),
        ("Иванов Иван", "", "0", "0", "0", "0", "17"),
    ]
    rows = {row["question"]: row for row in table(tmp_path / "questions.csv")}
    assert [rows["b1"][key] for key in ("right", "wrong", "not done")] == ["2", "0", "1"]
    assert [rows["b2"][key] for key in ("right", "wrong", "mistakes")] == ["0", "2", f"2: {SIGN}"]
    assert len(rows) == len(sets()["b"].questions) + len(sets()["c"].questions)

    pages = tmp_path / "feedback"
    page = (pages / "РТ-1" / "Иванов-Иван.html").read_text(encoding="utf-8")
    assert "<b>4</b> of 17 points" in page
    # nothing of a student's becomes HTML
    assert "The <code>sign</code>: &lt;b&gt;look&lt;/b&gt;" in page
    assert "Nothing came back." in page  # of set c
    assert (pages / "РТ-2" / "Иванов-Иван.html").exists()
    page = (tmp_path / "overview.html").read_text(encoding="utf-8")
    links = re.findall(r'href="([^"]+)"', page)
    assert len(links) == 3 and all(link.isascii() for link in links)
    for words in ("Sandbox: bubblewrap", "2: " + str(markupsafe.escape(SIGN)), "missing: c"):
        assert words in page
    # what the teacher is to look at names others, and the student's page does not
    persons[0].flags.append("set b: the notebook was handed out to Петрова Анна")
    assert "Петрова" not in feedback(persons[0], "b")


def test_an_assignment_comes_back_as_it_was(tmp_path):
    path = tmp_path / "assignment.csv"
    guarded = Student("=Иванов", "+1", "-53", "a b")
    save_assignment([*COURSE, guarded], path)
    assert read_assignment(path, ["1"]) == [*COURSE, guarded]
    path.write_text("name,group,variant\nA,1,53\nB,1,\n", encoding="utf-8")
    with pytest.raises(ValueError, match="line 3: B has no variant"):
        read_assignment(path, ["1"])
    path.write_text("name,group\nA,1\n", encoding="utf-8")
    assert [student.variant for student in read_assignment(path, ["7"])] == ["7"]
