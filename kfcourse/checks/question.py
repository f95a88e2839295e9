"""What a question is: its key, its known mistakes, its hidden arguments; and what a check says of an answer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

ROUNDING = 1e-9  # relative difference of numbers that rounding alone explains

PASSED, WRONG, UNUSABLE, MISSING = "passed", "wrong", "unusable", "not implemented"
MIME = "application/vnd.kfcourse.check+json"

Answer = Callable[..., Any]


@dataclass(frozen=True)
class Mistake:
    """A known wrong answer.

    Attributes
    ----------
    name : str
        Such as "noise-forgotten"; for tests and the instructor's table.
    says : str
        What the student reads: the kind of mistake, not the answer.
    answer : callable
        Exercise -> the wrong answer (a function, as the student's).
    """

    name: str
    says: str
    answer: Callable[[Any], Answer]


def catalogue(rows: Sequence[tuple[str, str, Answer]]) -> tuple[Mistake, ...]:
    """Mistakes whose wrong answer is the same function for every exercise: rows of name, says, answer."""

    def always(wrong: Answer) -> Callable[[Any], Answer]:
        return lambda _: wrong

    return tuple(Mistake(name, says, always(wrong)) for name, says, wrong in rows)


@dataclass(frozen=True)
class Question:
    """A question of an exercise set.

    Attributes
    ----------
    name : str
        Set and number: "a1".
    title : str
    level : {"warm-up", "core", "stretch"}
    answer : callable
        Exercise -> the right answer, a function.
    arguments : callable
        Exercise -> list of argument tuples with which every answer is called: symbols, or numbers from hidden seeds.
    mistakes : tuple of Mistake
    parts : tuple of str
        Names of the results, if the answer returns several; each is then diagnosed by itself.
    tolerance : float
        Relative difference of numbers that still counts as equal.
    """

    name: str
    title: str
    level: str
    answer: Callable[[Any], Answer]
    arguments: Callable[[Any], Sequence[tuple]]
    mistakes: tuple[Mistake, ...] = ()
    parts: tuple[str, ...] = ()
    tolerance: float = ROUNDING


@dataclass(frozen=True)
class Result:
    """Outcome of a check; shows itself as a line of text.

    Attributes
    ----------
    question, title : str
    status : {"passed", "wrong", "unusable", "not implemented"}
    message : str
    diagnosis : tuple of str
        Names of the mistakes it looks like.
    """

    question: str
    title: str
    status: str
    message: str
    diagnosis: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        return self.status == PASSED

    def __repr__(self) -> str:
        return f"{'✓' if self.passed else '✗'} {self.question} {self.title}: {self.message}"

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, Any]:
        data = {"question": self.question, "status": self.status, "diagnosis": list(self.diagnosis), "message": self.message}
        return {"text/plain": repr(self), MIME: data}
