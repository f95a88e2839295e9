"""A time limit for a block of code."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

AGAIN = 0.01  # seconds after which a loop that survived its end is stopped again


class OutOfTime(BaseException):
    """Not an Exception, so that `except Exception` of a student's loop does not swallow it."""


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise OutOfTime in this block after so many seconds, and again and again while it goes on.

    By the alarm signal; elsewhere than in a main thread with signals (Windows) there is no limit.  One long operation of
    compiled code, such as the power of two huge integers, is not stopped before its end.
    """
    if not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
        yield
        return

    running = True

    def stop(number: int, frame: Any) -> None:
        if running:
            raise OutOfTime

    previous = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds, AGAIN)
    try:
        yield
    finally:
        running = False  # an alarm between here and the next line does nothing
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, previous)
