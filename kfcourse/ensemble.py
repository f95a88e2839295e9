"""Trajectories of a model, drawn reproducibly, in blocks that fit the processor's cache.

Every block of trajectories and every few steps draw from a stream of their own, spawned from the seed,
so the numbers depend neither on the number of threads nor on the order in which blocks are computed.
Drawing takes as long as several filter steps, so threads draw ahead while the filters compute.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np

from kfcourse.gaussian import Array, Gaussian, square_root
from kfcourse.model import Model
from kfcourse.structure import compile_model

BLOCK = 50_000  # trajectories: long enough that the interpreter's overhead is small, short enough for the processor's caches
STEPS_AT_ONCE = 4  # steps drawn by one call: few calls, and little memory over the whole ensemble

T = TypeVar("T")


class Moment(NamedTuple):
    """One step of a block of trajectories: x_k (N, n), y_k (N, p), x_{k+1} (N, n)."""

    x: Array
    y: Array
    x_next: Array


class Trajectories(NamedTuple):
    """Stored trajectories: x (steps, runs, n), y (steps, runs, p)."""

    x: Array
    y: Array


@dataclass(frozen=True)
class Ensemble:
    """The trajectories that one seed stands for, generated whenever they are asked for.

    Attributes
    ----------
    model : Model
    runs, steps : int
        Trajectories, and measurements y_0 ... y_{steps-1} of each.
    seed : numpy.random.SeedSequence
    threads : int
        1 draws in the calling thread; more draw ahead in so many others.
    """

    model: Model
    runs: int
    steps: int
    seed: np.random.SeedSequence
    threads: int = 1

    def __post_init__(self) -> None:
        for name in ("runs", "steps", "threads"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
                raise ValueError(f"{name} must be a positive whole number, got {value!r}")

    @property
    def sizes(self) -> list[int]:
        """Number of trajectories in each block."""
        full, rest = divmod(self.runs, BLOCK)
        return [BLOCK] * full + ([rest] if rest else [])

    @property
    def _chunks(self) -> list[range]:
        return [range(k, min(k + STEPS_AT_ONCE, self.steps)) for k in range(0, self.steps, STEPS_AT_ONCE)]

    def by_block(self) -> Iterator[Iterator[Moment]]:
        """One iterator over the steps for each block; exhaust each before taking the next."""
        simulate = _Simulator(self.model)
        jobs = ((block, chunk) for block in range(len(self.sizes)) for chunk in range(len(self._chunks)))
        noises = draw_ahead((self._job(block, chunk) for block, chunk in jobs), self.threads, 2 * self.threads)
        for block in range(len(self.sizes)):
            yield self._steps_of_block(block, simulate, noises)

    def _steps_of_block(self, block: int, simulate: _Simulator, noises: Iterator[tuple[Array, Array]]) -> Iterator[Moment]:
        x = self._initial(block)
        for _ in self._chunks:
            for v, w in zip(*next(noises), strict=True):
                moment = simulate(x, v, w)
                yield moment
                x = moment.x_next

    def by_step(self) -> Iterator[list[Moment]]:
        """All blocks of a step together, step by step: for coefficients that need the whole ensemble."""
        simulate = _Simulator(self.model)
        blocks = range(len(self.sizes))
        jobs = (self._job(block, chunk) for chunk in range(len(self._chunks)) for block in blocks)
        noises = draw_ahead(jobs, self.threads, len(blocks))
        x = [self._initial(block) for block in blocks]
        for chunk in self._chunks:
            drawn = [next(noises) for _ in blocks]
            for k in range(len(chunk)):
                moments = [simulate(x[b], drawn[b][0][k], drawn[b][1][k]) for b in blocks]
                yield moments
                x = [moment.x_next for moment in moments]

    def _stream(self, *key: int) -> np.random.Generator:
        spawned = np.random.SeedSequence(self.seed.entropy, spawn_key=(*self.seed.spawn_key, *key))
        return np.random.Generator(np.random.SFC64(spawned))

    def _initial(self, block: int) -> Array:
        return _draw(self._stream(block, 0), self.model.prior, 1, self.sizes[block])[0]

    def _job(self, block: int, chunk: int) -> Callable[[], tuple[Array, Array]]:
        def draw() -> tuple[Array, Array]:
            rng, steps, size = self._stream(block, 1 + chunk), len(self._chunks[chunk]), self.sizes[block]
            v = _draw(rng, self.model.state_noise, steps, size)
            return v, _draw(rng, self.model.meter_noise, steps, size)

        return draw


class _Simulator:
    """One step of the model: (x, v, w) -> x, y = b(x, w), x' = a(x, v)."""

    def __init__(self, model: Model):
        self.state, self.meter = compile_model(model)
        self.n, self.p = model.n, model.p

    def __call__(self, x: Array, v: Array, w: Array) -> Moment:
        y, x_next = self.meter(x, w), self.state(x, v)
        # A formula without noise and state is one constant for all trajectories.
        return Moment(x, np.broadcast_to(y, (len(x), self.p)), np.broadcast_to(x_next, (len(x), self.n)))


def _draw(rng: np.random.Generator, law: Gaussian, steps: int, size: int) -> Array:
    """Gaussian noise (steps, size, r), every component contiguous in memory."""
    r = len(law.mean)
    standard = rng.standard_normal((steps, r, size)).swapaxes(1, 2)
    if not law.mean.any() and np.array_equal(law.cov, np.eye(r)):
        return standard
    return law.mean + standard @ square_root(law.cov).T


def draw_ahead(jobs: Iterable[Callable[[], T]], threads: int, ahead: int) -> Iterator[T]:
    """Results of the jobs in order; `threads` workers stay up to `ahead` jobs ahead of the consumer.

    The consumer computes meanwhile; drawing leaves the interpreter to it.
    """
    if threads == 1:
        for job in jobs:
            yield job()
        return
    waiting: deque[Future[T]] = deque()
    with ThreadPoolExecutor(threads) as pool:
        try:
            for job in jobs:
                waiting.append(pool.submit(job))
                if len(waiting) > ahead:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()


def simulate(model: Model, runs: int, steps: int, seed: int) -> Trajectories:
    """Trajectories to look at: x (steps, runs, n) and y (steps, runs, p), the same for the same seed."""
    ensemble = Ensemble(model, runs, steps, np.random.SeedSequence(seed))
    x, y = np.empty((steps, runs, model.n)), np.empty((steps, runs, model.p))
    start = 0
    for size, block in zip(ensemble.sizes, ensemble.by_block(), strict=True):
        for k, moment in enumerate(block):
            x[k, start : start + size], y[k, start : start + size] = moment.x, moment.y
        start += size
    return Trajectories(x, y)
