r"""Filters for an object that changes its way of moving or of being measured: one normal law for
each mode.

The object is in one of M modes, each with its own model of the same state; the mode is a Markov
chain,

    pi_ij = P(mode j at k + 1 | mode i at k)

The exact filter would keep one normal law for each history of modes, M^k of them.  These filters
merge them once a step, a mixture into the normal law with its mean and covariance.  With mu_j the
probability of mode j after y_k, c_j before it:

    correct     z_j, p_j and the likelihood L_j = N(y_k; h_j, F_j) in each mode;
                mu_j = c_j L_j / sum_i c_i L_i
    combine     z = sum mu_j z_j,   p = sum mu_j (p_j + (z_j - z)(z_j - z)^T)
    chain       c_j = sum_i pi_ij mu_i,   mu_i|j = pi_ij mu_i / c_j

and then they differ by when they merge:

    `imm`               the laws of the modes that may lead to j, before a prediction: tau_j,
                        Theta_j of the mixture
    `logic_dynamic`     after it: the mixture of tau_j(z_i, p_i), Theta_j(z_i, p_i)
                        (логико-динамический АОФ)
    `gpb2`              after the next correction, J^2 laws in between (generalised pseudo-Bayes of
                        order 2)

The first two are the same for affine tau.  Blom and Bar-Shalom (1988); Bar-Shalom, Li, Kirubarajan
(2001), section 11.6; for the second Rudenko's logic-dynamic filters.

Transitions may depend on the state, pi_ij(x).  With the law N(z, p) of x_k in mode i, Bayes'
formula for the next mode gives

    nu_ij = M_N[pi_ij(x)]                                    how probable j is
    z_ij  = M_N[x pi_ij(x)] / nu_ij                          the law of x_k, given that j comes
    p_ij  = M_N[(x - z_ij)(x - z_ij)^T pi_ij(x)] / nu_ij     next: N weighted by pi_ij

which, taken for a normal law, takes the places of pi_ij and (z_i, p_i) before a prediction; for
affine a that is exact.  The
means are found by Gauss-Hermite quadrature over the components that pi_ij contains, which a jump of
pi_ij deceives by some per cent; the other components follow by regression on these.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from scipy.special import logsumexp

from kfcourse.angles import Components, near, on_circle
from kfcourse.errors import ModelError
from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.laws import (
    Array,
    Gaussian,
    Measurement,
    apply,
    correct,
    gain,
    log_density,
    square_root,
    transpose,
)
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.jumping import probabilities as sums_to_one
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.quadrature import product_rule
from kfcourse.symbolic.structure import Structure, expect_each

CERTAIN = 1e300  # in the place of the logarithm of an infinite density: infinities have no quotient
# points an axis, by the number of components in the formulas of pi: 32 err by 1e-9 deviations at
# most on J1-overload, 16 by 4e-5; of several axes together not more than some hundreds
ORDER = {1: 32, 2: 12, 3: 7}

Chain: TypeAlias = Array | Callable[[int], Array] | JumpModel
Predict: TypeAlias = Callable[[Array, Array], Gaussian]
# Step and laws in each mode to pi, (M, M) or (runs, M, M), and the laws that lead from i to j.
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
    kept : Remembered or None
        The measurements or estimates that a designed filter goes by (`jump_optimal`).
    """

    probability: Array
    expected: Array
    predicted: tuple[Gaussian, ...]
    kept: Any = None


def imm(
    structures: Sequence[Structure], transition: Chain, probabilities: Array | None = None
) -> Filter:
    """The IMM filter with one structure a mode.

    Parameters
    ----------
    structures : sequence of M Structure
        Models with the same state, measurement and prior.
    transition : ndarray (M, M), callable, or JumpModel
        pi, rows sum to 1; or the step k to the pi from k to k + 1; or the model that has it, which
        may depend on the state.
    probabilities : ndarray (M,), optional
        Of the modes before the first measurement; by default those of the JumpModel, else equal.

    Returns
    -------
    Filter
        `state.memory` is a `Modes`.  A missing measurement leaves laws and probabilities as
        predicted.

    Raises
    ------
    TypeError
        Models, or filters, in the place of the structures.
    ValueError
        Models that do not fit together, numbers that are no probabilities.
    ModelError
        Transitions that depend on more than three components of the state.
    """

    def merged(
        predict: Predict, laws: Sequence[Gaussian], weights: Array, angles: Components
    ) -> Gaussian:
        return predict(*mixture(laws, weights, angles))

    return _with_modes("imm", structures, transition, probabilities, merged)


def logic_dynamic(
    structures: Sequence[Structure], transition: Chain, probabilities: Array | None = None
) -> Filter:
    """The logic-dynamic AOF: as `imm`, but predictions are merged, not the laws before them.

    lambda_j = sum_i mu_i|j tau_j(z_i, p_i)
    Psi_j = sum_i mu_i|j [Theta_j(z_i, p_i) + (tau_j(z_i, p_i) - lambda_j)(...)^T]

    Arguments, result and errors as of `imm`.
    """

    def merged(
        predict: Predict, laws: Sequence[Gaussian], weights: Array, angles: Components
    ) -> Gaussian:
        return mixture([predict(*law) for law in laws], weights, angles)

    expect_each(structures, "logic_dynamic")
    name = f"aof-jump-{structures[0].name}"
    return _with_modes(name, structures, transition, probabilities, merged)


def gpb2(
    structures: Sequence[Structure], transition: Chain, probabilities: Array | None = None
) -> Filter:
    """The generalised pseudo-Bayes filter of order 2: pairs of modes (i_{k-1}, i_k) are corrected
    each, and merged afterwards.

    Weights mu_ij ~ mu_i pi_ij N(y; h_ij, F_ij) of M^2 laws; then those with the same j become one.
    A mode whose probability is too small for a number goes on from the estimate: corrected time and
    again as if it held, its own law would leave the numbers.

    Arguments, result and errors as of `imm`; the memory's `predicted` holds the laws of the pairs,
    i first.
    """
    return _with_modes("gpb2", structures, transition, probabilities, None)


def _with_modes(
    name: str,
    structures: Sequence[Structure],
    transition: Chain,
    probabilities: Array | None,
    merged: Callable[[Predict, Sequence[Gaussian], Array, Components], Gaussian] | None,
) -> Filter:
    """A filter that merges what may lead to each mode by `merged`, (the mode's tau, Theta; laws;
    weights) -> prediction, or, without it, pairs of modes after their correction."""
    links, first, model = _checked(name, structures, transition, probabilities)
    angles, size = model.angles.x, len(structures)
    copies = size if merged is None else 1  # before a measurement as if any mode had come before

    def init(runs: int) -> State:
        start, expected = initial_state(model)(runs), np.tile(first / copies, (runs, copies))
        memory = Modes(np.tile(first, (runs, 1)), expected, (start.predicted,) * copies * size)
        return start._replace(memory=memory)

    def step(state: State, y: Array) -> State:
        memory, now = state.memory, [structure.at(state.step) for structure in structures]
        laws, mu = corrected(memory, expectations(now, memory), y)
        if merged is None:
            laws, mu = _by_second(laws, mu.reshape(len(y), size, size), angles)
        pi, leading = links(state.step, laws)
        if merged is None:
            expected = (mu[:, :, None] * pi).reshape(len(y), -1)
            predicted = tuple(
                structure.predict(*law)
                for row in leading
                for structure, law in zip(now, row, strict=True)
            )
        else:
            expected, weights = onward(mu, pi)
            predicted = tuple(
                merged(structure.predict, [row[j] for row in leading], weights[:, :, j], angles)
                for j, structure in enumerate(now)
            )
        law, ahead = mixture(laws, mu, angles), mixture(predicted, expected, angles)
        return State(state.step + 1, law, ahead, Modes(mu, expected, predicted))

    def expecting(before: State) -> tuple[Array, list[Measurement]]:
        now = [structure.at(before.step) for structure in structures]
        return before.memory.expected, expectations(now, before.memory)

    def evidence(before: State, y: Array, after: State) -> Array:
        return modes_given(*expecting(before), y)[1]

    return Filter(name, model, init, step, evidence=evidence, mixture=expecting)


def _by_second(
    laws: Sequence[Gaussian], pairs: Array, angles: Components
) -> tuple[list[Gaussian], Array]:
    """One law for each mode, and its probability (runs, M), from those of pairs of modes (runs, M,
    M): what has the same second mode is merged."""
    size, mu, weights = pairs.shape[-1], pairs.sum(axis=1), _shares(pairs)
    of_modes = [mixture(laws[j::size], weights[:, :, j], angles) for j in range(size)]
    estimate = mixture(of_modes, mu, angles)
    return [
        Gaussian(
            np.where(mu[:, j, None] > 0, law.mean, estimate.mean),
            np.where(mu[:, j, None, None] > 0, law.cov, estimate.cov),
        )
        for j, law in enumerate(of_modes)
    ], mu


def expectations(now: Sequence[Structure], memory: Modes) -> list[Measurement]:
    """What is expected to be measured in each mode, or for each pair of modes in the second of
    them."""
    return [now[i % len(now)].measure(*law) for i, law in enumerate(memory.predicted)]


def corrected(
    memory: Modes, expected: Sequence[Measurement], y: Array
) -> tuple[list[Gaussian], Array]:
    """The laws corrected with y, and their probabilities (runs, ...)."""
    laws = [correct(*pair, y) for pair in zip(memory.predicted, expected, strict=True)]
    return laws, modes_given(memory.expected, expected, y)[0]


def onward(mu: Array, pi: Array) -> tuple[Array, Array]:
    """c_j = sum_i mu_i pi_ij, (runs, M), and the weights mu_i|j, (runs, M, M); pi (M, M) or (runs,
    M, M)."""
    joint = mu[:, :, None] * pi
    expected = joint.sum(axis=1)
    # a mode that cannot come next starts from the combined law; nothing uses it
    return expected, _shares(np.where(expected[:, None, :] > 0, joint, mu[:, :, None]))


def _shares(joint: Array) -> Array:
    """joint_ij / sum_i joint_ij, (runs, M, M); equal ones where that is nothing."""
    total = joint.sum(axis=1, keepdims=True)
    return np.divide(joint, total, out=np.full_like(joint, 1.0 / joint.shape[1]), where=total > 0)


def _checked(
    name: str, structures: Sequence[Structure], transition: Chain, probabilities: Array | None
) -> tuple[Links, Array, Model]:
    """The links, the first probabilities (M,), and the first model; errors if the parts do not
    fit."""
    expect_each(structures, name)
    size, first = len(structures), structures[0].model

    def form(model: Model) -> tuple[Any, ...]:
        return model.x, model.p, model.angles, [part.tolist() for part in model.prior]

    for structure in structures:
        if form(structure.model) != form(first):
            raise ValueError(
                f"all modes need the same state, measured components, angles and prior: {first} "
                f"and {structure.model} differ"
            )
    jumping = transition if isinstance(transition, JumpModel) else None
    if probabilities is None:
        probabilities = np.full(size, 1.0 / size) if jumping is None else jumping.first
    start = sums_to_one("probabilities", probabilities, (size,))
    if jumping is not None and jumping.by_state:
        return by_state(jumping), start, first
    given = transition.transition_at if isinstance(transition, JumpModel) else transition

    def links(k: int, laws: Sequence[Gaussian]) -> tuple[Array, list[list[Gaussian]]]:
        pi = sums_to_one("transition", given(k) if callable(given) else given, (size, size))
        return pi, [[law] * size for law in laws]

    links(0, [])  # what is no chain is refused here
    return links, start, first


def by_state(model: JumpModel) -> Links:
    """The function of the step and the laws in each mode that gives nu (runs, J, J), and the laws
    N(z_ij, p_ij), i first.

    ModelError for formulas of more than three components.
    """
    used = [i for i, component in enumerate(model.x) if model.chain.has(component)]
    if len(used) > max(ORDER):
        raise ModelError(
            f"transitions that depend on {len(used)} components are not integrated: that takes "
            f"too many points; let them depend "
            f"on at most {max(ORDER)}, or make one number of the state on which they depend a "
            f"component of its own"
        )
    nodes, weights = product_rule(ORDER[len(used)], len(used))

    def weighted(i: int, law: Gaussian, k: int) -> tuple[Array, list[Gaussian]]:
        """nu_ij (runs, J), and N(z_ij, p_ij) for each j."""
        mean, cov = law.mean, np.broadcast_to(law.cov, (*law.mean.shape, law.mean.shape[-1]))
        root = square_root(cov[..., used, :][..., used])
        # x = z + spread s, but for what s does not tell
        spread = gain(cov[..., used], cov[..., used, :][..., used]) @ root
        x = np.repeat(mean[:, None], len(nodes), axis=1)
        x[..., used] += nodes @ transpose(root)
        mass = weights[:, None] * model.transition_of(x, k)[..., i, :]
        nu, laws = mass.sum(axis=1), []
        # where j cannot come the law stays as it is
        mass = np.where(nu[:, None] > 0, mass, weights[:, None])
        for share in np.moveaxis(mass / mass.sum(axis=1, keepdims=True), -1, 0):
            centre = share @ nodes
            away = nodes - centre[:, None]
            excess = transpose(share[..., None] * away) @ away - np.eye(len(used))
            laws.append(
                Gaussian(mean + apply(spread, centre), cov + spread @ excess @ transpose(spread))
            )
        return nu, laws

    def links(k: int, laws: Sequence[Gaussian]) -> tuple[Array, list[list[Gaussian]]]:
        nu, leading = zip(*(weighted(i, law, k) for i, law in enumerate(laws)), strict=True)
        return np.stack(nu, axis=1), list(leading)

    return links


def modes_given(
    expected: Array, measurements: Sequence[Measurement], y: Array
) -> tuple[Array, Array]:
    """c_j L_j / sum over the modes, (runs, M), and ln of the sum; in logarithms, as likelihoods far
    from the truth are 0.

    Where y is known before with certainty the density is infinite, and its modes share the
    probability.
    """
    with np.errstate(divide="ignore"):  # a mode that is excluded stays so
        logs = np.log(expected) + np.stack(
            [log_density(measurement, y) for measurement in measurements], axis=-1
        )
    logs = np.minimum(logs, CERTAIN)
    total = logsumexp(logs, axis=1)
    return np.exp(logs - total[:, None]), np.where(total < CERTAIN, total, np.inf)


def mixture(laws: Sequence[Gaussian], weights: Array, angles: Components = ()) -> Gaussian:
    """Mean and covariance of a mixture of normal laws, weights (runs, M).

    m = sum w_j m_j,   P = sum w_j (P_j + (m_j - m)(m_j - m)^T)

    Of components that are angles the mean is near the most probable law's.
    """
    if all(law is laws[0] for law in laws):
        return laws[0]
    means = np.stack([law.mean for law in laws])
    if angles:
        means = near(
            means, np.take_along_axis(means, weights.argmax(axis=1)[None, :, None], axis=0), angles
        )
    mean, cov = np.einsum("rj,jri->ri", weights, means), np.zeros(())
    for weight, law, off in zip(weights.T[..., None, None], laws, means - mean, strict=True):
        cov = cov + weight * (law.cov + off[..., :, None] * off[..., None, :])
    return Gaussian(on_circle(mean, angles), cov)
