"""Trajectories of a model, drawn reproducibly: a seed stands for them, and they are generated
whenever they are asked for.

Initial states and every few steps draw from streams of their own, spawned from the seed.  So the
numbers do not depend on who asks for them, or in which order.  They are equal to the last bit with
the same kernels of linear algebra (BLAS).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, overload

import numpy as np
import scipy

from kfcourse.angles import on_circle
from kfcourse.errors import NotFinite, expect, expect_sizes
from kfcourse.filters.exact.laws import modes_of
from kfcourse.laws import Array, Gaussian, normalised_square, square_root
from kfcourse.linear.runs import Trajectories
from kfcourse.symbolic.equations import compile_model
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model

STEPS_AT_ONCE = 4  # steps drawn by one call: few calls, and little memory


class Instant(NamedTuple):
    """One step of an ensemble: x_k (N, n), y_k (N, p), x_{k+1} (N, n).

    Also the modes i_k and i_{k+1}, (N,), numbers from 0; without modes all are 0.
    """

    x: Array
    y: Array
    x_next: Array
    mode: Array | None = None
    mode_next: Array | None = None


class JumpTrajectories(NamedTuple):
    """Stored trajectories of a model that jumps: x (steps, runs, n), y (steps, runs, p), modes
    (steps, runs)."""

    x: Array
    y: Array
    mode: Array


@dataclass(frozen=True)
class Ensemble:
    """The trajectories that one seed stands for; an iteration over it gives an `Instant` for each
    step.

    Attributes
    ----------
    model : Model or JumpModel
    runs, steps : int
        Trajectories, and measurements y_0 ... y_{steps-1} of each.
    seed : numpy.random.SeedSequence
        A number becomes one.
    wide : float, optional
        Initial states are drawn as by `stratified`, to be weighted by `weights`.
    """

    model: Model | JumpModel
    runs: int
    steps: int
    seed: np.random.SeedSequence
    wide: float | None = None

    def __post_init__(self) -> None:
        expect(self.model, Model, "an ensemble", JumpModel)
        if not isinstance(self.seed, np.random.SeedSequence):
            object.__setattr__(self, "seed", np.random.SeedSequence(self.seed))
        expect_sizes(runs=self.runs, steps=self.steps)

    def __iter__(self) -> Iterator[Instant]:
        return side_by_side([self])


def side_by_side(ensembles: Sequence[Ensemble]) -> Iterator[Instant]:
    """The steps of ensembles of one model, as of a single one that holds all their trajectories."""
    model, steps = ensembles[0].model, ensembles[0].steps
    advance = _advance(model)
    start: list[Any] = _joined([_initial(ensemble) for ensemble in ensembles])
    for first in range(0, steps, STEPS_AT_ONCE):
        count = min(STEPS_AT_ONCE, steps - first)
        parts = [_noises(ensemble, 1 + first // STEPS_AT_ONCE, count) for ensemble in ensembles]
        for k in range(count):
            noises = _joined([[kind[k] for kind in part] for part in parts])
            instant = advance(first + k, *start, *noises)
            yield instant
            start = [instant.x_next, instant.mode_next]


@overload
def simulate(model: Model, runs: int, steps: int, seed: int) -> Trajectories: ...
@overload
def simulate(model: JumpModel, runs: int, steps: int, seed: int) -> JumpTrajectories: ...
def simulate(
    model: Model | JumpModel, runs: int, steps: int, seed: int
) -> Trajectories | JumpTrajectories:
    """Trajectories to look at: x (steps, runs, n) and y (steps, runs, p), the same for the same
    seed.

    Of a model that jumps also its modes (steps, runs).
    """
    ensemble = Ensemble(model, runs, steps, np.random.SeedSequence(seed))
    x, y, _, mode, _ = zip(*ensemble, strict=True)
    if isinstance(model, JumpModel):
        return JumpTrajectories(np.stack(x), np.stack(y), np.stack(mode))
    return Trajectories(np.stack(x), np.stack(y))


def foretold(ensemble: Ensemble, k: int, drawn: tuple[Array, Array] | None) -> Array:
    """y_k (runs, p) of an ensemble whose states x_{k-1} (runs, n) and modes (runs,) are these; of
    the first step by the prior."""
    advance, (before, now) = _advance(ensemble.model), zip(*_noises(ensemble, 1, 2), strict=True)
    if drawn is None:
        return advance(0, *_initial(ensemble), *now).y
    moved = advance(k - 1, *drawn, *before)
    return advance(k, moved.x_next, moved.mode_next, *now).y


def check_finite(k: int, *trajectories: Array) -> None:
    """NotFinite if these arrays of a step are not all finite."""
    if not all(np.isfinite(values).all() for values in trajectories):
        raise NotFinite(
            f"step {k}: the model's trajectories become infinite, check its equations and "
            f"parameters"
        )


def weights(prior: Gaussian, x: Array, wide: float | None) -> Array:
    """Prior over the law that `stratified` draws from, at initial states x (N, n): (N,), between 0
    and 2.

    With t = (x - m)^T d^+ (x - m) and r the rank of d,
    2 N(x; m, d) / (N(x; m, d) + N(x; m, w^2 d)) = 2 / (1 + w^-r exp((1 - w^-2) t / 2)).
    A wider law alone has weights without bound: one start near the mean would count as many.
    """
    if wide is None:
        return np.ones(len(x))
    rank = np.linalg.matrix_rank(prior.cov, hermitian=True)
    exponent = 0.5 * (1 - wide**-2) * normalised_square(x - prior.mean, prior.cov)
    return 2 * scipy.special.expit(rank * np.log(wide) - exponent)


def stratified(rng: np.random.Generator, runs: int, r: int, wide: float) -> Array:
    """Standard normal states (runs, r), every second one `wide` times as wide, each half a Latin
    hypercube.

    Every component of a half has one value in each of as many strata of equal probability.
    """
    standard = np.empty((runs, r))
    for first, scale in enumerate((1.0, wide)):
        half = standard[first::2]
        strata = rng.permuted(np.tile(np.arange(len(half))[:, None], (1, r)), axis=0)
        half[:] = scale * scipy.special.ndtri((strata + rng.random(half.shape)) / max(len(half), 1))
    return standard


def _advance(model: Model | JumpModel) -> Callable[..., Instant]:
    """One step of the model: (k, x, mode, standard v, w, u) -> y = b^mode(x, w), the next mode by
    u, x' = a^next(x, v).  A model that does not jump needs no u, and stays in the mode 0."""
    modes = [(mode, *compile_model(mode)) for mode in modes_of(model)]
    between = modes[0][0].between

    def advance(k: int, x: Array, mode: Array, v: Array, w: Array, *u: Array) -> Instant:
        mode_next = mode
        if isinstance(model, JumpModel):
            pi = (
                model.transition_of(x, k)[np.arange(len(x)), mode]
                if model.by_state
                else model.transition_at(k)[mode]
            )
            mode_next = _chosen(pi, *u)
        y, x_next = np.empty((len(x), model.p)), np.empty((len(x), model.n))
        with np.errstate(over="ignore", invalid="ignore"):  # who looks at it reports what diverges
            for j, (law, state, meter) in enumerate(modes):
                before, after = (mode == j, mode_next == j) if len(modes) > 1 else (..., ...)
                y[before] = meter(x[before], _of_law(w[before], law.meter_noise), k)
                x_next[after] = state(x[after], _of_law(v[after], law.state_noise), k)
            if between is not None and not np.isfinite(x_next**2).all():
                raise NotFinite(
                    f"step {k} of {model}: a trajectory becomes infinite: the drift outgrows the "
                    f"state, as x**3 does, or is too fast for {between.substeps} sub-steps an "
                    f"interval; check its sign, or give more `substeps`"
                )
        y, x_next = on_circle(y, model.angles.y), on_circle(x_next, model.angles.x)
        return Instant(x, y, x_next, mode, mode_next)

    return advance


def _joined(parts: Sequence[Sequence[Array]]) -> list[Array]:
    """Arrays of several ensembles side by side, kind by kind."""
    return [
        kind[0] if len(kind) == 1 else np.concatenate(kind) for kind in zip(*parts, strict=True)
    ]


def _stream(seed: np.random.SeedSequence, *key: int) -> np.random.Generator:
    spawned = np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, *key))
    return np.random.Generator(np.random.SFC64(spawned))


def _initial(ensemble: Ensemble) -> list[Array]:
    """Initial states (runs, n) and modes (runs,); these from a stream of their own."""
    model, runs, wide = ensemble.model, ensemble.runs, ensemble.wide
    rng, r = _stream(ensemble.seed, 0, 0), len(model.prior.mean)
    standard = rng.standard_normal((r, runs)).T if wide is None else stratified(rng, runs, r, wide)
    x = on_circle(_of_law(standard, model.prior), model.angles.x)
    first = model.first if isinstance(model, JumpModel) else np.ones(1)
    return [x, _chosen(first[None], _stream(ensemble.seed, 0, 0, 0).random(runs))]


def _noises(ensemble: Ensemble, key: int, steps: int) -> list[Array]:
    """Standard normal numbers for v and w of a few steps, (steps, runs, r); of a model that jumps
    also (steps, runs) in 0 to 1."""
    model, runs, rng = ensemble.model, ensemble.runs, _stream(ensemble.seed, 0, key)
    mode = modes_of(model)[0]
    # every component contiguous in memory
    drawn = [
        rng.standard_normal((steps, len(law.mean), runs)).swapaxes(1, 2)
        for law in (mode.state_noise, mode.meter_noise)
    ]
    return [*drawn, rng.random((steps, runs))] if isinstance(model, JumpModel) else drawn


def _chosen(probabilities: Array, u: Array) -> Array:
    """A number for each of u (N,), between 0 and 1: j with the probability of column j, (N, J) or
    (1, J)."""
    return (u[:, None] >= np.cumsum(probabilities, axis=1)[:, :-1]).sum(axis=1).astype(np.int8)


def _of_law(standard: Array, law: Gaussian) -> Array:
    if not law.mean.any() and np.array_equal(law.cov, np.eye(len(law.mean))):
        return standard
    return law.mean + standard @ square_root(law.cov).T
