"""The particle filter: the Stratonovich equation by sampling, for models of any dimension.

    x_k^i ~ q(x | x_{k-1}^i, y_k),    weight  p(y_k | x_k^i) p(x_k^i | x_{k-1}^i) / q(x_k^i | x_{k-1}^i, y_k)

Without looking at the measurement (q = p(x | x_{k-1}), the bootstrap filter) it fails in the lab's own case: where the meter is
hundreds of times sharper than the prediction, few particles fall where the posterior is.  So the proposal q looks at it
(`proposals`).

The particles are two clouds that know nothing of each other.  Their estimates z_a and z_b err independently, so that

    M[|z - z*|^2] = M[(z - z_a)^T (z - z_b)],      z* the exact estimate, z that of any filter,

without any contribution of the sampling: that is how particles bound other filters where `exact` does not reach.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from kfcourse.angles import Components, difference, on_circle
from kfcourse.errors import expect
from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.filters.densities import likelihood, transition
from kfcourse.filters.particle_smoothing import backwards, weighted
from kfcourse.filters.proposals import Look
from kfcourse.laws import Array, Gaussian
from kfcourse.symbolic.equations import compile_model
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError

LARGEST = 1e150  # the squares of larger states are infinite
PATHS = 200  # that each cloud draws when it looks back


@dataclass(frozen=True, eq=False)
class Clouds:
    """What a filter remembers of two clouds of particles that know nothing of each other.

    Attributes
    ----------
    halves : ndarray (2, runs, n)
        The estimate of each cloud.
    effective : ndarray (runs,)
        How many particles counted.
    evidence : ndarray (2, runs)
        ln p(y_k | y_0, ..., y_{k-1}) as each cloud has it: the logarithm of its mean weight.
    seed : numpy.random.SeedSequence
    """

    halves: Array
    effective: Array
    evidence: Array
    seed: np.random.SeedSequence

    def apart(self) -> Array:
        """Standard error of the estimates, (runs,): half the distance of both clouds."""
        return np.asarray(0.5 * np.linalg.norm(self.halves[0] - self.halves[1], axis=1))

    def discretisation_error(self) -> Array:
        """What is stated of the error, (runs,): the standard error."""
        return self.apart()


@dataclass(frozen=True, eq=False)
class Particles(Clouds):
    """What the filter remembers; the others as of `Clouds`.

    Attributes
    ----------
    x : ndarray (runs, 2, M/2, n), or None before the first measurement
        Both clouds, all particles of equal weight.
    """

    x: Array | None

    def evidence_error(self) -> Array:
        """Standard error of the last ln p(y_k | y_0, ..., y_{k-1}), (runs,): half the distance of both clouds."""
        return 0.5 * np.abs(self.evidence[0] - self.evidence[1])


def particle(model: Model, particles: int = 1000, seed: int = 0, *, guided: bool = True, name: str = "particle") -> Filter:
    """The particle filter (Gordon, Salmond and Smith, 1993; guided as by Doucet, Godsill and Andrieu, 2000).

    Resampled systematically at each step, each cloud for itself.

    Parameters
    ----------
    model : Model
        Any dimension; the meter's noise must enter linearly, so that p(y | x) is known.
    particles : int
        Particles per trajectory, even, half of them in each cloud; `state.memory.effective` tells how many of them count.
    seed : int
        Steps are reproducible: the same state and measurement give the same result.
    guided : bool
        Whether the proposal looks at the measurement.  Without, it is the bootstrap filter.
    name : str
        Of the filter: "aof-exact" where it stands for the exact one.

    Returns
    -------
    Filter
        Its covariance estimates the posterior's: without bias where all particles weigh the same, as the guided ones of a linear
        model do; too large where few count, by some tenths where 40 without guidance meet a sharp meter.
    """
    expect(model, Model, "particle")
    even(particles)
    number, log_likelihood, angles = seed, likelihood(model), model.angles.x
    state_equation, _ = compile_model(model)
    gaussian_init = initial_state(model)
    start, ahead = Look.at_start(model), Look.ahead(model)
    size = particles // 2

    def init(runs: int) -> State:
        state = gaussian_init(runs)
        return state._replace(memory=Particles(*at_start(state.posterior.mean, particles, number), x=None))

    def first(rng: np.random.Generator, y: Array) -> tuple[Array, Array]:
        """x_0 (runs, 2, M/2, n), and the logarithms of p / q."""
        s, logs = plain(rng, (len(y), 2, size), start)
        if guided and not start.blind:
            found = start.proposal(np.zeros((len(y), model.n)), y, start.starts(), 0)
            heights = log_likelihood(y[:, None, :], start.noise_of(found.mean), 0) - 0.5 * (found.mean**2).sum(axis=-1)
            heights += np.log(np.diagonal(found.root, axis1=-2, axis2=-1)).sum(axis=-1)
            for_both = found._replace(share=normalised(heights)[0]).of_clouds(2)
            s, logs = where_measured(y, start.draw(for_both, rng, size), s)
        return on_circle(start.noise_of(s), angles), logs

    def following(rng: np.random.Generator, x: Array, y: Array, k: int) -> tuple[Array, Array]:
        """x_k (runs, 2, M/2, n) from the particles of the step before, and the logarithms of p / q."""
        s, logs = plain(rng, x.shape[:-1], ahead)
        if guided and not ahead.blind:
            found = ahead.proposal(x, y[:, None, None, :], np.zeros((1, s.shape[-1])), k)
            s, logs = where_measured(y, ahead.draw_each(found, rng), s)
        after = moved(x, s, k - 1)
        lost = ~np.logical_and.reduce(np.abs(after) < LARGEST, axis=-1)
        return np.where(lost[..., None], x, after), np.where(lost, -np.inf, logs)

    def moved(x: Array, s: Array, k: int) -> Array:
        """The states after step k."""
        return on_circle(np.broadcast_to(state_equation(x, ahead.noise_of(s), k), x.shape), angles)

    def step(state: State, y: Array) -> State:
        before, root = state.memory.x, state.memory.seed
        rng = stream(root, state.step)
        with np.errstate(over="ignore", invalid="ignore"):  # what lies beyond the largest number has no weight
            x, logs = first(rng, y) if before is None else following(rng, before, y, state.step)
            weights, log_mean = normalised(logs + log_likelihood(y[:, None, None, :], x, state.step))
            mean, cov = weighted(x, weights, angles)
            posterior = of_both(mean, cov, angles)
        flat, chosen = x.reshape(-1, size, model.n), systematic(weights.reshape(-1, size), rng)
        kept = np.take_along_axis(flat, chosen[..., None], axis=1).reshape(x.shape)
        effective = (1 / (weights**2).sum(axis=-1)).sum(axis=1)
        s, _ = plain(rng, x.shape[:-1], ahead)
        with np.errstate(over="ignore", invalid="ignore"):
            following_ones = moved(kept, s, state.step).reshape(len(y), particles, model.n)
            predicted = weighted(following_ones, np.full(following_ones.shape[:-1], 1.0 / particles), angles)
        memory = Particles(np.moveaxis(mean, 1, 0), effective, log_mean.T, root, x=kept)
        return State(state.step + 1, posterior, predicted, memory)

    def look_back(states: Iterable[State], y: Array) -> Callable[[int], Iterator[State]]:
        memories = [state.memory for state in states]

        def back(end: int) -> Iterator[State]:
            rng = stream(memories[0].seed, end)
            found = backwards([memory.x for memory in memories[:end]], transition(model), angles, min(size, PATHS), rng)
            for step, (clouds, effective) in zip(range(end, 0, -1), found, strict=True):
                law, halves = of_both(*clouds, angles), np.moveaxis(clouds.mean, 1, 0)
                yield State(step, law, law, replace(memories[step - 1], x=None, halves=halves, effective=effective))

        return back

    return Filter(name, model, init, step, slow=True, evidence=by_clouds, look_back=look_back)


def by_clouds(before: State, y: Array, after: State) -> Array:
    """ln of the mean of both clouds' weights, (runs,); 0 where nothing was measured."""
    return np.where(np.isnan(y).all(axis=-1), 0.0, np.logaddexp(*after.memory.evidence) - np.log(2))


def even(particles: int) -> None:
    """ModelError if so many particles are not two clouds of equal size."""
    if not isinstance(particles, int | np.integer) or particles < 2 or particles % 2:
        raise ModelError(f"a particle filter needs an even number of at least 2 particles, got {particles!r}")


def at_start(mean: Array, particles: int, number: int) -> tuple[Array, Array, Array, np.random.SeedSequence]:
    """The fields of `Clouds` before the first measurement, from the prior's means (runs, n)."""
    runs = len(mean)
    return np.stack([mean] * 2), np.full(runs, float(particles)), np.zeros((2, runs)), np.random.SeedSequence([number, runs])


def of_both(mean: Array, cov: Array, angles: Components) -> Gaussian:
    """The law by both clouds, from theirs (runs, 2, ...)."""
    apart = difference(mean[:, 0], mean[:, 1], angles)
    return Gaussian(on_circle(mean[:, 1] + 0.5 * apart, angles), cov.mean(axis=1) + 0.5 * apart[:, :, None] * apart[:, None, :])


def plain(rng: np.random.Generator, shape: tuple[int, ...], look: Look) -> tuple[Array, Array]:
    """Standard normal numbers (..., r): a proposal that is the law itself."""
    return rng.standard_normal((*shape, len(look.noise.mean))), np.zeros(shape)


def where_measured(y: Array, guided: tuple[Array, Array], plain: Array) -> tuple[Array, Array]:
    """The proposal's s and logarithms, but the law itself for trajectories whose measurement is missing."""
    missing = np.logical_and.reduce(np.isnan(y), axis=-1)[:, None, None]
    return np.where(missing[..., None], plain, guided[0]), np.where(missing, 0.0, guided[1])


def stream(root: np.random.SeedSequence, step: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(root.entropy, spawn_key=(step,)))


def normalised(logs: Array) -> tuple[Array, Array]:
    """Weights (..., M) that sum to 1, all equal where nothing is left of them, and the logarithm of their mean before (...)."""
    peak = logs.max(axis=-1, keepdims=True)
    weights = np.exp(logs - np.where(np.isfinite(peak), peak, 0.0))
    weights = np.where(np.isfinite(weights), weights, 0.0)
    total = weights.sum(axis=-1, keepdims=True)
    with np.errstate(divide="ignore"):
        mean = peak + np.log(total / logs.shape[-1])
    return np.where(total > 0, weights / np.where(total > 0, total, 1.0), 1.0 / logs.shape[-1]), mean[..., 0]


def systematic(weights: Array, rng: np.random.Generator) -> Array:
    """Indices (clouds, M) of systematic resampling: one uniform number a cloud, M equal steps."""
    clouds, m = weights.shape
    cumulative = np.cumsum(weights, axis=1)
    cumulative /= cumulative[:, -1:]
    wanted = (np.arange(m) + rng.random((clouds, 1))) / m
    shift = 2.0 * np.arange(clouds)[:, None]
    flat = np.searchsorted((cumulative + shift).ravel(), (wanted + shift).ravel()).reshape(clouds, m)
    return np.minimum(flat - np.arange(clouds)[:, None] * m, m - 1)
