"""What kind of mistake does a wrong answer look like?  A known one of all of its results, or of
one; or what a hint says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.exercises.checks.dependence import Sensitivity, names_of
from kfcourse.exercises.checks.failing import shown
from kfcourse.exercises.checks.hints import Agree, Case, general
from kfcourse.exercises.checks.question import Answer, Mistake, Question

MANY = 3  # numbers that are no coincidence
GENERAL = (
    "It does not look like one of the usual mistakes. Check each step of the derivation, "
    "and try a case whose answer you know."
)


@dataclass(frozen=True)
class Wrong:
    """A wrong answer beside what was expected."""

    question: Question
    answers: tuple[Answer, Answer]  # the right one, and the wrong one
    arguments: Sequence[tuple]
    answered: list[Any]
    expected: list[Any]
    # mistakes with their results, None where impossible
    known: Sequence[tuple[Mistake, list[Any] | None]]
    agree: Agree

    @property
    def parts(self) -> tuple[str, ...]:
        return self.question.parts

    def description(self) -> tuple[str, list[str], bool]:
        """What to say, the names of the mistakes it looks like, and whether that explains the first
        result that is wrong."""
        parts = self.parts
        right = [place for place, good in enumerate(self._right) if good]
        start = (
            f"{', '.join(parts[place] for place in right)} right, the rest not. "
            if right
            else "not right. "
        )
        whole = [
            mistake
            for mistake, wrong in self.known
            if wrong is not None and self.agree(self.answered, wrong)
        ]
        if whole:
            return start + _said(whole), _named(whole), True
        if not parts:
            seen, hint = self._diagnosis(None)
            return start + (hint or GENERAL), seen, _tells(seen)
        if self._swapped():
            return "not right. All results are right, but in another order.", ["swapped"], True
        described = [
            (parts[place], *self._diagnosis(place))
            for place in range(len(parts))
            if place not in right
        ]
        known = [description for description in described if self._known(description[1])]
        leads = known or [description for description in described if description[2]][:1]
        if not leads:
            return start + GENERAL, [], False
        names = list(dict.fromkeys(name for _, seen, _ in leads for name in seen))
        first, of_first, _ = described[0]
        hints: dict[str, list[str]] = {}
        rest = []
        for part, seen, hint in described:
            if all(hint != lead for *_, lead in leads):
                rest.append(part)
                continue
            # its formula may be right, on a wrong result
            follows = bool(known) and not set(seen) & set(of_first)
            hint += f" Or: it follows from {first}." * follows
            hints.setdefault(hint, []).append(part)
        says = " ".join(f"{', '.join(where)}: {hint}" for hint, where in hints.items())
        if first in rest and not known:  # what there is a hint of may follow from it
            return f"{start}{first} is wrong too: start there. {says}", names, False
        if rest:
            says += f" {', '.join(rest)} may be wrong for the same reason."
        return start + says, names, _tells(names)

    def _known(self, names: Sequence[str]) -> bool:
        return any(mistake.name in names for mistake, _ in self.known)

    def _agrees(self, place: int, wanted: Sequence[Any]) -> bool:
        return self.agree(part_of(self.answered, place), part_of(wanted, place))

    def _swapped(self) -> bool:
        return any(
            self.agree([tuple(result[i] for i in order) for result in self.answered], self.expected)
            for order in permutations(range(len(self.parts)))
            if list(order) != sorted(order)
        )

    def _diagnosis(self, place: int | None) -> tuple[list[str], str]:
        """Names of the mistakes that one result looks like, and what to say: nothing if it looks
        like none."""

        def of(results: Sequence[Any]) -> Sequence[Any]:
            return results if place is None else part_of(results, place)

        mine, theirs = of(self.answered), of(self.expected)
        possible = [(mistake, wrong) for mistake, wrong in self.known if wrong is not None]
        seen = [(mistake, wrong) for mistake, wrong in possible if self.agree(mine, of(wrong))]
        good = [self.agree([a], [b]) for a, b in zip(mine, theirs, strict=True)]
        first = slice(good.index(False), good.index(False) + 1)
        if not seen and isinstance(theirs[0], np.ndarray) and theirs[first][0].size >= MANY:
            # as in the first call that is wrong: more may be, later
            seen = [
                (mistake, wrong)
                for mistake, wrong in possible
                if self.agree(mine[first], of(wrong)[first])
                and all(
                    self.agree([a], [b])
                    for a, b, right in zip(of(wrong), theirs, good, strict=True)
                    if right
                )
            ]
        if seen:
            likely = self._likely(seen)
            return _named(likely), _said(likely)
        others = [
            (name, part_of(self.expected, i)) for i, name in enumerate(self.parts) if i != place
        ]
        hint = general(
            Case(
                answered=mine,
                expected=theirs,
                agree=self.agree,
                arguments=self.arguments,
                names=self.names,
                part=place or 0,
                others=others,
                sensitivity=self.sensitivity,
                axes=self.question.axes,
            )
        )
        return ([hint[0]], hint[1]) if hint else ([], "")

    def _likely(self, seen: Sequence[tuple[Mistake, list[Any]]]) -> list[Mistake]:
        """Those that spoil the fewest results that are right; of these, those that explain the most
        of the wrong ones."""
        ranks = [self._rank(wrong) for _, wrong in seen]
        return [
            mistake for (mistake, _), rank in zip(seen, ranks, strict=True) if rank == max(ranks)
        ]

    def _rank(self, wrong: Sequence[Any]) -> tuple[int, int]:
        fits = [self._agrees(place, wrong) for place in range(len(self.parts))]
        return sum(fit and right for fit, right in zip(fits, self._right, strict=True)), sum(fits)

    @cached_property
    def _right(self) -> list[bool]:
        """For each result, whether it is right."""
        return [self._agrees(place, self.expected) for place in range(len(self.parts))]

    @cached_property
    def names(self) -> list[str]:
        """What the arguments are called."""
        return names_of(self.answers[0], len(self.arguments[0]))

    @cached_property
    def sensitivity(self) -> Sensitivity:
        """To the arguments of the calls."""
        results = [
            tuple(list(result) if self.parts else [result] for result in pair)
            for pair in zip(self.expected, self.answered, strict=True)
        ]
        return Sensitivity(
            self.names, self.answers, self.arguments, results, bool(self.parts), self.question.spare
        )

    def case(self, values: Mapping[sp.Symbol, Any]) -> str:
        """One input for which the answer is wrong, and what it gives there."""
        right = [self.agree([a], [b]) for a, b in zip(self.answered, self.expected, strict=True)]
        size = [sum(np.size(value) for value in given) for given in self.arguments]
        which = min((i for i, good in enumerate(right) if not good), key=size.__getitem__)
        mine, theirs = self.answered[which], self.expected[which]
        parts = [
            place
            for place in range(len(self.parts))
            if not self.agree([mine[place]], [theirs[place]])
        ]
        place = parts[0] if parts else None
        mine, theirs = (result if place is None else result[place] for result in (mine, theirs))
        what = "" if place is None else self.parts[place]
        return shown(
            self.names, self.arguments[which], mine, theirs, what, self.question.axes, values
        )


def _said(mistakes: Sequence[Mistake]) -> str:
    return " Or: ".join(dict.fromkeys(mistake.says for mistake in mistakes))


def _tells(names: Sequence[str]) -> bool:
    """Whether a hint of one of these names tells more than that something is wrong."""
    return bool(set(names) - {"too-large", "too-small"})


def _named(mistakes: Sequence[Mistake]) -> list[str]:
    return list(dict.fromkeys(mistake.name for mistake in mistakes))


def part_of(results: Sequence[Any], place: int) -> list[Any]:
    return [result[place] for result in results]
