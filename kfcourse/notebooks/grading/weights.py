"""What an answer is worth."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from kfcourse.checks import Question, sets
from kfcourse.checks.question import PASSED

WEIGHTS = {"warm-up": 1, "core": 2, "stretch": 3}  # points of a right answer, by the question's level


def questions(letters: Iterable[str]) -> dict[str, Question]:
    """All questions of some sets, by name."""
    return {question.name: question for letter in letters for question in sets()[letter].questions}


def points(marks: Mapping[str, str], level: str | None = None) -> int:
    """Points of the right answers, of one level or of all."""
    known = questions(sorted({letter for letter in sets() for name in marks if name.startswith(letter)}))
    right = [known[name].level for name, mark in marks.items() if mark == PASSED and name in known]
    return sum(WEIGHTS[one] for one in right if level in (None, one))


def possible(letters: Iterable[str], level: str | None = None) -> int:
    """Points that there are in some sets."""
    return sum(WEIGHTS[one.level] for one in questions(letters).values() if level in (None, one.level))
