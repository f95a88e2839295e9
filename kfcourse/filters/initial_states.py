r"""The exact filter of an object without noise: all that is unknown is where it started, and how the meter fares.

    x_k = phi_k(x_0),      p(x_0 | y_0..k) ∝ p(x_0) prod_i p(y_i | phi_i(x_0), y_0..i-1)

Particles that are moved and resampled die out here: no noise tells copies of one apart, and after some tens of sharp measurements
all of them are one initial state.  So initial states are drawn anew where too few of them count: from a mixture of Student's laws
laid over the weighted ones, each weighted by the whole record so far.  Nothing is resampled, and no draw depends on an earlier
one but through the law that it comes from: the estimates are those of importance sampling (adaptive: Cappe and others, 2004).

If the meter jumps between modes, while the object is the same in all of them, the modes are summed out: given x_0 they are a
chain with known probabilities, and Bayes' formula for it is a sum over modes (Rao-Blackwell: what is not drawn does not err),

    alpha_j ∝ c_j p_j(y_k | x_k),     p(y_k | x_k, y_0..k-1) = sum_j c_j p_j(y_k | x_k),     c'_j = sum_i alpha_i pi_ij

A meter that fails makes laws of several widths: a spike where it is sound within a hump where it is not.  So half of the laws
of a mixture are as wide as the whole, the others as the hump that each lies on, by a step of Gauss and Newton, in turn for each
mode of the last measurement: a spike on which no draw lies yet is found.  Draws are made anew, too, where a mode's meter is so
sharp that hardly any would lie within its error.

What is stated of the error is `WITHIN` times the root of V + d^2: on eleven models with spikes, a kink and several humps, of 200
trajectories each, it held at 99.4 to 100 % of the corrections (exact: plain grids, or all histories of modes).  V is the variance
of weighted means by their weights (the delta method), d half the distance of the two clouds, which know nothing of each other.
For a normal error 2.6 times would do; the rest is for V and d, which are themselves uncertain where few draws count, and for
small humps that both clouds have lost.  These are few trajectories in a thousand; no statistic of the draws tells of them, and a
bound is too high by what they err.  How often the intervals hold of filters within some per cent of this bound has not been
counted with these laws.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy

from kfcourse.angles import Components, difference, on_circle
from kfcourse.errors import expect
from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.filters.densities import likelihood
from kfcourse.filters.particles import FREEDOM, PRIOR, WIDER, weighted
from kfcourse.laws import Array, Gaussian, gain, square_root
from kfcourse.symbolic.equations import compile_noiseless
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.moments import NoClosedForm
from kfcourse.symbolic.reading import ModelError, exact_matrix
from kfcourse.symbolic.structure import Structure, linearised

FIRST = 32  # times as many are drawn of the prior at the first measurement, that a narrow hump far out is not missed
ENOUGH = 0.08  # part of the particles that must count; else they are drawn anew, and small humps may be lost
ROUNDS = 8  # at a step
FIT = 0.5  # part that must count for laws to be laid over them: weights are flattened until it does
CENTRES = 32  # Student's laws in the mixture, of each kind
NARROWER = 0.6  # those as wide as the whole are narrower than it, in standard deviations
ROWS = 8  # whose distances from all laws are found at a time: the numbers stay in the processor's cache
SEEN = 20  # particles that a mode's meter must find within its own error; else they are drawn anew
RIDGE = 1e-12  # of the curvature in all directions together, in each, so that it has a root
WITHIN = 5.0  # times the standard error is stated
FARTHEST = 1.0  # that a step to the top of a hump leads, in standard deviations of the prior


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


@dataclass(frozen=True, eq=False)
class Undisturbed(Clouds):
    """What the filter remembers; the others as of `kfcourse.filters.particles.Clouds`, but ln p(y_0, ..., y_k) as the evidence.

    Attributes
    ----------
    s, x : ndarray (runs, 2, M/2, n), or None before the first measurement
        Initial states of both clouds, in standard deviations of the prior, and where they have come to by the next measurement.
    logs : ndarray (runs, 2, M/2)
        Logarithms of their weights.
    modes : ndarray (J, runs, 2, M/2)
        Probabilities of the next mode, given the initial state.
    record : tuple of ndarray (runs, p)
        All measurements so far.
    probability : ndarray (runs, J)
        Of the modes after the last measurement.
    variance : ndarray (runs,)
        Of the estimate's error, by the weights.
    """

    s: Array | None
    x: Array | None
    logs: Array
    modes: Array
    record: tuple[Array, ...]
    probability: Array
    variance: Array

    def discretisation_error(self) -> Array:
        """What the error of the estimates stays below at 99 of 100 corrections, (runs,)."""
        return np.asarray(WITHIN * np.sqrt(self.variance + self.apart() ** 2))


def _tangents(modes: tuple[Model, ...]) -> list[Structure]:
    """The linearised functions of each mode; none if one has no slope."""
    try:
        return [linearised(one) for one in modes]
    except NoClosedForm:
        return []


def is_undisturbed(model: Model | JumpModel) -> bool:
    """Whether no noise enters the object, which is the same in all modes: `undisturbed` then finds the exact estimate."""
    modes = model.modes if isinstance(model, JumpModel) else (model,)
    first = modes[0].state_equation.subs(modes[0].values)
    return all(_without_noise(one) and one.state_equation.subs(one.values) == first for one in modes)


def _without_noise(model: Model) -> bool:
    B = model.state_equation.jacobian(model.v).subs(model.values)
    return bool((B * exact_matrix(model.state_noise.cov)).is_zero_matrix)


def undisturbed(model: Model | JumpModel, particles: int = 256, seed: int = 0, name: str = "particle") -> Filter:
    """The exact filter of an object without noise, by importance sampling of its initial state.

    Parameters
    ----------
    model : Model or JumpModel
        No noise enters the object, the same in all modes; the meters have densities.
    particles : int
        Initial states per trajectory, even, half of them in each cloud.
    seed : int or numpy.random.Generator
        The same state and measurement give the same result.
    name : str
        Of the filter: "aof-exact" where it stands for the exact one.

    Returns
    -------
    Filter
        Its covariance has no bias of the order 1 / particles: the mean of it is the bound.

    Raises
    ------
    ModelError
        A noise enters the object, or modes differ in it; a meter has no density.
    """
    expect(model, Model, "undisturbed", JumpModel)
    even(particles)
    if not is_undisturbed(model):
        raise ModelError(
            f"{model}: here the initial state must tell all that follows, without a noise in the object, and with one object in "
            "all modes; take particle(model)"
        )
    modes = model.modes if isinstance(model, JumpModel) else (model,)
    likelihoods, (move, _) = [likelihood(one) for one in modes], compile_noiseless(modes[0])
    meters, tangents = [compile_noiseless(one)[1] for one in modes], _tangents(modes)
    chain = model if isinstance(model, JumpModel) else None
    first_law = np.ones(1) if chain is None else chain.first
    prior, angles, number = model.prior, modes[0].angles.x, seed
    root, r, size = square_root(prior.cov), modes[0].n, particles // 2
    gaussian_init = initial_state(modes[0])

    def init(runs: int) -> State:
        state = gaussian_init(runs)
        start, nothing = at_start(state.posterior.mean, particles, number), np.zeros((runs, 2, size))
        probability = np.tile(first_law, (runs, 1))
        memory = Undisturbed(*start, None, None, nothing, nothing, (), probability, np.zeros(runs))
        return state._replace(memory=memory)

    def placed(s: Array) -> tuple[Array, Array]:
        """Initial states, and the probabilities of their first modes (J, ...)."""
        law = np.broadcast_to(first_law[:, None, None], (len(first_law), *s.shape[:-1]))
        return on_circle(prior.mean + s @ root.T, angles), law

    def onward(x: Array, c: Array, y: Array, k: int) -> tuple[Array, Array, Array, Array]:
        """ln p(y_k | x_k, y_0..k-1), alpha, the next states and the probabilities of their modes."""
        with np.errstate(divide="ignore"):
            logs = np.stack([np.log(one) + found(y, x, k) for one, found in zip(c, likelihoods, strict=True)])
        logs = np.where(np.isnan(logs), -np.inf, logs)
        peak = logs.max(axis=0)
        alpha = np.exp(logs - np.where(np.isfinite(peak), peak, 0.0))
        total = alpha.sum(axis=0)
        alpha = np.divide(alpha, total, out=np.array(c), where=total > 0)
        with np.errstate(divide="ignore"):
            told = np.where(total > 0, peak + np.log(total), -np.inf)
        if chain is None:
            ahead = alpha
        elif chain.by_state:
            ahead = np.einsum("i...,...ij->j...", alpha, chain.transition_of(x, k))
        else:
            ahead = np.tensordot(chain.transition_at(k).T, alpha, axes=1)
        return told, alpha, on_circle(np.broadcast_to(move(x, k), x.shape), angles), ahead

    def whole(s: Array, record: tuple[Array, ...]) -> tuple[Array, Array, Array, Array, Array]:
        """ln p(y_0..k | x_0), and x_k with alpha, x_{k+1} and the probabilities of its modes."""
        x, c = placed(s)
        total = np.zeros(s.shape[:-1])
        for k, y in enumerate(record):
            here = x
            told, alpha, x, c = onward(x, c, y, k)
            total = total + told
        return total, here, alpha, x, c

    def humps(s: Array, record: tuple[Array, ...]) -> tuple[Array, Array]:
        """For states s (rows, C, r) the tops of the humps that they lie on, and roots L of the curvature there, L L^T.

        One step of Gauss and Newton on ln p(x_0 | y_0..k), whose curvature is the modes' mean with the weights alpha.  The last
        mode is in turn each of all: a hump so narrow that nobody is on it has no weight yet.
        """
        if not tangents:
            return s, np.broadcast_to(np.eye(r), (*s.shape, r))
        x, c = placed(s)
        slope, curvature, gradient = np.broadcast_to(root, (*s.shape, r)), np.zeros((r, r)) + np.eye(r), -s[..., None]
        for k, y in enumerate(record):
            here = x
            _, alpha, x, c = onward(here, c, y, k)
            if k == len(record) - 1:
                alpha = np.eye(len(modes))[:, None, np.arange(s.shape[1]) % len(modes)]
            for share, tangent in zip(alpha, tangents, strict=True):
                h, G, _, R = tangent.at(k).measure(here, np.zeros((modes[0].n,) * 2))
                off, missing = difference(y, h, modes[0].angles.y), np.isnan(y)[..., None]
                J = np.where(missing, 0.0, G @ slope)
                R = np.broadcast_to(R, (*h.shape, h.shape[-1]))
                weighed = share[..., None, None] * gain(np.swapaxes(J, -1, -2), np.where(np.isfinite(R), R, 0.0), broken=True)
                curvature = curvature + weighed @ J
                gradient = gradient + weighed @ np.where(missing, 0.0, off[..., None])
            slope = tangents[0].at(k).transition(here, np.zeros((modes[0].n,) * 2)).A @ slope
        good = np.asarray(np.isfinite(curvature).all(axis=(-2, -1)) & np.isfinite(gradient).all(axis=(-2, -1)))[..., None, None]
        curvature = np.where(good, curvature, np.eye(r))
        curvature = curvature + RIDGE * np.trace(curvature, axis1=-2, axis2=-1)[..., None, None] * np.eye(r)
        shift = np.linalg.solve(curvature, np.where(good, gradient, 0.0))[..., 0]
        size = np.linalg.norm(shift, axis=-1, keepdims=True)
        return s + shift * np.minimum(1.0, FARTHEST / np.maximum(size, 1e-300)), np.linalg.cholesky(curvature)

    def unseen(here: Array, weights: Array, c: Array, k: int) -> Array:
        """Rows in which a mode's meter is so sharp that fewer than `SEEN` particles lie within its error anywhere."""
        middle = np.einsum("rm,rmi->ri", weights, here)
        found = np.zeros(len(here), dtype=bool)
        for share, meter, tangent in zip(c, meters, tangents, strict=bool(tangents)):
            _, spread = weighted(np.broadcast_to(meter(here, k), (*here.shape[:-1], modes[0].p)), weights, ())
            R = np.broadcast_to(tangent.at(k).measure(middle, np.zeros((modes[0].n,) * 2)).R, spread.shape)
            part = np.linalg.det(R) / np.linalg.det(R + spread)
            found |= (part * size**2 < SEEN**2) & (share > 0).any(axis=1)
        return found

    def step(state: State, y: Array) -> State:
        memory: Undisturbed = state.memory
        rng, runs, k = stream(memory.seed, state.step), len(y), state.step
        record = tuple(np.repeat(one, 2, axis=0)[:, None] for one in (*memory.record, y))  # each cloud is a row from here on
        if memory.s is None or memory.x is None:
            many = rng.standard_normal((2 * runs, FIRST * size, r))
            s, logs = _anew(many, onward(*placed(many), record[-1], k)[0], size, rng, partial(humps, record=record))
            here, c = placed(s)
        else:
            s, here, logs = (one.reshape(2 * runs, size, *one.shape[3:]) for one in (memory.s, memory.x, memory.logs))
            c = memory.modes.reshape(-1, 2 * runs, size)
        with np.errstate(over="ignore", invalid="ignore"):
            told, alpha, following, ahead = onward(here, c, record[-1], k)
            blind = unseen(here, normalised(logs)[0], c, k) if memory.s is not None else np.zeros(2 * runs, dtype=bool)
            logs = logs + told
            weights, log_mean = normalised(logs)
            for count in range(ROUNDS):
                poor = np.flatnonzero(((weights**2).sum(axis=1) * (ENOUGH * size) > 1) | (blind & (count == 0)))
                if not len(poor):
                    break
                # what is written in place is no earlier state's
                s, logs, here, following = (np.array(one) for one in (s, logs, here, following))
                alpha, ahead = np.array(alpha), np.array(ahead)
                so_far = tuple(one[poor] for one in record)
                s[poor], logs[poor] = _anew(s[poor], logs[poor], size, rng, partial(humps, record=so_far))
                found = whole(s[poor], so_far)
                logs[poor] += found[0]
                here[poor], alpha[:, poor], following[poor], ahead[:, poor] = found[1:]
                weights, log_mean = normalised(logs)
            # what has left the finite numbers has no weight, and must not make the mean NaN
            clouds, to_come = (
                Gaussian(*(one.reshape(runs, 2, *one.shape[1:]) for one in weighted(x, weights, angles)))
                for x in (np.where(np.isfinite(states), states, 0.0) for states in (here, following))
            )
        off = difference(np.where(np.isfinite(here), here, 0.0), clouds.mean.reshape(2 * runs, 1, -1), angles)
        variance = (weights**2 * (off**2).sum(axis=-1)).sum(axis=1).reshape(runs, 2).sum(axis=1) / 4
        probability = (alpha * weights).sum(axis=2).reshape(-1, runs, 2).mean(axis=2).T
        effective = (1 / (weights**2).sum(axis=1)).reshape(runs, 2).sum(axis=1)
        s, following, logs = (one.reshape(runs, 2, size, *one.shape[2:]) for one in (s, following, logs))
        modes_ahead, totals = ahead.reshape(-1, runs, 2, size), log_mean.reshape(runs, 2).T
        halves = np.moveaxis(clouds.mean, 1, 0)
        clouds_now = halves, effective, totals, memory.seed
        after = Undisturbed(*clouds_now, s, following, logs, modes_ahead, (*memory.record, y), probability, variance)
        # E cov = p - sum w^2 off off^T - (sum w^2 off off^T - p sum w^2); the clouds' distance tells the first of these sums
        squares, covs = weights**2, clouds.cov.reshape(2 * runs, *clouds.cov.shape[2:])
        bias = np.einsum("rm,rmi,rmj->rij", squares, off, off) - squares.sum(axis=1)[:, None, None] * covs
        posterior = of_both(*clouds, angles)
        posterior = posterior._replace(cov=posterior.cov + bias.reshape(clouds.cov.shape).mean(axis=1))
        return State(k + 1, posterior, of_both(*to_come, angles), after)

    def evidence(before: State, y: Array, after: State) -> Array:
        return np.logaddexp(*after.memory.evidence) - np.logaddexp(*before.memory.evidence)

    return Filter(name, modes[0], init, step, slow=True, evidence=evidence)


def _anew(
    s: Array, logs: Array, size: int, rng: np.random.Generator, humps: Callable[[Array], tuple[Array, Array]]
) -> tuple[Array, Array]:
    """Initial states (rows, size, r) drawn from a mixture laid over the weighted ones, and ln N(s; 0, I) - ln of its density.

    Half of its parts are as wide as what lies there together, the others as the humps that they lie on.  A part is drawn from
    the prior, for what the mixture does not see.
    """
    rows, many, r = s.shape
    weights = _flattened(logs)
    mean, cov = weighted(s, weights, ())
    scale = np.sqrt(np.diagonal(cov, axis1=1, axis2=2)) + 1e-300
    correlation = cov / (scale[:, :, None] * scale[:, None, :]) + 1e-9 * np.eye(r)
    root = WIDER * NARROWER * scale[:, :, None] * np.linalg.cholesky(correlation)
    fine = systematic(weights, rng)[:, rng.permutation(many)[: 2 * CENTRES]]
    chosen = np.take_along_axis(s, fine[..., None], axis=1)
    half = chosen.shape[1] // 2
    # so that the whole is as wide as they were
    around = mean[:, None] + np.sqrt(1 - NARROWER**2) * (chosen[:, :half] - mean[:, None])
    tops, curvature = humps(chosen[:, half:])
    narrow = WIDER * np.linalg.inv(curvature).swapaxes(-1, -2)
    centres = np.concatenate([around, tops], axis=1)
    roots = np.concatenate([np.broadcast_to(root[:, None], (*around.shape, r)), narrow], axis=1)
    parts = np.arange(size) % centres.shape[1]
    normal = rng.standard_normal((rows, size, r))
    student = normal * np.sqrt(FREEDOM / rng.chisquare(FREEDOM, (rows, size)))[..., None]
    drawn = centres[:, parts] + (roots[:, parts] @ student[..., None])[..., 0]
    s = np.where((rng.random((rows, size)) < PRIOR)[..., None], normal, drawn)
    blocks = (slice(first, first + ROWS) for first in range(0, rows, ROWS))
    mixture = np.concatenate([_log_mixture(s[here], centres[here], roots[here]) for here in blocks])
    prior = -0.5 * (s**2).sum(axis=-1) - 0.5 * r * np.log(2 * np.pi)
    return s, prior - np.logaddexp(np.log(1 - PRIOR) + mixture, np.log(PRIOR) + prior)


def _log_mixture(s: Array, centres: Array, roots: Array) -> Array:
    """ln of the density at s (rows, size, r) of Student's laws, all as probable, of widths with roots (rows, laws, r, r)."""
    r = s.shape[-1]
    apart = np.linalg.inv(roots) @ (s.swapaxes(-1, -2)[:, None] - centres[..., None])  # (rows, laws, r, size)
    kernels = -0.5 * (FREEDOM + r) * np.log1p((apart**2).sum(axis=2) / FREEDOM)
    kernels -= np.log(np.abs(np.linalg.det(roots)))[..., None]
    constant = scipy.special.gammaln((FREEDOM + r) / 2) - scipy.special.gammaln(FREEDOM / 2) - 0.5 * r * np.log(FREEDOM * np.pi)
    return normalised(kernels.swapaxes(1, 2))[1] + constant


def _flattened(logs: Array) -> Array:
    """Weights to a power, at most 1, with which `FIT` of them count."""
    low, high = np.zeros(len(logs)), np.ones(len(logs))
    logs = np.where(np.isfinite(logs), logs, -np.inf) - logs.max(axis=1, keepdims=True)
    logs = np.where(np.isnan(logs), 0.0, logs)
    for _ in range(20):
        power = 0.5 * (low + high)
        weights = np.exp(power[:, None] * logs)
        enough = np.einsum("rm,rm->r", weights, weights) * (FIT * logs.shape[1]) <= weights.sum(axis=1) ** 2
        low, high = np.where(enough, power, low), np.where(enough, high, power)
    return normalised(np.where(np.isneginf(logs), -np.inf, low[:, None] * logs))[0]
