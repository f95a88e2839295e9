"""Whose notebook it is, what it is worth, and the pages for students and lecturers."""

import csv
import io
import re
from dataclasses import replace

import markupsafe
import pytest

from kfcourse.checks import sets
from kfcourse.checks.question import MISSING, PASSED, UNUSABLE, WRONG
from kfcourse.notebooks.course_list import Student, read_assignment, save_assignment
from kfcourse.notebooks.grading.owners import Person, of_folder, owner, people, same_code
from kfcourse.notebooks.grading.report import feedback, student_rows, write_report
from kfcourse.notebooks.grading.results import NOT_RUN, Comment, Grade
from kfcourse.notebooks.grading.weights import USUAL, WEIGHTS, Credit, points, possible

IVANOV = Student("Иванов Иван", "РТ-1", "53", "b c")
PETROVA = Student("Петрова Анна", "РТ-1", "20", "b c")
OTHER = Student("Иванов Иван", "РТ-2", "7", "b c")
COURSE = [IVANOV, PETROVA, OTHER]
SIGN = next(
    mistake.says.partition(". ")[0].rstrip(".")
    for question in sets()["b"].questions
    for mistake in question.mistakes
    if (question.name, mistake.name) == ("b2", "innovation-sign")
)


def graded(name, letter="b", variant="53", passed=(), student="", work="w", looks=(), **told):
    marks = {
        one.name: PASSED if one.name in passed else NOT_RUN for one in sets()[letter].questions
    }
    told |= {one: Comment("right") for one in passed}
    marks |= {one: WRONG for one, said in told.items() if said.says != "right"}
    return Grade(name, "graded", letter, variant, marks, (), looks, name, told, student, work)


@pytest.mark.quick
def test_the_group_in_a_path_tells_more_than_a_longer_name():
    short, long = (
        Student("Иванов Иван", "РТ-1", "53", "b"),
        Student("Иванов Иван Петрович", "РТ-2", "7", "b"),
    )
    for students in ([short, long], [long, short]):
        assert owner(graded("РТ-1/Иванов Иван Петрович/b.ipynb"), students) == short
        assert owner(graded("РТ-2/Иванов Иван Петрович/b.ipynb"), students) == long
        assert owner(graded("Иванов Иван Петрович/b.ipynb"), students) == long


@pytest.mark.quick
@pytest.mark.parametrize(
    ("name", "student", "expected"),
    [
        ("РТ-1/Иванов-Иван/b-aof.ipynb", "", IVANOV),
        ("РТ-2/Иванов-Иван/b-aof.ipynb", "", OTHER),
        # two of that name, and no group
        ("rt/Иван Иванов_1234_assignsubmission_file_/x.ipynb", "", None),
        ("Анна ПЕТРОВА_77_assignsubmission_file_/x.ipynb", "", PETROVA),
        ("b-Петрова-Анна.ipynb", "", PETROVA),
        ("b-aof.ipynb", "Петрова Анна, РТ-1", PETROVA),
        ("Петрова/b.ipynb", "", None),
        ("b-aof.ipynb", "Nobody, РТ-1", None),
    ],
)
def test_whose_notebook(name, student, expected):
    assert owner(graded(name, student=student), COURSE) == expected


def test_flags():
    grades = [
        graded("РТ-1/Иванов Иван/b.ipynb", work="x"),
        graded(
            "РТ-1/Петрова Анна/b.ipynb",
            variant="20",
            work="x",
            student="Иванов Иван, РТ-1",
            looks=("cell 3: import os; look: x", "b2 not graded: the check fails"),
        ),
        graded("РТ-1/Петрова Анна/c.ipynb", "c", variant="20", passed=["c1"], work="y"),
        graded("РТ-1/Петрова Анна/c (1).ipynb", "c", variant="20", passed=["c1", "c2"], work="z"),
        Grade("РТ-2/Иванов Иван/b.ipynb", "not graded", notes=("it killed its process",)),
        Grade("РТ-2/Иванов Иван/c.ipynb", "graded", "c", marks={"c1": MISSING}),
        Grade("x.ipynb", "not graded", notes=("not JSON",)),
        Grade("notes.ipynb", "not an exercise notebook"),
    ]
    (one, two, three), strangers = people(grades, COURSE)
    assert one.flags == ["missing: c"]
    assert two.flags == [
        "set b: the notebook was handed out to Иванов Иван, РТ-1",
        "set b: cell 3: import os; look: x",
        "set b: b2 not graded: the check fails",
        "set c: came back more than once, the best counts",
    ]
    assert points([two.grades["c"]], USUAL) == 3
    assert same_code([one, two, three]) == [("b", ["Иванов Иван", "Петрова Анна"])]
    assert three.flags == [
        "РТ-2/Иванов Иван/b.ipynb: not graded: it killed its process",
        "set c: came back empty",
        "missing: b",
    ]
    assert [grade.name for grade in strangers] == ["x.ipynb"]


def test_without_a_list_a_folder_is_a_student():
    grades = [graded("РТ-1/A/b.ipynb"), graded("РТ-1/A/c.ipynb", "c"), graded("B.ipynb")]
    assert [of_folder(one) for one in grades] == [Student("A", "РТ-1", "")] * 2 + [
        Student("B", "", "")
    ]
    persons, strangers = people([*grades, Grade("n.ipynb", "not an exercise notebook")])
    found = [(one.student.name, sorted(one.grades), one.flags) for one in persons]
    assert found == [("B", ["b"], ["missing: c"]), ("A", ["b", "c"], [])]
    assert strangers == []


@pytest.mark.quick
def test_points_are_the_weights_of_the_levels():
    assert possible("b") == sum(WEIGHTS[one.level] for one in sets()["b"].questions)
    assert (
        possible("abc")
        == sum(possible(letter) for letter in "abc")
        == sum(possible("abc", level) for level in WEIGHTS)
    )
    everything = {one.name: PASSED for one in sets()["b"].questions}
    assert points([Grade("x", "graded", "b", marks=everything)], USUAL) == possible("b")
    some = Grade("x", "graded", "b", marks=everything | {"b1": WRONG, "b2": UNUSABLE})
    assert points([some], USUAL) == possible("b") - WEIGHTS["warm-up"] - WEIGHTS["core"]
    assert {one.level for one in sets().values() for one in one.questions} <= set(WEIGHTS)


@pytest.mark.quick
def test_what_a_wrong_answer_is_worth_is_the_teachers_choice():
    """b2 has a third of its results right, b3 is right on top of the wrong b1, b4 both."""
    told = {
        "b1": Comment("no"),
        "b2": Comment("no", share=1 / 3),
        "b3": Comment("no", follows=("b1",)),
    }
    grade = graded("x", **told, b4=Comment("no", share=0.25, follows=("b2",)))
    assert grade.marks["b3"] == WRONG
    for credit, expected in (
        (Credit(0.0, 0.0), 0),
        (Credit(1.0, 0.0), 2 / 3 + 2 / 4),
        (Credit(1.0, 0.5), 2 / 3 + 1 + 1),
        (Credit(0.5, 1.0), 1 / 3 + 2 + 2),
    ):
        assert points([grade], credit) == pytest.approx(expected, abs=0.01)
        assert points([grade], credit, "core") == points([grade], credit)
    (row,) = student_rows([Person(IVANOV, {"b": grade})], "b", Credit(1.0, 0.5))
    assert (row["set b"], row["points"], row["of"]) == (2.67, 2.67, possible("b"))
    assert "0.67/2" in feedback(Person(IVANOV, {"b": grade}), "b", Credit(1.0, 0.5))
    better = replace(grade, name="y", comments=told | {"b2": Comment("no", share=2 / 3)})
    best = people([grade, better], None, Credit(1.0, 0.0))[0]
    assert {one.grades["b"].name for one in best} <= {"x", "y"}
    unusable = replace(grade, marks=dict.fromkeys(grade.marks, UNUSABLE))
    assert points([unusable], Credit(1.0, 1.0)) == 0  # only what is wrong has right parts


@pytest.fixture
def written(tmp_path):
    wrong = {
        "b2": Comment("not right. The `sign`: <b>look</b>", ("innovation-sign",)),
        "b3": Comment("not right."),
    }
    grades = [
        graded("РТ-1/Иванов Иван/b.ipynb", passed=["b1", "b5"], **wrong),
        graded("РТ-1/Петрова Анна/b.ipynb", variant="20", passed=["b1"], b2=wrong["b2"]),
    ]
    persons = write_report(grades, COURSE, tmp_path, "bubblewrap")
    return tmp_path, persons


def table(path):
    return list(csv.DictReader(io.StringIO(path.read_text(encoding="utf-8-sig"))))


def test_a_row_for_each_student_and_question(written):
    folder, _ = written
    rows = table(folder / "students.csv")
    assert [
        (row["name"], row["set b"], row["warm-up"], row["core"], row["stretch"], row["points"])
        for row in rows
    ] == [
        ("Иванов Иван", "4", "1", "0", "3", "4"),
        ("Петрова Анна", "1", "1", "0", "0", "1"),
        ("Иванов Иван", "", "0", "0", "0", "0"),
    ]
    assert {row["of"] for row in rows} == {str(possible("bc"))}
    rows = {row["question"]: row for row in table(folder / "questions.csv")}
    assert [rows["b1"][key] for key in ("right", "wrong", "not done")] == ["2", "0", "1"]
    assert [rows["b2"][key] for key in ("right", "wrong", "mistakes")] == ["0", "2", f"2: {SIGN}"]
    assert len(rows) == len(sets()["b"].questions) + len(sets()["c"].questions)


def test_pages(written):
    folder, _ = written
    page = (folder / "feedback" / "РТ-1" / "Иванов-Иван.html").read_text(encoding="utf-8")
    assert "<b>4</b> of 17 points" in page
    # nothing of a student's becomes HTML
    assert "The <code>sign</code>: &lt;b&gt;look&lt;/b&gt;" in page
    assert "Nothing came back." in page  # of set c
    assert (folder / "feedback" / "РТ-2" / "Иванов-Иван.html").exists()
    page = (folder / "overview.html").read_text(encoding="utf-8")
    links = re.findall(r'href="([^"]+)"', page)
    assert len(links) == 3 and all(link.isascii() for link in links)
    assert "Sandbox: bubblewrap" in page and "2: " + str(markupsafe.escape(SIGN)) in page
    assert "missing: c" in page


def test_the_page_of_a_student_says_nothing_of_others(written):
    _, persons = written
    persons[0].flags.append("set b: the notebook was handed out to Петрова Анна")
    assert "Петрова" not in feedback(persons[0], "b")


def test_an_assignment_comes_back_as_it_was(tmp_path):
    path = tmp_path / "assignment.csv"
    save_assignment(COURSE, path)
    assert read_assignment(path, ["1"]) == COURSE
    path.write_text("name,group,variant\nA,1,53\nB,1,\n", encoding="utf-8")
    with pytest.raises(ValueError, match="line 3: B has no variant"):
        read_assignment(path, ["1"])
    path.write_text("name,group\nA,1\n", encoding="utf-8")
    assert [one.variant for one in read_assignment(path, ["7"])] == ["7"]
