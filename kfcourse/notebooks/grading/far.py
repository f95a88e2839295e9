"""Grading on the workers of a Dask scheduler.

There each notebook is graded below a process of its own, by what the command does with notebooks on its machine.  So all that is
ended with a notebook is its own, on a worker of many threads, too; and with the worker everything ends.
"""

from __future__ import annotations

import json
import os
import secrets
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import as_completed
from contextlib import contextmanager
from pathlib import Path

from tqdm import tqdm

from kfcourse.files import package_digest
from kfcourse.montecarlo.parallel import cluster
from kfcourse.notebooks.grading import keeper
from kfcourse.notebooks.grading.pool import Order, grading
from kfcourse.notebooks.grading.submissions import Returned
from kfcourse.notebooks.grading.table import FAILED, Grade, RunAll, Started
from kfcourse.notebooks.grading.worker import grade_of, packed, returned_of

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
            far.client.subscribe_topic(topic, lambda event: started(named[event[1]]))
            submit = far.client.get_executor(retries=1).submit
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
        The process was killed.
    ValueError
        Notebooks cannot be graded here as they are to be.
    """
    from distributed import get_worker

    get_worker().log_event(topic, work.name)
    asked = {"work": packed(work), "order": packed(order), "package": package}
    command, life = [sys.executable, "-m", __name__], os.pipe()
    try:
        if os.name == "posix":  # what keeps the process ends it, and all below it, when this one ends
            command = [sys.executable, "-I", "-S", str(Path(keeper.__file__)), str(life[0]), *command]
        kept = {"pass_fds": life[:1], "start_new_session": True} if os.name == "posix" else {}
        done = subprocess.run(command, input=json.dumps(asked).encode(), capture_output=True, **kept)
    finally:
        for end in life:
            os.close(end)
    if done.returncode:
        raise ChildProcessError(f"status {done.returncode}: {done.stderr.decode(errors='replace')[-2000:]}")
    reply = json.loads(done.stdout)
    if "problem" in reply:
        raise ValueError(f"the Dask worker on {socket.gethostname()}: {reply['problem']}")
    return grade_of(reply["grade"]), reply["kind"]


def main() -> None:
    """Grade the notebook of which standard input tells."""
    asked = json.load(sys.stdin)
    given = asked["order"]
    order = Order(**(given | {key: given[key] and Path(given[key]) for key in ("folder", "masters")}))
    try:
        if package_digest() != asked["package"]:
            raise ValueError(f"another kfcourse is installed there, in {Path(__file__).parents[2]}: install the same version")
        if not order.folder.is_dir():
            raise ValueError(f"it does not see {order.folder}: --dask needs a file system that the workers share")
        with grading(order, 1) as (run, kinds):
            (found,) = run([returned_of(asked["work"])], lambda _: None)
            (kind,) = kinds
    except (ValueError, OSError) as error:
        reply = {"problem": str(error)}
    else:
        reply = {"grade": packed(found), "kind": kind}
    json.dump(reply, sys.stdout)


if __name__ == "__main__":
    main()
