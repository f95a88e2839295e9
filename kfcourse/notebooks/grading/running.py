"""Running a notebook in a kernel and a folder of its own, with limits of time, output and memory."""

from __future__ import annotations

import asyncio
import logging
import os
import re
import shutil
import signal
import site
import subprocess
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import matplotlib
from nbclient import NotebookClient
from nbclient.exceptions import CellTimeoutError, DeadKernelError
from nbformat import NotebookNode

from kfcourse.notebooks.grading.submissions import SECONDS

WHOLE = 5  # times as long may a notebook take
MEMORY = 4 * 2**30  # bytes of a kernel
OUTPUT = 10 * 2**20  # characters that a notebook may print, pictures included


class _Client(NotebookClient):
    """Executes a notebook as far as it goes; remembers where it is, and stops one that prints without end."""

    def __init__(self, notebook: NotebookNode, seconds: float):
        self.at = 0
        self.group = 0
        self.printed = 0
        self.deadline: float | None = None
        super().__init__(
            notebook,
            kernel_name="python3",
            timeout_func=lambda _: self._left(seconds),
            allow_errors=True,
            record_timing=False,
            shutdown_kernel="immediate",
            extra_arguments=["--log-level=CRITICAL"],
            on_notebook_start=self._started,
            on_cell_start=self._reached,
        )
        self.log = logging.getLogger("kfcourse.grade")  # what it would log is told in the table
        self.log.setLevel(logging.CRITICAL + 1)

    def _left(self, seconds: float) -> int:
        if self.deadline is None:
            self.deadline = time.monotonic() + WHOLE * seconds
        return max(1, round(min(seconds, self.deadline - time.monotonic())))

    def _started(self, notebook: NotebookNode) -> None:
        assert self.km is not None
        self.group = getattr(self.km.provisioner, "pgid", None) or 0

    def _reached(self, cell: NotebookNode, cell_index: int) -> None:
        self.at = cell_index

    def process_message(self, msg: dict[str, Any], cell: NotebookNode, cell_index: int) -> NotebookNode | None:
        self.printed += len(str(msg["content"]))
        if self.printed > OUTPUT:
            kill(self.group)
            return None
        return super().process_message(msg, cell, cell_index)


def run(notebook: NotebookNode, seconds: float = SECONDS) -> tuple[NotebookNode, str]:
    """Run a notebook in a new kernel and an empty folder, errors kept as outputs.

    Parameters
    ----------
    notebook : NotebookNode
        Its outputs are filled in.
    seconds : float
        Time limit of each cell; the notebook's is five times that.

    Returns
    -------
    notebook, stopped : NotebookNode, str
        `stopped` says where and why it did not come to its end; empty if it did.

    Raises
    ------
    RuntimeError
        No kernel starts.
    """
    client = _Client(notebook, seconds)
    reason = ""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        work = Path(folder) / "work"
        work.mkdir()
        try:
            asyncio.run(
                client.async_execute(
                    cwd=str(work), env=environment(Path(folder)), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
                )
            )
        except CellTimeoutError:
            late = client.deadline is not None and time.monotonic() > client.deadline - 1
            reason = f"the notebook takes longer than {WHOLE * seconds:g} s" if late else f"still running after {seconds:g} s"
        except DeadKernelError:
            reason = "the kernel died (out of memory, or ended by the notebook itself)"
        finally:
            kill(client.group)  # what it may have left running
        if client.printed > OUTPUT:
            reason = f"printed more than {OUTPUT // 2**20} MB"
    return notebook, f"{notebook.cells[client.at].metadata['where']}: {reason}" if reason else ""


def kill(group: int) -> None:
    """End all processes of a kernel's group."""
    if group and hasattr(os, "killpg"):
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(group, signal.SIGKILL)


KEPT = re.compile(
    r"PATH|LANG|LC_\w+|TZ|VIRTUAL_ENV|CONDA_PREFIX|\w*LD_LIBRARY_PATH|SYSTEMROOT|WINDIR|COMSPEC|PATHEXT", re.IGNORECASE
)


def environment(folder: Path) -> dict[str, str]:
    """Environment variables of a kernel: few of ours, and a home of its own."""
    fonts = folder / "matplotlib"
    fonts.mkdir()
    for path in Path(matplotlib.get_cachedir()).glob("fontlist*.json"):  # otherwise each kernel searches for fonts again
        shutil.copy(path, fonts)
    packages = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    return {name: value for name, value in os.environ.items() if KEPT.fullmatch(name)} | {
        "PYTHONPATH": os.pathsep.join(os.path.abspath(path) for path in packages if path),
        "HOME": str(folder),
        "USERPROFILE": str(folder),
        "IPYTHONDIR": str(folder / "ipython"),
        "MPLCONFIGDIR": str(fonts),
        "TMPDIR": str(folder),
        "TEMP": str(folder),
        "PYTHONUSERBASE": site.getuserbase(),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
