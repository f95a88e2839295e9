"""What a question is: its key, its known mistakes, its hidden arguments; and what a check says of
an answer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from kfcourse.exercises.checks.exercises import Exercise

ROUNDING = 1e-9  # relative difference of numbers that rounding alone explains

PASSED, WRONG, UNUSABLE, MISSING = "passed", "wrong", "unusable", "not implemented"
NOT_CHECKED = "not checked"  # the check itself failed: no fault of the answer
# Points of a right answer, by the question's level.
WEIGHTS = {"warm-up": 1, "core": 2, "stretch": 3}
MIME = "application/vnd.kfcourse.check+json"

Answer = Callable[..., Any]


class ForVariant(NamedTuple):
    """An answer that is another function for every variant: Exercise -> function.

    `name` is that of the student's function, if it is a key; `step` the answer made of earlier
    answers, which it calls.
    """

    make: Callable[[Exercise], Answer]
    name: str = ""
    step: Answer | None = None


def answer_for(exercise: Exercise, answer: Answer | ForVariant) -> Answer:
    """The function itself."""
    return answer.make(exercise) if isinstance(answer, ForVariant) else answer


@dataclass(frozen=True)
class Mistake:
    """A known wrong answer.

    Attributes
    ----------
    name : str
        Such as "noise-forgotten"; for tests.
    says : str
        What the student reads: the kind of mistake, not the answer.
    wrong : callable or ForVariant
        The wrong answer, a function as the student's.
    """

    name: str
    says: str
    wrong: Answer | ForVariant

    def answer(self, exercise: Exercise) -> Answer:
        """The wrong answer for an exercise."""
        return answer_for(exercise, self.wrong)


@dataclass(frozen=True)
class Question:
    """A question of an exercise set.

    Attributes
    ----------
    name : str
        Set and number: "a1".
    title : str
        As the statement prints it.
    level : {"warm-up", "core", "stretch"}
    key : callable or ForVariant
        The right answer: a function with the name and the arguments of the student's.
    arguments : callable
        Exercise -> list of argument tuples with which every answer is called: symbols, or numbers
        from hidden seeds.
    mistakes : tuple of Mistake
    parts : tuple of str
        Names of the results, if the answer returns several; each is then diagnosed by itself.
    tolerance : float
        Relative difference of numbers that still counts as equal.
    advice : str
        Said when the same wrong answer comes again: where to look, never the answer.
    axes : tuple of str
        What the leading axes of the results are, ("step", "trajectory"); of arguments of such a
        shape, too.
    spare : tuple of str
        Arguments of the key that follow from the others, as Q does from Psi = A p A^T + Q: an
        answer may do without one.
    """

    name: str
    title: str
    level: str
    key: Answer | ForVariant
    arguments: Callable[[Exercise], Sequence[tuple]]
    mistakes: tuple[Mistake, ...] = ()
    parts: tuple[str, ...] = ()
    tolerance: float = ROUNDING
    advice: str = ""
    axes: tuple[str, ...] = ()
    spare: tuple[str, ...] = ()

    @property
    def function(self) -> str:
        """Name of the function that the student writes."""
        return self.key.name if isinstance(self.key, ForVariant) else self.key.__name__

    def answer(self, exercise: Exercise) -> Answer:
        """The right answer for an exercise."""
        return answer_for(exercise, self.key)

    def result(self, status: str, message: str, **more: Any) -> Result:
        """What a check says of an answer to it."""
        return Result(self.name, self.title, status, message, **more)


@dataclass
class Attempts:
    """What a notebook has handed in so far.

    Attributes
    ----------
    wrong : dict
        Answers that are wrong, by question: later ones may stand on them.
    given : dict
        What the last wrong answer to a question gave, and how many times in a row.
    """

    wrong: dict[str, Answer] = field(default_factory=dict)
    given: dict[str, tuple[Any, int]] = field(default_factory=dict)


@dataclass(frozen=True)
class Result:
    """Outcome of a check; shows itself as a line of text.

    Attributes
    ----------
    question, title : str
    status : {"passed", "wrong", "unusable", "not implemented", "not checked"}
        Not checked: the check failed in itself.
    message : str
    diagnosis : tuple of str
        Names of the mistakes it looks like.
    share : float
        Of the results that are right, from 0 to 1; a wrong answer may have right parts.
    follows : tuple of str
        Earlier questions whose answers are wrong, if this step is right on top of them.
    trouble : str
        For the teacher: how the check, or its search for a hint, failed in itself.
    """

    question: str
    title: str
    status: str
    message: str
    diagnosis: tuple[str, ...] = ()
    share: float = 0.0
    follows: tuple[str, ...] = ()
    trouble: str = ""

    @property
    def passed(self) -> bool:
        return self.status == PASSED

    def __repr__(self) -> str:
        return f"{'✓' if self.passed else '✗'} {self.question} {self.title}: {self.message}"

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, Any]:
        data = {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in vars(self).items()
            if name != "title" and (value or name != "trouble")
        }
        return {"text/plain": repr(self), MIME: data}
