"""A time limit for a block of code, in any thread and on any system; a limit of memory, on Linux; limits of a whole process.

Two ways to stop code that does not ask whether it should:

* in a main thread that has alarms (Linux, macOS): the alarm signal.  It ends waits such as `time.sleep`, and operations of
  compiled code that look for signals, such as the product of huge integers;
* elsewhere (Windows; other threads): a watching thread, which has the interpreter raise the exception in the watched one at its
  next step of Python code.  What is under way in compiled code, a wait too, ends first.

A process of its own could be killed whatever it does.  But an answer to a check is a function of the student's kernel, and
without fork no other process can call it.  So in either way one long operation of a library, such as the decomposition of a
huge matrix, ends before it is stopped; where that must not be, as in grading, the kernel is a process that is killed.
"""

from __future__ import annotations

import ctypes
import gc
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any, ClassVar

FILE = 100 * 2**20  # bytes a process that is limited may write to one file
PROCESSES = 4096  # of the user's, threads included
AGAIN = 0.01  # seconds after which a loop that survived its end is stopped again


class OutOfTime(BaseException):
    """Not an Exception, so that `except Exception` of a student's loop does not swallow it."""


class time_limit:
    """Raise OutOfTime in this block after so many seconds, and again and again while it goes on.

    Blocks may stand one in the other, and each keeps its own limit.

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
        self.seconds = min(seconds, threading.TIMEOUT_MAX)  # centuries; infinity is no time for a clock

    def __enter__(self) -> None:
        main = threading.current_thread() is threading.main_thread()
        self._stopper = _Alarm() if main and hasattr(signal, "setitimer") else _Watcher()
        try:
            self._stopper.start(time.monotonic() + self.seconds)
        except BaseException:  # the end of a block around this one
            self._stopper.stop()
            raise

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        while True:
            try:
                return self._stopper.stop()
            except OutOfTime:  # too late, or of a block around this one: then it comes again
                continue


@contextmanager
def memory_limit(more: float | None) -> Iterator[None]:
    """MemoryError in this block where the process would take so many bytes more than it has; None is no limit.

    Linux only: elsewhere the system has no such limit, and nothing is limited.
    """
    if more is None or more == float("inf") or sys.platform != "linux":
        yield
        return
    import resource

    gc.collect()  # garbage that is found later would be room
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    before, most = resource.getrlimit(resource.RLIMIT_AS)
    limit = pages * resource.getpagesize() + int(more)
    resource.setrlimit(resource.RLIMIT_AS, (limit if before == resource.RLIM_INFINITY else min(limit, before), most))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (before, most))


def _inside(frame: FrameType | None) -> bool:
    """Whether a thread is where it must not be stopped: beginning a block or leaving it, or beginning a thread.

    Until a new thread runs it has the number of the one that begins it, and an exception for this one would end the new one
    before it says that it is there, for which its parent waits.
    """
    while frame is not None:
        if frame.f_code.co_filename == __file__:
            return True
        if frame.f_code is threading.Thread.start.__code__ and frame.f_locals["self"].ident is None:
            return True
        frame = frame.f_back
    return False


class _Alarm:
    """Stops the main thread by SIGALRM: one timer for all blocks, set to the first end."""

    ends: ClassVar[dict[_Alarm, float]] = {}  # of all blocks of the main thread
    before: ClassVar[Any] = None  # the handler that was there

    def start(self, end: float) -> None:
        if not self.ends:
            _Alarm.before = signal.signal(signal.SIGALRM, self.ring)
        self.ends[self] = end
        self.wind()

    def stop(self) -> None:
        self.ends.pop(self, None)
        self.wind()
        if not self.ends:
            signal.signal(signal.SIGALRM, signal.SIG_IGN)  # drops an alarm that is on its way, perhaps by another thread
            signal.signal(signal.SIGALRM, _Alarm.before)

    @classmethod
    def wind(cls) -> None:
        left = max(min(cls.ends.values()) - time.monotonic(), 1e-6) if cls.ends else 0.0
        signal.setitimer(signal.ITIMER_REAL, left, AGAIN)

    @classmethod
    def ring(cls, number: int, frame: FrameType | None) -> None:
        if cls.ends and min(cls.ends.values()) <= time.monotonic() and not _inside(frame):
            raise OutOfTime


class _Watcher:
    """Stops any thread from another one, by an exception that the interpreter raises in it."""

    def __init__(self) -> None:
        self.running = True
        self.switch = threading.Lock()
        self.alive = threading.Lock()  # held as long as the block goes on
        self.alive.acquire()

    def start(self, end: float) -> None:
        self.watched = threading.get_ident()
        threading.Thread(target=self.watch, args=(end,), name="time limit", daemon=True).start()

    def watch(self, end: float) -> None:
        wait = max(end - time.monotonic(), 0.0)
        while not self.alive.acquire(timeout=min(wait, threading.TIMEOUT_MAX)):
            wait = max(end - time.monotonic(), AGAIN)
            with self.switch:
                over = self.running and end <= time.monotonic()
                if over and not _inside(sys._current_frames().get(self.watched)):
                    _set_exception(ctypes.c_ulong(self.watched), ctypes.py_object(OutOfTime))

    def stop(self) -> None:
        with self.switch:
            if self.running:
                self.running = False
                self.alive.release()
        _set_exception(ctypes.c_ulong(threading.get_ident()), None)  # what was raised, but has not come yet


_set_exception = ctypes.pythonapi.PyThreadState_SetAsyncExc


def limit_process(memory: int) -> None:
    """Limit this process and its children, where the system can: memory, size of files, processes, no core dumps."""
    try:
        import resource
    except ImportError:  # Windows
        return
    limits = {"RLIMIT_AS": memory, "RLIMIT_FSIZE": FILE, "RLIMIT_CORE": 0, "RLIMIT_NPROC": PROCESSES}
    for name, bound in limits.items():
        try:
            kind = getattr(resource, name)
            _, hard = resource.getrlimit(kind)
            bound = bound if hard == resource.RLIM_INFINITY else min(bound, hard)
            resource.setrlimit(kind, (bound, bound))
        except (AttributeError, ValueError, OSError):  # this system knows no such limit
            continue
