"""One result of a wrong answer beside the right one: for the hidden arguments, and for others.

How a result depends on an argument is seen by calling both answers with the argument changed a
little, multiplied, or set to zero.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.exercises.checks.equality import equal
from kfcourse.exercises.checks.question import Answer
from kfcourse.exercises.checks.reference import Posed, given_by, part_of
from kfcourse.limits import OutOfTime

CALLS = 3  # with which dependence on an argument is looked for
FELT = 1e-12  # relative difference of results


@dataclass(frozen=True)
class Case:
    """One result of a wrong answer.

    posed, answer : the question, and the student's function
    results : all that this gave, for every tuple of hidden arguments
    part : the place of this result among them, if there are several
    """

    posed: Posed
    answer: Answer
    results: Sequence[Any]
    part: int | None

    @cached_property
    def answered(self) -> list[Any]:
        return part_of(self.results, self.part)

    @cached_property
    def expected(self) -> list[Any]:
        return part_of(self.posed.expected, self.part)

    @property
    def name(self) -> str:
        """Of the result; none of an only one."""
        return "" if self.part is None else self.posed.question.parts[self.part]

    @cached_property
    def right(self) -> bool:
        return self.given(self.posed.expected)

    def given(self, results: Sequence[Any]) -> bool:
        """Whether this result is that of some results."""
        return self.agree(self.answered, part_of(results, self.part))

    @property
    def numeric(self) -> bool:
        return isinstance(self.expected[0], np.ndarray)

    @property
    def pairs(self) -> list[tuple[Any, Any]]:
        return list(zip(self.answered, self.expected, strict=True))

    @property
    def formulas(self) -> list[list[sp.Expr]]:
        """All formulas of both sides."""
        return [sp.flatten(side) for side in (self.answered, self.expected)]

    @property
    def others(self) -> Iterator[tuple[str, list[Any]]]:
        """The other results that are expected, by name."""
        for place, name in enumerate(self.posed.question.parts):
            if place != self.part:
                yield name, part_of(self.posed.expected, place)

    def agree(self, first: Sequence[Any], second: Sequence[Any]) -> bool:
        return self.posed.agree(first, second)

    def given_by(self, answer: Answer, calls: Sequence[Sequence[Any]]) -> list[Any]:
        """This result of an answer, ours or the student's, for these arguments."""
        return part_of(given_by(answer, calls), self.part)

    def with_changed(self, place: int, change: Callable[[Any], Any]) -> list[list[np.ndarray]]:
        """The student's results and the right ones with one argument changed; none if it cannot
        be."""
        calls = self.posed.arguments[:CALLS]
        try:
            calls = [(*v[:place], change(v[place]), *v[place + 1 :]) for v in calls]
            # not into LAPACK, which complains on the terminal
            with np.errstate(divide="raise", invalid="raise"):
                return [
                    [np.asarray(result, float) for result in self.given_by(answer, calls)]
                    for answer in (self.answer, self.posed.key)
                ]
        except (OutOfTime, KeyboardInterrupt):
            raise
        except BaseException:  # of answers that end the program
            return [[], []]

    def feels(self, place: int) -> list[bool]:
        """Whether the student's result, and the right one, changes with an argument."""
        feels = [False, False]
        for which in range(VARIATIONS):
            sides = self.with_changed(place, partial(varied, which=which))
            for side, before in enumerate((self.answered, self.expected)):
                pairs = zip(sides[side], before, strict=False)
                feels[side] |= any(not equal(new, old, FELT, {}) for new, old in pairs)
        return feels


VARIATIONS = 4


def varied(value: Any, which: int) -> Any:
    """A hidden argument changed in one of several ways, covariances to covariances.

    What is counted or rounded does not feel a small change, a median no factor.

    Raises
    ------
    IndexError, TypeError
        It has not so many changes.
    """
    if isinstance(value, int | np.integer) and not isinstance(value, bool):
        return (value + 1, value + 2, 2 * value + 1)[which]
    factor: Any = np.linspace(1.03, 1.07, np.size(value)).reshape(np.shape(value))
    if np.ndim(value) >= 2 and value.shape[-1] == value.shape[-2]:
        scale = 1.03 + 0.01 * np.arange(value.shape[-1])
        factor = scale[:, None] * scale
    changes: Sequence[Callable[[Any], Any]] = (
        # a factor alone may cancel: a regression on a function is the same
        lambda entry: 1.05 * entry + 0.01 * entry**2 if callable(value) else factor * entry,
        lambda entry: 0.9 * entry,
        lambda entry: 5.0 * entry,
        np.flip,
    )
    return changed(value, changes[which])


def changed(value: Any, change: Callable[[Any], Any]) -> Any:
    """A hidden argument changed: a number, an array, or all that a function returns.

    Raises
    ------
    TypeError
        It is an integer, or nothing of the kind.
    """
    if isinstance(value, float | np.floating) or (
        isinstance(value, np.ndarray) and value.dtype.kind == "f"
    ):
        return change(value)
    if not inspect.isroutine(value):
        raise TypeError("an integer, or nothing that can be changed so")

    def other(*arguments: Any) -> Any:
        result = value(*arguments)
        return tuple(map(change, result)) if isinstance(result, tuple) else change(result)

    other.__dict__.update(getattr(value, "__dict__", {}))  # whether it takes the step
    return other
