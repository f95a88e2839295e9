"""Grading processes, each with a notebook at a time: watched, ended when they hang, and started anew when a notebook ends one."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from queue import SimpleQueue

from tqdm import tqdm

from kfcourse.notebooks.grading import keeper
from kfcourse.notebooks.grading.channel import Closed, Late, Patient
from kfcourse.notebooks.grading.marking import Setting
from kfcourse.notebooks.grading.running import START, Site
from kfcourse.notebooks.grading.sandbox import chosen
from kfcourse.notebooks.grading.staging import answers, stage
from kfcourse.notebooks.grading.submissions import Returned
from kfcourse.notebooks.grading.table import FAILED, Grade, RunAll, Started
from kfcourse.notebooks.grading.values import Strange
from kfcourse.notebooks.grading.worker import grade_of, packed

QUIET = 150.0  # seconds that a comparison, with the search for the kind of mistake, may take in all
AGAIN = 3  # answers of a notebook that are left out, because they end or stop the grading process, before it is given up


class Family:
    """The processes of this one: those that were there, the grading processes, and what a notebook has left, which is ended."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._ours = frozenset(keeper.below(os.getpid())) if os.name == "posix" else frozenset()
        keeper.adopt()

    def start(self, command: Sequence[str]) -> subprocess.Popen:
        """Start a grading process."""
        with self._lock:
            # Ctrl-C is for the command
            session = os.name == "posix"
            process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=session)
            self._ours |= {process.pid}
            return process

    def end(self, process: subprocess.Popen) -> None:
        """End a grading process, all below it, and what a notebook has left that had ended it."""
        with self._lock:
            if os.name == "posix":
                keeper.end(process.pid)
            process.kill()
            process.wait()
            self._ours -= {process.pid}
            if os.name == "posix":
                keeper.end(os.getpid(), self._ours)


class Worker:
    """A grading process."""

    def __init__(self, setting: Setting, family: Family):
        self._setting, self._family = setting, family
        self._process: subprocess.Popen | None = None

    def __call__(self, work: Returned) -> Grade:
        """The grade; a process that ends or hangs is a row.

        Nobody knows who has killed a process, so the same is done once more; an answer at which it ends again is not graded.
        """
        skip: list[str] = []
        ended = set[str]()
        while True:
            self._question = ""
            try:
                return self._ask(work, skip)
            except Late:
                problem, again = "the grading process hung", False
            except (Closed, Strange):
                problem, again = "the grading process was killed, twice: by the notebook, or by somebody else", True
            self.end()
            at = self._question or "its cells"
            if again and at not in ended:
                ended.add(at)
                continue
            if not self._question or len(skip) == AGAIN:
                return Grade(work.name, FAILED, note=f"{problem}; at {at}")
            skip.append(self._question)

    def _ask(self, work: Returned, skip: Sequence[str]) -> Grade:
        if self._process is None or self._process.poll() is not None:
            self._start()
        self._channel.send({"work": packed(work), "skip": list(skip)})
        while True:
            message = self._channel.wait(time.monotonic() + START + max(QUIET, 2 * work.seconds))
            if "grade" in message:
                return grade_of(message["grade"])
            self._question = message["at"]

    def _start(self) -> None:
        self._process = self._family.start([sys.executable, "-m", "kfcourse.notebooks.grading.worker"])
        assert self._process.stdin and self._process.stdout
        self._channel = Patient(self._process.stdout, self._process.stdin)
        self._channel.send(packed(self._setting))

    def end(self) -> None:
        """End the process, and what a notebook has started below it."""
        process, self._process = self._process, None
        if process is None:
            return
        self._family.end(process)
        for pipe in (process.stdin, process.stdout):
            with suppress(OSError):
                pipe.close()  # type: ignore[union-attr]


@dataclass(frozen=True)
class Order:
    """How a course's notebooks are to be graded, on whatever machine.

    Attributes
    ----------
    folder : Path
        Where they are; absolute, as the masters.
    masters : Path or None
    sandbox : {"auto", "bwrap", "none"}
    salt : str
        Of the hidden arguments.
    """

    folder: Path
    masters: Path | None
    sandbox: str
    salt: str


@contextmanager
def grading(order: Order, workers: int) -> Iterator[tuple[RunAll, set[str]]]:
    """A function that grades notebooks in so many processes, and the kind of sandbox they run in.

    The function says when it begins with a notebook, and yields the grades as they come.
    """
    with tempfile.TemporaryDirectory(prefix="kfcourse-") as made:
        place = Path(made).resolve()
        (place / "stage").mkdir()
        staged = stage(place / "stage")
        hidden = [Path(str(resources.files("kfcourse"))), *answers(), order.folder, *([order.masters] if order.masters else [])]
        held = chosen(order.sandbox, hidden, place, staged)
        with _processes(Setting(Site(staged, held), order.salt), workers) as run:
            yield run, {held.kind}


@contextmanager
def _processes(setting: Setting, workers: int) -> Iterator[RunAll]:
    free: SimpleQueue[Worker] = SimpleQueue()
    family = Family()
    made = [Worker(setting, family) for _ in range(workers)]
    for worker in made:
        free.put(worker)

    def one(work: Returned, started: Started) -> Grade:
        worker = free.get()
        try:
            started(work)
            return worker(work)
        finally:
            free.put(worker)

    def run(works: Sequence[Returned], started: Started) -> Iterator[Grade]:
        tasks = [threads.submit(one, work, started) for work in works]
        for task in tqdm(as_completed(tasks), desc="grade", total=len(tasks), unit="notebook", disable=None):
            yield task.result()

    threads = ThreadPoolExecutor(workers)
    try:
        yield run
    finally:
        threads.shutdown(wait=False, cancel_futures=True)
        for worker in made:
            worker.end()
        threads.shutdown()
