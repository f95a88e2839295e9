"""Trajectories of a model, drawn reproducibly, in blocks.

Every block of trajectories and every few steps draw from a stream of their own, spawned from the seed,
so the numbers depend neither on the number of threads nor on the order in which blocks are computed.
They are equal to the last bit with the same kernels of linear algebra (BLAS); another processor's may round otherwise.
NumPy releases the interpreter while it works on a block, so blocks run in parallel threads.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import accumulate
from typing import Any, NamedTuple, overload

import numpy as np
import scipy
import sympy as sp

from kfcourse.angles import on_circle
from kfcourse.errors import expect, expect_sizes
from kfcourse.laws import Array, Gaussian, normalised_square, square_root
from kfcourse.linear.runs import Trajectories
from kfcourse.montecarlo.batches import STRATA
from kfcourse.symbolic.compiled import Pass, is_scalar, load, loop
from kfcourse.symbolic.equations import compile_model
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model

# Largest and smallest block of trajectories: operations long enough to leave the interpreter to the other threads,
# arrays short enough for the processor's caches.
BLOCK, SMALL_BLOCK = 100_000, 16_384
STEPS_AT_ONCE = 4  # steps drawn by one call: few calls, and little memory over the whole ensemble


class Instant(NamedTuple):
    """One step of a block of trajectories: x_k (N, n), y_k (N, p), x_{k+1} (N, n)."""

    x: Array
    y: Array
    x_next: Array

    @property
    def after(self) -> tuple[Array, ...]:
        """What the next step starts from."""
        return (self.x_next,)


class JumpInstant(Instant):
    """The same of a model that jumps, with the modes i_k and i_{k+1} (N,), numbers from 0."""

    mode: Array
    mode_next: Array

    @property
    def after(self) -> tuple[Array, ...]:
        return self.x_next, self.mode_next


class JumpTrajectories(NamedTuple):
    """Stored trajectories of a model that jumps: x (steps, runs, n), y (steps, runs, p), modes (steps, runs)."""

    x: Array
    y: Array
    mode: Array


@dataclass(frozen=True)
class Ensemble:
    """The trajectories that one seed stands for, generated whenever they are asked for.

    Attributes
    ----------
    model : Model or JumpModel
    runs, steps : int
        Trajectories, and measurements y_0 ... y_{steps-1} of each.
    seed : numpy.random.SeedSequence
        A number becomes one.
    wide : float, optional
        Initial states drawn for small standard errors, in sets of `STRATA`: half of them from the prior, half from a law so many
        times as wide, each half by strata of equal probability.  `weight` makes up for it.  1: by strata of the prior alone;
        None: independently, without weights.
    compiled : bool
        Compiled by numba, which changes the last digits: of scalar models; others are as without.
    """

    model: Model | JumpModel
    runs: int
    steps: int
    seed: np.random.SeedSequence
    wide: float | None = None
    compiled: bool = False

    def __post_init__(self) -> None:
        expect(self.model, Model, "an ensemble", JumpModel)
        if not isinstance(self.seed, np.random.SeedSequence):
            object.__setattr__(self, "seed", np.random.SeedSequence(self.seed))
        if self.wide is not None and not 1 <= self.wide < np.inf:
            raise ValueError(f"a prior can be drawn wider, not narrower: wide must be at least 1, got {self.wide!r}")
        if self._mixed and self.model.angles.x:
            raise ValueError("initial states that are angles cannot be drawn from a wider law; leave wide=1")
        expect_sizes(runs=self.runs, steps=self.steps)

    @cached_property
    def sizes(self) -> list[int]:
        """Number of trajectories in each block: nearly equal, and two blocks at least if they are not too small."""
        blocks = max(-(-self.runs // BLOCK), min(2, self.runs // SMALL_BLOCK), 1)
        return np.diff(np.linspace(0, self.runs, blocks + 1).astype(int)).tolist()

    @property
    def _chunks(self) -> list[range]:
        return [range(k, min(k + STEPS_AT_ONCE, self.steps)) for k in range(0, self.steps, STEPS_AT_ONCE)]

    def block(self, index: int) -> Iterator[Instant]:
        """The steps of one block of trajectories."""
        start = self._start(index)
        for chunk in range(len(self._chunks)):
            for instant in self._steps(chunk, start, self._draw(index, chunk)):
                yield instant
                start = instant.after

    def stretches(self, index: int) -> Iterator[tuple[Array, Array]]:
        """The same of a compiled scalar model, a few steps at once: x (K + 1, N), its last row begins the next, y (K, N)."""
        assert isinstance(self._simulator, _CompiledSimulator)
        x = self._initial(index)
        for chunk in range(len(self._chunks)):
            several = self._simulator.several(x, *self._draw(index, chunk))
            yield several
            x = several[0][-1][:, None]

    def together(self, pool: Executor) -> Iterator[tuple[Array, Array]]:
        """The same of all blocks, side by side; each stretch holds until the next but one is asked for."""
        simulator, ends = self._simulator, [0, *accumulate(self.sizes)]
        assert isinstance(simulator, _CompiledSimulator)
        rooms = [simulator.room(STEPS_AT_ONCE, self.runs) for _ in range(2)]

        def fill(index: int, chunk: int, x: Array, y: Array) -> None:
            here, before = slice(*ends[index : index + 2]), rooms[chunk % 2 - 1][0]
            x[0, here] = before[-1, here] if chunk else self._initial(index)[:, 0]
            simulator.fill(x, y, here, *self._draw(index, chunk))

        for chunk, steps in enumerate(map(len, self._chunks)):
            x, y = rooms[chunk % 2]
            several = x[: steps + 1], y[:steps]
            list(pool.map(lambda index, chunk=chunk, several=several: fill(index, chunk, *several), range(len(self.sizes))))
            yield several

    def by_step(self, pool: Executor | None = None) -> Iterator[list[Instant]]:
        """All blocks of a step together, step by step: for coefficients that need the whole ensemble."""
        pool = pool or Serial()
        blocks = range(len(self.sizes))
        starts = list(pool.map(self._start, blocks))
        drawn = [pool.submit(self._draw, b, 0) for b in blocks]
        for chunk in range(len(self._chunks)):
            noises = [future.result() for future in drawn]  # of each block: of each kind (steps, size, ...)
            if chunk + 1 < len(self._chunks):
                drawn = [pool.submit(self._draw, b, chunk + 1) for b in blocks]  # ahead of time
            each = list(pool.map(lambda *given, chunk=chunk: list(self._steps(chunk, *given)), starts, noises))
            yield from map(list, zip(*each, strict=True))
            starts = [instants[-1].after for instants in each]

    def _steps(self, chunk: int, start: tuple[Array, ...], drawn: tuple[Array, ...]) -> Iterator[Instant]:
        """A few steps of a block of trajectories."""
        if isinstance(self._simulator, _CompiledSimulator):
            x, y = (rows[:, :, None] for rows in self._simulator.several(*start, *drawn))
            yield from map(Instant, x, y, x[1:])
            return
        for k, *noises in zip(self._chunks[chunk], *drawn, strict=True):
            instant = self._simulator(k, *start, *noises)
            yield instant
            start = instant.after

    @cached_property
    def _simulator(self) -> _Simulator | _JumpSimulator | _CompiledSimulator:
        if isinstance(self.model, JumpModel):
            return _JumpSimulator(self.model)
        return _CompiledSimulator(self.model) if self.compiled and is_scalar(self.model) else _Simulator(self.model)

    def _stream(self, *key: int) -> np.random.Generator:
        spawned = np.random.SeedSequence(self.seed.entropy, spawn_key=(*self.seed.spawn_key, *key))
        return np.random.Generator(np.random.SFC64(spawned))

    def _start(self, block: int) -> tuple[Array, ...]:
        """Initial states, and modes if there are any; these from a stream of their own."""
        x = self._initial(block)
        if not isinstance(self.model, JumpModel):
            return (x,)
        return x, _chosen(self.model.first[None], self._stream(block, 0, 0).random(len(x)))

    def _initial(self, block: int) -> Array:
        rng, size, prior = self._stream(block, 0), self.sizes[block], self.model.prior
        if self.wide is None:
            return on_circle(_draw(rng, prior, 1, size, self.compiled)[0], self.model.angles.x)
        standard = _by_strata(rng, -(-size // STRATA), len(prior.mean), self.wide)[:size]
        return on_circle(prior.mean + standard @ square_root(prior.cov).T, self.model.angles.x)

    @property
    def _mixed(self) -> bool:
        return self.wide is not None and self.wide > 1

    def weight(self, x: Array) -> Array | None:
        """Prior over the law drawn from, at initial states x (N, n): (N,), between 0 and 2; None if they are the same.

        With t = (x - m)^T d^+ (x - m) and r the rank of d,
        2 N(x; m, d) / (N(x; m, d) + N(x; m, w^2 d)) = 2 / (1 + w^-r exp((1 - w^-2) t / 2)).
        A wider law alone has weights without bound: one start near the mean would count as many.
        """
        if not self._mixed:
            return None
        assert self.wide is not None
        mean, cov = self.model.prior
        rank = np.linalg.matrix_rank(cov, hermitian=True)
        exponent = 0.5 * (1 - self.wide**-2) * normalised_square(x - mean, cov) - rank * np.log(self.wide)
        return 2 * scipy.special.expit(-exponent)

    def _draw(self, block: int, chunk: int) -> tuple[Array, ...]:
        """Noises of a few steps of a block: v and w, (steps, size, r); of a model that jumps also (steps, size) in 0 to 1."""
        rng, steps, size = self._stream(block, 1 + chunk), len(self._chunks[chunk]), self.sizes[block]
        if isinstance(self.model, JumpModel):
            first = self.model.modes[0]
            standard = [rng.standard_normal((steps, len(noises), size)).swapaxes(1, 2) for noises in (first.v, first.w)]
            return *standard, rng.random((steps, size))
        v = _draw(rng, self.model.state_noise, steps, size, self.compiled)
        return v, _draw(rng, self.model.meter_noise, steps, size, self.compiled)


class _Simulator:
    """One step of the model: (k, x, v, w) -> x, y = b(x, w), x' = a(x, v)."""

    def __init__(self, model: Model):
        self.state, self.meter = compile_model(model)
        self.n, self.p, self.angles = model.n, model.p, model.angles

    def __call__(self, k: int, x: Array, v: Array, w: Array) -> Instant:
        with np.errstate(over="ignore", invalid="ignore"):  # what diverges is reported by who looks at it
            y, x_next = self.meter(x, w, k), self.state(x, v, k)
        # A formula without noise and state is one constant for all trajectories.
        y, x_next = np.broadcast_to(y, (len(x), self.p)), np.broadcast_to(x_next, (len(x), self.n))
        return Instant(x, on_circle(y, self.angles.y), on_circle(x_next, self.angles.x))


class _CompiledSimulator:
    """Several steps of a scalar model in one pass."""

    def __init__(self, model: Model):
        self.constants = np.array([float(value) for value in model.values.values()])
        equations = model.meter_equation[0], model.state_equation[0]
        self.loop = _simulation(model.x[0], (*model.v, *model.w), tuple(model.values), *equations)

    def several(self, start: Array, v: Array, w: Array) -> tuple[Array, Array]:
        """x (K + 1, N) and y (K, N) from states (N, 1) and noises (K, N, r)."""
        x, y = self.room(*v.shape[:2])
        x[0] = start[:, 0]
        self.fill(x, y, slice(0, len(start)), v, w)
        return x, y

    def room(self, steps: int, size: int) -> tuple[Array, Array]:
        return np.empty((steps + 1, size)), np.empty((steps, size))

    def fill(self, x: Array, y: Array, here: slice, v: Array, w: Array) -> None:
        """x[1:] and y of some trajectories from their x[0] and noises (K, n, r)."""
        noises = [np.ascontiguousarray(one[:, :, i]) for one in (v, w) for i in range(one.shape[2])]
        for k, row in enumerate(y):
            self.loop(self.constants, x[k, here], *(one[k] for one in noises), row[here], x[k + 1, here])


@lru_cache(maxsize=256)
def _simulation(
    x: sp.Symbol, noises: tuple[sp.Symbol, ...], constants: tuple[sp.Symbol, ...], y: sp.Expr, x_next: sp.Expr
) -> Any:
    """The loop of the two equations."""
    given = {"x": x} | {f"noise{i}": one for i, one in enumerate(noises)}
    return load(loop("model", given, Pass({"y": y, "x_next": x_next}, constants))).model


class _JumpSimulator:
    """One step of a model that jumps: (k, x, mode, v, w, u) -> y = b^mode(x, w), the next mode by u, x' = a^next(x, v)."""

    def __init__(self, model: JumpModel):
        self.model, self.modes = model, [compile_model(mode) for mode in model.modes]

    def __call__(self, k: int, x: Array, mode: Array, v: Array, w: Array, u: Array) -> Instant:
        model, angles = self.model, self.model.angles
        if model.by_state:
            mode_next = _chosen(model.transition_of(x, k)[np.arange(len(x)), mode], u)
        else:
            mode_next = _chosen(model.transition_at(k)[mode], u)
        y, x_next = np.empty((len(x), model.p)), np.empty((len(x), model.n))
        with np.errstate(over="ignore", invalid="ignore"):
            for j, (one, (state, meter)) in enumerate(zip(model.modes, self.modes, strict=True)):
                here, there = mode == j, mode_next == j
                y[here] = meter(x[here], _of_law(w[here], one.meter_noise), k)
                x_next[there] = state(x[there], _of_law(v[there], one.state_noise), k)
        found = JumpInstant(x, on_circle(y, angles.y), on_circle(x_next, angles.x))
        found.mode, found.mode_next = mode, mode_next
        return found


def _chosen(probabilities: Array, u: Array) -> Array:
    """A number for each of u (N,), between 0 and 1: j with the probability of column j, (N, J) or (1, J)."""
    return (u[:, None] >= np.cumsum(probabilities, axis=1)[:, :-1]).sum(axis=1).astype(np.int8)


def _of_law(standard: Array, law: Gaussian) -> Array:
    return law.mean + standard @ square_root(law.cov).T


def _draw(rng: np.random.Generator, law: Gaussian, steps: int, size: int, compiled: bool) -> Array:
    """Gaussian noise (steps, size, r), every component contiguous in memory."""
    r = len(law.mean)
    standard = np.empty((steps, r, size))
    if compiled:
        from kfcourse.filters.loops import normals

        normals(rng, standard.reshape(-1))
    else:
        rng.standard_normal(out=standard)
    standard = standard.swapaxes(1, 2)
    if not law.mean.any() and np.array_equal(law.cov, np.eye(r)):
        return standard
    return _of_law(standard, law)


def _by_strata(rng: np.random.Generator, sets: int, r: int, wide: float) -> Array:
    """Standard normal states (sets * STRATA, r), half of each set `wide` times as wide, each half a Latin hypercube.

    Every component of a half has one value in each of as many strata of equal probability; within a set the order is random, so
    that a part of one is a fair sample too.
    """
    parts = 1 if wide == 1 else 2
    strata = STRATA // parts
    places = rng.permuted(np.broadcast_to(np.arange(strata), (sets, parts, r, strata)), axis=-1)
    standard = scipy.special.ndtri((places + rng.random(places.shape)) / strata)
    standard[:, 1:] *= wide
    order = rng.permuted(np.broadcast_to(np.arange(STRATA), (sets, STRATA)), axis=-1)
    standard = standard.swapaxes(2, 3).reshape(sets, STRATA, r)
    return np.take_along_axis(standard, order[:, :, None], axis=1).reshape(-1, r)


class Serial(Executor):
    """An executor without threads: everything is done at once, by the caller."""

    def submit(self, fn, /, *args, **kwargs) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


@contextmanager
def workers(threads: int) -> Iterator[Executor]:
    """An executor of so many threads, on whose number no result depends; what waits is dropped on an error or interrupt."""
    expect_sizes(threads=threads)
    pool = Serial() if threads == 1 else ThreadPoolExecutor(int(threads))
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


@overload
def simulate(model: Model, runs: int, steps: int, seed: int) -> Trajectories: ...
@overload
def simulate(model: JumpModel, runs: int, steps: int, seed: int) -> JumpTrajectories: ...
def simulate(model: Model | JumpModel, runs: int, steps: int, seed: int) -> Trajectories | JumpTrajectories:
    """Trajectories to look at: x (steps, runs, n) and y (steps, runs, p), the same for the same seed.

    Of a model that jumps also its modes (steps, runs).
    """
    ensemble = Ensemble(model, runs, steps, np.random.SeedSequence(seed))
    x, y, mode = np.empty((steps, runs, model.n)), np.empty((steps, runs, model.p)), np.zeros((steps, runs), dtype=np.int8)
    start = 0
    for index, size in enumerate(ensemble.sizes):
        for k, instant in enumerate(ensemble.block(index)):
            x[k, start : start + size], y[k, start : start + size] = instant.x, instant.y
            if isinstance(instant, JumpInstant):
                mode[k, start : start + size] = instant.mode
        start += size
    return JumpTrajectories(x, y, mode) if isinstance(model, JumpModel) else Trajectories(x, y)
