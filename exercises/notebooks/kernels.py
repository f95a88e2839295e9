"""Kernels that start with the libraries of the course imported: forks of one process that has done
it.

To import NumPy, SymPy, Matplotlib and the package takes longer than many a notebook.  Jupyter has
its kernels from a provisioner, chosen by its name in the environment variable
JUPYTER_DEFAULT_PROVISIONER_NAME.
"""

from __future__ import annotations

import gc
import logging
import multiprocessing
import os
import signal
import sys
import threading
import uuid
from importlib.metadata import entry_points
from multiprocessing import forkserver
from multiprocessing.context import ForkServerProcess
from typing import Any

from jupyter_client.connect import KernelConnectionInfo
from jupyter_client.provisioning import LocalProvisioner

FORKED = "kfcourse-forked"  # the name in pyproject.toml
LAUNCHER = "ipykernel_launcher"
# The last: a fork is told how its parent starts processes, and a worker of joblib does it in
# joblib's way.
IMPORTED = [
    "ipykernel.kernelapp",
    "matplotlib.backends.backend_svg",
    "scipy.special",
    "scipy.linalg",
    "scipy.stats",
    "sympy.physics.units",
    "kfcourse.pages",
    "kfcourse.exercises.sets",
    "joblib",
]


def prefer_forked() -> None:
    """From now on kernels are forked, those of processes started later too; unless others are
    chosen, or these not installed."""
    if entry_points(group="jupyter_client.kernel_provisioners", name=FORKED):
        os.environ.setdefault("JUPYTER_DEFAULT_PROVISIONER_NAME", FORKED)


class ForkedProvisioner(LocalProvisioner):
    """A Python kernel is a fork by the fork server of the standard library; any other is started as
    usual.

    Linux only: elsewhere a process cannot be forked, or not safely once libraries are loaded.
    """

    process: Any  # a Fork, or the Popen of the usual way

    async def pre_launch(self, **kwargs: Any) -> dict[str, Any]:
        """Name the kernel's sockets.

        Ports are chosen here and taken by the kernel much later: meanwhile another process may
        choose the same.  A name is the kernel's own, and begins with @: known to Linux alone, no
        file.
        """
        manager = self.parent
        # started again it keeps its own
        if manager and manager.transport == "tcp" and self._forks(self.kernel_spec.argv):
            manager.transport, manager.ip, manager.cache_ports = (
                "ipc",
                f"@{FORKED}-{uuid.uuid4()}",
                False,
            )
        return await super().pre_launch(**kwargs)

    def _forks(self, cmd: list[str]) -> bool:
        return sys.platform == "linux" and LAUNCHER in cmd

    async def launch_kernel(self, cmd: list[str], **kwargs: Any) -> KernelConnectionInfo:
        """Start the kernel that `cmd` (python -m ipykernel_launcher ...) would start."""
        if not self._forks(cmd):
            return await super().launch_kernel(cmd, **kwargs)
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(IMPORTED)
        # deaf to Ctrl-C, which is for the command: it would print where its imports stopped
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            forkserver.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        arguments = cmd[cmd.index(LAUNCHER) + 1 :]
        process = context.Process(
            target=serve, args=(arguments, dict(kwargs["env"]), kwargs.get("cwd"))
        )
        process.start()
        self.process, self.pid = Fork(process), process.pid
        return self.connection_info


class Fork:
    """A forked process with what Jupyter asks of a `subprocess.Popen`."""

    stdin = stdout = stderr = None

    def __init__(self, process: ForkServerProcess):
        self._process = process
        self.kill, self.terminate = process.kill, process.terminate

    def poll(self) -> int | None:
        return self._process.exitcode

    def wait(self) -> int | None:
        self._process.join()
        return self._process.exitcode

    def send_signal(self, number: int) -> None:
        if self._process.pid is not None and self._process.is_alive():
            os.kill(self._process.pid, number)


def serve(arguments: list[str], environment: dict[str, str], folder: str | None) -> None:
    """In the fork: be a kernel, with the environment and in the folder that it shall have."""
    from ipykernel.kernelapp import IPKernelApp

    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])  # as for any kernel
    threading.Thread(target=_follow, daemon=True).start()
    # what has been imported stays: not to be looked through, nor copied for that, at every
    # collection
    gc.freeze()
    os.environ.clear()
    os.environ.update(environment)
    if folder is not None:
        os.chdir(folder)
    sys.argv = [LAUNCHER, *arguments]
    # Without its parent, the fork server, it ends itself.
    kernel = IPKernelApp.instance(parent_handle=os.getppid(), log_level=logging.ERROR)
    kernel.initialize(arguments)
    if kernel.shell is not None:
        # as pyplot does when it is imported in a kernel; here it has been
        kernel.shell.enable_matplotlib("inline")
    kernel.start()


def _follow() -> None:
    """End with the process that wanted the kernel: the fork server would not, as long as one of its
    forks lives."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
