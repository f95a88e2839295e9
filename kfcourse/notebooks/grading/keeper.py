"""The parent of a notebook's process where there is no sandbox: ends all that it started when it, or the grader, ends.

::

    python keeper.py LIFE COMMAND...

runs the command in a session of its own until it ends, or until the pipe LIFE is closed.  Nothing is imported but the standard
library: it starts in no time.
"""

import os
import select
import signal
import subprocess
import sys
import time
from contextlib import suppress

ROUNDS = 100  # times a tree of processes is looked through: what is killed may just have started another


def adopt() -> bool:
    """Whether orphans among this process's descendants become its children from now on (Linux)."""
    if not sys.platform.startswith("linux"):
        return False
    with suppress(OSError, AttributeError):
        import ctypes

        return ctypes.CDLL(None, use_errno=True).prctl(36, 1, 0, 0, 0) == 0  # PR_SET_CHILD_SUBREAPER
    return False


def processes() -> dict[int, tuple[int, bool]]:
    """Every process: its parent, and whether it lives.

    One that has ended may still be the parent of others: of those that a thread started which ends after the first.
    """
    found = {}
    if os.path.isdir("/proc/self"):
        for name in os.listdir("/proc"):
            with suppress(OSError, ValueError):
                if name.isdigit():
                    with open(f"/proc/{name}/stat", "rb") as file:
                        state, parent = file.read().rpartition(b")")[2].split()[:2]
                    found[int(name)] = int(parent), state != b"Z"
        return found
    with suppress(OSError, ValueError, subprocess.SubprocessError):
        listed = subprocess.run(["ps", "-A", "-o", "pid=,ppid=,stat="], capture_output=True, text=True, timeout=10).stdout
        rows = [line.split() for line in listed.splitlines()]
        found = {int(pid): (int(parent), not state.startswith("Z")) for pid, parent, state in rows}
    return found


def below(root: int, spared: frozenset[int] = frozenset()) -> list[int]:
    """Descendants of a process that live, without those spared and their descendants."""
    of = processes()
    found, level = [], [root]
    while level:
        level = [pid for pid, (parent, _) in of.items() if parent in level and pid not in spared]
        found += level
    return [pid for pid in found if of[pid][1] and pid != os.getpid()]


def end(root: int, spared: frozenset[int] = frozenset()) -> bool:
    """Kill all descendants of a process; whether there are none any more."""
    calm = 0
    for _ in range(ROUNDS):
        left = below(root, spared)
        calm = 0 if left else calm + 1
        if calm == 2:  # while processes are listed, one may get another parent, and be overlooked
            return True
        for pid in left:
            with suppress(OSError):
                os.kill(pid, signal.SIGSTOP)  # first of all nobody starts another
        for pid in below(root, spared):
            with suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        time.sleep(0.01)
        if root == os.getpid():
            _bury(spared)
    return False


def _bury(spared: frozenset[int]) -> None:
    """Take note of children that have ended, which would stay as zombies."""
    for pid in os.listdir("/proc") if os.path.isdir("/proc/self") else []:
        if pid.isdigit() and int(pid) not in spared:
            with suppress(OSError):
                os.waitpid(int(pid), os.WNOHANG)


def main() -> None:
    adopt()
    life = int(sys.argv[1])
    os.set_inheritable(life, False)
    child = subprocess.Popen(sys.argv[2:], start_new_session=True)
    os.close(0)
    os.close(1)
    while child.poll() is None:
        ready, _, _ = select.select([life], [], [], 0.1)
        if ready:
            break
    with suppress(OSError):
        os.killpg(child.pid, signal.SIGKILL)
    end(os.getpid())
    with suppress(subprocess.TimeoutExpired):
        status = child.wait(5)
        sys.exit(128 - status if status < 0 else status)  # as a shell says it


if __name__ == "__main__":
    main()
