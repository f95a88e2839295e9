"""A time limit for a block of code, by the alarm signal; limits of a whole process.

The alarm ends waits, such as `time.sleep`, and operations of compiled code that look for signals,
such as the product of huge integers.  It rings in the main thread of Linux and macOS only: in
another thread, and on Windows, nothing is limited.  Where a block must end, as in grading, it runs
in a process that is killed.
"""

from __future__ import annotations

import signal
import threading
import time
from types import FrameType

# seconds after which a loop that survived its end, by `except BaseException`, is stopped again
AGAIN = 0.01
FILE = 100 * 2**20  # bytes that a limited process may write to one file
PROCESSES = 4096  # of the user's, threads included


class OutOfTime(BaseException):
    """Not an Exception, so that `except Exception` of a student's loop does not swallow it."""


class time_limit:
    """Raise OutOfTime in this block after so many seconds, and again and again while it goes on.

    Blocks may stand one in the other, and each keeps its own limit.  A forked process has none.

    Examples
    --------
    >>> from kfcourse.limits import OutOfTime, time_limit
    >>> try:
    ...     with time_limit(0.1):
    ...         while True:
    ...             pass
    ... except OutOfTime:
    ...     print("stopped")
    stopped
    """

    def __init__(self, seconds: float):
        # centuries; infinity is no time for a clock
        self.seconds = min(seconds, threading.TIMEOUT_MAX)

    def __enter__(self) -> None:
        main = threading.current_thread() is threading.main_thread()
        self.alarms = main and hasattr(signal, "setitimer")
        if self.alarms:
            self.start = time.monotonic()
            self.handler = signal.signal(signal.SIGALRM, _ring)
            self.outer, _ = signal.getitimer(signal.ITIMER_REAL)  # of the block around this one
            left = min(self.seconds, self.outer or self.seconds)
            signal.setitimer(signal.ITIMER_REAL, left, AGAIN)

    def __exit__(self, *_: object) -> None:
        if self.alarms:
            left = self.outer and max(self.outer - (time.monotonic() - self.start), 1e-6)
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, self.handler)
            signal.setitimer(signal.ITIMER_REAL, left, AGAIN if left else 0)


def _ring(number: int, frame: FrameType | None) -> None:
    """Stop what runs, unless a block begins or ends at this moment: the alarm comes again."""
    if frame is None or frame.f_code.co_filename != __file__:
        raise OutOfTime


def limit_process(memory: int) -> None:
    """Limit this process and its children, where the system can.

    Memory, size of files, number of processes; no core dumps.
    """
    try:
        import resource
    except ImportError:  # Windows
        return
    limits = {"AS": memory, "FSIZE": FILE, "CORE": 0, "NPROC": PROCESSES}
    for name, bound in limits.items():
        if (kind := getattr(resource, f"RLIMIT_{name}", None)) is not None:
            _, hard = resource.getrlimit(kind)
            bound = bound if hard == resource.RLIM_INFINITY else min(bound, hard)
            resource.setrlimit(kind, (bound, bound))
