"""How a result depends on the arguments: of the right answer and of a student's, compared by their
values.

An argument is changed a little, multiplied, or set to zero, and both answers are called with it.
"""

from __future__ import annotations

import copy
import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from kfcourse.limits import OutOfTime

CALLS = 3  # with which dependence on an argument is looked for


@dataclass(frozen=True)
class Sensitivity:
    """Which results depend on which argument: of the right answer, and of the student's.

    By value: an argument counts as used if the result changes with it in one of the calls, for one
    of its changes.

    answers : (right, student's)
    arguments : hidden arguments, a tuple a call
    results : what both give for each call, each as a list of parts
    several : whether answers have several results
    spare : arguments that follow from the others: a right answer may depend on them or not
    """

    names: Sequence[str]
    answers: tuple[Callable, Callable]
    arguments: Sequence[tuple]
    results: Sequence[tuple[list[Any], ...]]
    several: bool
    spare: Sequence[str] = ()

    def _parts(self, answer: Callable, values: Sequence[Any]) -> list[Any]:
        result = answer(*copy.deepcopy(values))
        return list(result) if self.several else [result]

    def called(self, place: int, change: Callable[[Any], Any]) -> list[tuple[list[Any], list[Any]]]:
        """Parts of the right result and of the student's for each call, with the argument changed;
        none if it cannot be."""
        pairs = []
        for arguments in self.arguments[:CALLS]:
            try:
                other = change(arguments[place])
                values = [*arguments[:place], other, *arguments[place + 1 :]]
                # not into LAPACK, which complains on the terminal
                with np.errstate(divide="raise", invalid="raise"):
                    right, mine = (
                        [np.asarray(part, float) for part in self._parts(answer, values)]
                        for answer in self.answers
                    )
            except (OutOfTime, KeyboardInterrupt):
                raise
            except BaseException:  # as above
                return []
            pairs.append((right, mine))
        return pairs

    def unused(self, part: int) -> list[str]:
        """Arguments that the part should depend on and does not."""
        return [
            name
            for place, name in enumerate(self.names)
            if name not in self.spare and self._moves(place, part) == (True, False)
        ]

    def _moves(self, place: int, part: int) -> tuple[bool, ...]:
        """Whether the right part, and the student's, changes with one of the changes of an
        argument."""
        return tuple(
            any(not same(new[side][part], old[side][part]) for new, old in self._changed[place])
            for side in (0, 1)
        )

    @cached_property
    def _changed(self) -> list[list[tuple[Sequence[list[Any]], Sequence[list[Any]]]]]:
        """For each argument what both give with changes of it that both take, and gave without."""
        return [
            [
                pair
                for change in CHANGES
                for pair in zip(self.called(place, change), self.results, strict=False)
            ]
            for place in range(len(self.names))
        ]


def names_of(answer: Callable, count: int) -> list[str]:
    """Names of the arguments."""
    try:
        names = list(inspect.signature(answer).parameters)
    except (TypeError, ValueError):
        names = []
    return names if len(names) == count else [f"number {place}" for place in range(1, count + 1)]


def nudged(value: Any, which: int) -> Any:
    """A hidden argument changed a little, covariances to covariances.

    Raises
    ------
    IndexError
        It has not so many changes.
    """
    if isinstance(value, int | np.integer) and not isinstance(value, bool):
        return [value + 1, value + 2, value + 3, 2 * value + 1, 3 * value + 2][which]
    if callable(value):  # a factor alone may cancel: a regression on it is the same
        return changed(value, [lambda entry: 1.05 * entry + 0.01 * entry**2][which])
    factor: Any = [np.linspace(1.03, 1.07, np.size(value)).reshape(np.shape(value)), 0.9][which]
    if np.ndim(value) >= 2 and value.shape[-1] == value.shape[-2]:
        scale = 1.03 + 0.01 * np.arange(value.shape[-1])
        factor = scale[:, None] * scale
    return changed(value, lambda entry: entry * factor)


def same(first: Any, second: Any) -> bool:
    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    return a.shape == b.shape and bool(
        np.allclose(a, b, rtol=1e-12, atol=1e-12 * np.max(np.abs(b), initial=0.0), equal_nan=True)
    )


def scaled(value: Any, factor: float) -> Any:
    """A hidden argument times a factor: a number, an array, or a function with such results."""
    return changed(value, lambda entry: factor * entry)


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


# What is counted or rounded does not feel a small change, a median no factor.
CHANGES: Sequence[Callable[[Any], Any]] = (
    *(partial(nudged, which=which) for which in range(5)),
    partial(scaled, factor=5.0),
    partial(changed, change=np.flip),
)
