"""Whether processes have ended: for tests of what must leave nothing behind."""

import time

import psutil


def ended(*processes: psutil.Process | int, seconds: float = 20) -> bool:
    """Whether all processes (or those of these numbers) end in time.

    One that has ended may stay a zombie: who adopts orphans need not bury them at once, or at all.
    """
    end = time.monotonic() + seconds
    while any(not _ended(child) for child in processes):
        if time.monotonic() > end:
            return False
        time.sleep(0.05)
    return True


def _ended(process: psutil.Process | int) -> bool:
    try:
        child = psutil.Process(process) if isinstance(process, int) else process
        return child.status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True
