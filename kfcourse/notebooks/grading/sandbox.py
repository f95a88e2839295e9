"""Where a returned notebook runs: bubblewrap's sandbox if it is installed and works, else a process of its own."""

from __future__ import annotations

import os
import shutil
import signal
import site
import subprocess
import sys
import sysconfig
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from kfcourse.notebooks.grading import keeper

KINDS = ("auto", "bwrap", "none")
HELD = {
    "bwrap": "bubblewrap: no network, no files but the package's and an empty folder, nothing left running",
    "none": "none: notebooks run with your rights; what a notebook starts is ended, other things it does are noted at best",
}
SYSTEM = ("/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64", "/libx32", "/opt")
ETC = ("/etc/ld.so.cache", "/etc/fonts", "/etc/alternatives", "/etc/localtime", "/etc/mime.types")


@dataclass(frozen=True)
class Sandbox:
    """How processes of notebooks are started.

    Attributes
    ----------
    kind : {"bwrap", "none"}
    hidden : tuple of str
        Folders that no notebook may see: the package with the answers, the returned notebooks.
    """

    kind: str
    hidden: tuple[str, ...] = ()

    def start(self, command: Sequence[str], folder: Path, stage: Path, environment: Mapping[str, str]) -> Process:
        """Start a command in `folder/work`; it may write in `folder`, and read the package in `stage` and Python's libraries."""
        if self.kind == "bwrap":
            return Process([*self._bubblewrap(folder, stage), *command], folder / "work", environment)
        if os.name == "posix":
            read, write = os.pipe()
            parent = [sys.executable, "-I", "-S", str(Path(keeper.__file__)), str(read)]
            try:
                return Process([*parent, *command], folder / "work", environment, life=(read, write))
            finally:
                os.close(read)
        return Process(command, folder / "work", environment)

    def _bubblewrap(self, folder: Path, stage: Path) -> list[str]:
        found = ["bwrap", "--unshare-all", "--die-with-parent", "--new-session"]
        found += ["--proc", "/proc", "--dev", "/dev", "--tmpfs", "/tmp"]
        for place in SYSTEM:
            if os.path.islink(place):
                found += ["--symlink", os.readlink(place), place]
            elif os.path.isdir(place):
                found += ["--ro-bind", place, place]
        for file in ETC:
            found += ["--ro-bind-try", file, file]
        libraries = [
            sys.base_prefix,
            sys.prefix,
            *([sysconfig.get_path("purelib", f"{os.name}_user")] if site.ENABLE_USER_SITE else []),
        ]
        for place in dict.fromkeys(libraries):
            if not any(Path(place).is_relative_to(known) for known in SYSTEM):
                found += ["--ro-bind-try", place, place]
        for place in self.hidden:
            seen = (*SYSTEM, *libraries)
            if os.path.isdir(place) and any(Path(place).resolve().is_relative_to(os.path.realpath(known)) for known in seen):
                found += ["--tmpfs", place]
        found += ["--ro-bind", str(stage), str(stage)]  # the package as notebooks see it, whatever was hidden
        return [*found, "--bind", str(folder), str(folder), "--chdir", str(folder / "work")]


class Process:
    """A notebook's process, what keeps it, and two pipes."""

    def __init__(self, command: Sequence[str], folder: Path, environment: Mapping[str, str], life: tuple[int, int] | None = None):
        self._life = life[1] if life else None
        self._others = frozenset(keeper.below(os.getpid())) if os.name == "posix" else frozenset()
        self.popen = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            cwd=folder,
            env=dict(environment),
            pass_fds=life[:1] if life else (),
            start_new_session=os.name == "posix",
        )

    def killed(self) -> bool:
        """Whether it was ended from outside, as an administrator or a system without memory does it: by SIGKILL."""
        with suppress(subprocess.TimeoutExpired):
            self.popen.wait(2)
        return self.popen.poll() in (-signal.SIGKILL, 128 + signal.SIGKILL) if os.name == "posix" else False

    @property
    def keeper_killed(self) -> bool:
        """Whether a signal has ended the process that keeps the notebook's."""
        return self._life is not None and (self.popen.poll() or 0) < 0

    def end(self) -> bool:
        """End it with all that it started; whether the notebook had killed what keeps it."""
        killed = self.keeper_killed
        if self._life is not None:
            os.close(self._life)
            self._life = None
            with suppress(subprocess.TimeoutExpired):
                self.popen.wait(3)
        if os.name == "posix":
            if self.popen.poll() is None:
                with suppress(ProcessLookupError, PermissionError):
                    os.killpg(self.popen.pid, signal.SIGKILL)
            keeper.end(os.getpid(), self._others)
        elif shutil.which("taskkill"):
            subprocess.run(["taskkill", "/F", "/T", "/PID", str(self.popen.pid)], capture_output=True)
        with suppress(OSError):
            self.popen.kill()
        with suppress(subprocess.TimeoutExpired):
            self.popen.wait(5)
        for pipe in (self.popen.stdin, self.popen.stdout):
            with suppress(OSError):
                pipe.close()  # type: ignore[union-attr]
        return killed


def chosen(kind: str, hidden: Sequence[Path | str], folder: Path, stage: Path) -> Sandbox:
    """The sandbox asked for; with "auto" bubblewrap's if it works here.

    Raises
    ------
    ValueError
        Bubblewrap is asked for and missing, or does not work; says what it said.
    """
    closed = tuple(str(Path(path).resolve()) for path in hidden)
    if kind == "none":
        return Sandbox("none", closed)
    tried = Sandbox("bwrap", closed)
    problem = "it is not installed (Debian, Ubuntu: apt install bubblewrap)"
    if shutil.which("bwrap"):
        (folder / "work").mkdir(exist_ok=True)
        command = [*tried._bubblewrap(folder, stage), sys.executable, "-I", "-c", "import numpy"]
        done = subprocess.run(command, capture_output=True, text=True)
        if not done.returncode:
            return tried
        problem = f"it does not work here: {(done.stderr.strip().splitlines() or ['no message'])[-1][:200]}"
    if kind == "bwrap":
        raise ValueError(f"--sandbox bwrap: {problem}; or --sandbox none")
    return Sandbox("none", closed)
