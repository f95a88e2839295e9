"""Self-checks: is an answer right, and if not, what kind of mistake does it look like?

A `Question` holds the right answer and a catalogue of mistakes, wrong answers that students give, each with what to say of it.
The student's function and they are called with the same hidden arguments; an answer that equals a mistake is recognised by name.
Nothing that a student hands in may crash a check, and no message contains the answer.
"""

from __future__ import annotations

import copy
import traceback
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy as sp

from kfcourse.checks.equality import Unusable, equal, like
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
                results.append(like(answer(*copy.deepcopy(values)), wanted))
    except OutOfTime:
        raise Unusable(f"still running after {seconds:g} s: is there a loop that never ends?") from None
    except (Unusable, KeyboardInterrupt):  # whoever stops the kernel means the check too
        raise
    except RecursionError:
        raise Unusable("calls itself without end (RecursionError)") from None
    except BaseException as error:
        if isinstance(error, NotImplementedError) and not _in_library(error):
            raise Missing from None
        raise Unusable(f"stops with {_told(error)}") from None
    return results


def _frames(error: BaseException) -> list[traceback.FrameSummary]:
    return list(traceback.extract_tb(error.__traceback__))


def _foreign(frame: traceback.FrameSummary) -> bool:
    """Whether the line is of a library or of this package, not of a student."""
    own = Path(frame.filename)
    return "site-packages" in frame.filename or any(own.is_relative_to(folder) for folder in (PACKAGE, *folders()))


def _in_library(error: BaseException) -> bool:
    return _foreign(_frames(error)[-1])


def _told(error: BaseException) -> str:
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
    agree = partial(_agree, values=exercise.model.values, tolerance=question.tolerance)
    try:
        with time_limit(seconds):
            if agree(found, expected):
                return result(PASSED, "right")
    except OutOfTime:
        return result(UNUSABLE, f"cannot be compared within {seconds:g} s: simplify it")
    try:
        with time_limit(DIAGNOSIS), np.errstate(all="ignore"):
            return result(WRONG, *_compared(question, exercise, arguments, found, expected, agree))
    except OutOfTime:
        return result(WRONG, f"not right. {GENERAL}")


Agree = Callable[[Sequence[Any], Sequence[Any]], bool]


def _compared(
    question: Question, exercise: Exercise, arguments: Sequence[tuple], found: list[Any], expected: list[Any], agree: Agree
) -> tuple[str, list[str]]:
    """What to say of a wrong answer, and the names of the mistakes it looks like."""
    catalogue = [(m, _wrong(m, exercise, arguments, expected)) for m in question.mistakes]
    if not question.parts:
        names, hint = _diagnosis(found, expected, catalogue, agree)
        return f"not right. {hint}", names
    right, names, hints = [], [], []
    for i, part in enumerate(question.parts):
        mine, theirs = _part(found, i), _part(expected, i)
        if agree(mine, theirs):
            right.append(part)
            continue
        seen, hint = _diagnosis(mine, theirs, [(m, wrong and _part(wrong, i)) for m, wrong in catalogue], agree)
        names += seen
        hints.append(f"{part}: {hint}")
    start = f"{', '.join(right)} right, the rest not. " if right else "not right. "
    return start + " ".join(hints), list(dict.fromkeys(names))


def _part(results: Sequence[Any], place: int) -> list[Any]:
    return [result[place] for result in results]


def _reference(answer: Answer, arguments: Sequence[tuple]) -> list[Any]:
    """Results of an answer of ours, in a form that others are compared with."""
    return [_standard(answer(*copy.deepcopy(values))) for values in arguments]


def _standard(value: Any) -> Any:
    if isinstance(value, tuple | list):
        return tuple(_standard(part) for part in value)
    return value if isinstance(value, sp.Basic | sp.MatrixBase) else np.asarray(value, dtype=float)


def _agree(found: Sequence[Any], expected: Sequence[Any], values: Mapping[sp.Symbol, Any], tolerance: float) -> bool:
    return all(equal(a, b, tolerance, values) for a, b in zip(found, expected, strict=True))


def _wrong(mistake: Mistake, exercise: Exercise, arguments: Sequence[tuple], expected: Sequence[Any]) -> list[Any] | None:
    """Results of a known wrong answer; None if this variant does not allow the mistake."""
    try:
        wrong = mistake.answer(exercise)
        return [like(wrong(*copy.deepcopy(values)), wanted) for values, wanted in zip(arguments, expected, strict=True)]
    except Exception:  # of shapes, mostly; a test makes sure that each mistake is known where it is possible
        return None


def _diagnosis(
    found: Sequence[Any],
    expected: Sequence[Any],
    catalogue: Sequence[tuple[Mistake, Sequence[Any] | None]],
    agree: Agree,
) -> tuple[list[str], str]:
    """Names of the mistakes that a wrong answer looks like, and what to say."""
    seen = [mistake for mistake, wrong in catalogue if wrong is not None and agree(found, wrong)]
    if seen:
        return [m.name for m in seen], " Or: ".join(dict.fromkeys(m.says for m in seen))
    for name, hint, change in TRANSFORMATIONS:
        try:
            if agree([change(value) for value in found], expected):
                return [name], hint
        except Exception:  # this result cannot be changed so
            continue
    right = sum(agree([a], [b]) for a, b in zip(found, expected, strict=True))
    if right:
        return ["sometimes"], f"It is right for {right} of {len(expected)} hidden inputs: which case did you leave out?"
    return [], GENERAL


def _each(value: Any, change: Callable[[Any], Any]) -> Any:
    """A change of every entry; the power of a symbolic matrix would be another thing, and may take for ever."""
    return value.applyfunc(change) if isinstance(value, sp.MatrixBase) else change(value)


GENERAL = (
    "It does not look like one of the usual mistakes. Check each step of the derivation, and try a case whose answer you know."
)
TRANSFORMATIONS: tuple[tuple[str, str, Callable[[Any], Any]], ...] = (
    ("sign", "The size is right, the sign is not.", lambda v: -v),
    ("transposed", "It looks transposed.", lambda v: v.T if isinstance(v, sp.MatrixBase) else np.swapaxes(v, -1, -2)),
    ("root", "It looks like a standard deviation where a variance belongs.", lambda v: _each(v, lambda entry: entry**2)),
    ("square", "It looks like a variance where a standard deviation belongs.", lambda v: _each(v, lambda entry: entry**0.5)),
    ("factor-2", "It is half of what it should be.", lambda v: v * 2),
    ("factor-half", "It is twice what it should be.", lambda v: v / 2),
    ("inverse", "It looks like the inverse of what it should be.", lambda v: _each(v, lambda entry: 1 / entry)),
)
