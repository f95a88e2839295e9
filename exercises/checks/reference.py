"""A question as it is posed in an exercise: its hidden arguments, and what our own answers give."""

from __future__ import annotations

import copy
import inspect
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy as sp

from kfcourse.exercises.checks.equality import equal, like
from kfcourse.exercises.checks.question import Answer, Mistake, Question

if TYPE_CHECKING:
    from kfcourse.exercises.checks.exercises import Exercise


@dataclass(frozen=True)
class Posed:
    """What is asked, and what our own answers give."""

    question: Question
    exercise: Exercise

    @cached_property
    def arguments(self) -> list[tuple]:
        return list(self.question.arguments(self.exercise))

    @cached_property
    def key(self) -> Answer:
        return self.question.answer(self.exercise)

    @cached_property
    def names(self) -> list[str]:
        """What the arguments are called."""
        return list(inspect.signature(self.key).parameters)

    @cached_property
    def expected(self) -> list[Any]:
        return [standard(result) for result in given_by(self.key, self.arguments)]

    @cached_property
    def known(self) -> list[tuple[Mistake, list[Any]]]:
        """Mistakes with their results, as far as the variant allows them."""
        known = []
        for mistake in self.question.mistakes:
            # of shapes, mostly; a test makes sure that each is known where it is possible
            with suppress(Exception):
                known.append((mistake, self.in_form(mistake.answer(self.exercise))))
        return known

    @cached_property
    def given(self) -> set[str]:
        """Names of the symbols that an answer is called with."""
        return symbols(value for values in self.arguments for value in values)

    @cached_property
    def values(self) -> dict[sp.Symbol, Any]:
        """Of the parameters: of the model's symbols that are no arguments of the answer."""
        values = self.exercise.model.values
        return {s: value for s, value in values.items() if s.name not in self.given}

    def in_form(self, answer: Answer) -> list[Any]:
        """What an answer gives for the hidden arguments, in the form of what is expected."""
        results = given_by(answer, self.arguments)
        return [like(result, wanted) for result, wanted in zip(results, self.expected, strict=True)]

    def agree(self, first: Sequence[Any], second: Sequence[Any]) -> bool:
        """Whether results are equal, call by call."""
        tolerance, places = self.question.tolerance, self.exercise.places
        return all(
            equal(a, b, tolerance, self.values, places) for a, b in zip(first, second, strict=True)
        )


def posed(question: Question, exercise: Exercise) -> Posed:
    """The question as it is posed in an exercise, which keeps it: answers are compared with the
    same again and again."""
    return exercise.posed.setdefault(question, Posed(question, exercise))


def given_by(answer: Answer, calls: Iterable[Sequence[Any]]) -> list[Any]:
    """What an answer gives for copies of these arguments."""
    return [answer(*copy.deepcopy(values)) for values in calls]


def standard(value: Any) -> Any:
    """A result in the form in which results are compared: formulas, arrays of floats, texts, and
    tuples of them."""
    if isinstance(value, tuple | list):
        return tuple(standard(part) for part in value)
    if isinstance(value, sp.Basic | sp.MatrixBase | str):
        return value
    return np.asarray(value, dtype=float)


def part_of(results: Sequence[Any], place: int | None) -> list[Any]:
    """One result of each call; all there is, if there is one only."""
    return list(results) if place is None else [result[place] for result in results]


def symbols(values: Iterable[Any]) -> set[str]:
    """Names of the symbols in formulas; none in anything else."""
    return {s.name for value in values for s in getattr(value, "free_symbols", ())}
