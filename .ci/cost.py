"""Run targets of the Makefile one after another, and print what each cost: `python .ci/cost.py make lint unit`."""

import ctypes
import os
import subprocess
import sys
import time

PR_SET_CHILD_SUBREAPER = 36


def adopt() -> None:
    """Linux: become the parent of processes that outlive theirs, as fork servers do; else nobody counts what they cost."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1)


def bury(seconds: float = 10) -> None:
    """Wait for them."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            pid, _ = os.waitpid(-1, os.WNOHANG)
        except (ChildProcessError, AttributeError):  # there is none; Windows
            return
        if not pid:
            time.sleep(0.05)


def main(make: str, targets: list[str]) -> int:
    rows: list[tuple[str, float, float]] = []
    status = 0
    adopt()
    for target in targets:
        wall, before = time.perf_counter(), os.times()
        try:
            status = subprocess.run([make, "--no-print-directory", target]).returncode
        except KeyboardInterrupt:
            status = 130
        bury()
        after = os.times()
        cpu = after.children_user + after.children_system - before.children_user - before.children_system
        rows.append((target, time.perf_counter() - wall, cpu))
        if status:
            break
    rows.append(("together", sum(row[1] for row in rows), sum(row[2] for row in rows)))
    print(f"\n{'':12}{'wall s':>10}{'CPU s':>10}")
    for name, wall, cpu in rows:
        print(f"{name:12}{wall:10.1f}{cpu:10.1f}")
    print(f"\n{target} failed." if status else "\nAll checks passed.")
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
