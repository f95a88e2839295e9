"""The slow filters of a comparison: on a part of the common trajectories, as many as budgets of time and memory allow.

Chunks of trajectories grow from a few to hundreds, as far as the memory allows; results are kept by batches of a few
trajectories, always the same ones.  So the time decides after which chunk the work stops, and nothing else: chunks are the same
whether they come one after the other or, once they are seen to take their time, from several processes.
"""

from __future__ import annotations

import gc
import sys
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from kfcourse.errors import Reason
from kfcourse.filters.base import Filter
from kfcourse.laws import Array
from kfcourse.limits import OutOfTime, time_limit
from kfcourse.montecarlo.batches import STRATA
from kfcourse.montecarlo.blocks import Failed, TooMuch, progress_bar, run_block
from kfcourse.montecarlo.comparison import EXACT, SlowPart
from kfcourse.montecarlo.ensemble import Ensemble, Instant, Serial
from kfcourse.montecarlo.exceptional import Chosen
from kfcourse.montecarlo.parallel import START, Cluster, Submit, may_start, one_thread, processes
from kfcourse.montecarlo.statistics import Sums

BATCH = STRATA  # trajectories of a batch: their initial states share the prior out among them
CHUNKS = (16, 16, 32, 64, 128, 256, 512)  # trajectories taken at once; after these always as many as the last
FEWEST = 100  # trajectories that are a result: with fewer, the rare ones that make up a distance are missing
LEAST = 10e6  # bytes that can be a limit: interpreter and libraries take some at any time
WAIT = 0.5  # seconds, so that what waits can be interrupted: on Windows, and by a time limit in another thread
MARGIN = 1.3  # how much longer than the chunks before the next one may take, for each trajectory


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


class _Data(NamedTuple):
    """x, y and the following x, (steps, size, ...), of the chosen trajectories; their weights (size,) if they are not equal."""

    x: Array
    y: Array
    x_next: Array
    weight: Array | None
    chosen: Chosen


class _NoRoom(Exception):
    """So many trajectories, so many chunks at once, are too many for the memory."""

    def __init__(self, count: int, jobs: int, problem: MemoryError):
        super().__init__(count, jobs, problem)
        self.count, self.jobs, self.problem = count, jobs, problem


def run_slow_filters(
    fast: Sequence[Filter],
    slow: Sequence[Filter],
    ensemble: Ensemble,
    chosen: Chosen,
    batches: Array,
    seconds: float | None,
    memory: float | None,
    jobs: int,
    progress: bool | None,
    *,
    back: bool = False,
    far: Cluster | None = None,
) -> tuple[SlowPart | None, dict[str, Reason]]:
    """All filters on the chosen trajectories, in `jobs` processes, as threads would wait for one another.

    Batches of such sizes have the fast filters' sums over all trajectories.  With `back` they look back from the end; `far` away
    if there is a cluster.  Also, by name, why slow filters were left out; the others then start again without them, or with what
    runs instead.
    """
    data, size = _data(ensemble, chosen), len(chosen.places)
    left_out: dict[str, Reason] = {}
    replaced: dict[str, Reason] = {}
    wanted = {one.name: one for one in slow}
    if size < FEWEST and EXACT in wanted:
        left_out[EXACT] = f"on {size} trajectories the rare ones that matter are missing: take at least {FEWEST}, or 0"
    with one_thread():
        begun = time.monotonic()
        end = None if seconds is None else begun + seconds
        while running := [one for name, one in wanted.items() if name not in left_out]:
            names = [one.name for one in running]
            try:
                sums = _chunks_in_time([*fast, *running], data, end, memory, jobs, progress, back, far)
            except Failed as failed:
                other = wanted[failed.name].instead
                (left_out if other is None else replaced)[failed.name] = failed.reason
                wanted[failed.name] = other or wanted[failed.name]
                continue
            except BrokenProcessPool:
                why = "a process that computed it was killed, perhaps as memory ran out: take fewer jobs at once, or less memory"
                return None, left_out | dict.fromkeys(names, why)
            done = sum(int(one.counts.sum()) for one in sums)
            few = BATCH if chosen.wanted else 0  # the first ones alone stand for those only that are not exceptional
            found = _slow_part(names, Sums.concatenate(sums), chosen, batches, replaced) if done > few else None
            if found and (done >= FEWEST or EXACT not in names):
                return found, left_out
            if not found:
                first = min(size, done + CHUNKS[0])
                least = (seconds or 0.0) * max(1.0, (FEWEST if EXACT in names else first) / (first * jobs))
                reason = f"{first} trajectories take more than {seconds:g} s: {_more_time(least)}"
                return None, left_out | dict.fromkeys(names, reason)
            spent = time.monotonic() - begun  # more than the limit where it came late
            why = f"{done} trajectories take {spent:.2g} s, and of fewer than {FEWEST} the rare ones that matter are missing"
            left_out[EXACT] = f"{why}: {_more_time(MARGIN * spent * FEWEST / done)}"
            return found.without_exact(), left_out
        return None, left_out


def _more_time(seconds: float) -> str:
    return f"give it more time, some {float(f'{seconds:.1g}'):g} s"


def _chunks_in_time(
    filters: Sequence[Filter],
    data: _Data,
    end: float | None,
    memory: float | None,
    jobs: int,
    progress: bool | None,
    back: bool,
    far: Cluster | None,
) -> list[Sums]:
    """Sums over the chunks that are done in time; one that would take too much time or memory is done in smaller ones."""
    names = [one.name for one in filters]
    size, jobs = len(data.chosen.places), far.cores if far else jobs if may_start() else 1
    chunk = partial(_chunk, filters, data, names.index(EXACT) if EXACT in names else None, back)
    with progress_bar("slow filters", size, "trajectory", progress) as bar:
        replaceable = any(one.name == EXACT and one.instead is not None for one in filters)
        work = _Work(size, end, bar, jobs if replaceable else 0)
        while not work.over:
            jobs = min(jobs, work.chunks())
            try:
                if far:
                    with far.processes(jobs, partial(chunk, None)) as submit:
                        work.advance(submit, jobs)
                elif jobs == 1 or not work.long():
                    with memory_limit(memory):
                        work.advance(partial(Serial().submit, chunk, None), 1, until_long=jobs > 1)
                else:
                    with processes(jobs, partial(chunk, None if memory is None else memory / jobs)) as submit:
                        work.advance(submit, jobs)
            except _NoRoom as found:
                if found.jobs > 1:
                    jobs //= 2  # fewer have more room each
                elif found.count > CHUNKS[0]:
                    work.most = max(found.count // 2 // BATCH * BATCH, CHUNKS[0])  # whole batches, so that they stay the same
                else:
                    most_of_it = "there is" if memory is None else f"the {memory / 1e6:g} MB that the slow filters may take"
                    # What another filter lacks a slow one has taken.
                    problem = found.problem
                    name, step = (problem.name, f"step {problem.step}: ") if isinstance(problem, TooMuch) else (names[-1], "")
                    raise Failed(name, f"{step}{found.count} trajectories need more memory than {most_of_it}") from None
            except OSError:
                if jobs == 1:
                    raise
                jobs = 1  # no more processes are to be had
    return work.found


def _chunk(
    filters: Sequence[Filter],
    data: _Data,
    reference: int | None,
    back: bool,
    memory: float | None,
    seconds: float | None,
    start: int,
    count: int,
) -> tuple[Sums, float] | MemoryError | None:
    """Sums over one chunk and the seconds it took; None if it has not as many, or what is too large for the memory."""
    begun = time.monotonic()
    here, (steps, _, n) = slice(start, start + count), data.x.shape
    weight = None if data.weight is None else data.weight[here]
    try:
        with memory_limit(memory), _within(seconds):
            instants = [Instant(*(array[k, here] for array in (data.x, data.y, data.x_next))) for k in range(steps)]
            sums = Sums.empty(len(filters), steps, n, data.chosen.batches(start, count))
            run_block(filters, instants, sums, reference, lambda x: weight, back=back)
    except OutOfTime:
        return None
    except MemoryError as problem:
        return problem.with_traceback(None)  # that would keep what filled the memory
    return sums, time.monotonic() - begun


@dataclass
class _Work:
    """Chunks that are done, and those to come."""

    size: int
    end: float | None
    bar: tqdm[None]
    cores: int  # for the exact filter if particles would take its place, else 0
    found: list[Sums] = field(default_factory=list)
    start: int = 0
    seconds: float = 0.0
    most: int = CHUNKS[-1]
    over: bool = False

    def advance(self, submit: Submit, jobs: int, until_long: bool = False) -> None:
        """Do chunks, `jobs` at a time, until all are done or the time is over; or until what is left is seen to be long.

        Behind a chunk that fails nothing counts: results are those of one chunk after the other.
        """
        running: deque[tuple[int, Future[tuple[Sums, float] | MemoryError | None]]] = deque()
        while not (until_long and self.long()):
            undone = [future for _, future in running if not future.done()]
            ahead = self.start + sum(count for count, _ in running)
            if len(undone) < jobs and (count := self.next(len(self.found) + len(running), ahead)):
                left = None if self.end is None else self.end - time.monotonic()
                running.append((count, submit(left, ahead, count)))
            elif undone:
                wait(undone, WAIT, FIRST_COMPLETED)
            elif not running:
                self.over = True
                return
            while running and running[0][1].done():
                count, future = running.popleft()
                result = future.result()
                if result is None:
                    self.over = True
                    return
                if isinstance(result, MemoryError):
                    raise _NoRoom(count, jobs, result)
                self.found.append(result[0])
                self.start += count
                self.seconds += result[1]
                self.bar.update(count)
                self._check_time()

    def _check_time(self) -> None:
        """Failed after the first chunk, while there is time for particles, if the exact filter will not be through enough."""
        if self.end is None or not self.cores or len(self.found) > 1:
            return
        each, wanted = self.seconds / self.start, min(FEWEST, self.size)
        if each * (wanted - self.start) / self.cores > (left := self.end - time.monotonic()):
            raise Failed(EXACT, f"{self.start} trajectories take {self.seconds:.2g} s, {wanted} more than the {left:.2g} s left")

    def next(self, index: int, ahead: int) -> int:
        """Trajectories of a chunk that begins there; 0 if none are left, or none in time."""
        count = min(CHUNKS[min(index, len(CHUNKS) - 1)], self.most, self.size - ahead)
        if self.end is None or not self.found:
            return count
        each, left = MARGIN * self.seconds / self.start, self.end - time.monotonic()
        while each * count > left and count >= 2 * CHUNKS[0]:
            count = count // 2 // BATCH * BATCH
        return count if each * count <= left else 0

    def chunks(self) -> int:
        """How many are left, if there is time for all."""
        sizes = [*CHUNKS[len(self.found) :], *[CHUNKS[-1]] * (self.size // BATCH)]
        ends = np.cumsum(np.minimum(sizes, self.most))
        return int(np.searchsorted(ends, self.size - self.start)) + 1

    def long(self) -> bool:
        """Whether what is left is worth the start of processes, by the time that the chunks took that are done."""
        if not self.found:
            return False
        left = self.seconds / self.start * (self.size - self.start)
        return min(left, np.inf if self.end is None else self.end - time.monotonic()) > START


def _within(seconds: float | None) -> AbstractContextManager[None]:
    return nullcontext() if seconds is None else time_limit(max(seconds, 1e-3))


def _data(ensemble: Ensemble, chosen: Chosen) -> _Data:
    """The chosen ones of the ensemble's trajectories."""
    parts: list[list[Instant]] = []
    order, start = np.argsort(chosen.places, kind="stable"), 0
    wanted = chosen.places[order]
    for index, size in enumerate(ensemble.sizes):
        if len(here := wanted[(wanted >= start) & (wanted < start + size)] - start):
            parts.append([Instant(*(a[here] for a in instant)) for instant in ensemble.block(index)])
        start += size
    back = np.argsort(order)
    x, y, x_next = (
        np.stack([np.concatenate([part[k][i] for part in parts])[back] for k in range(ensemble.steps)]) for i in range(3)
    )
    weight = ensemble.weight(x[0])
    if not chosen.counted.all():
        weight = chosen.counted * (1.0 if weight is None else weight)
    return _Data(x, y, x_next, weight, chosen)


def _slow_part(names: list[str], sums: Sums, chosen: Chosen, batches: Array, replaced: Mapping[str, Reason]) -> SlowPart:
    """What was found on the first so many of the chosen trajectories.

    Exceptional ones for which there was no time are like those for which there was: these stand for them.
    """
    done = int(sums.counts.sum())
    exceptional = chosen.exceptional[:done]
    if not exceptional.any():
        return SlowPart(names, sums, replaced=replaced)
    single = exceptional[np.cumsum(sums.counts).astype(int) - 1]
    places = np.searchsorted(np.cumsum(batches), chosen.places[:done][exceptional], side="right")
    gathered = sums.of_batches(single).gathered(places, len(batches))
    each = chosen.wanted / np.count_nonzero(exceptional)
    return SlowPart(names, sums.of_batches(~single), gathered.times(each), replaced)
