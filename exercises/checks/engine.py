"""Self-checks: is an answer right, and if not, what kind of mistake does it look like?

A `Question` holds the right answer and a catalogue of mistakes, wrong answers that students give,
each with what to say of it. The student's function and they are called with the same hidden
arguments; an answer that equals a mistake is recognised by name. Nothing that a student hands in
may crash a check, and no message contains the answer.
"""

from __future__ import annotations

import copy
import traceback
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import kfcourse
from kfcourse.exercises.checks.derived import Derivation
from kfcourse.exercises.checks.diagnosis import GENERAL, Wrong
from kfcourse.exercises.checks.editing import rebound, uses
from kfcourse.exercises.checks.equality import Unusable, like
from kfcourse.exercises.checks.question import (
    MISSING,
    NOT_CHECKED,
    PASSED,
    UNUSABLE,
    WRONG,
    Answer,
    Attempts,
    ForVariant,
    Question,
    Result,
)
from kfcourse.exercises.checks.reference import Posed, given_by, posed, standard
from kfcourse.exercises.checks.registry import folders
from kfcourse.limits import OutOfTime, time_limit

if TYPE_CHECKING:
    from kfcourse.exercises.checks.exercises import Exercise

OURS = Path(kfcourse.__file__).resolve().parent, Path(__file__).resolve().parents[1]
SECONDS = 20.0  # an answer may take
DIAGNOSIS = 60.0  # the search for the kind of mistake
FOLLOWS = "right-on-top-of-an-earlier-wrong-answer"


class Missing(Exception):
    """The student has not written this answer yet."""


def call(
    answer: Any, arguments: Sequence[tuple], expected: Sequence[Any], seconds: float
) -> list[Any]:
    """The answer's results for every tuple of arguments, in the form of the expected ones.

    Raises
    ------
    Missing
        It raises NotImplementedError.
    Unusable
        It is not callable, fails, takes too long, or returns something of another form.
    """
    if not callable(answer):
        raise Unusable(
            f"expected a function, got {type(answer).__name__}; pass the function itself, without "
            f"calling it"
        )
    results = []
    try:
        with time_limit(seconds), np.errstate(all="ignore"):
            for values, wanted in zip(arguments, expected, strict=True):
                results.append(_formed(answer(*copy.deepcopy(values)), wanted))
    except OutOfTime as late:
        # an answer in another process may have a limit of its own
        took = late.args[0] if late.args else seconds
        raise Unusable(
            f"still running after {took:g} s: is there a loop that never ends?"
        ) from None
    except (Missing, Unusable, KeyboardInterrupt):  # whoever stops the kernel means the check too
        raise
    except RecursionError:
        raise Unusable("calls itself without end (RecursionError)") from None
    except BaseException as error:
        if isinstance(error, NotImplementedError) and not in_library(error):
            raise Missing from None
        raise Unusable(f"stops with {in_a_line(error)}") from None
    return results


def _formed(result: Any, wanted: Any) -> Any:
    """The result in the form of the expected one; says so if only the order is another."""
    try:
        return like(result, wanted)
    except Unusable as reason:
        several = isinstance(wanted, tuple) and isinstance(result, tuple | list)
        orders = permutations(result) if several and len(result) == len(wanted) else ()
        if any(_fits(order, wanted) for order in orders):
            raise Unusable(f"{reason}: are the results in another order?") from None
        raise


def _fits(result: Any, wanted: Any) -> bool:
    try:
        like(result, wanted)
    except Exception:  # of nonsense of the student's
        return False
    return True


def _frames(error: BaseException) -> list[traceback.FrameSummary]:
    return traceback.extract_tb(error.__traceback__)


def _foreign(frame: traceback.FrameSummary) -> bool:
    """Whether the line is of a library or of this package, not of a student."""
    own = Path(frame.filename)
    return "site-packages" in frame.filename or any(
        own.is_relative_to(folder) for folder in (*OURS, *folders())
    )


def in_library(error: BaseException) -> bool:
    return _foreign(_frames(error)[-1])


def in_a_line(error: BaseException) -> str:
    """The error in one line, with the student's own line of code."""
    try:
        text = " ".join(str(error).split())[:200]
    except Exception:  # of a class of the student's
        text = "no message"
    if isinstance(error, TypeError) and ("to float" in text or "ufunc" in text):
        text += " (functions of symbols are sp.sin, sp.exp, ..., not those of math or NumPy)"
    elif "NDimArray" in text or "to Python scalars" in text:
        text += " (functions of arrays are np.sin, np.exp, ..., not those of math or SymPy)"
    elif isinstance(error, np.linalg.LinAlgError) and "did not converge" in text:
        text += " (is there NaN or infinity in what it was given?)"
    elif isinstance(error, TypeError) and "for ^:" in text:
        text += " (a power is **)"
    own = [frame for frame in _frames(error) if not _foreign(frame)]
    where = f", in line {own[-1].lineno} of {own[-1].name}()" if own else ""
    return f"{type(error).__name__}{': ' * bool(text)}{text}{where}"


def check(
    question: Question,
    exercise: Exercise,
    answer: Any,
    seconds: float = SECONDS,
    past: Attempts | None = None,
) -> Result:
    """Check an answer to a question; never raises, whatever the answer is, and whatever fails in
    the check itself.

    `past` is what was handed in before, of the same notebook; the answer is added to it.
    """
    past = past or Attempts()
    past.wrong.pop(question.name, None)
    try:
        result = _Check(posed(question, exercise), answer, seconds, past).result()
    except Exception as error:
        says = (
            "The check itself failed, and that is not your fault. It counts for nothing; "
            "please tell your teacher."
        )
        return question.result(NOT_CHECKED, says, trouble=_trouble(error))
    if result.status == WRONG:
        past.wrong[question.name] = answer
    if result.passed:
        past.given.pop(question.name, None)
    return result


def _trouble(error: Exception) -> str:
    """Kind and place of an error of ours, for the teacher."""
    frames = [
        f"{Path(frame.filename).name}:{frame.lineno} {frame.name}" for frame in _frames(error)
    ]
    return f"{in_a_line(error)} ({' < '.join(reversed(frames[-4:]))})"


@dataclass(frozen=True)
class _Check:
    """An answer to a question."""

    posed: Posed
    answer: Any
    seconds: float
    past: Attempts

    @property
    def question(self) -> Question:
        return self.posed.question

    def result(self) -> Result:
        try:
            answered = call(self.answer, self.posed.arguments, self.posed.expected, self.seconds)
            if isinstance(self.question, Derivation):
                return self._derived(self.question, answered)
            with time_limit(self.seconds):
                right = self.posed.agree(answered, self.posed.expected)
        except Missing:
            return self.question.result(MISSING, "not implemented yet")
        except Unusable as reason:
            return self.question.result(UNUSABLE, str(reason))
        except OutOfTime:
            return self.question.result(
                UNUSABLE, f"cannot be compared within {self.seconds:g} s: simplify it"
            )
        if right:
            return self.question.result(PASSED, "right", share=1.0)
        try:
            # what other arguments and other keys lead to is no news
            with (
                time_limit(DIAGNOSIS),
                np.errstate(all="ignore"),
                warnings.catch_warnings(action="ignore"),
            ):
                return self._wrong(answered)
        except OutOfTime:
            return self.question.result(WRONG, f"not right. {GENERAL}")
        # of ours: the answer is wrong all the same, only the hint is lost
        except Exception as error:
            return self.question.result(WRONG, f"not right. {GENERAL}", trouble=_trouble(error))

    def _derived(self, question: Derivation, answered: list[str]) -> Result:
        try:
            with time_limit(DIAGNOSIS), np.errstate(all="ignore"):
                judged = question.judge(self.posed.exercise, answered[0])
        except OutOfTime:
            raise Unusable(
                f"cannot be compared within {DIAGNOSIS:g} s: take smaller steps"
            ) from None
        if not judged.passed and self._times(answered) and question.advice:
            return replace(judged, message=f"{judged.message} {question.advice}")
        return judged

    def _wrong(self, answered: list[Any]) -> Result:
        times, follows = self._times(answered), self._follows(answered)
        wrong = Wrong(self.posed, self.answer, answered)
        if follows:
            says = (
                f"this step is right on top of your {' and '.join(follows)}; what is not right "
                f"yet is there: look there first."
            )
            return self.question.result(
                WRONG, says, diagnosis=(FOLLOWS,), share=wrong.share, follows=follows
            )
        message, names, explained = wrong.description()
        advice = self.question.advice if times else ""
        example = not explained or times > bool(self.question.advice)
        message = " ".join(filter(None, [message, advice, wrong.example() if example else ""]))
        return self.question.result(WRONG, message, diagnosis=tuple(names), share=wrong.share)

    def _times(self, answered: list[Any]) -> int:
        """How many times in a row the same wrong results have come before."""
        before, times = self.past.given.get(self.question.name, (None, 0))
        again = before is not None and self.posed.agree(answered, before)
        self.past.given[self.question.name] = answered, times + 1 if again else 1
        return times if again else 0

    def _follows(self, answered: list[Any]) -> tuple[str, ...]:
        """Earlier questions on whose wrong answers this one is right: all of them, or one."""
        key = self.question.key
        own_step = key.step if isinstance(key, ForVariant) else key
        if own_step is None:
            return ()
        earlier = {
            question.function: question
            for question in self.posed.exercise.questions.values()
            if question.name in self.past.wrong
        }
        own = [function for function in earlier if function in uses(own_step)]
        for chosen in ([own] if len(own) > 1 else []) + [[function] for function in own]:
            try:
                answers = {function: self._in_form(earlier[function]) for function in chosen}
                step = rebound(own_step, answers)
                with time_limit(self.seconds):
                    theirs = self.posed.in_form(step)
                    if self.posed.agree(answered, theirs):
                        return tuple(earlier[function].name for function in chosen)
            except (Exception, OutOfTime):  # of the earlier answer
                continue
        return ()

    def _in_form(self, question: Question) -> Answer:
        """A wrong answer to an earlier question with results in the form of the key's, as our own
        functions take them."""
        key, wrong = question.answer(self.posed.exercise), self.past.wrong[question.name]

        def in_form(*values: Any) -> Any:
            (mine,), (ours,) = (given_by(answer, [values]) for answer in (wrong, key))
            return like(mine, standard(ours))

        return in_form
