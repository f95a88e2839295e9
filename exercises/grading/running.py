"""Running a notebook's cells and calling its functions, in a process of its own with limits of time
and memory."""

from __future__ import annotations

import os
import re
import secrets
import shutil
import site
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from kfcourse.exercises.checks import Exercise
from kfcourse.exercises.checks.engine import Missing
from kfcourse.exercises.checks.equality import Unusable
from kfcourse.exercises.grading import sandbox
from kfcourse.exercises.grading.channel import Closed, PatientChannel
from kfcourse.exercises.grading.sandbox import Sandbox
from kfcourse.exercises.grading.staging import FONTS
from kfcourse.exercises.grading.submissions import SECONDS
from kfcourse.exercises.grading.values import ProtocolError, decode, encode
from kfcourse.exercises.notebooks.master import opened
from kfcourse.exercises.notebooks.texts import clean
from kfcourse.limits import OutOfTime

WHOLE = 5  # times as long may a notebook take
MEMORY = 4 * 2**30  # bytes of a notebook's process
START = 60.0  # seconds until a process answers
GRACE = 3.0  # seconds after which a process that stops nothing is stopped
ANSWER = 18.0  # seconds that one call of an answer may take, where a cell may not take less
KILLED = "its process was killed, by the notebook, by somebody else, or for want of memory"


class Stopped(Exception):
    """The notebook does not go on; the message says why."""


class Killed(Stopped):
    """Its process was killed: whose fault that is nobody knows."""


class Ran(NamedTuple):
    """What came of a cell.

    error : its error in words, if any;  stub : whether it is that of an answer that nobody has
    written;
    answers : question to the type of what was handed in, "" for a function.
    """

    error: str
    stub: bool
    answers: dict[str, str]


class Kernel:
    """A notebook's process.  What it sends are values: nothing of it is believed.

    Parameters
    ----------
    place : Sandbox
    exercise : Exercise
        As it was handed out.
    seconds : float
        Time limit of a cell; all cells may take five times as long.
    """

    def __init__(self, place: Sandbox, exercise: Exercise, seconds: float = SECONDS):
        self._place, self.seconds = place, seconds
        self._opening = {
            "do": "open",
            "letter": exercise.letter,
            "opening": opened(exercise),
            "numbers": {f"{exercise.letter} {exercise.variant.name}": exercise.numbers},
        }
        self._deadline = float("inf")
        # cells: an answer that is stopped with its process lets the others be asked
        self._done: list[dict[str, Any]] = []
        self._process: subprocess.Popen | None = None

    def __enter__(self) -> Kernel:
        self._start()
        self._deadline = time.monotonic() + WHOLE * self.seconds
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _start(self) -> None:
        """Start the process, and run the cells that an earlier one has run."""
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        folder = Path(self._folder.name).resolve()
        command = [sys.executable, "-m", "kfcourse.exercises.grading.session", str(MEMORY)]
        self._process = self._place.start(command, folder, environment(folder, self._place.stage))
        assert self._process.stdin and self._process.stdout
        self._channel = PatientChannel(self._process.stdout, self._process.stdin)
        try:
            self._request(self._opening, START)
        except (Stopped, OutOfTime):
            raise RuntimeError("the process of the notebook does not start") from None
        for message in self._done:
            self._request(message, self.seconds)

    def close(self) -> None:
        """End the process and all below it."""
        process, self._process = self._process, None
        if process is not None:
            sandbox.end(process)
            self._folder.cleanup()

    def cell(self, source: str, names: Sequence[str] = ()) -> Ran:
        """Run a cell; `names` are those by which a check cell calls the exercise.

        Raises
        ------
        Stopped
        """
        message = {"do": "cell", "source": source, "names": list(names)}
        try:
            reply = self._request(message, min(self.seconds, self._deadline - time.monotonic()))
        except OutOfTime:
            late = time.monotonic() >= self._deadline
            raise Stopped(
                f"the notebook takes longer than {WHOLE * self.seconds:g} s"
                if late
                else f"still running after {self.seconds:g} s"
            ) from None
        self._done.append(message)
        types = {name: str(kind or "") for name, kind in reply["answers"].items()}
        return Ran(clean(str(reply["error"] or "")), bool(reply["stub"]), types)

    def answer(self, question: str) -> Callable:
        """The function handed in for a question, called in its process."""

        def called(*arguments: Any) -> Any:
            try:
                return self.ask(question, arguments, min(ANSWER, self.seconds))
            except Stopped as reason:
                raise Unusable(str(reason)) from None

        return called

    def ask(self, question: str, arguments: tuple, seconds: float) -> Any:
        """The value of the function handed in for a question.

        Raises
        ------
        Missing, Unusable, OutOfTime
            As an answer that is called here would make `call` of checks/engine.py say; the last
            with the seconds.
        Stopped
        """
        functions: list[Callable] = []
        data = encode(arguments, functions)
        message = {"do": "ask", "question": question, "arguments": data, "seconds": seconds}
        try:
            reply = self._request(message, seconds + GRACE, functions)
            if "value" in reply:
                return decode(reply["value"])
        except OutOfTime:
            raise OutOfTime(seconds) from None
        except ProtocolError as reason:
            raise Unusable(f"returns what cannot be read: {clean(str(reason))}") from None
        fails = reply.get("fails")
        if fails == "missing":
            raise Missing
        if fails == "late":
            raise OutOfTime(seconds)
        raise Unusable(clean(str(fails), 300))

    def _request(
        self, message: dict[str, Any], seconds: float, functions: Sequence[Callable] = ()
    ) -> dict[str, Any]:
        """What the process replies; functions of ours are called when it asks for it."""
        if self._process is None:
            self._start()
        # a reply to nothing is no reply
        number, until = secrets.token_hex(4), time.monotonic() + seconds
        answered = False
        try:
            self._channel.send(message | {"id": number})
            while True:
                reply = self._channel.wait(until)
                if "call" in reply:
                    self._channel.send(_called(reply, functions))
                elif reply.get("id") == number:
                    answered = True
                    return reply
        except TimeoutError:
            raise OutOfTime from None
        except Closed:
            if self._process is not None and sandbox.was_killed(self._process):
                raise Killed(KILLED) from None
            raise Stopped(
                "its process ended (ended by the notebook itself, or out of memory)"
            ) from None
        except ValueError as error:
            raise Stopped(f"sends what is no answer: {clean(str(error))}") from None
        finally:
            # also where a limit of time around this one ended: it may be at work still
            if not answered:
                self.close()


def _called(reply: Mapping[str, Any], functions: Sequence[Callable]) -> dict[str, Any]:
    """What a function of ours makes of the notebook's values."""
    try:
        named = {name: decode(value) for name, value in reply["named"].items()}
        return {"value": encode(functions[reply["call"]](*decode(reply["values"]), **named))}
    except Exception as error:  # of values of the student's, or of a call of nothing
        return {"raises": type(error).__name__, "says": clean(str(error), 300)}


KEPT = re.compile(
    r"PATH|LANG|LC_\w+|TZ|VIRTUAL_ENV|CONDA_PREFIX|\w*LD_LIBRARY_PATH|SYSTEMROOT|WINDIR|COMSPEC|PATHEXT",
    re.IGNORECASE,
)


def environment(folder: Path, stage: Path) -> dict[str, str]:
    """Environment variables of a notebook's process: few of ours, and a home of its own."""
    fonts = shutil.copytree(stage / FONTS, folder / ".matplotlib")
    kept = {name: value for name, value in os.environ.items() if KEPT.fullmatch(name)}
    homes = dict.fromkeys(("HOME", "USERPROFILE", "TMPDIR", "TEMP"), str(folder))
    switches = ("PYTHONDONTWRITEBYTECODE", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
    return (kept | homes | dict.fromkeys(switches, "1")) | {
        "PYTHONPATH": str(stage),  # nothing of yours
        "IPYTHONDIR": str(folder / ".ipython"),
        "MPLCONFIGDIR": str(fonts),
        "MPLBACKEND": "agg",
        "PYTHONUSERBASE": site.getuserbase(),
    }
