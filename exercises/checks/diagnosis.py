"""What kind of mistake does a wrong answer look like?  A known one of all of its results, or of
one; or what a hint says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations
from typing import Any, NamedTuple

import numpy as np

from kfcourse.exercises.checks.case import Case
from kfcourse.exercises.checks.failing import shown
from kfcourse.exercises.checks.hints import general
from kfcourse.exercises.checks.question import Answer, Mistake
from kfcourse.exercises.checks.reference import Posed, part_of

MANY = 3  # numbers that are no coincidence
GENERAL = (
    "It does not look like one of the usual mistakes. Check each step of the derivation, "
    "and try a case whose answer you know."
)


class Lead(NamedTuple):
    """What one result looks like: names of mistakes, and what to say."""

    names: list[str]
    says: str


@dataclass(frozen=True)
class Wrong:
    """A wrong answer, and what it gave for the hidden arguments."""

    posed: Posed
    answer: Answer
    answered: list[Any]

    @property
    def parts(self) -> tuple[str, ...]:
        return self.posed.question.parts

    @cached_property
    def right(self) -> list[bool]:
        """For each of several results, whether it is right."""
        return [self._agrees(place, self.posed.expected) for place in range(len(self.parts))]

    def _agrees(self, place: int | None, wanted: Sequence[Any]) -> bool:
        return self.posed.agree(part_of(self.answered, place), part_of(wanted, place))

    def description(self) -> tuple[str, list[str], bool]:
        """What to say, the names of the mistakes it looks like, and whether that explains the first
        result that is wrong."""
        parts = self.parts
        right = [part for part, good in zip(parts, self.right, strict=True) if good]
        start = f"{', '.join(right)} right, the rest not. " if right else "not right. "
        if whole := [mistake for mistake, wrong in self.posed.known if self._agrees(None, wrong)]:
            lead = _lead(whole)
            return start + lead.says, lead.names, True
        if self._swapped():
            return "not right. All results are right, but in another order.", ["swapped"], True
        wrong = [place for place, good in enumerate(self.right) if not good] if parts else [None]
        known = {place: _lead(seen) for place in wrong if (seen := self._mistakes(place))}
        leads = known
        for place in wrong:
            if not leads and (hint := general(Case(self.posed, self.answer, self.answered, place))):
                leads = {place: Lead([hint[0]], hint[1])}
        if not leads:
            return start + GENERAL, [], False
        names = list(dict.fromkeys(name for lead in leads.values() for name in lead.names))
        if not parts:
            return start + leads[None].says, names, True
        called = dict[int | None, str](enumerate(parts))
        first, hints = wrong[0], dict[str, list[str]]()
        for place, lead in leads.items():
            # its formula may be right, on a wrong result
            follows = known and not set(lead.names) & set(leads.get(first, Lead([], "")).names)
            says = lead.says + f" Or: it follows from {called[first]}." * bool(follows)
            hints.setdefault(says, []).append(called[place])
        says = " ".join(f"{', '.join(where)}: {hint}" for hint, where in hints.items())
        if first not in leads and not known:  # what there is a hint of may follow from it
            return f"{start}{called[first]} is wrong too: start there. {says}", names, False
        if rest := [called[place] for place in wrong if place not in leads]:
            says += f" {', '.join(rest)} may be wrong for the same reason."
        return start + says, names, True

    def _swapped(self) -> bool:
        return any(
            self.posed.agree(
                [tuple(result[i] for i in order) for result in self.answered], self.posed.expected
            )
            for order in permutations(range(len(self.parts)))
            if list(order) != sorted(order)
        )

    def _mistakes(self, place: int | None) -> list[Mistake]:
        """Known mistakes that one result looks like: of all, those that spoil the fewest results
        that are right; of these, those that explain the most of the wrong ones."""
        agree, known = self.posed.agree, self.posed.known
        seen = [(mistake, wrong) for mistake, wrong in known if self._agrees(place, wrong)]
        mine, theirs = part_of(self.answered, place), part_of(self.posed.expected, place)
        good = [agree([a], [b]) for a, b in zip(mine, theirs, strict=True)]
        first = good.index(False)
        if not seen and isinstance(theirs[first], np.ndarray) and theirs[first].size >= MANY:
            # as in the first call that is wrong: more may be, later
            wanted = [i for i, right in enumerate(good) if right or i == first]
            seen = [
                (mistake, wrong)
                for mistake, wrong in known
                if agree([mine[i] for i in wanted], [part_of(wrong, place)[i] for i in wanted])
            ]
        ranks = [self._rank(wrong) for _, wrong in seen]
        return [
            mistake for (mistake, _), rank in zip(seen, ranks, strict=True) if rank == max(ranks)
        ]

    def _rank(self, wrong: Sequence[Any]) -> tuple[int, int]:
        fits = [self._agrees(place, wrong) for place in range(len(self.parts))]
        return sum(fit and right for fit, right in zip(fits, self.right, strict=True)), sum(fits)

    def example(self) -> str:
        """One input for which the answer is wrong, and what it gives there."""
        posed = self.posed
        wrong = [
            call
            for call, pair in enumerate(zip(self.answered, posed.expected, strict=True))
            if not posed.agree(*([side] for side in pair))
        ]
        call = min(wrong, key=lambda call: sum(map(np.size, posed.arguments[call])))
        mine, right = self.answered[call], posed.expected[call]
        for part, own, wanted in zip(self.parts, mine, right, strict=True) if self.parts else ():
            if not posed.agree([own], [wanted]):
                return shown(posed, call, own, wanted, part)
        return shown(posed, call, mine, right, "")


def _lead(mistakes: Sequence[Mistake]) -> Lead:
    names = list(dict.fromkeys(mistake.name for mistake in mistakes))
    return Lead(names, " Or: ".join(dict.fromkeys(mistake.says for mistake in mistakes)))
