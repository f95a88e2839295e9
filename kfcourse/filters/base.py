"""What a filter is: an immutable value with `init` and `step`; state goes in and comes out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from kfcourse.angles import Components, on_circle
from kfcourse.laws import Array, Gaussian, Measurement, Vectors
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import Structure


class State(NamedTuple):
    """State of a filter over an ensemble, between two steps.

    Attributes
    ----------
    step : int
        Number of measurements used so far.
    posterior : Gaussian
        Estimate z (runs, n) and its error covariance as the filter sees it, (..., n, n).
    predicted : Gaussian
        Prediction lambda (runs, n) of the next state, and Psi (..., n, n).  The exact filter and
        particles go without: NaN, and `ahead` finds them.
    memory : object
        What else the filter remembers (grid, particles); None for most.
    expected : Measurement, optional
        What a filter whose laws are normal expected of the last measurement: its likelihood needs
        no more.
    """

    step: int
    posterior: Gaussian
    predicted: Gaussian
    memory: Any = None
    expected: Measurement | None = None


# The state of so many trajectories before the first measurement.
Init: TypeAlias = Callable[[int], State]
# Correct with y_k, (runs, p), then predict k + 1.  A trajectory whose y is NaN is not corrected.
Advance: TypeAlias = Callable[[State, Vectors], State]
# ln p(y_k | y_0, ..., y_{k-1}), (runs,), from the states before and after the measurement; 0 where
# it is missing.
Evidence: TypeAlias = Callable[[State, Vectors, State], Array]
# From the filter's states after each measurement, and y: what so many of these measurements tell, K
# -> states.  Their laws are those given y_0, ..., y_{K-1}, that of step K - 1 first and of step 0
# last, each found when it is asked for.  Their memory may tell how good they are,
# `discretisation_error()`, (runs,), in the units of x.
LookBack: TypeAlias = Callable[[Iterable[State], Vectors], Callable[[int], Iterator[State]]]


@dataclass(frozen=True)
class Filter:
    """A filter ready to run.

    Attributes
    ----------
    name : str
        Short name, such as "aof-gaussian".
    model : Model
        The model it was built for.
    init : Init
        runs -> State.
    step : Advance
        (State, y (runs, p)) -> State.  The estimate and the filter's own error covariance are its
        `posterior`.
    slow : bool
        Thousands of times the cost of the others, and the memory: comparisons give it fewer
        trajectories at a time.
    structure : Structure, optional
        For a filter whose laws are normal ones: the structural functions by which it expects
        measurements from its prediction, and predicts from its posterior.  Looking back, likelihood
        and gates take from it what no filter needs while it runs.
    evidence : Evidence, optional
        Where it is another than the normal law's by `structure`: how likely a measurement was
        before it came.
    look_back : LookBack, optional
        Where it is another than the normal law's by `structure`: what the whole record tells of
        each state.
    mixture : callable, optional
        Where what it expects of a measurement is a mixture of normal laws: the state before it to
        their weights (runs, M), and the M expectations.
    drawn : bool
        Where it is another law: whether its memory has the posterior to draw from, `drawn(number,
        rng)` -> so many states (number, runs, n) of each trajectory, and their modes (number,
        runs).
    """

    name: str
    model: Model
    init: Init
    step: Advance
    slow: bool = False
    structure: Structure | None = None
    evidence: Evidence | None = None
    look_back: LookBack | None = None
    mixture: Callable[[State], tuple[Array, Sequence[Measurement]]] | None = None
    drawn: bool = False

    def __post_init__(self) -> None:
        if self.model.angles.x:
            object.__setattr__(self, "step", _on_circle(self.step, self.model.angles.x))


def ahead(filter_: Filter, state: State) -> Gaussian:
    """What a filter predicts, by a step without measurement where its state does not tell."""
    if not np.isnan(state.predicted.mean).all():
        return state.predicted
    nothing = np.full((len(state.posterior.mean), filter_.model.p), np.nan)
    return filter_.step(state, nothing).posterior


def without_prediction(step: int, posterior: Gaussian, memory: Any) -> State:
    """The state of a filter that would have to move its memory for a prediction."""
    return State(
        step, posterior, Gaussian(*(np.full_like(part, np.nan) for part in posterior)), memory
    )


def structure_of(filter_: Filter, what: str) -> Structure:
    """The structural functions of a filter; ValueError that tells what needs them if it has
    none."""
    if filter_.structure is None:
        raise ValueError(
            f"{what} needs the structural functions by which a filter expects and predicts, and "
            f"{filter_.name} has none of its own: "
            "take one whose laws are normal, such as aof(linearised(model)), "
            "aof(unscented(model)) or kalman_filter(model)"
        )
    return filter_.structure


def _on_circle(step: Advance, angles: Components) -> Advance:
    """The step with estimates and predictions of angles between -pi and pi."""

    return lambda state, y: with_angles_on_circle(step(state, y), angles)


def with_angles_on_circle(state: State, angles: Components) -> State:
    """The state with the angles of its means between -pi and pi."""
    if not angles:
        return state
    posterior, predicted = (
        Gaussian(on_circle(law.mean, angles), law.cov) for law in (state.posterior, state.predicted)
    )
    return state._replace(posterior=posterior, predicted=predicted)


def initial_state(model: Model) -> Init:
    """`init` of every Gaussian filter: lambda_0 = m, Psi_0 = d."""

    def init(runs: int) -> State:
        prior = Gaussian(np.tile(model.prior.mean, (runs, 1)), model.prior.cov)
        return State(0, prior, prior)

    return init
