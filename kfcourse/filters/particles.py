r"""The particle filter: the Stratonovich equation by sampling, for models of any dimension, with
modes or without.

    x_k^i ~ q(x | x_{k-1}^i, y_k),   weight
        p(y_k | x_k^i) p(x_k^i | x_{k-1}^i) / q(x_k^i | x_{k-1}^i, y_k)

Without looking at the measurement (q = p(x | x_{k-1}), the bootstrap filter) it fails in the lab's
own case: where the meter is hundreds of times sharper than the prediction, few particles fall where
the posterior is.  So the proposal looks at it.  A particle x and standard normal s make the next
state and its measurement,

    x' = a(x, m_v + L s),  L L^T = D_v;     y = g(s) + e,   g(s) = b(x', m_w),   Cov(e) = R(s)

and a step of Gauss and Newton, which is a correction with g and R taken for affine and constant at
the last s, finds a normal law of s; some of them, from s = 0, find a mode of the posterior and its
width.  q is a wider one there, beside a part of N(0, I) itself, which bounds the weights.  The
initial state is a noise, too: x_0 = m + L s.

Of a model that jumps a particle is a state and a mode.  The next mode is drawn with probability in
proportion to pi_ij(x) times the normal density of y_k that the proposal of mode j has left.

The particles are two clouds that know nothing of each other.  Their estimates z_a and z_b err
independently, so that

    M[|z - z*|^2] = M[(z - z_a)^T (z - z_b)],      z* the exact estimate, z that of any filter,

without any contribution of the sampling: that is how particles bound other filters where `exact`
does not reach.

Gordon, Salmond and Smith (1993); Doucet, Godsill and Andrieu (2000).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from kfcourse.angles import Components, difference, moments_on_circle, near, on_circle
from kfcourse.errors import expect
from kfcourse.filters.base import Filter, State, initial_state, without_prediction
from kfcourse.filters.densities import likelihood
from kfcourse.laws import (
    Array,
    Gaussian,
    Measurement,
    apply,
    correct,
    log_density,
    square_root,
    transpose,
)
from kfcourse.symbolic.equations import compile_model
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError

# steps of Gauss and Newton: after one a hundredth of the particles may count on variant 53, a third
# adds nothing
ROUNDS = 2
# step in s by which slopes are found, in standard deviations: from 1e-6 to 1e-2 as many particles
# count
SMALL = 1e-4
# the law around the mode, whose tails the posterior's must not exceed: of 500 particles 430 count
# on variant 53, by twice or half the width 256
WIDER = 1.2
# share drawn from N(0, I) and of modes drawn by pi, for what a normal law does not see: no weight
# is above 1 / PRIOR of what N(0, I) gives; half of it, and 451 of 500 count
PRIOR = 0.1


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
    x : ndarray (runs, 2, M/2, n), or None before the first measurement
        Both clouds, all particles of equal weight.
    mode : ndarray (runs, 2, M/2), or None before the first measurement
        Of each particle.
    probability : ndarray (runs, J)
        Of the modes after the last measurement.
    part : tuple of int
        Of a comparison: which trajectories these are.  Each part has random numbers of its own.
    """

    halves: Array
    effective: Array
    evidence: Array
    x: Array | None
    mode: Array | None
    probability: Array
    part: tuple[int, ...] = ()

    def generator(self, *entropy: int) -> np.random.Generator:
        """Random numbers of the part, the same for the same `entropy`."""
        return np.random.default_rng(np.random.SeedSequence(entropy, spawn_key=self.part))

    def drawn(self, number: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """States of both clouds, and their modes: as of `Filter`."""
        assert self.x is not None and self.mode is not None  # there has been a measurement
        runs, _, size = self.mode.shape
        shape = (number, runs)
        which = np.arange(runs), rng.integers(2, size=shape), rng.integers(size, size=shape)
        return self.x[which], self.mode[which]

    def discretisation_error(self) -> Array:
        """Standard error of the estimates, (runs,): half the distance of both clouds."""
        return np.asarray(0.5 * np.linalg.norm(self.halves[0] - self.halves[1], axis=-1))


def particle(
    model: Model | JumpModel,
    particles: int = 1000,
    seed: int = 0,
    *,
    guided: bool = True,
    name: str = "particle",
) -> Filter:
    """The particle filter, resampled systematically at each step, each cloud for itself.

    Parameters
    ----------
    model : Model or JumpModel
        Any dimension; p(y | x) must be known, so the meter's noise must enter linearly.
    particles : int
        Particles per trajectory, even, half of them in each cloud; `state.memory.effective` tells
        how many count.
    seed : int
        Steps are reproducible: the same state and measurement give the same result.
    guided : bool
        Whether the proposal looks at the measurement.  Without, it is the bootstrap filter.
    name : str
        Of the filter: "aof-exact" where it stands for the exact one.

    Returns
    -------
    Filter
        Its covariance estimates the posterior's; too large where few count, by some tenths where 40
        without guidance meet a sharp meter.  `state.memory.probability` are the modes'
        probabilities.

    Raises
    ------
    ModelError
        There is no density of y given x (in some mode); the number of particles is not even.
    """
    expect(model, Model, "particle", JumpModel)
    if not isinstance(particles, int | np.integer) or particles < 2 or particles % 2:
        raise ModelError(
            f"a particle filter needs an even number of at least 2 particles, got {particles!r}"
        )
    jumping = model if isinstance(model, JumpModel) else None
    modes = model.modes if isinstance(model, JumpModel) else (model,)
    sampler = Sampler([*map(Mode.of, modes)], jumping, particles // 2, seed, guided)
    return Filter(
        name, modes[0], sampler.init, sampler.step, slow=True, evidence=_evidence, drawn=True
    )


@dataclass(frozen=True)
class Sampler:
    """The steps of a particle filter: what it draws, weighs, resamples."""

    modes: Sequence[Mode]
    jumping: JumpModel | None
    size: int  # of each cloud
    seed: int
    guided: bool

    @property
    def angles(self) -> Components:
        return self.modes[0].model.angles.x

    @property
    def first(self) -> Array:
        """Probabilities of the modes before anything is measured, (J,)."""
        return np.ones(1) if self.jumping is None else self.jumping.first

    def init(self, runs: int) -> State:
        state = initial_state(self.modes[0].model)(runs)
        halves = np.stack([state.posterior.mean] * 2)
        count, evidence = np.full(runs, 2.0 * self.size), np.zeros((2, runs))
        probability = np.tile(self.first, (runs, 1))
        return state._replace(memory=Clouds(halves, count, evidence, None, None, probability))

    def chances(self, x: Array, mode: Array, k: int) -> Array:
        """Probabilities of the mode after step k, (runs, 2, M/2, J)."""
        if self.jumping is None:
            return np.ones((*mode.shape, 1))
        pi = self.jumping.transition_of(x, k)
        return np.take_along_axis(pi, mode[..., None, None], axis=-2)[..., 0, :]

    def ways(
        self, before: Clouds, shape: tuple[int, ...], k: int
    ) -> tuple[Array, list[tuple[Callable[[Array], Array], int]]]:
        """Probabilities of the modes at step k, and of each how standard normal s make x_k, and how
        many they are."""
        if before.x is None or before.mode is None:
            prior = self.modes[0].model.prior
            root = square_root(prior.cov)
            way = lambda s: on_circle(prior.mean + s @ root.T, self.angles), len(root)
            return np.broadcast_to(self.first, (*shape, len(self.modes))), [way] * len(self.modes)
        return self.chances(before.x, before.mode, k - 1), [
            (partial(mode.moved, before.x, k=k - 1), mode.noises) for mode in self.modes
        ]

    def drawn(
        self, rng: np.random.Generator, before: Clouds, y: Array, k: int
    ) -> tuple[Array, Array, Array]:
        """x_k (runs, 2, M/2, n), its modes, and ln of p over the density with which both were
        drawn."""
        shape = (len(y), 2, self.size)
        pi, ways = self.ways(before, shape, k)
        states, logs, heights = [], [], []
        for mode, (moved, noises) in zip(self.modes, ways, strict=True):
            s = rng.standard_normal((*shape, noises))
            log, height = np.zeros(shape), np.zeros(shape)
            if self.guided:
                law, tells, height = mode.look(moved, s.shape, y[:, None, None], k)
                wide, log_of_wide = _wide(rng, law)
                s, log = np.where(tells[..., None], wide, s), np.where(tells, log_of_wide, log)
            states.append(moved(s))
            logs.append(log)
            heights.append(height)
        seen, _ = _normalised(np.log(pi) + np.stack(heights, axis=-1))
        share = (1 - PRIOR) * seen + PRIOR * pi
        modes = _chosen(rng, share)
        lifted = np.take_along_axis(np.log(pi) - np.log(share), modes[..., None], axis=-1)[..., 0]
        return np.choose(modes[..., None], states), modes, lifted + np.choose(modes, logs)

    def step(self, state: State, y: Array) -> State:
        k, memory = state.step, state.memory
        rng = memory.generator(self.seed, len(y), k)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            x, mode, logs = self.drawn(rng, memory, y, k)
            # a state whose fourth power is no number is lost, as one is that is infinite
            lost = np.asarray(~np.isfinite(x**4).all(axis=-1))
            x = np.where(lost[..., None], self.modes[0].model.prior.mean, x)
            likelihoods = [each.log_likelihood(y[:, None, None], x, k) for each in self.modes]
            logs = np.where(lost, -np.inf, logs + np.choose(mode, likelihoods))
            weights, log_mean = _normalised(logs)
            law = weighted(x, weights, self.angles)
            counts = [(weights * (mode == j)).sum(-1).mean(1) for j in range(len(self.modes))]
            kept = _systematic(rng, weights)
            x = np.take_along_axis(x, kept[..., None], axis=2)
            mode = np.take_along_axis(mode, kept, axis=2)
        effective = (1 / (weights**2).sum(axis=-1)).sum(axis=1)
        memory = Clouds(
            np.moveaxis(law.mean, 1, 0), effective, log_mean.T, x, mode,
            np.stack(counts, axis=-1), memory.part,
        )  # fmt: skip
        return without_prediction(k + 1, _of_both(*law, self.angles), memory)


class Mode(NamedTuple):
    """What particles must know of a model, or of a mode: its equations with standard normal noises.

    Attributes
    ----------
    model : Model
    noises : int
        r, the number of the object's noises.
    state, meter : callable
        a(x, m_v + L s) and b(x, m_w + L w) at step k: (x (..., n), s (..., r), k), (x, w (..., q),
        k).
    log_likelihood : callable
        (y (..., p), x (..., n), k) -> ln p(y | x).
    """

    model: Model
    noises: int
    state: Callable[[Array, Array, int], Array]
    meter: Callable[[Array, Array, int], Array]
    log_likelihood: Callable[[Array, Array, int], Array]

    @classmethod
    def of(cls, model: Model) -> Mode:
        a, b = compile_model(model)
        v, w = model.state_noise, model.meter_noise
        L, M = square_root(v.cov).T, square_root(w.cov).T
        return cls(
            model,
            len(L),
            lambda x, s, k: a(x, v.mean + s @ L, k),
            lambda x, s, k: b(x, w.mean + s @ M, k),
            likelihood(model),
        )

    def moved(self, x: Array, s: Array, k: int) -> Array:
        """The states after step k, from states x (..., n) with noises s (..., r)."""
        return on_circle(np.broadcast_to(self.state(x, s, k), x.shape), self.model.angles.x)

    def look(
        self, moved: Callable[[Array], Array], shape: tuple[int, ...], y: Array, k: int
    ) -> tuple[Gaussian, Array, Array]:
        """Normal laws of s, of the shape (..., r), given y_k; whether y tells of s, (...); ln p(y)
        by these laws."""
        turning, still = self.model.angles.y, np.zeros(len(self.model.w))

        def slopes(function: Callable[[Array], Array], at: Array, width: float) -> Array:
            beside = width * np.eye(at.shape[-1])
            return np.stack(
                [difference(function(at + e), function(at - e), turning) for e in beside], axis=-1
            ) / (2 * width)

        prior = law = Gaussian(np.zeros(shape), np.eye(shape[-1]))
        for _ in range(ROUNDS):
            s, x = law.mean, moved(law.mean)
            h = self.meter(x, still, k)
            H = slopes(lambda s: self.meter(moved(s), still, k), s, SMALL)
            B = slopes(lambda w, x=x: self.meter(x, w, k), still, 1.0)  # type: ignore[misc]
            R = B @ transpose(B)
            seen, value = (
                Measurement(h - apply(H, s), H, H @ transpose(H) + R, R),
                near(y, h, turning),
            )
            law = correct(prior, seen, value)
            law = Gaussian(np.nan_to_num(law.mean, posinf=0.0, neginf=0.0), law.cov)
        tells = (H != 0).any(axis=(-2, -1)) & ~np.isnan(y).all(axis=-1)
        return law, tells, np.nan_to_num(log_density(seen, value), nan=-np.inf)


def _wide(rng: np.random.Generator, law: Gaussian) -> tuple[Array, Array]:
    """s (..., r) by a mixture of a wider normal law and of N(0, I), and ln N(s; 0, I) / q."""
    shape, r = law.mean.shape[:-1], law.mean.shape[-1]
    # the least variances of s may be smaller than the rounding of those near 1
    cov = np.where(np.isfinite(law.cov), law.cov, np.eye(r)) + 1e-14 * np.eye(r)
    root = WIDER * np.linalg.cholesky(cov)
    normal, plain = rng.standard_normal(law.mean.shape), rng.random(shape) < PRIOR
    s = np.where(plain[..., None], normal, law.mean + apply(root, normal))
    square = (apply(np.linalg.inv(root), s - law.mean) ** 2).sum(axis=-1)
    # over (2 pi)^(-r/2)
    log = -0.5 * square - np.log(np.diagonal(root, axis1=-2, axis2=-1)).sum(axis=-1)
    standard = -0.5 * (s * s).sum(axis=-1)
    return s, standard - np.logaddexp(log + np.log(1 - PRIOR), standard + np.log(PRIOR))


def _evidence(before: State, y: Array, after: State) -> Array:
    """ln of the mean of both clouds' weights, (runs,); 0 where nothing was measured."""
    return np.where(np.isnan(y).all(axis=-1), 0.0, np.logaddexp(*after.memory.evidence) - np.log(2))


def _normalised(logs: Array) -> tuple[Array, Array]:
    """Weights (..., M) that sum to 1, all equal where nothing is left of them, and the logarithm of
    their mean before (...)."""
    peak = logs.max(axis=-1, keepdims=True)
    weights = np.nan_to_num(np.exp(logs - np.where(np.isfinite(peak), peak, 0.0)), posinf=0.0)
    total = weights.sum(axis=-1, keepdims=True)
    mean = peak + np.log(total / logs.shape[-1])
    return np.where(
        total > 0, weights / np.where(total > 0, total, 1.0), 1.0 / logs.shape[-1]
    ), mean[..., 0]


def _systematic(rng: np.random.Generator, weights: Array) -> Array:
    """Indices (runs, 2, M/2) of systematic resampling: one uniform number a cloud, M/2 equal
    steps."""
    size = weights.shape[-1]
    cumulative = np.cumsum(weights, axis=-1)
    cumulative /= cumulative[..., -1:]
    number = np.arange(cumulative[..., 0].size).reshape(*weights.shape[:-1], 1)
    wanted = (np.arange(size) + rng.random(number.shape)) / size
    # all clouds in one row
    places = np.searchsorted((cumulative + 2.0 * number).ravel(), wanted + 2.0 * number)
    return np.minimum(places - number * size, size - 1)


def _chosen(rng: np.random.Generator, share: Array) -> Array:
    """An index for each of the probabilities (..., J)."""
    return (rng.random((*share.shape[:-1], 1)) > np.cumsum(share, axis=-1)[..., :-1]).sum(axis=-1)


def weighted(x: Array, weights: Array, angles: Components) -> Gaussian:
    """Mean (..., n) and covariance (..., n, n) of weighted particles (..., M, n)."""
    mean = np.einsum("...m,...mi->...i", weights, x)
    for i in angles:
        mean[..., i], _ = moments_on_circle(x[..., i], weights)
    deviation = difference(x, mean[..., None, :], angles)
    return Gaussian(mean, np.einsum("...m,...mi,...mj->...ij", weights, deviation, deviation))


def _of_both(mean: Array, cov: Array, angles: Components) -> Gaussian:
    """The law by both clouds, from theirs (runs, 2, ...)."""
    half = 0.5 * difference(mean[:, 0], mean[:, 1], angles)
    return Gaussian(
        on_circle(mean[:, 1] + half, angles), cov.mean(axis=1) + half[:, :, None] * half[:, None, :]
    )
