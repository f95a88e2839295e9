"""Running a notebook's cells and calling its functions, in a process of its own with limits of time and memory."""

from __future__ import annotations

import os
import re
import secrets
import shutil
import site
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from kfcourse.checks.engine import Missing
from kfcourse.checks.equality import Unusable
from kfcourse.limits import OutOfTime
from kfcourse.notebooks.grading.channel import Closed, Late, Patient
from kfcourse.notebooks.grading.sandbox import Process, Sandbox
from kfcourse.notebooks.grading.staging import FONTS
from kfcourse.notebooks.grading.submissions import SECONDS
from kfcourse.notebooks.grading.values import Strange, decode, encode
from kfcourse.notebooks.texts import clean

WHOLE = 5  # times as long may a notebook take
MEMORY = 4 * 2**30  # bytes of a notebook's process
START = 60.0  # seconds until a process answers
GRACE = 3.0  # seconds after which a process that stops nothing is stopped
ANSWER = 18.0  # seconds that one call of an answer may take, where a cell may not take less
ANSWERS = 45.0  # all calls of it, those of the search for the kind of mistake included


class Stopped(Exception):
    """The notebook does not go on; the message says why."""


class Ended(Stopped):
    """Its process was killed, and killed again when the same was asked once more: whose fault that is nobody knows."""


class Killed(Exception):
    """The process that keeps the notebook's was killed."""


class Lost(Unusable):
    """An answer that got its process killed, twice."""


class Opening(NamedTuple):
    """The exercise as the notebook opens it: its letter, the variant as code, personal numbers by "letter variant"."""

    letter: str
    variant: str
    numbers: Mapping[str, Mapping[str, float]]


class Ran(NamedTuple):
    """What came of a cell: name and text of its error; question to the type of what was handed in, "" for a function."""

    error: tuple[str, str] | None
    answers: dict[str, str]


@dataclass(frozen=True)
class Site:
    """Where notebooks run.

    Attributes
    ----------
    stage : Path
        The package as they see it.
    sandbox : Sandbox
    """

    stage: Path
    sandbox: Sandbox


class Kernel:
    """A notebook's process.  What it sends are values, and notes on what it does: nothing of it is believed.

    Parameters
    ----------
    place : Site
    opening : Opening
    seconds : float
        Time limit of a cell; all cells may take five times as long.
    """

    def __init__(self, place: Site, opening: Opening, seconds: float = SECONDS):
        self.notes: list[str] = []
        self._place, self._opening, self.seconds = place, opening, seconds
        self._deadline = float("inf")
        self._done: list[tuple[str, tuple[str, ...]]] = []  # cells, to be run again
        self._process: Process | None = None
        self._pending = False

    def __enter__(self) -> Kernel:
        self._start()
        self._deadline = time.monotonic() + WHOLE * self.seconds
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _start(self) -> None:
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        folder = Path(os.path.realpath(self._folder.name))
        (folder / "work").mkdir()
        stage, sandbox = self._place.stage, self._place.sandbox
        command = [sys.executable, "-m", "kfcourse.notebooks.grading.session", *sandbox.hidden, str(MEMORY)]
        self._process = sandbox.start(command, folder, stage, environment(folder, stage))
        assert self._process.popen.stdin and self._process.popen.stdout
        self._channel = Patient(self._process.popen.stdout, self._process.popen.stdin)
        self._pending = False
        letter, variant, numbers = self._opening
        message = {"do": "open", "letter": letter, "opening": variant, "numbers": numbers}
        try:
            self._request(message, time.monotonic() + START, [])
        except (Stopped, OutOfTime):
            raise RuntimeError("the process of the notebook does not start") from None

    def close(self) -> None:
        """End the process and all that it started.

        Raises
        ------
        Killed
            So was what keeps it.
        """
        process, self._process = self._process, None
        if process is not None:
            killed = process.end()
            self._folder.cleanup()
            if killed:
                raise Killed("the process that keeps it was killed, twice: by the notebook, or by somebody else")

    def cell(self, source: str, names: Sequence[str] = ()) -> Ran:
        """Run a cell; `names` are those by which a check cell calls the exercise.

        Raises
        ------
        Stopped, Killed
        """
        message = {"do": "cell", "source": source, "names": list(names)}
        try:
            reply = self._once_more(lambda: self._request(message, min(time.monotonic() + self.seconds, self._deadline), []))
        except OutOfTime:
            late = time.monotonic() >= self._deadline
            long = f"the notebook takes longer than {WHOLE * self.seconds:g} s" if late else ""
            raise Stopped(long or f"still running after {self.seconds:g} s") from None
        self._done.append((source, tuple(names)))
        error, answers = reply.get("error"), reply.get("answers")
        told = (clean(str(error[0]), 60), clean(str(error[1]))) if isinstance(error, list) and len(error) == 2 else None
        types = {str(name): str(kind or "") for name, kind in answers.items()} if isinstance(answers, dict) else {}
        return Ran(told, types)

    def ask(self, question: str, arguments: tuple, seconds: float) -> Any:
        """The value of the function handed in for a question.

        Raises
        ------
        Missing, Unusable, OutOfTime
            As an answer that is called here would make `kfcourse.checks.engine.call` say; the last with the seconds.
        """
        functions: list[Callable] = []

        def number(function: Callable) -> int:
            functions.append(function)
            return len(functions) - 1

        sent = encode(arguments, number)
        message = {"do": "ask", "question": question, "arguments": sent, "seconds": seconds}
        try:
            reply = self._once_more(lambda: self._request(message, time.monotonic() + seconds + GRACE, functions))
        except OutOfTime:
            raise OutOfTime(seconds) from None
        except Ended as reason:
            raise Lost(str(reason)) from None
        except Stopped as reason:
            raise Unusable(str(reason)) from None
        try:
            if "value" in reply:
                return decode(reply["value"])
        except Strange as reason:
            raise Unusable(f"returns what cannot be read: {clean(str(reason))}") from None
        if reply.get("fails") == "missing":
            raise Missing
        if reply.get("fails") == "late":
            raise OutOfTime(seconds)
        raise Unusable(clean(str(reply.get("says")), 300))

    def _once_more(self, request: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """What a living process replies; one that is killed meanwhile is started anew, and asked again."""
        self._revive()
        try:
            return request()
        except Ended:
            self._revive()
            return request()

    def _revive(self) -> None:
        """Start anew, and run all cells again, if the process was ended in the midst of a question."""
        if self._process is not None and not self._pending:
            return
        self.close()
        self._start()
        for source, names in self._done:
            until = min(time.monotonic() + self.seconds, self._deadline)
            try:
                self._request({"do": "cell", "source": source, "names": list(names)}, until, [])
            except OutOfTime:
                raise Stopped("the cells before it, run once more, take too long") from None

    def _request(self, message: dict[str, Any], until: float, functions: Sequence[Callable]) -> dict[str, Any]:
        """What the process replies; functions of ours are called when it asks for it."""
        self._pending = True
        number = secrets.token_hex(4)  # a reply to nothing is no reply
        try:
            self._channel.send(message | {"id": number})
            while True:
                reply = self._channel.wait(until, self._keeper_lives)
                if "note" in reply:
                    self.notes += [clean(str(reply["note"]))] * (len(self.notes) < 20)
                elif "call" in reply:
                    self._channel.send(_called(reply, functions))
                elif reply.get("id") == number:
                    self._pending = False
                    return reply
        except Late:
            self.close()
            raise OutOfTime from None
        except Closed:
            killed = self._process is not None and self._process.killed()
            self.close()
            if killed:
                raise Ended("its process was killed, twice (out of memory, by the notebook, or by somebody else)") from None
            raise Stopped("its process ended (ended by the notebook itself, or out of memory)") from None
        except (Strange, ValueError) as error:
            self.close()
            raise Stopped(f"sends what is no answer: {clean(str(error))}") from None

    def _keeper_lives(self) -> None:
        if self._process is not None and self._process.keeper_killed:
            self.close()


def _called(reply: Mapping[str, Any], functions: Sequence[Callable]) -> dict[str, Any]:
    """What a function of ours makes of the notebook's values."""
    try:
        values, named = decode(reply.get("values")), reply.get("named") or {}
        number = reply["call"]
        if type(number) is not int or not 0 <= number < len(functions) or not isinstance(values, tuple):
            raise Strange("a call of nothing")
        return {"value": encode(functions[number](*values, **{str(key): decode(one) for key, one in named.items()}))}
    except Exception as error:  # of values of the student's
        return {"raises": type(error).__name__, "says": clean(str(error), 300)}


class Answer:
    """A function of a notebook's, called in its process."""

    def __init__(self, kernel: Kernel, question: str):
        self._kernel, self._question, self._left = kernel, question, ANSWERS
        self._most = min(ANSWER, kernel.seconds)
        self.lost = ""  # why no answer could be had

    def __call__(self, *arguments: Any) -> Any:
        if self._left <= 0:
            raise OutOfTime
        start = time.monotonic()
        try:
            return self._kernel.ask(self._question, arguments, min(self._most, self._left))
        except Lost as reason:
            self.lost = str(reason)
            raise
        finally:
            self._left -= time.monotonic() - start


KEPT = re.compile(
    r"PATH|LANG|LC_\w+|TZ|VIRTUAL_ENV|CONDA_PREFIX|\w*LD_LIBRARY_PATH|SYSTEMROOT|WINDIR|COMSPEC|PATHEXT", re.IGNORECASE
)


def environment(folder: Path, stage: Path) -> dict[str, str]:
    """Environment variables of a notebook's process: few of ours, and a home of its own."""
    fonts = folder / "matplotlib"
    shutil.copytree(stage / FONTS, fonts)
    return {name: value for name, value in os.environ.items() if KEPT.fullmatch(name)} | {
        "PYTHONPATH": str(stage),  # nothing of yours
        "PYTHONDONTWRITEBYTECODE": "1",
        "HOME": str(folder),
        "USERPROFILE": str(folder),
        "IPYTHONDIR": str(folder / "ipython"),
        "MPLCONFIGDIR": str(fonts),
        "MPLBACKEND": "agg",
        "TMPDIR": str(folder),
        "TEMP": str(folder),
        "PYTHONUSERBASE": site.getuserbase(),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
