"""In the process of a notebook that is graded: runs its cells and calls its functions, and knows no answers.

Only values leave it.  What it is asked, and what becomes of the values, is decided by the grader, which no line of the notebook
enters; a notebook that changes this module can return other values, as it can by other functions, and nothing else.
"""

from __future__ import annotations

import ast
import builtins
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from IPython.core.error import StdinNotImplementedError
from IPython.core.interactiveshell import InteractiveShell
from traitlets.config import Config

import kfcourse.exercises
from kfcourse.checks import Exercise, Result, exercise
from kfcourse.checks.engine import in_library, told
from kfcourse.limits import OutOfTime, limit_process, time_limit
from kfcourse.notebooks.grading.channel import Channel, Closed
from kfcourse.notebooks.grading.values import decode, encode


class Task:
    """An exercise in a check cell: takes what is handed in, whatever the notebook has made of its class."""

    def __init__(self, task: Exercise, answers: dict[str, Any]):
        self._task, self._answers = task, answers

    def check(self, name: str, answer: Any) -> Result:
        """Hand in an answer."""
        self._answers[name] = answer
        return Result(name, "", "not run", "handed in")

    def __getattr__(self, name: str) -> Any:
        return getattr(self._task, name)


class Quiet(InteractiveShell):
    """Prints no tracebacks: nobody reads them."""

    def showtraceback(self, *_: Any, **__: Any) -> None:
        """Nothing."""


class Session:
    """A notebook's cells in one namespace, and the functions that it hands in."""

    def __init__(self, channel: Channel):
        self._channel = channel
        self._answers: dict[str, Any] = {}
        config = Config()
        config.HistoryManager.enabled = False
        self._shell = Quiet.instance(config=config)
        builtins.input = _nobody_answers
        Exercise.check = _not_checked  # type: ignore[method-assign]

    def open(self, letter: str, opening: str, numbers: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
        """Open the exercise as it was handed out; `numbers`: personal numbers by "letter variant"."""
        kfcourse.exercises.NUMBERS.update(numbers)
        self._opened = letter, ast.literal_eval(opening)
        exercise(*self._opened)
        return {}

    def cell(self, source: str, names: Sequence[str] = ()) -> dict[str, Any]:
        """Run a cell: the error it ends with, if any, and the types of what it hands in.

        `names` are those by which a check cell calls the exercise; they get it as it was handed out.
        """
        handed_in: dict[str, Any] = {}
        if names:
            self._shell.push(dict.fromkeys(names, Task(exercise(*self._opened), handed_in)))
        done = self._shell.run_cell(source)
        if "matplotlib.pyplot" in sys.modules:
            sys.modules["matplotlib.pyplot"].close("all")
        error = done.error_before_exec or done.error_in_exec
        self._answers |= handed_in  # earlier ones stay: later steps may stand on them
        answers = {str(name): None if callable(one) else type(one).__name__ for name, one in handed_in.items()}
        return {"error": error and [type(error).__name__, _text(error)], "answers": answers}

    def ask(self, question: str, arguments: Any, seconds: float) -> dict[str, Any]:
        """Call the function handed in for a question: its value, or how it fails."""
        try:
            with time_limit(seconds), np.errstate(all="ignore"):
                return {"value": encode(self._answers[question](*decode(arguments, self._proxy)))}
        except OutOfTime:
            return {"fails": "late", "says": ""}
        except Closed:
            raise
        except RecursionError:
            return {"fails": "stops", "says": "calls itself without end (RecursionError)"}
        except BaseException as error:
            if isinstance(error, NotImplementedError) and not in_library(error):
                return {"fails": "missing", "says": ""}
            return {"fails": "stops", "says": f"stops with {told(error)}"}

    def _proxy(self, number: int) -> Any:
        """A function of the grader's: called there, with these values."""

        def function(*values: Any, **named: Any) -> Any:
            self._channel.send({"call": number, "values": encode(values), "named": {k: encode(v) for k, v in named.items()}})
            answer = self._channel.receive()
            if "value" in answer:
                return decode(answer["value"])
            kind = getattr(builtins, str(answer.get("raises")), ValueError)
            raise (kind if isinstance(kind, type) and issubclass(kind, Exception) else ValueError)(str(answer.get("says")))

        return function


def _not_checked(self: Exercise, name: str, answer: Any) -> Result:
    return Result(name, "", "not run", "not checked here")


def _nobody_answers(*_: Any) -> NoReturn:
    raise StdinNotImplementedError("nobody is there to answer input() while a notebook is graded")


def _text(error: BaseException) -> str:
    try:
        return str(error)[:500]
    except Exception:  # of a class of the student's
        return "no message"


def serve(channel: Channel, protected: Sequence[str], memory: int) -> None:
    """Do what comes, until nobody is there any more."""
    session = Session(channel)
    limit_process(memory)
    watch(channel, Path.cwd(), protected)
    work: dict[str, Any] = {"open": session.open, "cell": session.cell, "ask": session.ask}
    while True:
        try:
            message = channel.receive()
            number = message.pop("id")
            channel.send(work[message.pop("do")](**message) | {"id": number})
        except Closed:
            return
        except KeyboardInterrupt:
            continue


STARTS = ("subprocess.Popen", "os.system", "os.fork", "os.forkpty", "os.exec", "os.posix_spawn", "os.spawn", "os.startfile")
NETWORK = ("socket.connect", "socket.bind", "socket.getaddrinfo", "socket.sendto", "socket.gethostbyname")
SIGNALS = ("os.kill", "os.killpg", "signal.pthread_kill")
WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


def watch(channel: Channel, folder: Path, protected: Sequence[str]) -> None:
    """Tell the grader what an exercise has no need of, and open none of the files in the protected folders.

    For what is done plainly.  Whoever wants to get round this can: it is no sandbox.
    """
    home = os.path.realpath(folder.parent)
    said: set[str] = set()
    needed = [_folder(path) for path in (sys.prefix, sys.base_prefix, home, *sys.path)]  # perhaps inside of a closed one
    closed = {path: tuple(place for place in needed if place.startswith(path)) for path in map(_folder, protected)}
    tell = channel.send

    def note(text: str) -> None:
        if text not in said and len(said) < 20:
            said.add(text)
            tell({"note": text})

    def heard(event: str, arguments: tuple) -> None:
        if event == "open":
            path, _, flags = arguments
            if not isinstance(path, str | bytes | os.PathLike):
                return
            place = os.path.realpath(os.fsdecode(path))
            if any(place.startswith(path) and not place.startswith(inside) for path, inside in closed.items()):
                note(f"reads {place}")
                raise PermissionError(f"{place} is closed while notebooks are graded")
            if isinstance(flags, int) and flags & WRITES and not place.startswith((home + os.sep, "/dev/")):
                note(f"writes {place}")
        elif event in ("os.remove", "os.rename", "os.rmdir", "shutil.rmtree") and isinstance(arguments[0], str | os.PathLike):
            place = os.path.realpath(arguments[0])
            if not place.startswith(home + os.sep):
                note(f"removes {place}")
        elif event in STARTS:
            note("starts processes")
        elif event in NETWORK:
            note("uses the network")
        elif event in SIGNALS:
            note("sends signals to processes")

    sys.addaudithook(heard)


def _folder(path: str) -> str:
    return os.path.realpath(path) + os.sep


def main() -> None:
    """The process: messages come and go where standard input and output were, which are closed to the notebook."""
    protected, memory = sys.argv[1:-1], int(sys.argv[-1])
    channel = Channel(os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb"))
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):
        os.dup2(nowhere, stream)
    sys.meta_path[:] = [finder for finder in sys.meta_path if "__editable__" not in getattr(finder, "__module__", "")]
    serve(channel, protected, memory)


if __name__ == "__main__":
    main()
