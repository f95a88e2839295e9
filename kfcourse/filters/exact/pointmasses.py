"""The exact filter of scalar models, with modes or without: what `panels` computes, as a
`Filter`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kfcourse.angles import moments_on_circle
from kfcourse.errors import expect
from kfcourse.filters.base import Filter, State, initial_state, without_prediction
from kfcourse.filters.exact.columns import (
    ERROR,
    EVIDENCE,
    EXPECTED,
    KEPT,
    LEFT,
    LOST,
    MEAN,
    NUMBERS,
    PROBABILITY,
    RIGHT,
    STATUS,
    VARIANCE,
    Q,
)
from kfcourse.filters.exact.laws import constants, load, modes_of, printed
from kfcourse.filters.multiple_models import mixture
from kfcourse.laws import Array, Gaussian
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError

# Of the mean and the deviation at a step, in posterior deviations: their square, 1e-4 of the bound,
# is what 20,000 trajectories tell. True errors are at most 4e-4 on the lab's variants, 2e-5 in the
# mean.
ACCURACY = 1e-2
FINEST = 1e-6  # what a sum of eight kernels over five deviations allows
TOLERABLE = 0.1  # error of a step, in deviations, beyond which there is no posterior
CHUNK = 256  # trajectories that a thread takes at once: some milliseconds
NEGLIGIBLE = 1e-12  # probability of a mode whose density need not be found
PARTS = 64  # of a panel where states are drawn: their variance errs by 6e-4 (by 8e-3 with 16)
REASONS = (
    "its error is above a tenth of a deviation: the measurement contradicts the model, or digits "
    "are lost",
    "the posterior needs too many panels",
    "the prediction needs too many kernels",
    "no state explains the measurement",
)  # of `panels`' statuses, the first one's where the step ended well


class Unresolved(ModelError):
    """A posterior cannot be had: a record contradicts the model, or a density is too rough."""


class PointMass(NamedTuple):
    """What the filter remembers.

    Attributes
    ----------
    panels, begin : ndarray (rows, KEPT), (runs * J + 1,)
        The densities, and where those of a mode begin (`columns`).
    numbers : ndarray (runs, J, NUMBERS)
    log_likelihood : ndarray (runs,)
        ln p(y_k | y_0, ..., y_{k-1}).
    error : ndarray (runs,)
        Estimated error of mean and deviation, in posterior deviations: that of this step and of all
        before it, as if the filter never forgot one.
    variance : ndarray (runs,)
        Of the posteriors.
    """

    panels: Array
    begin: Array
    numbers: Array
    log_likelihood: Array
    error: Array
    variance: Array

    @property
    def probability(self) -> Array:
        """Posterior probabilities of the modes, (runs, J)."""
        return self.numbers[:, :, PROBABILITY]

    def density(self, run: int, mode: int = 0) -> tuple[Array, Array]:
        """States x (M,), ascending, at which a trajectory's posterior is held, and p(x, mode)
        there."""
        place = run * self.numbers.shape[1] + mode
        rows = self.panels[self.begin[place] : self.begin[place + 1]]
        p = np.exp(rows[:, :Q]) * self.probability[run, mode]
        return _points(rows)[0].ravel(), p.ravel()

    def drawn(self, number: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """As of `Filter`: each part of a panel has its mass, and nothing is told of where in it."""
        from kfcourse.filters.exact.panels import COEFFICIENT, legendre

        runs, modes = self.probability.shape
        above = rng.random((number, runs, 1)) >= self.probability.cumsum(axis=1)[:, :-1]
        mode = above.sum(axis=-1)
        place = np.arange(runs) * modes + mode
        size = (self.panels[:, RIGHT] - self.panels[:, LEFT]) / PARTS
        up_to_ends = legendre.legval(np.linspace(-1, 1, PARTS + 1), legendre.legint(COEFFICIENT))
        masses = np.diff(np.exp(self.panels[:, :Q]) @ up_to_ends) * size[:, None] * PARTS / 2
        up_to = np.concatenate([[0.0], np.maximum(masses, 0.0).cumsum()])
        begin, end = up_to[self.begin[place] * PARTS], up_to[self.begin[place + 1] * PARTS]
        wanted = begin + rng.random(mode.shape) * (end - begin)
        row, part = np.divmod(
            np.clip(np.searchsorted(up_to, wanted) - 1, 0, masses.size - 1), PARTS
        )
        x = self.panels[row, LEFT] + size[row] * (part + rng.random(mode.shape))
        return x[..., None], mode

    def discretisation_error(self) -> Array:
        """Estimated error of the posterior means, (runs,), in the units of x."""
        return self.error * np.sqrt(self.variance)


def pointmass(model: Model | JumpModel, accuracy: float = ACCURACY) -> Filter:
    """The exact AOF of a scalar model by point masses.

    Parameters
    ----------
    model : Model or JumpModel
        One state, one measurement, noises entering linearly (with any functions of x as factors);
        the meter's may be one that can be solved for, as in y = exp(x + w).  Of a model with modes,
        all of which are such, `state.memory.probability` are their posterior probabilities.
        An object in continuous time is followed by sub-steps (`kfcourse.continuous.exact`).
    accuracy : float
        Error of a step's mean and deviation, in posterior deviations, at most.

    Raises
    ------
    ModelError
        The model is not scalar, a noise enters nonlinearly, or object or meter have none.
    Unresolved
        When it runs: a step whose error is above a tenth of a deviation.  A record that contradicts
        the model makes one, where a state is more than some six deviations from where it was
        predicted.

    Notes
    -----
    It is compiled when it first runs, which takes some seconds once, and kept on the disk.
    """
    expect(model, Model, "pointmass", JumpModel)
    if not FINEST <= accuracy < 1:
        raise ModelError(f"the exact filter needs {FINEST:g} <= accuracy < 1, got {accuracy}")
    modes = modes_of(model)
    if modes[0].between is not None:
        return modes[0].between.exact(model, accuracy)
    if len(modes) > 1 and model.angles.x:
        raise ModelError(
            "the exact filter over modes holds no state that is an angle; use particle(model)"
        )
    exact = Exact(model, printed(model), accuracy)
    back = exact.look_back if len(modes) == 1 else None
    return Filter(
        "aof-exact",
        modes[0],
        exact.init,
        exact.step,
        evidence=_evidence,
        look_back=back,
        drawn=True,
    )


def _evidence(before: State, y: Array, after: State) -> Array:
    return after.memory.log_likelihood


@dataclass(frozen=True)
class Exact:
    """The exact filter of a model, which is printed as the function `text`."""

    model: Model | JumpModel
    text: str
    accuracy: float

    def init(self, runs: int) -> State:
        chances = self.model.first if isinstance(self.model, JumpModel) else np.ones(1)
        numbers = np.zeros((runs, len(chances), NUMBERS))
        numbers[:, :, PROBABILITY] = numbers[:, :, EXPECTED] = chances
        # a panel for each, from wherever the first state is drawn
        panels = np.zeros((runs * len(chances), KEPT))
        panels[:, RIGHT] = 1.0
        memory = PointMass(panels, np.arange(len(panels) + 1), numbers, *np.zeros((3, runs)))
        return initial_state(modes_of(self.model)[0])(runs)._replace(memory=memory)

    def step(self, state: State, y: Array) -> State:
        k, before = state.step, state.memory
        memory, law = self._advance(f"step {k}", k, y[:, 0], before)
        memory = memory._replace(error=before.error + memory.error)
        return without_prediction(k + 1, law, memory)

    def look_back(self, states: Iterable[State], y: Array) -> Callable[[int], Iterator[State]]:
        """`Filter.look_back` of a model without modes."""
        visited = [self.init(y.shape[1]), *states]

        def back(end: int) -> Iterator[State]:
            state, error = visited[end], np.zeros(y.shape[1])
            yield state
            for k in reversed(range(end - 1)):
                before, filtered = visited[k].memory, visited[k + 1].memory
                where = f"looking back to step {k}"
                memory, law = self._advance(where, k, y[k, :, 0], before, state.memory)
                error = error + memory.error
                memory = memory._replace(
                    log_likelihood=filtered.log_likelihood, error=filtered.error + error
                )
                state = State(k + 1, law, law, memory)
                yield state

        return back

    def _transitions(self, k: int) -> Array:
        """Probabilities of transitions from step k, (J, J); negative where they depend on the
        state; none before the first."""
        if k < 0:
            return np.eye(len(modes_of(self.model)))
        if not isinstance(self.model, JumpModel):
            return np.ones((1, 1))
        if self.model.by_state:
            return np.full(self.model.chain.shape, -1.0)
        return self.model.transition_at(k)

    def _advance(
        self, where: str, k: int, y: Array, before: PointMass, later: PointMass | None = None
    ) -> tuple[PointMass, Gaussian]:
        """The posteriors at step k, with the error of this step, and their law; looking back from
        `later`.

        Threads take some trajectories each.  What they compute does not depend on how many there
        are; joblib's workers have one each.
        """
        from numba import config

        from kfcourse.filters.exact.panels import advance

        compiled = load(self.text)
        chain = self._transitions(k - 1)
        now_and_then = np.stack([constants(self.model, max(k - back, 0)) for back in (0, 1)])
        turns = np.array([2 * np.pi if which else np.inf for which in reversed(self.model.angles)])
        ahead = later or before
        numbers, values, size = ahead.numbers.copy(), np.array(y, dtype=float), len(chain)
        numbers[:, :, LOST] = before.numbers[:, :, LOST]

        def chunk(start: int) -> tuple[Array, Array]:
            runs = slice(start, start + CHUNK)
            ends = slice(start * size, (start + CHUNK) * size + 1)
            return advance(
                compiled,
                now_and_then,
                turns,
                values[runs],
                before.panels,
                before.begin[ends],
                ahead.panels,
                ahead.begin[ends],
                chain,
                k == 0,
                later is not None,
                self.accuracy,
                numbers[runs].reshape(-1, NUMBERS),
            )

        starts, threads = range(0, len(values), CHUNK), config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]
        if len(starts) == 1 or threads == 1:
            parts = list(map(chunk, starts))
        else:
            with ThreadPoolExecutor(threads) as pool:
                parts = list(pool.map(chunk, starts))
        panels = np.concatenate([panels for panels, _ in parts])
        begin = np.cumsum(np.concatenate([[0], *(np.diff(begin) for _, begin in parts)]))
        if self.model.angles.x:
            # a row for each trajectory, filled up by panels without mass
            place = np.arange(np.diff(begin).max())
            inside = place < np.diff(begin)[:, None]
            x, mass = (
                part[np.where(inside, begin[:-1, None] + place, 0)] for part in _points(panels)
            )
            rows = len(values), -1
            moments = moments_on_circle(x.reshape(rows), (mass * inside[..., None]).reshape(rows))
            numbers[:, 0, MEAN], numbers[:, 0, VARIANCE] = moments
        laws = [
            Gaussian(mode[:, MEAN, None], mode[:, VARIANCE, None, None])
            for mode in np.moveaxis(numbers, 1, 0)
        ]
        law = mixture(laws, numbers[:, :, PROBABILITY])
        evidence = np.where(np.isnan(y), 0.0, np.logaddexp.reduce(numbers[:, :, EVIDENCE], axis=1))
        memory = PointMass(panels, begin, numbers, evidence, _error(numbers, law), law.cov[:, 0, 0])
        self._check(where, memory)
        return memory, law

    def _check(self, where: str, memory: PointMass) -> None:
        """Unresolved if a mode that is possible has no posterior, or an error is too large."""
        possible = memory.numbers[:, :, EXPECTED] > NEGLIGIBLE
        empty = (np.diff(memory.begin).reshape(possible.shape) == 0) & possible
        wrong = empty.any(axis=1) | ~(memory.error < TOLERABLE)
        if not wrong.any():
            return
        run = int(np.argmax(wrong))
        statuses = memory.numbers[run, empty[run], STATUS].astype(int)
        reason = REASONS[statuses[0] or len(REASONS) - 1] if len(statuses) else REASONS[0]
        raise Unresolved(
            f"{where} of {self.model}, run {run}: {reason}; look at the measurement, or leave the "
            f"exact filter out",
            reason=reason,
        )


def _points(panels: Array) -> tuple[Array, Array]:
    """States at the points of panels, and the masses of the density there, both (rows, Q)."""
    from kfcourse.filters.exact.panels import POINT, WEIGHT

    left, right = panels[:, LEFT, None], panels[:, RIGHT, None]
    x = left * (0.5 - 0.5 * POINT) + right * (0.5 + 0.5 * POINT)
    return x, np.exp(panels[:, :Q]) * WEIGHT * 0.5 * (right - left)


def _error(numbers: Array, law: Gaussian) -> Array:
    """Error of the mixture in its deviations, (runs,).

    A mode's mean errs in the mode's deviations, its probability by that part of itself.
    """
    sd, apart = np.sqrt(numbers[:, :, VARIANCE]), np.abs(numbers[:, :, MEAN] - law.mean)
    moved = numbers[:, :, PROBABILITY] * numbers[:, :, ERROR] * (sd + apart)
    # what has no posterior is told by `_check`
    with np.errstate(invalid="ignore", divide="ignore"):
        return moved.sum(axis=1) / np.sqrt(law.cov[:, 0, 0])
