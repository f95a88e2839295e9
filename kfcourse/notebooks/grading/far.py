"""Grading on the workers of a Dask scheduler.

There each notebook is graded below a process that has no other meanwhile, by what the command does with notebooks on its machine.
So all that is ended with a notebook is its own, on a worker of many threads, too; and with the worker everything ends.
"""

from __future__ import annotations

import os
import secrets
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import as_completed
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from tqdm import tqdm

from kfcourse.files import package_digest
from kfcourse.montecarlo.parallel import cluster
from kfcourse.notebooks.grading import keeper
from kfcourse.notebooks.grading.channel import Channel, Closed, Late, Patient
from kfcourse.notebooks.grading.pool import Order, grading
from kfcourse.notebooks.grading.submissions import Returned
from kfcourse.notebooks.grading.table import FAILED, Grade, RunAll, Started
from kfcourse.notebooks.grading.values import Strange
from kfcourse.notebooks.grading.worker import grade_of, packed, returned_of

IDLE = 60.0  # seconds without work after which a process ends: its start costs two, and nobody says that all is done
LOST = "the process that graded it was killed, again and again: by the notebook, or by somebody else"


@contextmanager
def far_grading(order: Order, address: str) -> Iterator[tuple[RunAll, set[str]]]:
    """As `grading`, on the workers of the scheduler at an address; the kinds of sandboxes are those that were used so far.

    What a lost worker had begun, another begins anew.  The grades are those of one machine.

    Raises
    ------
    ValueError
        Dask is not installed, or no scheduler or worker is there; a worker has another version of the package, does not see the
        folder, or has no sandbox as it is asked for.
    """
    kinds: set[str] = set()
    topic = f"kfcourse-{secrets.token_hex(8)}"  # of messages
    with cluster(address) as far:
        assert far is not None
        from distributed.scheduler import KilledWorker

        def run(works: Sequence[Returned], started: Started) -> Iterator[Grade]:
            named = {work.name: work for work in works}
            far.subscribe_topic(topic, lambda event: started(named[event[1]]))
            submit = far.get_executor(retries=1).submit
            tasks = {submit(graded, work, order, package_digest(), topic): work for work in works}
            for task in tqdm(as_completed(tasks), desc="grade", total=len(tasks), unit="notebook", disable=None):
                try:
                    grade, kind = task.result()
                except (ChildProcessError, KilledWorker):
                    yield Grade(tasks[task].name, FAILED, note=LOST)
                else:
                    kinds.add(kind)
                    yield grade

        yield run, kinds


def graded(work: Returned, order: Order, package: str, topic: str) -> tuple[Grade, str]:
    """The grade of a notebook, made on a worker, and the kind of its sandbox; it is said that the notebook's turn has come.

    Raises
    ------
    ChildProcessError
        The process that graded it was killed.
    ValueError
        Notebooks cannot be graded here as they are to be.
    """
    from distributed import get_worker

    get_worker().log_event(topic, work.name)
    free = _free.setdefault((order, package), [])
    process = _living(free) or Kept(order, package, get_worker().local_directory)
    try:
        reply = process.grade(work)
    except (Closed, Strange):
        process.end()
        raise ChildProcessError(LOST) from None
    if "problem" in reply:
        process.end()
        raise ValueError(f"the Dask worker on {socket.gethostname()}: {reply['problem']}")
    free.append(process)
    return grade_of(reply["grade"]), reply["kind"]


class Kept:
    """A process that grades as ordered, one notebook at a time, until it has nothing to do for a while.

    What keeps it ends it, with all below it, when this process ends.
    """

    def __init__(self, order: Order, package: str, folder: str):
        self._life, command, posix = os.pipe(), [sys.executable, "-m", __name__], os.name == "posix"
        if posix:
            command = [sys.executable, "-I", "-S", str(Path(keeper.__file__)), str(self._life[0]), *command]
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"TMPDIR": folder},  # the cluster clears it away whatever happens
            pass_fds=self._life[:1] if posix else (),
            start_new_session=posix,
        )
        assert self._process.stdin and self._process.stdout
        self._channel = Channel(self._process.stdout, self._process.stdin)
        self._first = {"order": packed(order), "package": package}

    def grade(self, work: Returned) -> dict[str, Any]:
        """Grade and kind of the sandbox, or a problem; Closed if the process was killed."""
        first, self._first = self._first, {}
        self._channel.send(first | {"work": packed(work)})
        return self._channel.receive()

    @property
    def ended(self) -> bool:
        return self._process.poll() is not None

    def end(self) -> None:
        """End it with all below it."""
        for end in self._life:
            os.close(end)
        self._process.wait()


def _living(free: list[Kept]) -> Kept | None:
    """One that has not ended for want of work."""
    with suppress(IndexError):  # any thread takes from the list
        while (process := free.pop()).ended:
            process.end()
        return process
    return None


_free: dict[tuple[Order, str], list[Kept]] = {}


def main() -> None:
    """Grade what comes, until nothing does."""
    channel = Patient(os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb"))
    try:
        asked = channel.wait(time.monotonic() + IDLE)
        given = asked["order"]
        order = Order(**(given | {key: given[key] and Path(given[key]) for key in ("folder", "masters")}))
        if package_digest() != asked["package"]:
            raise ValueError(f"another kfcourse is installed there, in {Path(__file__).parents[2]}: install the same version")
        if not order.folder.is_dir():
            raise ValueError(f"it does not see {order.folder}: --dask needs a file system that the workers share")
        with grading(order, 1) as (run, kinds):
            while True:
                (grade,), (kind,) = run([returned_of(asked["work"])], lambda _: None), kinds
                channel.send({"grade": packed(grade), "kind": kind})
                asked = channel.wait(time.monotonic() + IDLE)
    except (ValueError, OSError) as error:
        channel.send({"problem": str(error)})
    except (Closed, Late):
        return


if __name__ == "__main__":
    main()
