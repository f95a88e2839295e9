"""In the process of a notebook that is graded: runs its cells and calls its functions, and knows no
answers.

Only values leave it.  What it is asked, and what becomes of the values, is decided by the grader,
which no line of the notebook enters; a notebook that changes this module can return other values,
as it can by other functions, and nothing else.
"""

from __future__ import annotations

import ast
import builtins
import os
import sys
from collections.abc import Mapping, Sequence
from typing import Any, NoReturn

import numpy as np
from IPython.core.error import StdinNotImplementedError
from IPython.core.interactiveshell import InteractiveShell
from traitlets.config import Config

from kfcourse.exercises import sets
from kfcourse.exercises.checks import Exercise, Result, exercise
from kfcourse.exercises.checks.engine import in_a_line, in_library
from kfcourse.exercises.grading.channel import Channel, Closed, close_streams
from kfcourse.exercises.grading.values import decode, encode
from kfcourse.limits import OutOfTime, limit_process, time_limit


class Shell(InteractiveShell):
    """IPython without a screen: nobody reads tracebacks, and what concerns the display alone stops
    no cell."""

    def showtraceback(self, *_: Any, **__: Any) -> None:
        """Nothing."""

    def run_line_magic(self, *arguments: Any, **named: Any) -> Any:
        """As usual; %matplotlib, %config and their like need not be there, nor a window."""
        try:
            return super().run_line_magic(*arguments, **named)
        except Exception:
            return None


class Session:
    """A notebook's cells in one namespace, and the functions that it hands in."""

    def __init__(self, channel: Channel):
        self._channel = channel
        self._answers: dict[str, Any] = {}
        config = Config()
        config.HistoryManager.enabled = False
        self._shell = Shell.instance(config=config)
        builtins.input = _nobody_answers
        Exercise.check = _hand_in  # type: ignore[method-assign]

    def open(
        self, letter: str, opening: str, numbers: Mapping[str, Mapping[str, float]]
    ) -> dict[str, Any]:
        """Open the exercise as it was handed out; `numbers`: personal numbers by "letter
        variant"."""
        vars(sets)["NUMBERS"].update(numbers)  # they are on the stage only
        self._opened = letter, ast.literal_eval(opening)
        exercise(*self._opened)
        return {}

    def cell(self, source: str, names: Sequence[str] = ()) -> dict[str, Any]:
        """Run a cell: the error it ends with, if any, whether a stub raised it, and the types of
        what it hands in.

        `names` are those by which a check cell calls the exercise; they get it as it was handed
        out.
        """
        handed_in: dict[str, Any] = {}
        if names:
            task = exercise(*self._opened)
            vars(task)["handed_in"] = handed_in
            self._shell.push(dict.fromkeys(names, task))
        done = self._shell.run_cell(source)
        if "matplotlib.pyplot" in sys.modules:
            sys.modules["matplotlib.pyplot"].close("all")
        error = done.error_before_exec or done.error_in_exec
        self._answers |= handed_in  # earlier ones stay: later steps may stand on them
        answers = {
            str(name): None if callable(value) else type(value).__name__
            for name, value in handed_in.items()
        }
        return {"error": error and _text(error), "stub": _of_a_stub(error), "answers": answers}

    def ask(self, question: str, arguments: Any, seconds: float) -> dict[str, Any]:
        """Call the function handed in for a question: its value, or how it fails."""
        try:
            with time_limit(seconds), np.errstate(all="ignore"):
                return {"value": encode(self._answers[question](*decode(arguments, self._proxy)))}
        except OutOfTime:
            return {"fails": "late"}
        except Closed:
            raise
        except RecursionError:
            return {
                "fails": "calls itself without end, or nests a formula without end (RecursionError)"
            }
        except BaseException as error:
            return {"fails": "missing" if _of_a_stub(error) else f"stops with {in_a_line(error)}"}

    def _proxy(self, number: int) -> Any:
        """A function of the grader's: called there, with these values."""

        def function(*values: Any, **named: Any) -> Any:
            sent = {name: encode(value) for name, value in named.items()}
            self._channel.send({"call": number, "values": encode(values), "named": sent})
            answer = self._channel.receive()
            if "value" in answer:
                return decode(answer["value"])
            kind = getattr(builtins, str(answer.get("raises")), ValueError)
            known = isinstance(kind, type) and issubclass(kind, Exception)
            raise (kind if known else ValueError)(str(answer.get("says")))

        return function


def _of_a_stub(error: Any) -> bool:
    return isinstance(error, NotImplementedError) and not in_library(error)


def _hand_in(self: Exercise, name: str, answer: Any) -> Result:
    """In place of a check: keeps the answer, if a check cell calls it."""
    vars(self).get("handed_in", {})[name] = answer
    return Result(name, "", "not run", "not checked here")


def _nobody_answers(*_: Any) -> NoReturn:
    raise StdinNotImplementedError("nobody is there to answer input() while a notebook is graded")


def _text(error: BaseException) -> str:
    try:
        return f"{type(error).__name__}: {str(error)[:500]}"
    except Exception:  # of a class of the student's
        return type(error).__name__


def main() -> None:
    """The process: messages come and go where standard input and output were, which are closed to
    the notebook."""
    channel = Channel(os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb"))
    close_streams()
    sys.meta_path[:] = [
        finder
        for finder in sys.meta_path
        if "__editable__" not in getattr(finder, "__module__", "")
    ]
    session = Session(channel)
    limit_process(int(sys.argv[1]))
    while True:
        try:
            message = channel.receive()
            number = message.pop("id")
            reply = getattr(session, message.pop("do"))(**message)
            try:
                channel.send(reply | {"id": number})
            except ValueError as error:  # too large
                channel.send({"fails": f"returns {error}", "id": number})
        except Closed:
            return


if __name__ == "__main__":
    main()
