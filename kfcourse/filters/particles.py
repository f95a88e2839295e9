"""The bootstrap particle filter: the Stratonovich equation by sampling, for models of any dimension.

A cross-check of the exact filter where that does not reach.  Its weakness is the lab's own case: where
the meter is hundreds of times sharper than the prediction, few particles fall where the posterior is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kfcourse.angles import Components, difference, moments_on_circle, on_circle
from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.filters.densities import likelihood
from kfcourse.laws import Array, Gaussian, square_root
from kfcourse.seeds import Seed, seed_number
from kfcourse.symbolic.equations import compile_model
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError


class Particles(NamedTuple):
    """Predicted particles (runs, M, n), the effective number (runs,) at the last correction, and the seed."""

    x: Array
    effective: Array
    seed: np.random.SeedSequence


def particle(model: Model, particles: int = 1000, seed: Seed = 0) -> Filter:
    """The bootstrap particle filter (Gordon, Salmond and Smith), resampled systematically at each step.

    Parameters
    ----------
    model : Model
        Any dimension; the meter's noise must enter linearly, so that p(y | x) is known.
    particles : int
        Particles per trajectory; `state.memory.effective` tells how many of them count.
    seed : int or numpy.random.Generator
        Steps are reproducible: the same state and measurement give the same result.
    """
    if particles < 2:
        raise ModelError(f"a particle filter needs at least 2 particles, got {particles}")
    number, log_likelihood = seed_number(seed), likelihood(model)
    state_equation, _ = compile_model(model)
    gaussian_init = initial_state(model)

    def sample(rng: np.random.Generator, law: Gaussian, runs: int) -> Array:
        standard = rng.standard_normal((runs, particles, len(law.mean)))
        return law.mean + standard @ square_root(law.cov).T

    def init(runs: int) -> State:
        root = np.random.SeedSequence([number, runs])
        x = sample(_stream(root, 0), model.prior, runs)
        return gaussian_init(runs)._replace(memory=Particles(x, np.full(runs, float(particles)), root))

    def step(state: State, y: Array) -> State:
        x, _, root = state.memory
        rng = _stream(root, state.step + 1)
        logs = log_likelihood(y[:, None, :], x, state.step)
        peak = logs.max(axis=1, keepdims=True)
        weights = np.exp(logs - np.where(np.isfinite(peak), peak, 0.0))
        total = weights.sum(axis=1, keepdims=True)
        weights = np.where(total > 0, weights / np.where(total > 0, total, 1.0), 1.0 / particles)
        posterior = _weighted(x, weights, model.angles.x)
        chosen = np.take_along_axis(x, _systematic(weights, rng)[..., None], axis=1)
        noise = sample(rng, model.state_noise, len(x))
        following = on_circle(np.broadcast_to(state_equation(chosen, noise, state.step), x.shape), model.angles.x)
        predicted = _weighted(following, np.full(weights.shape, 1.0 / particles), model.angles.x)
        return State(state.step + 1, posterior, predicted, Particles(following, 1 / (weights**2).sum(axis=1), root))

    return Filter("particle", model, init, step, slow=True)


def _stream(root: np.random.SeedSequence, step: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(root.entropy, spawn_key=(step,)))


def _weighted(x: Array, weights: Array, angles: Components) -> Gaussian:
    """Mean (runs, n) and covariance (runs, n, n) of weighted particles."""
    mean = np.einsum("rm,rmi->ri", weights, x)
    for i in angles:
        mean[:, i], _ = moments_on_circle(x[..., i], weights)
    deviation = difference(x, mean[:, None, :], angles)
    return Gaussian(mean, np.einsum("rm,rmi,rmj->rij", weights, deviation, deviation))


def _systematic(weights: Array, rng: np.random.Generator) -> Array:
    """Indices (runs, M) of systematic resampling: one uniform number a trajectory, M equal steps."""
    runs, m = weights.shape
    cumulative = np.cumsum(weights, axis=1)
    cumulative /= cumulative[:, -1:]
    wanted = (np.arange(m) + rng.random((runs, 1))) / m
    shift = 2.0 * np.arange(runs)[:, None]
    flat = np.searchsorted((cumulative + shift).ravel(), (wanted + shift).ravel()).reshape(runs, m)
    return np.minimum(flat - np.arange(runs)[:, None] * m, m - 1)
