"""Grading processes: each holds the right answers and compares, one notebook after another.

A notebook that ends its grading process, or makes it hang, is not graded; a new process goes on
with the next one.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path

from tqdm import tqdm

from kfcourse.exercises.grading import marking, sandbox
from kfcourse.exercises.grading.channel import close_streams
from kfcourse.exercises.grading.marking import Setting
from kfcourse.exercises.grading.results import FAILED, Grade
from kfcourse.exercises.grading.running import MEMORY, START, WHOLE
from kfcourse.exercises.grading.sandbox import Sandbox
from kfcourse.exercises.grading.staging import packages, stage
from kfcourse.exercises.grading.submissions import Returned
from kfcourse.limits import limit_process

# seconds for what is ours: making the notebook of a variant, comparing, searching for the kinds of
# mistakes
QUIET = 600.0


class Grader:
    """A grading process, started when there is something to grade, and anew when a notebook has
    ended it."""

    def __init__(self, setting: Setting):
        self._setting = setting
        self._pool: ProcessPoolExecutor | None = None
        self._pid: int | None = None

    def __call__(self, work: Returned) -> Grade:
        try:
            if self._pool is None:
                context = multiprocessing.get_context(
                    "forkserver" if sys.platform == "linux" else "spawn"
                )
                context.set_forkserver_preload([__name__, "kfcourse.exercises.sets"])
                self._pool = ProcessPoolExecutor(1, context, _begin)
                self._pid = self._pool.submit(os.getpid).result()
            limit = START + 2 * WHOLE * work.seconds + QUIET
            return self._pool.submit(marking.grade, work, self._setting).result(limit)
        except TimeoutError:
            problem = "the grading process hung"
        except BrokenProcessPool:
            problem = (
                "the grading process was killed, by the notebook, by somebody else, or for "
                "want of memory"
            )
        self.end()
        return Grade(work.name, FAILED, notes=(problem,))

    def end(self) -> None:
        """End the process, and what is below it."""
        pool, self._pool = self._pool, None
        if pool is not None:
            if self._pid is not None:
                sandbox.end_with_all_below(self._pid)
            pool.shutdown(wait=False, cancel_futures=True)


def _begin() -> None:
    """In a new grading process: Ctrl-C and the screen are the command's, and without the command it
    ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    close_streams()
    parent = multiprocessing.parent_process()
    assert parent is not None

    def follow() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
    limit_process(3 * MEMORY)


@contextmanager
def place(folder: Path, masters: Path | None, kind: str) -> Iterator[Sandbox]:
    """Where notebooks run: a copy of the package without the answers, and the sandbox that hides
    the rest."""
    with tempfile.TemporaryDirectory(prefix="kfcourse-") as made:
        staged = stage(Path(made).resolve())
        hidden = [*packages(), folder, *([masters] if masters else [])]
        yield Sandbox(kind, staged, tuple(str(path.resolve()) for path in hidden))


def graded(works: Sequence[Returned], setting: Setting, workers: int) -> Iterator[Grade]:
    """The grades as they come, so many notebooks at once, with a progress bar."""
    own, graders = threading.local(), list[Grader]()

    def begin() -> None:
        own.grader = Grader(setting)
        graders.append(own.grader)

    threads = ThreadPoolExecutor(workers, initializer=begin)
    try:
        tasks = [threads.submit(lambda work: own.grader(work), work) for work in works]
        for task in tqdm(
            as_completed(tasks), desc="grade", total=len(tasks), unit="notebook", disable=None
        ):
            yield task.result()
    finally:
        threads.shutdown(wait=False, cancel_futures=True)
        for grader in graders:
            grader.end()
        threads.shutdown()
