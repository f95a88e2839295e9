"""Filters of given structure whose coefficients are regressions over an ensemble (DUOF, FOS and
their kin).

The equations of such a filter are written once, as a generator that yields each `Regression` it
needs and receives the
fitted `Affine`.  While it is designed the ensemble answers, through the `Scatter` of its
trajectories (`kfcourse.montecarlo.designing`); while it runs, the stored coefficients do.  Both
steps of a filter may end in one: `fitted_correction`, `fitted_prediction`.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kfcourse.angles import Angles, difference, near
from kfcourse.filters.base import Advance, Filter, Init, State, initial_state
from kfcourse.laws import Array, Gaussian, Matrices, Vectors, apply, gain, symmetric, where_measured
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import Structure


class Affine(NamedTuple):
    """The best affine predictor of a target from a regressor, and what it leaves unexplained.

    `target` ≈ `matrix` `regressor` + `offset`,   Cov(`target` - `prediction`) = `residual`
    """

    matrix: Matrices
    offset: Vectors
    residual: Matrices

    def __call__(self, regressor: Vectors) -> Vectors:
        return apply(self.matrix, regressor) + self.offset


class Scatter(NamedTuple):
    """Means and scatter of (target, regressor) over an ensemble.

    Scatter is the sum of products of deviations from the mean: large means do not cancel.
    """

    size: int
    targets: int  # r
    mean: Array  # (r + s,)
    scatter: Array  # (r + s, r + s)

    @classmethod
    def of(cls, target: Array, regressor: Array) -> Scatter:
        """Those of target (N, r) and regressor (N, s) stacked into one vector."""
        # sums run along rows of numbers
        size, both = len(target), np.concatenate([target.T, regressor.T])
        mean = both.sum(axis=1) / max(size, 1)
        off = both - mean[:, None]
        # no thread of a library is started
        return cls(size, target.shape[1], mean, np.einsum("in,jn->ij", off, off))

    def regression(self, targets: int | None = None) -> Affine:
        """Least squares of the targets on the rest; notebooks handed out with earlier versions also
        say how many there are.

        `matrix` = Cov(t, r) Cov(r)^+,  `offset` = M[t] - `matrix` M[r],  `residual` = Cov(t) -
        `matrix` Cov(t, r)^T
        """
        cov, r = self.scatter / self.size, self.targets if targets is None else targets
        cross = cov[:r, r:]
        matrix = gain(cross, cov[r:, r:])
        offset = self.mean[:r] - matrix @ self.mean[r:]
        return Affine(matrix, offset, _nonnegative(cov[:r, :r] - matrix @ cross.T))


def _nonnegative(matrix: Array) -> Array:
    """A covariance that is one but for rounding: symmetrised, its negative eigenvalues set to 0."""
    values, vectors = np.linalg.eigh(symmetric(matrix))
    if values.min() >= 0:
        return symmetric(matrix)
    return (vectors * np.maximum(values, 0.0)) @ vectors.T


class Regression(NamedTuple):
    """A request: fit `target` by an affine function of `regressor` over the ensemble.

    Attributes
    ----------
    target : callable
        (x_k (N, n), x_{k+1} (N, n)) -> (N, r); known only while designing.
    regressor : ndarray (N, s)
        What the filter itself knows.
    mode : int, optional
        Of a model that jumps: over the trajectories that are in this mode at the step.
    """

    target: Callable[[Array, Array], Array]
    regressor: Array
    mode: int | None = None

    def scatter(self, x: Array, x_next: Array, modes: Array | None = None) -> Scatter:
        """The moments over a part of the ensemble, which in a model that jumps is in these modes
        (N,)."""
        target, regressor = self.target(x, x_next), self.regressor
        if self.mode is not None and modes is not None:
            target, regressor = target[modes == self.mode], regressor[modes == self.mode]
        return Scatter.of(target, regressor)


Equations = Generator[Regression, Affine, State]
Part = Generator[Regression, Affine, Gaussian]


def fitted_correction(lam: Array, direction: Array, y: Array, angles: Angles) -> Part:
    """z = lambda + H direction + e, H and e from the regression of x - lambda on the direction; p
    is its residual.

    Where a component of y is missing (NaN) z is lambda.
    """
    fit = yield Regression(lambda x, x_next: difference(x, lam, angles.x), direction)
    return Gaussian(lam + where_measured(y, fit(direction)), fit.residual)


def fitted_prediction(s_next: Array, angles: Angles) -> Part:
    """lambda' = L s' + n, L and n from the regression of x' on s'; Psi' is its residual."""
    fit = yield Regression(lambda x, x_next: near(x_next, s_next, angles.x), s_next)
    return Gaussian(fit(s_next), fit.residual)


@dataclass(frozen=True)
class Design:
    """A filter of given structure whose coefficients are still to be found.

    Attributes
    ----------
    name : str
    model : Model
    equations : callable
        (State, y) -> generator of one step: yields `Regression`, receives `Affine`, returns the
        next `State`.
    start : Init, optional
        For a filter that carries more than a prediction: the state before the first measurement.
    structure : Structure, optional
        The structural functions that the equations use.
    """

    name: str
    model: Model
    equations: Callable[[State, Vectors], Equations]
    start: Init | None = None
    structure: Structure | None = None

    @property
    def init(self) -> Init:
        """The state before the first measurement."""
        return self.start or initial_state(self.model)

    def with_coefficients(self, coefficients: Sequence[Sequence[Affine]]) -> Filter:
        """The filter with the coefficients of every step, in the order the equations ask for
        them."""
        steps = [self.answered(tuple(fits)) for fits in coefficients]

        def step(state: State, y: Vectors) -> State:
            if state.step >= len(steps):
                raise ValueError(
                    f"{self.name} was designed for {len(steps)} steps; design it with more to run "
                    f"step {state.step + 1}"
                )
            return steps[state.step](state, y)

        return Filter(self.name, self.model, self.init, step)

    def answered(self, fits: Sequence[Affine]) -> Advance:
        """A step of the equations, each regression answered with its stored coefficients."""

        def step(state: State, y: Vectors) -> State:
            equations = self.equations(state, y)
            try:
                next(equations)
                for fit in fits:
                    equations.send(fit)
            except StopIteration as stop:
                return stop.value
            raise ValueError("the equations ask for more regressions than were designed")

        return step
