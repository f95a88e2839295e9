"""Whose notebook is it?  And what a lecturer should look at: another variant, missing work, the
same code twice."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import PurePosixPath

from kfcourse.exercises.checks import sets
from kfcourse.exercises.checks.question import MISSING
from kfcourse.exercises.grading.results import NOT_RUN, OTHER, Grade
from kfcourse.exercises.grading.weights import USUAL, Credit, points
from kfcourse.exercises.notebooks.course_list import Student


@dataclass
class Person:
    """A student, and what came back.

    Attributes
    ----------
    student : Student
    grades : dict
        Letter of a set to the notebook that counts.
    flags : list of str
        What to look at.
    failed : list of Grade
        Notebooks that could not be graded.
    """

    student: Student
    grades: dict[str, Grade] = field(default_factory=dict)
    flags: list[str] = field(default_factory=list)
    failed: list[Grade] = field(default_factory=list)


def words(text: str) -> list[str]:
    """Words of a name or path in small letters; how they are written apart does not matter."""
    return re.sub(r"[\W_]+", " ", unicodedata.normalize("NFC", text)).casefold().split()


def owner(path: str, whom: object, students: Iterable[Student]) -> Student | None:
    """Whose notebook it is: by the names in its path, else by `whom` it was handed out to; None if
    that is not clear.

    A student is found in a folder or file that has all words of the name, in any order:
    `group/Name`, or the folders of a
    learning platform.  Of several, those whose group is in the path go first, then those with the
    longest names.
    """
    parts = [set(words(part)) for part in PurePosixPath(path).with_suffix("").parts]
    everything = set().union(*parts)
    named = [
        student for student in students if any(set(words(student.name)) <= part for part in parts)
    ]
    if not named:
        named = [student for student in students if whom == f"{student.name}, {student.group}"]

    def rank(student: Student) -> tuple[bool, int]:
        return set(words(student.group)) <= everything, len(words(student.name))

    best = [student for student in named if rank(student) == max(map(rank, named))]
    return best[0] if len(best) == 1 else None


def of_folder(grade: Grade) -> Student:
    """Whose notebook it is where there is no list: a folder is a student, or a file beside no
    other."""
    path = PurePosixPath(grade.name)
    if not path.parent.name:
        return Student(path.stem, "", "")
    group = path.parent.parent.as_posix()
    return Student(path.parent.name, "" if group == "." else group, "")


def people(
    grades: Sequence[Grade], students: Sequence[Student] | None = None, credit: Credit = USUAL
) -> tuple[list[Person], list[Grade]]:
    """Every student with the notebooks that came back, and the notebooks that belong to nobody.

    `students` is the course list; without it every folder is a student.  Of several notebooks of a
    set the one counts that is worth most by the `credit`.
    """
    persons = {student: Person(student) for student in students or ()}
    strangers = []
    for grade in sorted(grades, key=lambda grade: grade.name):
        if grade.status == OTHER:
            continue
        whose = of_folder(grade) if students is None else owner(grade.name, grade.student, students)
        if whose is None:
            strangers.append(grade)
        else:
            _hand_in(persons.setdefault(whose, Person(whose)), grade, credit)
    everything = {letter for person in persons.values() for letter in person.grades}
    for person in persons.values():
        missing = [
            letter
            for letter in person.student.sets.split() or sorted(everything)
            if letter not in person.grades
        ]
        if missing:
            person.flags.append(f"missing: {', '.join(missing)}")
    return list(persons.values()), strangers


def _hand_in(person: Person, grade: Grade, credit: Credit) -> None:
    student = person.student
    if not grade.marks:
        person.failed.append(grade)
        person.flags.append(f"{grade.name}: not graded: {grade.note}")
        return
    if grade.student and grade.student != f"{student.name}, {student.group}" and student.variant:
        person.flags.append(f"set {grade.letter}: the notebook was handed out to {grade.student}")
    if not grade.work and {*grade.marks.values()} <= {MISSING, NOT_RUN}:
        person.flags.append(f"set {grade.letter}: came back empty")
    gone = [note for note in grade.notes if note.startswith("the cell of")]
    person.flags += [f"set {grade.letter}: {look}" for look in (*gone, *grade.looks)]
    other = person.grades.get(grade.letter)
    if other is not None:
        person.flags.append(f"set {grade.letter}: came back more than once, the best counts")
    if other is None or points([grade], credit) > points([other], credit):
        person.grades[grade.letter] = grade


def same_code(persons: Iterable[Person]) -> list[tuple[str, list[str]]]:
    """Groups of students whose code differs in nothing but comments and spaces: the set, and their
    names."""
    groups: dict[tuple[str, str], list[str]] = {}
    for person in persons:
        for letter, grade in person.grades.items():
            if grade.work:
                groups.setdefault((letter, grade.work), []).append(person.student.name)
    return [(letter, names) for (letter, _), names in sorted(groups.items()) if len(names) > 1]


def known_sets(persons: Iterable[Person]) -> list[str]:
    """Letters of the sets that came back, or should have."""
    back = {
        letter for person in persons for letter in (*person.grades, *person.student.sets.split())
    }
    return [letter for letter in sets() if letter in back]
