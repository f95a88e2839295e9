"""How a result depends on the arguments: of the right answer and of a student's, compared by their
values.

An argument is changed a little, multiplied, or set to zero, and both answers are called with it.
"""

from __future__ import annotations

import copy
import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
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

    @cached_property
    def _table(self) -> list[tuple[str, list[bool], list[bool]]]:
        rows = []
        for place, name in enumerate(self.names):
            seen = [
                row
                for which in range(min(CALLS, len(self.arguments)))
                for row in self._changes(place, which)
            ]
            if seen:
                right, mine = (
                    [any(column) for column in zip(*side, strict=True)]
                    for side in zip(*seen, strict=True)
                )
                rows.append((name, right, mine))
        return rows

    def _changes(self, place: int, which: int) -> list[tuple[list[bool], list[bool]]]:
        """Which parts change, of the right answer and of the student's, for each change of an
        argument that both take."""
        arguments, found = self.arguments[which], []
        for other in nudged(arguments[place]):
            values = [*arguments[:place], other, *arguments[place + 1 :]]
            try:
                right, mine = (
                    [
                        not same(a, b)
                        for a, b in zip(self._parts(answer, values), before, strict=True)
                    ]
                    for answer, before in zip(self.answers, self.results[which], strict=True)
                )
            except (OutOfTime, KeyboardInterrupt):
                raise
            # the answer does not work for such an argument, or ends the program
            except BaseException:
                continue
            found.append((right, mine))
        return found

    def _parts(self, answer: Callable, values: Sequence[Any]) -> list[Any]:
        result = answer(*copy.deepcopy(values))
        return list(result) if self.several else [result]

    def called(self, place: int, change: Callable[[Any], Any]) -> list[tuple[list[Any], list[Any]]]:
        """Parts of the right result and of the student's for each call, with the argument changed;
        none if it cannot be."""
        found = []
        for arguments in self.arguments[:CALLS]:
            try:
                other = change(arguments[place])
                values = [*arguments[:place], other, *arguments[place + 1 :]]
                # not into LAPACK, which complains on the terminal
                with np.errstate(divide="raise", invalid="raise"):
                    right, mine = (
                        [np.asarray(part, float) for part in self._parts(one, values)]
                        for one in self.answers
                    )
            except (OutOfTime, KeyboardInterrupt):
                raise
            except BaseException:  # as above
                return []
            found.append((right, mine))
        return found

    def unused(self, part: int) -> list[str]:
        """Arguments that the part should depend on and does not."""
        found = [name for name, right, mine in self._table if right[part] and not mine[part]]
        return [name for name in found if name not in self.spare and not self._jumps(name, part)]

    def _jumps(self, name: str, part: int) -> bool:
        """Whether the student's answer changes if an argument is five times as large, or reversed.

        What is counted or rounded does not feel a small change, a median no factor; they depend on
        the argument all the same.
        """
        place = list(self.names).index(name)
        found = [
            self.called(place, lambda value: scaled(value, 5.0)),
            self.called(place, lambda value: changed(value, np.flip)),
        ]
        return any(
            not same(mine[part], before[part])
            for called in found
            for (_, mine), (_, before) in zip(called, self.results, strict=False)
        )


def names_of(answer: Callable, count: int) -> list[str]:
    """Names of the arguments."""
    try:
        names = list(inspect.signature(answer).parameters)
    except (TypeError, ValueError):
        names = []
    return names if len(names) == count else [f"number {place}" for place in range(1, count + 1)]


def nudged(value: Any) -> list[Any]:
    """A hidden argument changed a little, covariances to covariances; nothing if it cannot be
    changed so."""
    if isinstance(value, int | np.integer):
        return (
            []
            if isinstance(value, bool)
            else [value + 1, value + 2, value + 3, 2 * value + 1, 3 * value + 2]
        )
    if isinstance(value, float | np.floating):
        return [value * factor for factor in (1.05, 0.9)]
    if isinstance(value, np.ndarray) and value.dtype.kind == "f":
        if value.ndim >= 2 and value.shape[-1] == value.shape[-2]:
            scale = 1.03 + 0.01 * np.arange(value.shape[-1])
            return [scale[:, None] * value * scale]
        return [value * np.linspace(1.03, 1.07, value.size).reshape(value.shape)]
    if inspect.isroutine(value):

        def changed(*arguments: Any) -> Any:
            result = value(*arguments)
            # a factor alone may cancel: a regression on it is the same; entry by entry the square
            # of a covariance is one
            several = isinstance(result, tuple)
            return (
                tuple(1.05 * part + 0.01 * part**2 for part in result)
                if several
                else 1.05 * result + 0.01 * result**2
            )

        changed.__dict__.update(getattr(value, "__dict__", {}))  # whether it takes the step
        return [changed]
    return []


def same(first: Any, second: Any) -> bool:
    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    return a.shape == b.shape and bool(
        np.allclose(a, b, rtol=1e-12, atol=1e-12 * np.max(np.abs(b), initial=0.0), equal_nan=True)
    )


def scaled(value: Any, factor: float) -> Any:
    """A hidden argument times a factor: a number, an array, or a function with such results."""
    return changed(value, lambda one: factor * one)


def changed(value: Any, change: Callable[[Any], Any], which: int | None = None) -> Any:
    """A hidden argument changed: a number, an array, or what a function returns, all of it or one
    of several results.

    Raises
    ------
    TypeError
        It is an integer, or nothing of the kind.
    IndexError
        There is no such result.
    """
    if isinstance(value, float | np.floating) or (
        isinstance(value, np.ndarray) and value.dtype.kind == "f"
    ):
        return change(value)
    if not inspect.isroutine(value):
        raise TypeError("an integer, or nothing that can be changed so")

    def other(*arguments: Any) -> Any:
        result = value(*arguments)
        if which is not None and which >= (len(result) if isinstance(result, tuple) else 1):
            raise IndexError(which)
        if not isinstance(result, tuple):
            return change(result)
        return tuple(
            change(part) if which in (None, place) else part for place, part in enumerate(result)
        )

    other.__dict__.update(getattr(value, "__dict__", {}))  # whether it takes the step
    return other
