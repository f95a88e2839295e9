"""What an answer is worth."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from kfcourse.exercises.checks import Question, sets
from kfcourse.exercises.checks.question import PASSED, WEIGHTS, WRONG
from kfcourse.exercises.grading.results import Grade


@dataclass(frozen=True)
class Credit:
    """What a wrong answer is worth, as a share of the right one's points: the teacher's choice.

    Attributes
    ----------
    parts : float
        If all its results were right; it gets as much of that as it has right results.
    follow_on : float
        If it is right on top of the student's own wrong answer to an earlier question.
    """

    parts: float = 0.5
    follow_on: float = 0.0

    def share(self, grade: Grade, question: str) -> float:
        """Of the question's points."""
        mark, comment = grade.marks.get(question), grade.comments.get(question)
        if mark != WRONG or comment is None:
            return float(mark == PASSED)
        return max(self.parts * comment.share, self.follow_on * bool(comment.follows))


USUAL = Credit()


def questions(letters: Iterable[str]) -> dict[str, Question]:
    """All questions of some sets, by name."""
    return {question.name: question for letter in letters for question in sets()[letter].questions}


def worth(grade: Grade | None, question: Question, credit: Credit) -> float:
    """Points of an answer, to hundredths; none of a notebook that did not come."""
    return round(WEIGHTS[question.level] * credit.share(grade, question.name), 2) if grade else 0.0


def points(grades: Iterable[Grade], credit: Credit, level: str | None = None) -> float:
    """Points of all answers, those of one level or of all; whole ones without decimals."""
    asked = [
        (grade, question)
        for grade in grades
        if grade.letter in sets()
        for question in sets()[grade.letter].questions
    ]
    return tidy(
        sum(
            worth(grade, question, credit)
            for grade, question in asked
            if level in (None, question.level)
        )
    )


def tidy(number: float) -> float:
    """A number of points as it is printed: 3, not 3.0."""
    rounded = round(number, 2)
    return int(rounded) if rounded == int(rounded) else rounded


def possible(letters: Iterable[str], level: str | None = None) -> int:
    """Points that there are in some sets."""
    return sum(
        WEIGHTS[question.level]
        for question in questions(letters).values()
        if level in (None, question.level)
    )
