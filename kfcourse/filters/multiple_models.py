r"""Filters for an object that changes its way of moving or of being measured: one normal law for each mode.

The object is in one of M modes, each with its own model of the same state; the mode is a Markov chain,

    pi_ij = P(mode j at k + 1 | mode i at k)

The exact filter would keep one normal law for each history of modes, M^k of them.  These filters merge them once a step, a
mixture into the normal law with its mean and covariance.  With mu_j the probability of mode j after y_k, c_j before it:

    correct     z_j, p_j and the likelihood L_j = N(y_k; h_j, F_j) in each mode;   mu_j = c_j L_j / sum_i c_i L_i
    combine     z = sum mu_j z_j,   p = sum mu_j (p_j + (z_j - z)(z_j - z)^T)
    chain       c_j = sum_i pi_ij mu_i,   mu_i|j = pi_ij mu_i / c_j

and then they differ by when they merge:

    `imm`               the laws of the modes that may lead to j, before a prediction: tau_j, Theta_j of the mixture
    `logic_dynamic`     after it: the mixture of tau_j(z_i, p_i), Theta_j(z_i, p_i)     (логико-динамический АОФ)
    `gpb2`              after the next correction, J^2 laws in between (generalised pseudo-Bayes of order 2)

The first two are the same for affine tau.  Blom and Bar-Shalom (1988); Bar-Shalom, Li, Kirubarajan (2001), section 11.6; for
the second Rudenko's logic-dynamic filters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple, TypeAlias

import numpy as np

from kfcourse.angles import Components, near, on_circle
from kfcourse.filters.base import Evidence, Filter, State, initial_state
from kfcourse.filters.state_transitions import by_state
from kfcourse.laws import Array, Gaussian, Measurement, correct, log_density
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.structure import Structure, each_once, expect_each, moving_alike

Chain: TypeAlias = Array | Callable[[int], Array] | JumpModel
Predict: TypeAlias = Callable[[Gaussian], Gaussian]
Links: TypeAlias = Callable[[int, Sequence[Gaussian]], tuple[Array, list[list[Gaussian]]]]


class Modes(NamedTuple):
    """What a filter of several models remembers.

    Attributes
    ----------
    probability : ndarray (runs, M)
        mu, probabilities of the modes after the last measurement.
    expected : ndarray (runs, M)
        c, probabilities before the next one.
    predicted : tuple of M Gaussian
        Law of the next state in each mode: mean (runs, n), cov (..., n, n).
    """

    probability: Array
    expected: Array
    predicted: tuple[Gaussian, ...]


def imm(structures: Sequence[Structure], transition: Chain, probabilities: Array | None = None, name: str = "imm") -> Filter:
    """The IMM filter with one structure a mode.

    Parameters
    ----------
    structures : sequence of M Structure
        Models with the same state, measurement and prior.
    transition : ndarray (M, M), callable, or JumpModel
        pi, rows sum to 1; or the step k to the pi from k to k + 1; or the model that has it, which may depend on the state
        (`state_transitions`).
    probabilities : ndarray (M,), optional
        Of the modes before the first measurement; by default those of the JumpModel, else equal.
    name : str
        Name of the filter.

    Returns
    -------
    Filter
        `state.memory` is a `Modes`.  A missing measurement leaves laws and probabilities as predicted.

    Raises
    ------
    TypeError
        Models, or filters, in the place of the structures.
    ValueError
        Models that do not fit together, numbers that are no probabilities, or too abrupt functions of the state.
    """
    expect_each(structures, name)
    angles = structures[0].model.angles.x if structures else ()

    def following(predict: Predict, laws: Sequence[Gaussian], weights: Array) -> Gaussian:
        return predict(mixture(laws, weights, angles))

    return _one_law_a_mode(name, structures, transition, probabilities, following)


def logic_dynamic(
    structures: Sequence[Structure], transition: Chain, probabilities: Array | None = None, name: str | None = None
) -> Filter:
    """The logic-dynamic AOF: as `imm`, but predictions are merged, not the laws before them.

    lambda_j = sum_i mu_i|j tau_j(z_i, p_i)
    Psi_j = sum_i mu_i|j [Theta_j(z_i, p_i) + (tau_j(z_i, p_i) - lambda_j)(...)^T]

    Arguments, result and errors as of `imm`.
    """
    expect_each(structures, "logic_dynamic")
    angles = structures[0].model.angles.x if structures else ()

    def following(predict: Predict, laws: Sequence[Gaussian], weights: Array) -> Gaussian:
        return mixture([predict(law) for law in laws], weights, angles)

    given = name or (f"aof-jump-{structures[0].name}" if structures else "")
    return _one_law_a_mode(given, structures, transition, probabilities, following)


def _one_law_a_mode(
    name: str,
    structures: Sequence[Structure],
    transition: Chain,
    probabilities: Array | None,
    following: Callable[[Predict, Sequence[Gaussian], Array], Gaussian],
) -> Filter:
    """A filter that merges what may lead to each mode by `following`: (the mode's tau, Theta; laws; weights) -> prediction."""
    models = [structure.model for structure in structures]
    angles = models[0].angles.x if models else ()
    links, first = _checked(structures, transition, probabilities)
    alike = moving_alike(structures)

    def init(runs: int) -> State:
        start = initial_state(models[0])(runs)
        expected = np.tile(first, (runs, 1))
        return start._replace(memory=Modes(expected, expected, (start.predicted,) * len(models)))

    def step(state: State, y: Array) -> State:
        memory: Modes = state.memory
        now = [structure.at(state.step) for structure in structures]
        expectations = _expectations(now, memory)
        corrected = [correct(prior, one, y) for prior, one in zip(memory.predicted, expectations, strict=True)]
        mu, _ = modes_given(memory.expected, expectations, y)
        pi, leading = links(state.step, corrected)
        expected, weights = onward(mu, pi)
        predict, predicted = each_once(now, alike), list[Gaussian]()
        drawn_anew = pi.ndim == 2 and bool((pi == pi[0]).all())  # then nothing that leads to a mode tells it from another
        for j, first_alike in enumerate(alike):
            if drawn_anew and first_alike < j:
                predicted.append(predicted[first_alike])
            else:
                predicted.append(following(partial(predict, j), [row[j] for row in leading], weights[:, :, j]))
        return State(
            state.step + 1,
            mixture(corrected, mu, angles),
            mixture(predicted, expected, angles),
            Modes(mu, expected, tuple(predicted)),
        )

    return Filter(name, models[0], init, step, evidence=_evidence(structures))


def _expectations(now: Sequence[Structure], memory: Modes) -> list[Measurement]:
    """What is expected to be measured in each mode, or for each pair of modes in the second of them."""
    return [now[i % len(now)].measure(*law) for i, law in enumerate(memory.predicted)]


def _evidence(structures: Sequence[Structure]) -> Evidence:
    def evidence(before: State, y: Array, after: State) -> Array:
        now = [structure.at(before.step) for structure in structures]
        return modes_given(before.memory.expected, _expectations(now, before.memory), y)[1]

    return evidence


def gpb2(structures: Sequence[Structure], transition: Chain, probabilities: Array | None = None, name: str = "gpb2") -> Filter:
    """The generalised pseudo-Bayes filter of order 2: pairs of modes (i_{k-1}, i_k) are corrected each, and merged afterwards.

    Weights mu_ij ~ mu_i pi_ij N(y; h_ij, F_ij) of M^2 laws; then those with the same j become one.  A mode whose probability is
    too small for a number goes on from the estimate: corrected time and again as if it held, its own law would leave the numbers.

    Arguments, result and errors as of `imm`; the memory's `predicted` holds the laws of the pairs, i first.
    """
    expect_each(structures, name)
    models = [structure.model for structure in structures]
    angles, size = models[0].angles.x if models else (), len(models)
    links, first = _checked(structures, transition, probabilities)
    alike = moving_alike(structures)

    def init(runs: int) -> State:
        start = initial_state(models[0])(runs)
        weights = np.tile(first / size, (runs, size))  # as if any mode had come before, the same law of each
        return start._replace(memory=Modes(np.tile(first, (runs, 1)), weights, (start.predicted,) * size**2))

    def step(state: State, y: Array) -> State:
        memory: Modes = state.memory
        now = [structure.at(state.step) for structure in structures]
        expectations = _expectations(now, memory)
        corrected = [correct(prior, one, y) for prior, one in zip(memory.predicted, expectations, strict=True)]
        pairs = modes_given(memory.expected, expectations, y)[0].reshape(len(y), size, size)
        mu = pairs.sum(axis=1)
        weights = _shares(pairs)
        laws = [mixture(corrected[j::size], weights[:, :, j], angles) for j in range(size)]
        combined = mixture(laws, mu, angles)
        laws = [_of_somebody(law, mu[:, j], combined) for j, law in enumerate(laws)]
        pi, leading = links(state.step, laws)
        predict = each_once(now, alike)
        predicted = [predict(j, law) for row in leading for j, law in enumerate(row)]
        expected = (mu[:, :, None] * pi).reshape(len(y), -1)
        return State(state.step + 1, combined, mixture(predicted, expected, angles), Modes(mu, expected, tuple(predicted)))

    return Filter(name, models[0], init, step, evidence=_evidence(structures))


def _of_somebody(law: Gaussian, probability: Array, combined: Gaussian) -> Gaussian:
    """The law of a mode; where it has no probability the combined one."""
    nobody = probability == 0
    if not nobody.any():
        return law
    nobody = nobody[:, None]
    return Gaussian(np.where(nobody, combined.mean, law.mean), np.where(nobody[..., None], combined.cov, law.cov))


def onward(mu: Array, pi: Array) -> tuple[Array, Array]:
    """c_j = sum_i mu_i pi_ij, (runs, M), and the weights mu_i|j, (runs, M, M); pi (M, M) or (runs, M, M)."""
    joint = mu[:, :, None] * pi
    expected = joint.sum(axis=1)
    if not np.minimum.reduce(expected, axis=None) > 0:
        # a mode that cannot come next starts from the combined law; nothing uses it
        joint = np.where(expected[:, None, :] > 0, joint, mu[:, :, None])
    return expected, _shares(joint)


def _shares(joint: Array) -> Array:
    """joint_ij / sum_i joint_ij, (runs, M, M); equal ones where that is nothing."""
    total = joint.sum(axis=1, keepdims=True)
    if np.minimum.reduce(total, axis=None) > 0:
        return joint / total
    return np.divide(joint, total, out=np.full_like(joint, 1.0 / joint.shape[1]), where=total > 0)


def _checked(structures: Sequence[Structure], transition: Chain, probabilities: Array | None) -> tuple[Links, Array]:
    """Step and laws to pi and what leads from i to j; and first probabilities (M,); ValueError if the parts do not fit."""
    size = len(structures)
    if not size:
        raise ValueError("give at least one structure, such as linearised(model)")
    first = structures[0].model
    for structure in structures[1:]:
        model = structure.model
        if [s.name for s in model.x] != [s.name for s in first.x] or model.p != first.p:
            raise ValueError(
                f"all modes need the same state and measurement: {[s.name for s in first.x]} with {first.p} component(s) "
                f"and {[s.name for s in model.x]} with {model.p} differ"
            )
        if model.angles != first.angles:
            raise ValueError("all modes need the same components declared as angles")
        if not all(np.array_equal(ours, theirs) for ours, theirs in zip(model.prior, first.prior, strict=True)):
            raise ValueError("all modes need the same prior: before the first measurement there is one law of the state")
    of_step = transition.transition_at if isinstance(transition, JumpModel) else transition
    if probabilities is None:
        probabilities = transition.first if isinstance(transition, JumpModel) else np.full(size, 1.0 / size)
    start = _probabilities("probabilities", probabilities, (size,))
    if isinstance(transition, JumpModel) and transition.by_state:
        return by_state(transition), start

    def pi_at(k: int) -> Array:
        return _probabilities("transition", of_step(k) if callable(of_step) else of_step, (size, size))

    constant = pi_at(0)

    def links(k: int, laws: Sequence[Gaussian]) -> tuple[Array, list[list[Gaussian]]]:
        return pi_at(k) if callable(of_step) else constant, [[law] * size for law in laws]

    return links, start


def _probabilities(what: str, given: Array, shape: tuple[int, ...]) -> Array:
    """The probabilities, whose rows sum to 1; ValueError if they are none."""
    table = np.asarray(given, dtype=float)
    if table.shape != shape:
        raise ValueError(f"{what} must have the shape {shape} for {shape[0]} mode(s), got {table.shape}")
    total = table.sum(axis=-1, keepdims=True)
    if not (np.isfinite(table).all() and table.min() >= 0 and np.allclose(total, 1.0, atol=1e-9)):
        raise ValueError(f"{what} must be probabilities that sum to 1{' in each row' * (table.ndim - 1)}, got {table.tolist()}")
    return table / total


def modes_given(expected: Array, measurements: Sequence[Measurement], y: Array) -> tuple[Array, Array]:
    """c_j L_j / sum over the modes, (runs, M), and ln of the sum; in logarithms, as likelihoods far from the truth are 0.

    In memory the trajectories of a mode are neighbours, which all that follows inherits: sums over few modes are then fast.
    """
    with np.errstate(divide="ignore"):  # a mode that is excluded stays so
        logs = np.stack([np.log(expected[:, j]) + log_density(one, y) for j, one in enumerate(measurements)])
    peak = logs.max(axis=0)
    weights = np.exp(logs - peak)
    total = weights.sum(axis=0)
    return (weights / total).T, peak + np.log(total)


def mixture(laws: Sequence[Gaussian], weights: Array, angles: Components = ()) -> Gaussian:
    """Mean and covariance of a mixture of normal laws, weights (runs, M).

    m = sum w_j m_j,   P = sum w_j (P_j + (m_j - m)(m_j - m)^T)

    Of components that are angles the mean is near the most probable law's.
    """
    if all(law is laws[0] for law in laws):
        return laws[0]
    columns = [weights[:, j, None] for j in range(len(laws))]
    means = [law.mean for law in laws]
    if angles:
        likeliest = np.take_along_axis(np.stack(means, axis=1), weights.argmax(axis=1)[:, None, None], axis=1)[:, 0]
        means = [near(one, likeliest, angles) for one in means]
    mean = sum(w * one for w, one in zip(columns, means, strict=True))
    cov: Array | float = 0.0
    for w, one, law in zip(columns, means, laws, strict=True):
        deviation = one - mean
        cov = cov + w[..., None] * (law.cov + deviation[..., :, None] * deviation[..., None, :])
    return Gaussian(on_circle(np.asarray(mean), angles), np.asarray(cov))
