"""Work shared out among processes, for what threads slow down: much Python between operations on small arrays.

On Linux they are forks of this process, which have all that it has at once, closures too.  Elsewhere a fork is not safe once
libraries are loaded: there they are joblib's, which import the package first and are sent the work.  On a cluster they are the
workers of a Dask scheduler: `Cluster`.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from functools import cache, partial
from importlib import import_module
from multiprocessing.connection import Connection, Pipe
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

FORK = sys.platform == "linux"
START = 0.5 if FORK else 5.0  # seconds of work that are worth the start of processes

Submit = Callable[..., Future[Any]]


def cores() -> int:
    """Cores that this process may use: those of its affinity and of its container."""
    from joblib import cpu_count

    return int(cpu_count())


class Cluster:
    """The workers of a Dask scheduler.

    What a worker that is lost was doing, another does again.  No number depends on who does what, as long as all workers have
    this package, the same versions of its libraries and processors alike.
    """

    def __init__(self, client: Any):
        self.client = client

    @property
    def executor(self) -> Executor:
        """The workers as an executor, for functions that know all they need."""
        return self.client.get_executor()

    @property
    def cores(self) -> int:
        """Pieces of work that can be done at once."""
        return max(sum(self.client.nthreads().values()), 1)

    @contextmanager
    def processes(self, count: int, work: Callable[..., Any]) -> Iterator[Submit]:
        """As `processes`: what the work needs is sent to each worker once.

        As the result of a task, which is found again if the workers that hold it are lost; scattered data would be gone.
        """
        sent = self.client.submit(_itself, work, pure=False)
        yield partial(self.executor.submit, _do_far, sent)


def _itself(work: Callable[..., Any]) -> Callable[..., Any]:
    return work


def _do_far(work: Callable[..., Any], *arguments: Any) -> Any:
    with one_thread():
        return work(*arguments)


@contextmanager
def cluster(address: str | None) -> Iterator[Cluster | None]:
    """The cluster of the Dask scheduler at an address, such as tcp://scheduler:8786; None if there is no address.

    Raises
    ------
    ValueError
        Dask is not installed, no scheduler answers, it has no workers; or workers were lost again and again.
    """
    if address is None:
        yield None
        return
    try:
        from dask.distributed import Client
        from distributed.comm import normalize_address, resolve_address
        from distributed.scheduler import KilledWorker
    except ImportError:
        raise ValueError("--dask needs the package `distributed`: pip install 'kfcourse[dask]'") from None
    try:
        resolve_address(normalize_address(address))  # a client that cannot read it waits 20 s, and ends in a traceback
        client = Client(address, timeout=10, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise ValueError(f"no Dask scheduler answers at {address}: {error}") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=60)
        except TimeoutError:
            raise ValueError(f"the Dask scheduler at {address} has no workers: start some with `dask worker {address}`") from None
        try:
            yield Cluster(client)
        except KilledWorker:
            raise ValueError(f"workers of {address} were lost again and again: give each more memory, or fewer threads") from None


def may_start() -> bool:
    """Whether this process may have others: a worker of `multiprocessing.Pool` may not."""
    return not multiprocessing.current_process().daemon


def one_thread() -> threadpool_limits:
    """Linear algebra in one thread from now on, or in a block: on small matrices others only wait, and take a core for it.

    What limits must not stop half-way is loaded first: parts of SciPy, and OpenBLAS' buffers, without which it ends the process.
    """
    for part in ("linalg", "ndimage", "special"):
        import_module(f"scipy.{part}")
    limits = threadpool_limits(1, "blas")
    _make_buffers(os.getpid())
    return limits


@cache
def _make_buffers(_process: int) -> None:
    """Once in each process, as it takes longer than a small comparison."""
    square = np.eye(512)
    np.linalg.cholesky(np.linalg.solve(square, square) @ square)


@contextmanager
def processes(count: int, work: Callable[..., Any]) -> Iterator[Submit]:
    """So many processes and a function with the arguments of `work`, which gives futures of its results.

    None of them outlives this block, nor this process: what is under way is dropped at once.

    Raises
    ------
    concurrent.futures.process.BrokenProcessPool
        From a future: a process was killed.
    OSError
        No process can be started.
    """
    if not FORK:
        from joblib.externals.loky import ProcessPoolExecutor as Loky

        pool = Loky(count, initializer=_begin, initargs=(work,))
        try:
            yield partial(pool.submit, _do)
        finally:
            pool.shutdown(kill_workers=True)
        return
    over, end = Pipe(duplex=False)
    forks = ProcessPoolExecutor(count, multiprocessing.get_context("fork"), _begin_fork, (work, over, end))
    try:
        with warnings.catch_warnings():
            # Python 3.12 warns of locks that other threads hold; the forks compute and write to a pipe, and take none.
            warnings.simplefilter("ignore", DeprecationWarning)
            forks.submit(int)  # the first starts them all
        yield partial(forks.submit, _do)
    finally:
        end.send_bytes(b"over")
        _close_results(forks)
        forks.shutdown(cancel_futures=True)
        over.close()
        end.close()


def _close_results(forks: ProcessPoolExecutor) -> None:
    """Of a result that a fork had half sent when it ended the rest never comes: forks alone can send it, if this process cannot.

    The thread that reads results would wait for it, and whoever ends the pool for that thread; there is no public way to it.
    """
    forks._result_queue._writer.close()  # type: ignore[attr-defined]


def _begin(work: Callable[..., Any]) -> None:
    """In a new process."""
    global _work
    _work = work
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which ends this process
    one_thread()


def _begin_fork(work: Callable[..., Any], over: Connection, end: Connection) -> None:
    for number in (signal.SIGTERM, signal.SIGHUP):  # the parent's handlers clear away what is the parent's
        signal.signal(number, signal.SIG_DFL)
    end.close()  # now the parent alone has it
    threading.Thread(target=_end_with, args=(over,), daemon=True).start()
    gc.freeze()  # what there is stays: not to be looked through, nor copied for that, at every collection
    _begin(work)


def _end_with(over: Connection) -> None:
    """End this process when the parent says so, or is no more; nobody reads the word, so that all forks see it."""
    over.poll(None)
    os._exit(1)


def _do(*arguments: Any) -> Any:
    return _work(*arguments)


_work: Callable[..., Any]
