"""What comes of a course: tables of students and questions, a page for each student, and an
overview."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import jinja2

from kfcourse.exercises.checks import sets
from kfcourse.exercises.checks.question import MISSING, PASSED, UNUSABLE, WEIGHTS, WRONG
from kfcourse.exercises.derivations.wording import coded
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
    for name, rows in (
        ("students", student_rows(persons, letters, credit)),
        ("questions", question_rows(persons, letters)),
    ):
        write_csv(list(rows[0]) if rows else [], rows, folder / f"{name}.csv")
    pages = feedback_pages(persons)
    for person, page in zip(persons, pages, strict=True):
        (folder / page).parent.mkdir(parents=True, exist_ok=True)
        save(feedback(person, letters, credit), folder / page)
    save(overview(persons, pages, strangers, letters, protection, credit), folder / "overview.html")
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
        student, grades = person.student, person.grades
        came = list(grades.values())
        row: dict[str, Any] = {
            "name": student.name,
            "group": student.group,
            "variant": student.variant,
        }
        row |= {
            f"set {letter}": points([grades[letter]], credit) if letter in grades else ""
            for letter in letters
        }
        row |= {level: points(came, credit, level) for level in WEIGHTS}
        row |= {
            "points": points(came, credit),
            "of": possible(letters),
            "look at": "; ".join(person.flags),
        }
        rows.append(row)
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
        row: dict[str, Any] = {"question": name, "title": question.title, "level": question.level}
        row |= {label: counts[mark] for mark, label in KINDS.items()}
        row |= {
            "in part": sum(0 < result.share < 1 for result in results),
            "follows": sum(bool(result.follows) for result in results),
        }
        rows.append(
            row | {"mistakes": "; ".join(f"{count}: {mistake}" for mistake, count in mistakes)}
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
        got = points([grade] if grade else [], credit)
        parts.append((sets()[letter], grade, rows, got, possible([letter])))
    came = list(person.grades.values())
    return _page(
        "feedback",
        person=person,
        sets=parts,
        levels=[
            (level, points(came, credit, level), possible(letters, level)) for level in WEIGHTS
        ],
        signs=SIGNS,
        weights=WEIGHTS,
        points=points(came, credit),
        of=possible(letters),
    )


def overview(
    persons: Sequence[Person],
    pages: Sequence[Path],
    strangers: Sequence[Grade],
    letters: Sequence[str],
    protection: str,
    credit: Credit = USUAL,
) -> str:
    """The lecturer's page: students with what to look at, who has the same code, questions with
    their mistakes."""
    rows = zip(
        student_rows(persons, letters, credit), (page.as_posix() for page in pages), strict=True
    )
    return _page(
        "overview",
        students=sorted(rows, key=lambda row: (row[0]["group"], row[0]["name"])),
        persons=persons,
        same=same_code(persons),
        strangers=strangers,
        letters=letters,
        questions=question_rows(persons, letters),
        kinds=list(KINDS.values()),
        weights=WEIGHTS,
        credit=credit,
        protection=protection,
    )


def _page(name: str, **values: Any) -> str:
    loader = jinja2.PackageLoader("kfcourse.exercises.notebooks")
    environment = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True)
    environment.filters["coded"] = coded
    return environment.get_template(f"{name}.html.j2").render(**values)
