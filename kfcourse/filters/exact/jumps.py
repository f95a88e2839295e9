r"""The exact filter of a scalar model that jumps: one density of the state for each mode, and the modes' probabilities.

    p(x_k, i_k = j | y_0..k-1) = sum_i Integral pi_ij(x_{k-1}) p(x_{k-1}, i_{k-1} = i | y_0..k-1) p_j(x_k | x_{k-1}) dx_{k-1}
    p(x_k, i_k = j | y_0..k)   = C p_j(y_k | x_k) p(x_k, i_k = j | y_0..k-1)

Each density is held and made as `kfcourse.filters.exact` does, with the same error control.  A prediction in mode j is a sum of
kernels too, from the nodes of all modes i that may come before; the likelihood of mode j is that step's evidence.  Nothing is
merged: a history of modes is no more than a hump of a density.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kfcourse.errors import expect
from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.filters.densities import ScalarDensities, scalar_densities
from kfcourse.filters.exact.adaptive import check_scalar
from kfcourse.filters.exact.constants import TOLERABLE
from kfcourse.filters.exact.evidence import log_evidence
from kfcourse.filters.exact.kernels import Grid, Kernels, TooNarrow, Unresolved, of_prior
from kfcourse.filters.exact.pointmasses import ACCURACY, FINE, corrected
from kfcourse.filters.exact.prediction import predictions
from kfcourse.filters.multiple_models import mixture, onward
from kfcourse.laws import Array, Gaussian
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.reading import ModelError

ALIGNED = 4  # `Kernels` takes every second and fourth kernel of a sum: those of each mode begin at such a place
COUNTS = 1e-12  # probability of a mode whose error counts

Groups = list[tuple[Array, Kernels]]


class JumpMass(NamedTuple):
    """What the filter remembers.

    Attributes
    ----------
    probability, expected : ndarray (runs, J)
        Of the modes after the last measurement, and before the next one.
    fine : list of J dict
        Posterior of the state in each mode, by the number of the trajectory; none where the mode has no probability.
    groups : list of J lists
        Predictions in each mode: numbers of trajectories, and their kernels.
    error, sd : ndarray (runs,)
        Estimated error of the posterior mean, in posterior standard deviations, of all steps together; and these.
    """

    probability: Array
    expected: Array
    fine: list[dict[int, Grid]]
    groups: list[Groups]
    error: Array
    sd: Array

    def discretisation_error(self) -> Array:
        """Estimated error of the posterior means, (runs,), in the units of x."""
        return self.error * self.sd


def jump_pointmass(model: JumpModel, accuracy: float = ACCURACY) -> Filter:
    """The exact AOF of a scalar model that jumps, by point masses in each mode.

    Parameters
    ----------
    model : JumpModel
        One state that is no angle, one measurement; in every mode noises that enter linearly, and a meter with noise.
    accuracy : float
        As of `kfcourse.filters.pointmass`, for the density of each mode.

    Returns
    -------
    Filter
        "aof-exact"; `state.memory.probability` are the modes' exact posterior probabilities.

    Raises
    ------
    ModelError
        The model is another one.
    Unresolved
        When it runs: a density would need more nodes than the budget has.
    """
    expect(model, JumpModel, "jump_pointmass")
    for name, mode in zip(model.names, model.modes, strict=True):
        check_scalar(mode)
        if mode.angles.x:
            raise ModelError("the exact filter over modes holds no state that is an angle")
        if scalar_densities(mode).noiseless:
            raise ModelError(
                f"mode {name}: without noise in the meter {list(mode.meter_equation)} there is no likelihood density"
            )
    laws, prior, init = [scalar_densities(mode) for mode in model.modes], of_prior(model.prior), initial_state(model.modes[0])

    def start(runs: int) -> State:
        expected = np.tile(model.first, (runs, 1))
        groups: list[Groups] = []
        for j in range(len(laws)):
            rows = np.flatnonzero(expected[:, j] > 0)
            groups.append([(rows, prior.rows(np.zeros(len(rows), dtype=int)))] if len(rows) else [])
        return init(runs)._replace(memory=JumpMass(expected, expected, [], groups, np.zeros(runs), np.zeros(runs)))

    def step(state: State, y: Array) -> State:
        now = [law.at(state.step) for law in laws]
        try:
            try:
                return _step(state, y, now, model, accuracy, FINE[0])
            except TooNarrow:
                return _step(state, y, now, model, accuracy, FINE[1])
        except Unresolved as error:
            raise Unresolved(f"step {state.step} of {model}: {error}; leave the exact filter out (--slow-runs 0)") from None

    def evidence(before: State, y: Array, after: State) -> Array:
        now = [law.at(before.step) for law in laws]
        return _log_likelihoods(before.memory.expected, before.memory.groups, y, now, after.memory.fine)[1]

    return Filter("aof-exact", model.modes[0], start, step, slow=True, evidence=evidence)


def _step(state: State, y: Array, laws: Sequence[ScalarDensities], model: JumpModel, accuracy: float, nodes: int) -> State:
    memory: JumpMass = state.memory
    parts = [corrected(groups, y, law, accuracy, nodes) for groups, law in zip(memory.groups, laws, strict=True)]
    fine = [part.grids for part in parts]
    probability, _ = _log_likelihoods(memory.expected, memory.groups, y, laws, fine)
    counts = probability > COUNTS
    means, variances, errors = (
        np.where(counts, np.stack(columns, axis=1), 0.0) for columns in list(zip(*(part[1:4] for part in parts), strict=True))
    )
    posterior = mixture(
        [Gaussian(m[:, None], v[:, None, None]) for m, v in zip(means.T, variances.T, strict=True)],
        np.where(counts, probability, 0.0),
    )
    sd = np.sqrt(posterior.cov[:, 0, 0])
    # a mean errs by so many of its mode's standard deviations, the mode's probability by that part of itself
    moved = (probability * errors * (np.sqrt(variances) + np.abs(means - posterior.mean))).sum(axis=1)
    if model.by_state:
        pi, leading, doubt = _by_state(fine, model, state.step)
    else:
        pi, leading, doubt = model.transition_at(state.step), [fine] * len(laws), np.zeros(1)
    joint, (expected, _) = probability[:, :, None] * pi, onward(probability, pi)
    groups = [_prediction(leading[j], law, joint[:, :, j], expected[:, j]) for j, law in enumerate(laws)]
    predicted = np.zeros((2, len(laws), len(y)))
    for j, some in enumerate(groups):
        for rows, kernels in some:
            predicted[:, j, rows] = kernels.moments()
    ahead = mixture([Gaussian(m[:, None], v[:, None, None]) for m, v in zip(*predicted, strict=True)], expected)
    # a transition's probability that errs moves its mode's law, and weighs it wrongly against the others
    away = np.abs(predicted[0] - ahead.mean[:, 0]).max(axis=0) / np.sqrt(ahead.cov[:, 0, 0])
    return State(
        state.step + 1,
        posterior,
        ahead,
        JumpMass(
            probability, expected, fine, groups, memory.error + moved / sd + (1 + away) * (probability * doubt).sum(axis=1), sd
        ),
    )


def _by_state(fine: Sequence[dict[int, Grid]], model: JumpModel, k: int) -> tuple[Array, list[list[dict[int, Grid]]], Array]:
    """nu_ij = Integral pi_ij(x) p(x | i) dx, (runs, J, J); for each j the posteriors weighted by pi_ij; and the error of nu.

    It is what half the nodes change, (runs, J), where these are a rule of their own.
    """
    size, runs = len(fine), 1 + max(max(grids, default=0) for grids in fine)
    nu, doubt = np.zeros((runs, size, size)), np.zeros((runs, size))
    leading: list[list[dict[int, Grid]]] = [[{} for _ in fine] for _ in fine]
    for i, grids in enumerate(fine):
        if not grids:
            continue
        places, ends = list(grids), np.cumsum([len(grid.x) for grid in grids.values()])[:-1]
        probabilities = np.split(model.transition_of(np.concatenate([grid.x for grid in grids.values()])[:, None], k), ends)
        for place, grid, found in zip(places, grids.values(), probabilities, strict=True):
            weighted = grid.mass[:, None] * found[:, i]
            nu[place, i] = weighted.sum(axis=0)
            if grid.uniform:
                half = weighted[::2].sum(axis=0) / grid.mass[::2].sum()
                doubt[place, i] = np.abs(half - nu[place, i]).max()
            if doubt[place, i] > TOLERABLE:
                raise Unresolved("the transitions change too abruptly with the state for the nodes of a posterior")
            for j in np.flatnonzero(nu[place, i]).tolist():
                mass, density = weighted[:, j] / nu[place, i, j], grid.density * found[:, i, j] / nu[place, i, j]
                leading[j][i][place] = Grid(grid.x, mass, density, grid.uniform)
    return nu, leading, doubt


def _log_likelihoods(
    expected: Array, groups: Sequence[Groups], y: Array, laws: Sequence[ScalarDensities], fine: Sequence[dict[int, Grid]]
) -> tuple[Array, Array]:
    """Probabilities of the modes given y, (runs, J), and ln p(y | the past), (runs,)."""
    logs = np.full(expected.shape, -np.inf)
    for j, (some, law, grids) in enumerate(zip(groups, laws, fine, strict=True)):
        for rows, kernels in some:
            inside = [(np.arange(len(rows)), kernels)]
            found = log_evidence(inside, y[rows], law, [grids[i] for i in rows.tolist()])
            logs[rows, j] = np.log(expected[rows, j]) + found
    logs = np.where(np.isnan(logs), -np.inf, logs)
    peak = logs.max(axis=1, keepdims=True)
    weights = np.exp(logs - peak)
    total = weights.sum(axis=1, keepdims=True)
    return weights / total, (peak + np.log(total))[:, 0]


def _prediction(fine: Sequence[dict[int, Grid]], law: ScalarDensities, joint: Array, expected: Array) -> Groups:
    """The prediction in one mode: kernels from the posteriors of all modes, with weights joint (runs, J) / expected (runs,)."""
    sources: dict[int, list[tuple[float, Kernels, int]]] = {}
    for i, grids in enumerate(fine):
        places = [place for place in grids if joint[place, i] > 0]
        for rows, kernels in predictions([grids[place] for place in places], law):
            for number, row in enumerate(rows.tolist()):
                place = places[row]
                sources.setdefault(place, []).append((joint[place, i] / expected[place], kernels, number))
    alike: dict[tuple[object, ...], list[int]] = {}
    for place, parts in sources.items():
        rough = any(kernels.pushed is not None for _, kernels, _ in parts)
        sizes = tuple((kernels.mu.shape[1], bool(kernels.spectral[number])) for _, kernels, number in parts)
        alike.setdefault((place,) if rough else sizes, []).append(place)
    return [(np.array(places), _together([sources[place] for place in places])) for places in alike.values()]


def _together(parts: Sequence[Sequence[tuple[float, Kernels, int]]]) -> Kernels:
    """The kernels of trajectories, each with as many parts of the same sizes, as one sum each."""
    columns: list[list[Array]] = []
    heaviest = np.array([[weight for weight, _, _ in row] for row in parts]).argmax(axis=1)
    middles = []
    for part in range(len(parts[0])):
        weights, kernels, numbers = zip(*(row[part] for row in parts), strict=True)
        weight = np.array(weights)[:, None]
        mu, sigma, mass, even, centre, width, _ = (
            np.stack([one[which][number] for one, number in zip(kernels, numbers, strict=True)]) for which in range(7)
        )
        spare = -mu.shape[1] % ALIGNED if len(parts[0]) > 1 else 0
        places = [np.pad(one, ((0, 0), (0, spare)), "edge") for one in (mu, sigma)]
        columns.append([*places, *(np.pad(weight * one, ((0, 0), (0, spare))) for one in (mass, even))])
        middles.append((centre, width))
    mu, sigma, mass, even = (np.concatenate(arrays, axis=1) for arrays in zip(*columns, strict=True))
    centre, width = (
        np.take_along_axis(np.concatenate(one, axis=1), heaviest[:, None], axis=1) for one in zip(*middles, strict=True)
    )
    spectral = np.array([all(bool(kernels.spectral[number]) for _, kernels, number in row) for row in parts])
    found = Kernels(mu, sigma, mass, even, centre, width, spectral)
    if not any(kernels.pushed is not None for _, kernels, _ in parts[0]):
        return found

    def pushed(x: Array) -> Array:
        each = []
        for weight, kernels, number in parts[0]:
            one = kernels.rows(slice(number, number + 1))
            each.append(weight * one.density(x, one.mass, one.even))
        return np.sum(each, axis=0)

    return found._replace(pushed=pushed, pushed_bytes=sum(kernels.pushed_bytes for _, kernels, _ in parts[0]))
