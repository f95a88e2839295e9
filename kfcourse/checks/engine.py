"""Self-checks: is an answer right, and if not, what kind of mistake does it look like?

A `Question` holds the right answer and a catalogue of mistakes, wrong answers that students give, each with what to say of it.
The student's function and they are called with the same hidden arguments; an answer that equals a mistake is recognised by name.
Nothing that a student hands in may crash a check, and no message contains the answer.
"""

from __future__ import annotations

import copy
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import permutations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy as sp

from kfcourse.checks.equality import Places, Unusable, equal, like
from kfcourse.checks.hints import Agree, Case, Sensitivity, general, names_of
from kfcourse.checks.question import MISSING, PASSED, UNUSABLE, WRONG, Answer, Mistake, Question, Result
from kfcourse.checks.registry import folders
from kfcourse.limits import OutOfTime, time_limit

if TYPE_CHECKING:
    from kfcourse.checks.exercises import Exercise

PACKAGE = Path(__file__).resolve().parent.parent
SECONDS = 20.0  # an answer may take
DIAGNOSIS = 60.0  # the search for the kind of mistake


class Missing(Exception):
    """The student has not written this answer yet."""


def call(answer: Any, arguments: Sequence[tuple], expected: Sequence[Any], seconds: float) -> list[Any]:
    """The answer's results for every tuple of arguments, in the form of the expected ones.

    Raises
    ------
    Missing
        It raises NotImplementedError.
    Unusable
        It is not callable, fails, takes too long, or returns something of another form.
    """
    if not callable(answer):
        raise Unusable(f"expected a function, got {type(answer).__name__}; pass the function itself, without calling it")
    results = []
    try:
        with time_limit(seconds), np.errstate(all="ignore"):
            for values, wanted in zip(arguments, expected, strict=True):
                results.append(_formed(answer(*copy.deepcopy(values)), wanted))
    except OutOfTime:
        raise Unusable(f"still running after {seconds:g} s: is there a loop that never ends?") from None
    except (Missing, Unusable, KeyboardInterrupt):  # whoever stops the kernel means the check too
        raise
    except RecursionError:
        raise Unusable("calls itself without end (RecursionError)") from None
    except BaseException as error:
        if isinstance(error, NotImplementedError) and not in_library(error):
            raise Missing from None
        raise Unusable(f"stops with {told(error)}") from None
    return results


def _formed(result: Any, wanted: Any) -> Any:
    """The result in the form of the expected one; says so if only the order is another."""
    try:
        return like(result, wanted)
    except Unusable as reason:
        if not isinstance(wanted, tuple) or not isinstance(result, tuple | list) or len(result) != len(wanted):
            raise
        if any(_fits(order, wanted) for order in permutations(result)):
            raise Unusable(f"{reason}: are the results in another order?") from None
        raise


def _fits(result: Any, wanted: Any) -> bool:
    try:
        like(result, wanted)
    except Exception:  # of nonsense of the student's
        return False
    return True


def _frames(error: BaseException) -> list[traceback.FrameSummary]:
    return list(traceback.extract_tb(error.__traceback__))


def _foreign(frame: traceback.FrameSummary) -> bool:
    """Whether the line is of a library or of this package, not of a student."""
    own = Path(frame.filename)
    return "site-packages" in frame.filename or any(own.is_relative_to(folder) for folder in (PACKAGE, *folders()))


def in_library(error: BaseException) -> bool:
    return _foreign(_frames(error)[-1])


def told(error: BaseException) -> str:
    """The error in one line, with the student's own line of code."""
    try:
        text = " ".join(str(error).split())[:200]
    except Exception:  # of a class of the student's
        text = "no message"
    if isinstance(error, TypeError) and ("to float" in text or "ufunc" in text):
        text += " (functions of symbols are sp.sin, sp.exp, ..., not those of math or NumPy)"
    own = [frame for frame in _frames(error) if not _foreign(frame)]
    where = f", in line {own[-1].lineno} of {own[-1].name}()" if own else ""
    return f"{type(error).__name__}{': ' * bool(text)}{text}{where}"


def check(question: Question, exercise: Exercise, answer: Any, seconds: float = SECONDS) -> Result:
    """Check an answer to a question; never raises because of the answer."""

    def result(status: str, message: str, diagnosis: Sequence[str] = ()) -> Result:
        return Result(question.name, question.title, status, message, tuple(diagnosis))

    arguments = list(question.arguments(exercise))
    expected = _reference(question.answer(exercise), arguments)
    try:
        found = call(answer, arguments, expected, seconds)
    except Missing:
        return result(MISSING, "not implemented yet")
    except Unusable as reason:
        return result(UNUSABLE, str(reason))
    agree = partial(_agree, values=exercise.model.values, tolerance=question.tolerance, places=exercise.places)
    try:
        with time_limit(seconds):
            if agree(found, expected):
                return result(PASSED, "right")
    except OutOfTime:
        return result(UNUSABLE, f"cannot be compared within {seconds:g} s: simplify it")
    try:
        with time_limit(DIAGNOSIS), np.errstate(all="ignore"):
            known = [(mistake, _wrong(mistake, exercise, arguments, expected)) for mistake in question.mistakes]
            key = question.answer(exercise)
            return result(WRONG, *_Wrong(question.parts, (key, answer), arguments, found, expected, known, agree).told())
    except OutOfTime:
        return result(WRONG, f"not right. {GENERAL}")


@dataclass(frozen=True)
class _Wrong:
    """A wrong answer beside what was expected."""

    parts: tuple[str, ...]
    answers: tuple[Answer, Answer]  # the right one, and the wrong one
    arguments: Sequence[tuple]
    found: list[Any]
    expected: list[Any]
    known: Sequence[tuple[Mistake, list[Any] | None]]  # mistakes with their results, None where impossible
    agree: Agree

    def told(self) -> tuple[str, list[str]]:
        """What to say, and the names of the mistakes it looks like."""
        parts = self.parts
        right = [place for place in range(len(parts)) if self._agrees(place, self.expected)]
        start = f"{', '.join(parts[place] for place in right)} right, the rest not. " if right else "not right. "
        whole = [mistake for mistake, wrong in self.known if wrong is not None and self.agree(self.found, wrong)]
        if whole:
            return start + _said(whole), _named(whole)
        if not parts:
            seen, hint = self._diagnosis(None)
            return start + (hint or GENERAL), seen
        if self._swapped():
            return "not right. All results are right, but in another order.", ["swapped"]
        names: list[str] = []
        hints: dict[str, list[str]] = {}
        for place in range(len(parts)):
            if place not in right:
                seen, hint = self._diagnosis(place)
                names += seen
                hints.setdefault(hint, []).append(parts[place])
        unknown = hints.pop("", [])
        told = [f"{', '.join(where)}: {hint}" for hint, where in hints.items()]
        if unknown:
            told.append(f"{', '.join(unknown)} may be wrong for the same reason." if told else GENERAL)
        return start + " ".join(told), list(dict.fromkeys(names))

    def _agrees(self, place: int, wanted: Sequence[Any]) -> bool:
        return self.agree(_part(self.found, place), _part(wanted, place))

    def _swapped(self) -> bool:
        orders = [order for order in permutations(range(len(self.parts))) if list(order) != sorted(order)]
        return any(
            all(self.agree(_part(self.found, i), _part(self.expected, j)) for i, j in enumerate(order)) for order in orders
        )

    def _diagnosis(self, place: int | None) -> tuple[list[str], str]:
        """Names of the mistakes that one result looks like, and what to say: nothing if it looks like none."""

        def of(results: Sequence[Any]) -> Sequence[Any]:
            return results if place is None else _part(results, place)

        mine, theirs = of(self.found), of(self.expected)
        possible = [(mistake, of(wrong)) for mistake, wrong in self.known if wrong is not None]
        seen = [mistake for mistake, wrong in possible if self.agree(mine, wrong)]
        if seen:
            return _named(seen), _said(seen)
        apart = [[not self.agree([a], [b]) for a, b in zip(wrong, theirs, strict=True)] for _, wrong in possible]
        apart = [row for row in apart if any(row)]
        telling = [2 * sum(column) >= len(apart) for column in zip(*apart, strict=True)] or [True] * len(theirs)
        others = [(name, _part(self.expected, i)) for i, name in enumerate(self.parts) if i != place]
        said = general(
            Case(mine, theirs, self.agree, self.arguments, self.sensitivity.names, place or 0, others, telling, self.sensitivity)
        )
        return ([said[0]], said[1]) if said else ([], "")

    @cached_property
    def sensitivity(self) -> Sensitivity:
        """To the arguments of the first call that is not right."""
        one = next(i for i, (a, b) in enumerate(zip(self.found, self.expected, strict=True)) if not self.agree([a], [b]))
        names = names_of(self.answers[0], len(self.arguments[one]))
        results = tuple(list(side[one]) if self.parts else [side[one]] for side in (self.expected, self.found))
        return Sensitivity(names, self.answers, self.arguments[one], results, bool(self.parts))


def _said(mistakes: Sequence[Mistake]) -> str:
    return " Or: ".join(dict.fromkeys(mistake.says for mistake in mistakes))


def _named(mistakes: Sequence[Mistake]) -> list[str]:
    return list(dict.fromkeys(mistake.name for mistake in mistakes))


def _part(results: Sequence[Any], place: int) -> list[Any]:
    return [result[place] for result in results]


def _reference(answer: Answer, arguments: Sequence[tuple]) -> list[Any]:
    """Results of an answer of ours, in a form that others are compared with."""
    return [standard(answer(*copy.deepcopy(values))) for values in arguments]


def standard(value: Any) -> Any:
    """A result in the form in which results are compared: formulas, arrays of floats, and tuples of them."""
    if isinstance(value, tuple | list):
        return tuple(standard(part) for part in value)
    return value if isinstance(value, sp.Basic | sp.MatrixBase) else np.asarray(value, dtype=float)


def _agree(
    found: Sequence[Any], expected: Sequence[Any], values: Mapping[sp.Symbol, Any], tolerance: float, places: Places = ()
) -> bool:
    return all(equal(a, b, tolerance, values, places) for a, b in zip(found, expected, strict=True))


def _wrong(mistake: Mistake, exercise: Exercise, arguments: Sequence[tuple], expected: Sequence[Any]) -> list[Any] | None:
    """Results of a known wrong answer; None if this variant does not allow the mistake."""
    try:
        wrong = mistake.answer(exercise)
        return [like(wrong(*copy.deepcopy(values)), wanted) for values, wanted in zip(arguments, expected, strict=True)]
    except Exception:  # of shapes, mostly; a test makes sure that each mistake is known where it is possible
        return None


GENERAL = (
    "It does not look like one of the usual mistakes. Check each step of the derivation, and try a case whose answer you know."
)
