"""The exact filter by point masses: a step, the ways it may take, and the error that is carried from step to step."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from kfcourse.angles import moments_on_circle
from kfcourse.errors import expect
from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.filters.densities import ScalarDensities, is_nonlinear, scalar_densities
from kfcourse.filters.exact.adaptive import TENTH, check_scalar, on_panels
from kfcourse.filters.exact.batch import Place, Posteriors, posteriors
from kfcourse.filters.exact.constants import ELEMENTS, MORE, NODES, SPACINGS, TOLERABLE
from kfcourse.filters.exact.evidence import log_evidence
from kfcourse.filters.exact.kernels import Grid, Kernels, TooNarrow, Unresolved, apart, chunks, of_prior
from kfcourse.filters.exact.places import Candidates, hidden, likeliest, looked, of_kernels, spaced
from kfcourse.filters.exact.prediction import predictions
from kfcourse.filters.exact.roots import at_roots
from kfcourse.filters.exact.smoothing import smoothed
from kfcourse.filters.exact.usual import Packed, UsualWay, compiled_usual_way
from kfcourse.laws import Array, Gaussian
from kfcourse.symbolic.compiled import is_scalar
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError

# Of the mean and the deviation at a step, in posterior standard deviations: their square, 1e-6 of the bound, is far below what
# any number of trajectories tells.
ACCURACY = 1e-3
FINE = (129, 257)  # nodes of a posterior that must be interpolated: the second if the first are too few to share its mass
TRIED = 65  # nodes of a posterior after one that needed panels
MEMORY = 2**28  # bytes of predictions
REMADE = 128  # trajectories whose predictions are made again at once


class PointMass(NamedTuple):
    """What the filter remembers.

    Attributes
    ----------
    fine : sequence of Grid
        The posterior of each trajectory.
    error : ndarray (runs,)
        Estimated error of mean and deviation, in posterior standard deviations: that of this step and of all before it, as if
        the filter never forgot one.
    variance : ndarray (runs,)
        Of the posteriors.
    adaptive : ndarray (runs,)
        Whether this step was left to the adaptive filter.
    groups : list of (ndarray, Kernels)
        The predictions: numbers of trajectories, and their kernels.
    later : ndarray of int
        Trajectories whose predictions are made again in the next step, as there is no room for them.
    """

    fine: Sequence[Grid]
    error: Array
    variance: Array
    adaptive: Array
    groups: list[tuple[Array, Kernels]]
    later: Array

    def predictions(self, law: ScalarDensities) -> Iterator[tuple[Array, Kernels]]:
        """Those of all trajectories, as `groups`; with the law of the step that was made."""
        yield from self.groups
        for chunk in chunks(len(self.later), 1, REMADE):
            rows = self.later[chunk]
            for some, kernels in predictions([self.fine[i] for i in rows.tolist()], law):
                yield rows[some], kernels

    def bytes(self) -> int:
        """That the predictions hold."""
        return sum(kernels.bytes() for _, kernels in self.groups)

    def without_predictions(self) -> PointMass:
        """The same, all predictions to be made again."""
        return self._replace(groups=[], later=np.arange(len(self.fine)))

    def evidence_error(self) -> Array:
        """Estimated error of the last ln p(y_k | y_0, ..., y_{k-1}), (runs,): the total's relative error is part of `error`."""
        return self.error

    def discretisation_error(self) -> Array:
        """Estimated error of the posterior means, (runs,), in the units of x."""
        return self.error * np.sqrt(self.variance)


def pointmass(model: Model, accuracy: float = ACCURACY, memory: float = MEMORY) -> Filter:
    """The exact AOF of a scalar model by point masses.

    Parameters
    ----------
    model : Model
        One state, one measurement, noises entering linearly (with any functions of x as factors); the meter's may be solved
        for (`inverted`), or be nothing.  The object may jump, at thresholds farther apart than a posterior's nodes.
    accuracy : float
        Largest estimated error of a step, in posterior standard deviations; a step with a larger one is left to the
        adaptive filter.
    memory : float
        Bytes that predictions may take from one step to the next, and those of all steps for who looks back; further ones are
        made twice, a chunk of some 50 MB at a time.  A posterior is some kB, 10 MB at most, and not counted.

    Raises
    ------
    ModelError
        The model is not scalar, the meter jumps, or a noise enters nonlinearly and cannot be solved for.
    Unresolved
        When it runs: a step would need more nodes than the budget has.

    Notes
    -----
    Nodes overlap where a density has 1e-10 of its height and end where it has 1e-14, which no trajectory of the model notices.
    A record that contradicts the model, so that later measurements put a state more than some six deviations from where it was
    thought to be, needs what has been cut off: the filter is wrong then and does not tell.  `smoothing_error` does, or refuses.
    """
    expect(model, Model, "pointmass")
    check_scalar(model)
    if not 0 < accuracy < 1:
        raise ModelError(f"the point-mass filter needs 0 < accuracy < 1, got {accuracy}")
    densities, init, prior = scalar_densities(model), initial_state(model), of_prior(model.prior)

    def before(state: State, runs: int) -> Iterable[tuple[Array, Kernels]]:
        if state.memory:
            return state.memory.predictions(densities.at(state.step - 1))
        return [(np.arange(runs), prior.rows(np.zeros(runs, dtype=int)))]

    def step(state: State, y: Array, usual_way: UsualWay | None = None) -> State:
        law = densities.at(state.step)
        way = partial(_quick_step, usual_way, state.memory, model.prior) if usual_way else _step
        try:
            try:
                posterior, predicted, found = way(before(state, len(y)), y, law, accuracy, FINE[0], memory)
            except TooNarrow:
                posterior, predicted, found = way(before(state, len(y)), y, law, accuracy, FINE[1], memory)
        except Unresolved as error:
            raise Unresolved(f"step {state.step} of {model}: {error}; leave the exact filter out (--slow-runs 0)") from None
        if model.angles.x:
            posterior, predicted = _on_circle(found, law)
        if state.memory:
            found = found._replace(error=found.error + state.memory.error)
        return State(state.step + 1, posterior, predicted, found)

    def evidence(state: State, y: Array, after: State) -> Array:
        return log_evidence(before(state, len(y)), y, densities.at(state.step), after.memory.fine)

    def look_back(states: Iterable[State], y: Array) -> Callable[[int], Iterator[State]]:
        runs, room, visited = y.shape[1], memory, [init(y.shape[1])]
        for state in states:
            room -= state.memory.bytes()
            visited.append(state if room >= 0 else state._replace(memory=state.memory.without_predictions()))

        def back(end: int) -> Iterator[State]:
            memories = [state.memory for state in visited[1 : end + 1]]
            known = [one.fine for one in memories], np.array([one.error for one in memories])
            found = smoothed(*known, y, lambda k: before(visited[k], runs), densities, accuracy, bool(model.angles.x))
            for step, one in zip(range(end, 0, -1), found, strict=True):
                law = Gaussian(one.mean[:, None], one.variance[:, None, None])
                yield State(step, law, law, one)

        return back

    found = Filter("aof-exact", model, init, step, slow=True, evidence=evidence, look_back=look_back)
    if not is_scalar(model) or densities.noiseless or densities.piece or is_nonlinear(model):
        return found
    return replace(found, quick=(step, lambda: partial(step, usual_way=compiled_usual_way(model))))


def _on_circle(memory: PointMass, law: ScalarDensities) -> tuple[Gaussian, Gaussian]:
    """Posterior and prediction of a state that is an angle: the filter works on the line, whole turns are dropped at the end."""
    after, before = np.empty((2, len(memory.fine))), np.empty((2, len(memory.fine)))
    for place, grid in enumerate(memory.fine):
        after[:, place] = moments_on_circle(grid.x, grid.mass)
    for rows, kernels in memory.predictions(law):
        mean, variance = moments_on_circle(kernels.mu, kernels.mass)
        before[:, rows] = mean, variance + (kernels.mass * kernels.sigma**2).sum(axis=1)
    posterior, predicted = (Gaussian(mean[:, None], variance[:, None, None]) for mean, variance in (after, before))
    return posterior, predicted


class Corrected(NamedTuple):
    """Posteriors of some trajectories: grids by number, and moments, estimated error, and whether adaptive, (runs,) each."""

    grids: dict[int, Grid]
    mean: Array
    variance: Array
    error: Array
    adaptive: Array


def corrected(
    groups: Iterable[tuple[Array, Kernels]], y: Array, law: ScalarDensities, accuracy: float, fine_nodes: int
) -> Corrected:
    """The posteriors from predictions, (numbers of trajectories, kernels), and y (runs, 1); NaN for trajectories in no group."""
    grids: dict[int, Grid] = {}
    mean, variance, error = np.full((3, len(y)), np.nan)
    adaptive = np.zeros(len(y), dtype=bool)

    def correct(rows: Array, kernels: Kernels, hasty: bool) -> None:
        values, resolved = y[rows], np.zeros(len(rows), dtype=bool)
        error[rows] = np.inf
        place, candidates = likeliest(kernels, values, law)
        for some, found, good in _in_batch(kernels, values, law, place, candidates, accuracy, fine_nodes, hasty):
            done = rows[some]
            mean[done], variance[done], error[done] = found.mean, found.variance, found.error + found.inherited
            for i, x, mass, density in zip(done.tolist(), found.x, found.mass, found.density, strict=True):
                grids[i] = Grid(x, mass, density, uniform=True)
            resolved[some] = good
        left = np.flatnonzero(~resolved)
        if not len(left):
            return
        better = _on_panels(kernels.rows(left), values[left], law, candidates.rows(left), accuracy, error[rows[left]])
        for row, grid, error_there in better:
            i = int(rows[left[row]])
            grids[i], error[i], adaptive[i] = grid, error_there, True
            mean[i], variance[i] = grid.mean(), grid.variance()
        if hasty and np.isinf(error[rows]).any():
            raise Unresolved("panels do not resolve a posterior")

    for rows, kernels in groups:
        if law.noiseless and not np.isnan(y[rows]).any():
            for place, grid in zip(rows.tolist(), at_roots(kernels, y[rows], law), strict=True):
                grids[place], error[place] = grid, 0.0
                mean[place], variance[place] = grid.mean(), grid.variance()
            continue
        for chunk in chunks(len(rows), NODES[0] * kernels.mu.shape[1], ELEMENTS):
            some, here, hasty = rows[chunk], kernels.rows(chunk), kernels.panels and accuracy >= TENTH
            try:
                correct(some, here, hasty)
            except Unresolved:
                if not hasty:
                    raise
                correct(some, here, hasty=False)
    return Corrected(grids, mean, variance, error, adaptive)


def _step(
    groups: Iterable[tuple[Array, Kernels]], y: Array, law: ScalarDensities, accuracy: float, fine_nodes: int, room: float
) -> tuple[Gaussian, Gaussian, PointMass]:
    """Posterior, prediction of the next state, and memory after the measurements y (runs, 1)."""
    grids, mean, variance, error, adaptive = corrected(groups, y, law, accuracy, fine_nodes)
    fine = [grids[place] for place in range(len(y))]
    predicted = np.empty((2, len(y)))
    following, later = _following(fine, np.arange(len(y)), law, room, predicted)
    memory = PointMass(fine, error, variance, adaptive, following, later)
    posterior, prediction = (Gaussian(m[:, None], v[:, None, None]) for m, v in ((mean, variance), predicted))
    return posterior, prediction, memory


def _following(
    grids: Sequence[Grid], rows: Array, law: ScalarDensities, room: float, moments: Array, usual: Array | None = None
) -> tuple[list[tuple[Array, Kernels]], Array]:
    """The predictions from posteriors of these numbers as far as there is room, and the others' numbers; writes their moments.

    `usual` is told which are sums of kernels that overlap, and these are not kept: loops make them again.
    """
    kept, later = [], [np.empty(0, dtype=int)]
    for places, kernels in predictions(grids, law):
        some = rows[places]
        moments[:, some] = kernels.moments()
        again = usual is not None and kernels.spectral.all()
        if usual is not None:
            usual[some] = again
        room -= 0 if again else kernels.bytes()
        if again or room < 0:
            later.append(some)
        else:
            kept.append((some, kernels))
    return kept, np.sort(np.concatenate(later))


def _quick_step(
    usual_way: UsualWay,
    memory: PointMass | None,
    prior: Gaussian,
    groups: Iterable[tuple[Array, Kernels]],
    y: Array,
    law: ScalarDensities,
    accuracy: float,
    fine_nodes: int,
    room: float,
) -> tuple[Gaussian, Gaussian, PointMass]:
    """`_step` with the usual way and sums of kernels compiled: what the first leaves, and its predictions, go here as there."""
    from kfcourse.filters.exact.loops import add_bells

    numbers, size, usual = np.empty((5, len(y))), np.zeros(len(y), dtype=int), np.zeros(len(y), dtype=bool)
    values = np.empty((3, 0))
    known = memory.fine if memory else Packed.of_normal(prior, len(y))
    if isinstance(known, Packed):
        rows = np.flatnonzero(known.usual)
        done = usual_way(known, rows, y[rows, 0], accuracy, fine_nodes)
        values, numbers[:, rows], size[rows], usual[rows] = done.values, done.numbers, done.size, done.usual
    if memory:
        groups = memory._replace(later=memory.later[size[memory.later] == 0]).predictions(law)
    else:
        groups = ((some[size[some] == 0], kernels.rows(size[some] == 0)) for some, kernels in groups if (size[some] == 0).any())
    groups = ((some, kernels._replace(bells=add_bells)) for some, kernels in groups)
    found = corrected(groups, y, law, accuracy, fine_nodes)
    others = size == 0
    numbers[:3, others] = np.array(found[1:4])[:, others]
    fine = Packed.together(values, size, usual, found.grids)
    rest = np.flatnonzero(~usual)
    following, later = _following([fine[i] for i in rest.tolist()], rest, law, room, numbers[3:], usual)
    mean, variance, error, *predicted = numbers
    later = np.union1d(later, np.flatnonzero(usual))
    after = PointMass(fine, error, variance, found.adaptive, following, later)
    posterior, prediction = (Gaussian(m[:, None], v[:, None, None]) for m, v in ((mean, variance), predicted))
    return posterior, prediction, after


def _in_batch(
    kernels: Kernels,
    y: Array,
    law: ScalarDensities,
    place: Place,
    candidates: Candidates,
    accuracy: float,
    fine_nodes: int,
    hasty: bool,
) -> Iterator[tuple[Array, Posteriors, Array]]:
    """Rows of kernels, their posteriors, and whether these are resolved; on the finest grid also those that are not.

    In haste only few nodes are tried, and once: a posterior after one that needed panels is likely to need them, too.
    """
    look = looked(kernels, y, law, place)
    left, least = np.arange(len(y)), np.zeros(len(y))  # trajectories to do, and the nodes that kernels need
    spacings, most = (SPACINGS[:1], TRIED) if hasty else (SPACINGS, NODES[-1])
    for spacing in spacings:
        place, wanted = spaced(look.rows(left), candidates.rows(left), law, spacing)
        sizes = np.searchsorted(NODES[:-1], np.maximum(wanted, least[left]))
        again = np.zeros(len(left), dtype=bool)
        for size in np.unique(sizes[np.array(NODES)[sizes] <= most]).tolist():
            count, todo = NODES[size], np.flatnonzero(sizes == size)
            for chunk in chunks(len(todo), count * kernels.mu.shape[1], ELEMENTS):
                some = todo[chunk]
                i, there = left[some], place.rows(some)
                found = posteriors(kernels.rows(i), y[i], law, there, count)
                least[i] = nodes_for_kernels(law, found, count, fine_nodes)
                humps = candidates.rows(i)
                if kernels.panels:  # the prediction may have humps of its own
                    humps = humps.beside(of_kernels(kernels.rows(i), y[i], law))
                unseen = hidden(humps, there, count)
                found = found._replace(error=np.where(unseen, np.inf, found.error))
                good = (found.error <= accuracy) & (least[i] <= count)
                told = good | (spacing == spacings[-1]) | (count == NODES[-1])
                yield i[told], Posteriors(*(array[told] for array in found)), good[told]
                least[i] = np.maximum(least[i], np.where(good, 0, MORE * count))
                again[some] = ~told
        left = left[again]
        if not len(left):
            return


def _on_panels(
    kernels: Kernels, y: Array, law: ScalarDensities, candidates: Candidates, accuracy: float, error: Array
) -> Iterator[tuple[int, Grid, float]]:
    """Rows, their posteriors and errors on panels, where these are better than with nodes; together, or else one by one."""

    def found(rows: slice) -> list[tuple[Grid, float]]:
        return on_panels(kernels.rows(rows), y[rows], law, candidates.rows(rows), accuracy)

    try:
        results = found(slice(None))
    except Unresolved:
        results = []
        for i in range(len(y)):
            try:
                results += found(slice(i, i + 1))
            except Unresolved:
                if not error[i] <= TOLERABLE:
                    raise
                results.append((Grid(*np.empty((3, 0))), np.inf))
    for row, (grid, error_there) in enumerate(results):
        if TOLERABLE < error_there < np.inf and not error[row] <= TOLERABLE:
            raise Unresolved("a posterior has more humps, spikes or kinks than its nodes resolve")
        if error_there < error[row]:
            yield row, grid, error_there


def nodes_for_kernels(law: ScalarDensities, found: Posteriors, count: int, fine_nodes: int) -> Array:
    """How many nodes a posterior needs, (T,), that the next prediction be a sum of kernels that overlap.

    If they are too many even for the finest grid, `fine_nodes`: it will be interpolated.
    """
    wanted = (count - 1) * apart(*law.kernel(found.x), found.mass) + 1
    return np.where(wanted <= NODES[-1], wanted, fine_nodes)
