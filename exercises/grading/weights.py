"""What an answer is worth."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from kfcourse.exercises.checks import Question, Result, sets
from kfcourse.exercises.checks.question import WEIGHTS, WRONG
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

    def share(self, result: Result) -> float:
        """Of the question's points."""
        if result.status != WRONG:
            return float(result.passed)
        return max(self.parts * result.share, self.follow_on * bool(result.follows))


USUAL = Credit()


def questions(letters: Iterable[str]) -> dict[str, Question]:
    """All questions of some sets, by name."""
    return {question.name: question for letter in letters for question in sets()[letter].questions}


def worth(grade: Grade, question: Question, credit: Credit) -> float:
    """Points of an answer."""
    return tidy(WEIGHTS[question.level] * credit.share(grade.results[question.name]))


def points(grades: Iterable[Grade], credit: Credit, level: str | None = None) -> float:
    """Points of all answers, those of one level or of all."""
    return tidy(
        sum(
            worth(grade, question, credit)
            for grade in grades
            for question in sets()[grade.letter].questions
            if level in (None, question.level)
        )
    )


def tidy(number: float) -> float:
    """A number of points as it is printed, to hundredths: 3, not 3.0."""
    rounded = round(number, 2)
    return int(rounded) if rounded == int(rounded) else rounded


def possible(letters: Iterable[str], level: str | None = None) -> int:
    """Points that there are in some sets."""
    return sum(
        WEIGHTS[question.level]
        for question in questions(letters).values()
        if level in (None, question.level)
    )
