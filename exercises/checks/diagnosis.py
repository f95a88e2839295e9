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
from kfcourse.exercises.checks.reference import Posed

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

    @cached_property
    def cases(self) -> list[Case]:
        """Each of its results."""
        places: Sequence[int | None] = range(len(self.posed.question.parts)) or [None]
        return [Case(self.posed, self.answer, self.answered, place) for place in places]

    @property
    def share(self) -> float:
        """Of its results that are right."""
        return sum(case.right for case in self.cases) / len(self.cases)

    def description(self) -> tuple[str, list[str], bool]:
        """What to say, the names of the mistakes it looks like, and whether that explains the first
        result that is wrong."""
        right = [case.name for case in self.cases if case.right]
        wrong = [case for case in self.cases if not case.right]
        start = f"{', '.join(right)} right, the rest not. " if right else "not right. "
        agree = self.posed.agree
        if whole := [mistake for mistake, would in self.posed.known if agree(self.answered, would)]:
            lead = _lead(whole)
            return start + lead.says, lead.names, True
        if self._swapped():
            return "not right. All results are right, but in another order.", ["swapped"], True
        known = {case.name: _lead(seen) for case in wrong if (seen := self._mistakes(case))}
        leads = known
        for case in wrong:
            if not leads and (hint := general(case)):
                leads = {case.name: Lead([hint[0]], hint[1])}
        if not leads:
            return start + GENERAL, [], False
        names = list(dict.fromkeys(name for lead in leads.values() for name in lead.names))
        first, hints = wrong[0].name, dict[str, list[str]]()
        if not first:  # the only result
            return start + leads[first].says, names, True
        for part, lead in leads.items():
            # its formula may be right, on a wrong result
            follows = known and not set(lead.names) & set(leads.get(first, Lead([], "")).names)
            says = lead.says + f" Or: it follows from {first}." * bool(follows)
            hints.setdefault(says, []).append(part)
        says = " ".join(f"{', '.join(where)}: {hint}" for hint, where in hints.items())
        if first not in leads and not known:  # what there is a hint of may follow from it
            return f"{start}{first} is wrong too: start there. {says}", names, False
        if rest := [case.name for case in wrong if case.name not in leads]:
            says += f" {', '.join(rest)} may be wrong for the same reason."
        return start + says, names, True

    def _swapped(self) -> bool:
        return any(
            self.posed.agree(
                [tuple(result[i] for i in order) for result in self.answered], self.posed.expected
            )
            for order in permutations(range(len(self.posed.question.parts)))
            if list(order) != sorted(order)
        )

    def _mistakes(self, case: Case) -> list[Mistake]:
        """Known mistakes that one result looks like: of all, those that spoil the fewest results
        that are right; of these, those that explain the most of the wrong ones."""
        known = self.posed.known
        seen = [(self._rank(would), mistake) for mistake, would in known if case.given(would)]
        best = max((rank for rank, _ in seen), default=(0, 0))
        return [mistake for rank, mistake in seen if rank == best]

    def _rank(self, would: Sequence[Any]) -> tuple[int, int]:
        fits = [case for case in self.cases if case.given(would)]
        return sum(case.right for case in fits), len(fits)

    def example(self) -> str:
        """One input for which the answer is wrong, and what it gives there."""
        sizes = [sum(map(np.size, values)) for values in self.posed.arguments]
        wrong = [
            (call, case)
            for case in self.cases
            for call, (mine, right) in enumerate(case.pairs)
            if not case.agree([mine], [right])
        ]
        call, case = min(wrong, key=lambda place: (sizes[place[0]], place[0]))
        return shown(case, call)


def _lead(mistakes: Sequence[Mistake]) -> Lead:
    names = list(dict.fromkeys(mistake.name for mistake in mistakes))
    return Lead(names, " Or: ".join(dict.fromkeys(mistake.says for mistake in mistakes)))
