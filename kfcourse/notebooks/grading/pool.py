"""Grading processes, each with a notebook at a time: watched, ended when they hang, and started anew when a notebook ends one."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from queue import SimpleQueue

from tqdm import tqdm

from kfcourse.notebooks.grading import keeper
from kfcourse.notebooks.grading.channel import Closed, Late, Patient
from kfcourse.notebooks.grading.marking import Setting
from kfcourse.notebooks.grading.running import START
from kfcourse.notebooks.grading.submissions import Returned
from kfcourse.notebooks.grading.table import FAILED, Grade
from kfcourse.notebooks.grading.values import Strange
from kfcourse.notebooks.grading.worker import grade_of, packed

QUIET = 150.0  # seconds that a comparison, with the search for the kind of mistake, may take in all
AGAIN = 3  # answers of a notebook that may end, or stop, the grading process before the notebook is given up


class Worker:
    """A grading process."""

    def __init__(self, setting: Setting):
        self._setting = setting
        self._process: subprocess.Popen | None = None

    def __call__(self, work: Returned) -> Grade:
        """The grade; a process that ends or hangs is a row."""
        skip: list[str] = []
        while True:
            self._question = ""
            try:
                return self._ask(work, skip)
            except Late:
                problem = "the grading process hung"
            except (Closed, Strange):
                problem = "it killed its process"
            self.end()
            if not self._question or self._question in skip or len(skip) == AGAIN:
                return Grade(work.name, FAILED, note=problem)
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
        self._process = subprocess.Popen(
            [sys.executable, "-m", "kfcourse.notebooks.grading.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=os.name == "posix",  # Ctrl-C is for the command
        )
        assert self._process.stdin and self._process.stdout
        self._channel = Patient(self._process.stdout, self._process.stdin)
        self._channel.send(packed(self._setting))

    def end(self) -> None:
        """End the process, and what a notebook has started below it."""
        process, self._process = self._process, None
        if process is None:
            return
        if os.name == "posix":
            keeper.end(process.pid)
            with suppress(OSError):
                os.killpg(process.pid, signal.SIGKILL)
        with suppress(OSError):
            process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            with suppress(OSError):
                pipe.close()  # type: ignore[union-attr]


@contextmanager
def grading(setting: Setting, workers: int) -> Iterator[Callable[[Sequence[Returned]], Iterator[Grade]]]:
    """A function that grades notebooks in so many processes, and yields the grades as they come, with a progress bar."""
    free: SimpleQueue[Worker] = SimpleQueue()
    made = [Worker(setting) for _ in range(workers)]
    for worker in made:
        free.put(worker)

    def one(work: Returned) -> Grade:
        worker = free.get()
        try:
            return worker(work)
        finally:
            free.put(worker)

    def run(works: Sequence[Returned]) -> Iterator[Grade]:
        tasks = [threads.submit(one, work) for work in works]
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
