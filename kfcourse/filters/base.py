"""What a filter is: an immutable value with `init`, `step` and `estimate`.

Two kinds of filters reach that interface:

* `Filter`: ready to run (AOF, Kalman, exact, particle);
* `Design`: a filter of given structure whose coefficients are regressions over an ensemble (DUOF, FOS,
  MFOS).  Its equations are written once, as a generator that yields each `Regression` it needs and
  receives the fitted `Affine`: while designing, the ensemble answers; while running, the stored
  coefficients do.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from kfcourse.laws import Affine, Array, Gaussian
from kfcourse.symbolic.model import Model


class State(NamedTuple):
    """State of a filter over an ensemble, between two steps.

    Attributes
    ----------
    step : int
        Number of measurements used so far.
    posterior : Gaussian
        Estimate z (runs, n) and its error covariance as the filter sees it, (..., n, n).
    predicted : Gaussian
        Prediction lambda (runs, n) of the next state, and Psi (..., n, n).
    memory : object
        What else the filter remembers (grid, particles); None for most.
    """

    step: int
    posterior: Gaussian
    predicted: Gaussian
    memory: Any = None


@dataclass(frozen=True)
class Filter:
    """A filter ready to run.

    Attributes
    ----------
    name : str
        Short name, such as "aof-gaussian".
    model : Model
        The model it was built for.
    init : callable
        runs -> State before the first measurement.
    step : callable
        (State, y (runs, p)) -> State: correct with y_k, then predict k + 1.  NaN in y: no correction.
    slow : bool
        Thousands of times the cost of the others: comparisons run it on a subset of the trajectories.
    """

    name: str
    model: Model
    init: Callable[[int], State]
    step: Callable[[State, Array], State]
    slow: bool = False

    def estimate(self, state: State) -> Gaussian:
        """Estimate z (runs, n) and the filter's own error covariance (..., n, n)."""
        return state.posterior


def initial_state(model: Model) -> Callable[[int], State]:
    """`init` of every Gaussian filter: lambda_0 = m, Psi_0 = d."""

    def init(runs: int) -> State:
        prior = Gaussian(np.tile(model.prior.mean, (runs, 1)), model.prior.cov)
        return State(0, prior, prior)

    return init


class Regression(NamedTuple):
    """A request: fit `target` by an affine function of `regressor` over the ensemble.

    Attributes
    ----------
    target : callable
        (x_k (N, n), x_{k+1} (N, n)) -> (N, r); known only while designing.
    regressor : ndarray (N, s)
        What the filter itself knows.
    """

    target: Callable[[Array, Array], Array]
    regressor: Array


class Step(NamedTuple):
    """What the equations of one step return."""

    posterior: Gaussian
    predicted: Gaussian


Equations = Generator[Regression, Affine, Step]


@dataclass(frozen=True)
class Design:
    """A filter of given structure whose coefficients are still to be found.

    Attributes
    ----------
    name : str
    model : Model
    equations : callable
        (predicted: Gaussian, y) -> generator of one step: yields `Regression`, receives `Affine`, returns `Step`.
    """

    name: str
    model: Model
    equations: Callable[[Gaussian, Array], Equations]
    slow: bool = False

    def with_coefficients(self, coefficients: Sequence[Sequence[Affine]]) -> Filter:
        """The filter with the coefficients of every step, in the order the equations ask for them."""
        table = tuple(tuple(fits) for fits in coefficients)

        def step(state: State, y: Array) -> State:
            if state.step >= len(table):
                raise ValueError(
                    f"{self.name} was designed for {len(table)} steps; design it with more to run step {state.step + 1}"
                )
            result = _answer(self.equations(state.predicted, y), table[state.step])
            return State(state.step + 1, result.posterior, result.predicted)

        return Filter(self.name, self.model, initial_state(self.model), step)


def _answer(equations: Equations, fits: Sequence[Affine]) -> Step:
    """Run the equations of one step, answering each regression with its stored coefficients."""
    try:
        next(equations)
        for fit in fits:
            equations.send(fit)
    except StopIteration as stop:
        return stop.value
    raise ValueError("the equations ask for more regressions than were designed")
