r"""Particles of a model that jumps: each is a state and a mode, and looks at the measurement before it chooses its next mode.

    mode j with probability r_j ∝ pi_ij(x) p_j(y_k | x^j) |q_j|       x^j the state that mode j makes likeliest, given y_k
    then the noise from the proposal q_j of mode j, see `proposals`, and the weight

    pi_ij(x) p_j(y_k | x_k) p_j(x_k | x) / (r_j q_j(x_k | x, y_k))

r_j is the probability of the next mode given this particle and y_k, by a normal law; for affine equations it is exactly that, and
all that is random is which particles are kept.  Two clouds that know nothing of each other, as of `particles`.  An object without
noise makes copies of copies: `undisturbed` is for that.  Doucet, Godsill and Andrieu (2000), with a mode beside the state.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kfcourse.angles import on_circle
from kfcourse.errors import expect
from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.filters.densities import likelihood
from kfcourse.filters.particle_smoothing import weighted
from kfcourse.filters.particles import (
    LARGEST,
    Particles,
    at_start,
    by_clouds,
    even,
    normalised,
    of_both,
    plain,
    stream,
    systematic,
    where_measured,
)
from kfcourse.filters.proposals import Look, component
from kfcourse.laws import Array
from kfcourse.symbolic.equations import compile_model
from kfcourse.symbolic.jumping import JumpModel

UNSEEN = 0.1  # share of the modes drawn by their probabilities before y_k all the same, for what a normal law does not see


@dataclass(frozen=True, eq=False)
class JumpParticles(Particles):
    """What the filter remembers; the others as of `kfcourse.filters.particles.Particles`.

    Attributes
    ----------
    mode : ndarray (runs, 2, M/2), or None before the first measurement
        Of each particle.
    probability : ndarray (runs, J)
        Of the modes after the last measurement.
    """

    mode: Array | None
    probability: Array


def jump_particle(model: JumpModel, particles: int = 1000, seed: int = 0, name: str = "particle") -> Filter:
    """The particle filter of a model that jumps, of any dimension.

    Parameters
    ----------
    model : JumpModel
        In each mode the meter's noise enters linearly, or can be solved for, so that p_j(y | x) is known.
    particles : int
        Per trajectory, even, half of them in each cloud.
    seed : int
        The same state and measurement give the same result.
    name : str
        Of the filter: "aof-exact" where it stands for the exact one.

    Returns
    -------
    Filter
        `state.memory.probability` are the modes' probabilities.

    Raises
    ------
    ModelError
        There is no density of y given x in some mode.
    """
    expect(model, JumpModel, "jump_particle")
    even(particles)
    size, count, angles, number = particles // 2, len(model.modes), model.angles.x, seed
    likelihoods = [likelihood(mode) for mode in model.modes]
    equations = [compile_model(mode)[0] for mode in model.modes]
    starts, aheads = [Look.at_start(mode) for mode in model.modes], [Look.ahead(mode) for mode in model.modes]
    gaussian_init = initial_state(model.modes[0])

    def init(runs: int) -> State:
        state = gaussian_init(runs)
        start, probability = at_start(state.posterior.mean, particles, number), np.tile(model.first, (runs, 1))
        return state._replace(memory=JumpParticles(*start, x=None, mode=None, probability=probability))

    def moved(j: int, x: Array, s: Array, k: int) -> Array:
        """The states after step k in mode j."""
        return on_circle(np.broadcast_to(equations[j](x, aheads[j].noise_of(s), k), x.shape), angles)

    def first(rng: np.random.Generator, y: Array) -> tuple[Array, Array, Array]:
        """x_0 (runs, 2, M/2, n), modes, and the logarithms of p / q."""
        shape, heights, drawn = (len(y), 2, size), [], []
        for look, told in zip(starts, likelihoods, strict=True):
            s, logs = plain(rng, shape, look)
            height = np.zeros((len(y), 1, 1))
            if not look.blind:
                found = look.proposal(np.zeros((len(y), model.n)), y, look.starts(), 0)
                each = told(y[:, None, :], look.noise_of(found.mean), 0) + _size(found.mean, found.root)
                share, height_of = normalised(each)
                s, logs = where_measured(y, look.draw(found._replace(share=share).of_clouds(2), rng, size), s)
                height = height_of[:, None, None]
            heights.append(np.broadcast_to(height, shape))
            drawn.append((on_circle(look.noise_of(s), angles), logs))
        prior = np.broadcast_to(model.first, (*shape, count))
        return _of_chosen(rng, prior, heights, drawn, y)

    def following(rng: np.random.Generator, x: Array, mode: Array, y: Array, k: int) -> tuple[Array, Array, Array]:
        """The same at step k, from the particles of the step before."""
        heights, drawn = [], []
        for j, (look, told) in enumerate(zip(aheads, likelihoods, strict=True)):
            s, logs = plain(rng, x.shape[:-1], look)
            likeliest, size_of = np.zeros((*x.shape[:-1], s.shape[-1])), np.zeros(())
            if not look.blind:
                found = look.proposal(x, y[:, None, None, :], np.zeros((1, s.shape[-1])), k)
                likeliest, size_of = found.mean[..., 0, :], _size(found.mean, found.root)[..., 0]
                s, logs = where_measured(y, look.draw_each(found, rng), s)
            heights.append(told(y[:, None, None, :], moved(j, x, likeliest, k - 1), k) + size_of)
            after = moved(j, x, s, k - 1)
            lost = ~np.logical_and.reduce(np.abs(after) < LARGEST, axis=-1)
            drawn.append((np.where(lost[..., None], x, after), np.where(lost, -np.inf, logs)))
        prior = np.take_along_axis(model.transition_of(x, k - 1), mode[..., None, None], axis=-2)[..., 0, :]
        return _of_chosen(rng, prior, heights, drawn, y)

    def step(state: State, y: Array) -> State:
        before, root, k = state.memory, state.memory.seed, state.step
        rng = stream(root, k)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            x, mode, logs = first(rng, y) if before.x is None else following(rng, before.x, before.mode, y, k)
            logs = logs + _by_mode(mode, [told(y[:, None, None, :], x, k) for told in likelihoods])
            weights, log_mean = normalised(logs)
            mean, cov = weighted(x, weights, angles)
        probability = np.stack([(weights * (mode == j)).sum(axis=-1).mean(axis=1) for j in range(count)], axis=-1)
        effective = (1 / (weights**2).sum(axis=-1)).sum(axis=1)
        chosen = systematic(weights.reshape(-1, size), rng).reshape(mode.shape)
        x, mode = np.take_along_axis(x, chosen[..., None], axis=2), np.take_along_axis(mode, chosen, axis=2)
        with np.errstate(over="ignore", invalid="ignore"):
            prior = np.take_along_axis(model.transition_of(x, k), mode[..., None, None], axis=-2)[..., 0, :]
            next_mode = _drawn(rng, prior)
            each = [moved(j, x, plain(rng, x.shape[:-1], look)[0], k) for j, look in enumerate(aheads)]
            ahead = _by_mode(next_mode, each).reshape(len(y), particles, model.n)
            predicted = weighted(ahead, np.full(ahead.shape[:-1], 1.0 / particles), angles)
        clouds = np.moveaxis(mean, 1, 0), effective, log_mean.T, root
        memory = JumpParticles(*clouds, x=x, mode=mode, probability=probability)
        return State(k + 1, of_both(mean, cov, angles), predicted, memory)

    return Filter(name, model.modes[0], init, step, slow=True, evidence=by_clouds)


def _size(mean: Array, root: Array) -> Array:
    """ln of N(s; 0, I) over the density of N(mean, root root^T), both at the mean: (..., J)."""
    return np.log(np.diagonal(root, axis1=-2, axis2=-1)).sum(axis=-1) - 0.5 * (mean**2).sum(axis=-1)


def _of_chosen(
    rng: np.random.Generator, prior: Array, heights: list[Array], drawn: list[tuple[Array, Array]], y: Array
) -> tuple[Array, Array, Array]:
    """Modes by `prior` (..., J) times the exponents of `heights`; what was drawn in each, and the logarithms of p / q."""
    missing = np.logical_and.reduce(np.isnan(y), axis=-1)[:, None, None, None]
    with np.errstate(divide="ignore"):
        logs = np.log(prior)
    seen, _ = normalised(logs + np.where(missing, 0.0, np.nan_to_num(np.stack(heights, axis=-1), nan=-np.inf, neginf=-np.inf)))
    share = (1 - UNSEEN) * np.where(missing, prior, seen) + UNSEEN * prior
    mode = _drawn(rng, share)
    with np.errstate(divide="ignore"):
        lifted = np.take_along_axis(logs - np.log(share), mode[..., None], axis=-1)[..., 0]
    x, of_noise = (_by_mode(mode, [one[at] for one in drawn]) for at in (0, 1))
    return x, mode, np.nan_to_num(lifted + of_noise, nan=-np.inf, neginf=-np.inf)  # no mode without a probability


def _by_mode(mode: Array, of_each: list[Array]) -> Array:
    """Of the arrays (..., n) or (...), one a mode, what belongs to each mode (...)."""
    found = np.array(of_each[0])
    for j, one in enumerate(of_each[1:], 1):
        here = mode == j
        found[here] = one[here]
    return found


def _drawn(rng: np.random.Generator, share: Array) -> Array:
    """A mode for each of the probabilities (..., J)."""
    return component(share, rng.random((*share.shape[:-1], 1)))[..., 0]
