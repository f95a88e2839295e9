"""Where a returned notebook runs: in bubblewrap's sandbox, or as any program of yours."""

from __future__ import annotations

import os
import shutil
import signal
import site
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import psutil  # type: ignore[import-untyped]

KINDS = ("bwrap", "none")
PROTECTION = {
    "bwrap": "bubblewrap: no network, no files but the package's and an empty folder, nothing "
    "left running",
    "none": "NONE: each notebook could read the right answers, change your files and the other "
    "notebooks, and use your network",
}
SYSTEM = ("/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64", "/libx32", "/opt")
ETC = ("/etc/ld.so.cache", "/etc/fonts", "/etc/alternatives", "/etc/localtime", "/etc/mime.types")


@dataclass(frozen=True)
class Sandbox:
    """How processes of notebooks are started.

    Attributes
    ----------
    kind : {"bwrap", "none"}
    stage : Path
        Of the package as notebooks see it.
    hidden : tuple of str
        Folders that no notebook may see in the sandbox: the package with the answers, the returned
        notebooks.
    """

    kind: str
    stage: Path
    hidden: tuple[str, ...] = ()

    def start(
        self, command: Sequence[str], folder: Path, environment: Mapping[str, str]
    ) -> subprocess.Popen:
        """Start a command in `folder`, where it may write; it reads the package on the stage and
        Python's libraries."""
        return subprocess.Popen(
            [*(self.bubblewrap(folder) if self.kind == "bwrap" else ()), *command],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            cwd=folder,
            env=dict(environment),
            start_new_session=True,
        )

    def bubblewrap(self, folder: Path) -> list[str]:
        """The beginning of a command that runs in the sandbox."""
        options = ["bwrap", "--unshare-all", "--die-with-parent", "--new-session"]
        options += ["--proc", "/proc", "--dev", "/dev", "--tmpfs", "/tmp"]
        for place in SYSTEM:
            if os.path.islink(place):
                options += ["--symlink", os.readlink(place), place]
            elif os.path.isdir(place):
                options += ["--ro-bind", place, place]
        for file in ETC:
            options += ["--ro-bind-try", file, file]
        libraries = [sys.base_prefix, sys.prefix]
        if site.ENABLE_USER_SITE:
            libraries.append(sysconfig.get_path("purelib", f"{os.name}_user"))
        for place in dict.fromkeys(libraries):
            if not any(Path(place).is_relative_to(known) for known in SYSTEM):
                options += ["--ro-bind-try", place, place]
        seen = [os.path.realpath(place) for place in (*SYSTEM, *libraries)]
        for place in self.hidden:
            if os.path.isdir(place) and any(
                Path(place).resolve().is_relative_to(known) for known in seen
            ):
                options += ["--tmpfs", place]
        # the package as notebooks see it, whatever was hidden
        options += ["--ro-bind", str(self.stage), str(self.stage)]
        return [*options, "--bind", str(folder), str(folder), "--chdir", str(folder)]


def was_killed(process: subprocess.Popen) -> bool:
    """Whether a process that has closed its pipe was killed, such as by a system without memory."""
    with suppress(subprocess.TimeoutExpired):
        process.wait(2)
    return process.poll() in (-9, 128 + 9)  # the signal, and as bubblewrap tells it


def end(process: subprocess.Popen) -> None:
    """End a process with all that is still below it or in its session.  Its output is not closed:
    what has escaped may hold the pipe open, and closing would wait for the thread that reads."""
    with suppress(OSError):
        end_with_all_below(process.pid)
        if os.name == "posix":
            os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def end_with_all_below(pid: int) -> None:
    """Kill a process, and what it has started so far as it is still below it."""
    with suppress(psutil.Error):
        process = psutil.Process(pid)
        for child in (*process.children(recursive=True), process):
            with suppress(psutil.Error):
                child.kill()


def problem(box: Sandbox) -> str:
    """Why bubblewrap does not work here; nothing if it does."""
    if not shutil.which("bwrap"):
        return "bubblewrap is not installed (Debian, Ubuntu: apt install bubblewrap)"
    with tempfile.TemporaryDirectory() as folder:
        command = [*box.bubblewrap(Path(folder).resolve()), sys.executable, "-I", "-c"]
        done = subprocess.run([*command, "import numpy"], capture_output=True, text=True)
    words = (done.stderr.strip().splitlines() or ["no message"])[-1][:200]
    return f"bubblewrap does not work here: {words}" if done.returncode else ""
