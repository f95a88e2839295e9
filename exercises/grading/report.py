"""What comes of a course: tables of students and questions, a page for each student, and an
overview."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from kfcourse.exercises.checks import sets
from kfcourse.exercises.checks.question import MISSING, PASSED, UNUSABLE, WEIGHTS, WRONG
from kfcourse.exercises.grading.owners import Person, known_sets, people, same_code
from kfcourse.exercises.grading.results import (
    NOT_GRADED,
    NOT_RUN,
    SIGNS,
    Grade,
    in_words,
)
from kfcourse.exercises.grading.weights import (
    USUAL,
    Credit,
    points,
    possible,
    questions,
    worth,
)
from kfcourse.exercises.notebooks.course_list import Student
from kfcourse.exercises.notebooks.texts import page as written
from kfcourse.exercises.notebooks.texts import write_csv
from kfcourse.files import save

KINDS = {
    PASSED: "right",
    WRONG: "wrong",
    UNUSABLE: "not usable",
    MISSING: "not done",
    NOT_GRADED: "not graded",
}


def write_report(
    grades: Sequence[Grade],
    students: Sequence[Student] | None,
    folder: Path,
    protection: str,
    credit: Credit = USUAL,
) -> list[Person]:
    """Write students.csv, questions.csv, overview.html and feedback/<group>/<name>.html.

    Parameters
    ----------
    grades : sequence of Grade
    students : sequence of Student or None
        The course list; without it every folder is a student.
    folder : Path
    protection : str
        What kept the notebooks from doing harm.
    credit : Credit
        What wrong answers are worth.

    Returns
    -------
    list of Person
    """
    persons, strangers = people(grades, students, credit)
    letters = known_sets(persons)
    folder.mkdir(parents=True, exist_ok=True)
    students_rows = student_rows(persons, letters, credit)
    questions_rows = question_rows(persons, letters)
    for name, rows in (("students", students_rows), ("questions", questions_rows)):
        write_csv(list(rows[0]) if rows else [], rows, folder / f"{name}.csv")
    pages = feedback_pages(persons)
    for person, page in zip(persons, pages, strict=True):
        (folder / page).parent.mkdir(parents=True, exist_ok=True)
        save(feedback(person, letters, credit), folder / page)
    linked = zip(students_rows, (page.as_posix() for page in pages), strict=True)
    overview = written(
        "overview",
        students=sorted(linked, key=lambda row: (row[0]["group"], row[0]["name"])),
        persons=persons,
        same=same_code(persons),
        strangers=strangers,
        letters=letters,
        questions=questions_rows,
        kinds=list(KINDS.values()),
        weights=WEIGHTS,
        credit=credit,
        protection=protection,
    )
    save(overview, folder / "overview.html")
    return persons


def feedback_pages(persons: Iterable[Person]) -> list[Path]:
    """A page for each person in the folder of the report; names that differ in signs alone get
    numbers."""
    pages: dict[str, Path] = {}
    for person in persons:
        page, number = Path("feedback", person.student.folder), 1
        while str(page).casefold() in pages:
            number += 1
            page = Path("feedback", f"{person.student.folder}-{number}")
        pages[str(page).casefold()] = page.with_name(f"{page.name}.html")
    return list(pages.values())


def student_rows(
    persons: Iterable[Person], letters: Sequence[str], credit: Credit = USUAL
) -> list[dict[str, Any]]:
    """A row for each student: points of each set, of each level, and in all; what to look at."""
    rows = []
    for person in persons:
        name, group, variant, _ = person.student
        row: dict[str, Any] = {"name": name, "group": group, "variant": variant}
        for letter in letters:
            back = letter in person.grades
            row[f"set {letter}"] = points([person.grades[letter]], credit) if back else ""
        for level in WEIGHTS:
            row[level] = points(person.grades.values(), credit, level)
        row["points"] = points(person.grades.values(), credit)
        rows.append(row | {"of": possible(letters), "look at": "; ".join(person.flags)})
    return rows


def question_rows(persons: Sequence[Person], letters: Sequence[str]) -> list[dict[str, Any]]:
    """A row for each question: how many were right, wrong, not usable, not done; the mistakes,
    commonest first."""
    rows = []
    for name, question in questions(letters).items():
        grades = (grade for person in persons for grade in person.grades.values())
        results = [grade.results[name] for grade in grades if name in grade.results]
        counts = Counter(result.status for result in results)
        counts[MISSING] += counts[NOT_RUN] + len(persons) - len(results)
        mistakes = Counter(
            in_words(question, mistake) for result in results for mistake in result.diagnosis
        ).most_common()
        rows.append(
            {"question": name, "title": question.title, "level": question.level}
            | {label: counts[mark] for mark, label in KINDS.items()}
            | {
                "in part": sum(0 < result.share < 1 for result in results),
                "follows": sum(bool(result.follows) for result in results),
                "mistakes": "; ".join(f"{count}: {mistake}" for mistake, count in mistakes),
            }
        )
    return rows


def feedback(person: Person, letters: Sequence[str], credit: Credit = USUAL) -> str:
    """The page of a student: every question with its mark, points, and what the check says; no
    solutions."""
    parts = []
    for letter in letters:
        grade = person.grades.get(letter)
        rows = grade and [
            (question, grade.results[question.name], worth(grade, question, credit))
            for question in sets()[letter].questions
        ]
        parts.append((sets()[letter], grade, rows, possible([letter])))
    (row,) = student_rows([person], letters, credit)
    return written(
        "feedback",
        person=person,
        sets=parts,
        row=row,
        levels=[(level, row[level], possible(letters, level)) for level in WEIGHTS],
        signs=SIGNS,
        weights=WEIGHTS,
    )
