r"""The exact filter of a scalar object in continuous time, by sub-steps of the exact filter.

    dx = a(x, t) dt + B(x, t) dw,    b = B^2

Over a short h the law of x' given x is nearly normal.  With u = a' h, where ' is d/dx, and the
coefficients in the middle of h,

    M x' = x + h a phi_1(u) + h^2 b a'' phi_2(u) / 2,     phi_1(u) = (e^u - 1) / u
    D x' = h b(x + h a / 2) phi_1(2 u) + h^2 b b'' / 4,   phi_2(u) = (e^u - 1 - u) / u^2

are right to h^2, and exact for a linear object (local linearisation; T. Ozaki 1992, I. Shoji and
T. Ozaki 1998).  The third cumulant is h^3 b^2 a'' where B is constant, so the law at the end of an
interval errs with h^2; where B depends on x, the cumulant is of the order h^2, and the law errs
with h.  Twice as many sub-steps tell by how much.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import sympy as sp

from kfcourse.angles import Components, difference
from kfcourse.filters.base import Filter, State
from kfcourse.filters.exact.laws import printed
from kfcourse.filters.exact.pointmasses import Exact, PointMass, Unresolved
from kfcourse.laws import Array, Gaussian
from kfcourse.symbolic.known import Known
from kfcourse.symbolic.model import Model

H = sp.Symbol("length of a sub-step", positive=True)
SMALL = sp.Rational(1, 50)  # |u| below which phi is its series, to 1e-13 of it
MOST = 512  # sub-steps between two measurements


def normal_step(model: Model) -> Model:
    """The difference equation of a sub-step of the length H."""
    x, v = model.x[0], model.v[0]
    a, b = model.between.drift[0], sum(entry**2 for entry in model.between.diffusion)
    slope, u = a.diff(x), a.diff(x) * H
    mean = x + H * a * phi(1, u) + H**2 * b * slope.diff(x) * phi(2, u) / 2
    middle = b.subs(x, x + H * a / 2)
    variance = H * middle * phi(1, 2 * u) + H**2 * b * b.diff(x, 2) / 4
    equation = sp.ImmutableMatrix([mean + sp.sqrt(variance) * v])
    noise = Gaussian(np.zeros(1), np.eye(1))
    return replace(model, state_equation=equation, v=(v,), state_noise=noise, between=None)


def phi(order: int, u: sp.Expr) -> sp.Expr:
    """The exponential of u without its first terms, divided by u^order."""
    series = sum(u**i / sp.factorial(i + order) for i in range(7))
    if u == 0:
        return series
    closed = (sp.exp(u) - sum(u**i / sp.factorial(i) for i in range(order))) / u**order
    return sp.Piecewise((series, sp.Abs(u) < SMALL), (closed, True))


class Underway(NamedTuple):
    """What the filter remembers.

    Attributes
    ----------
    posterior : PointMass
        At the last measurement.
    ahead, coarse : State
        A sub-step before the next one; and a sub-step of twice the length before it.
    substeps : int
        From one to the other.
    """

    posterior: PointMass
    ahead: State
    coarse: State
    substeps: int

    @property
    def error(self) -> Array:
        """As of `PointMass`, (runs,): that of all sub-steps is in it."""
        return self.posterior.error

    def discretisation_error(self) -> Array:
        """Estimated error of the posterior means, (runs,), in the units of x."""
        return self.posterior.discretisation_error()

    def density(self, run: int) -> tuple[Array, Array]:
        """As of `PointMass`."""
        return self.posterior.density(run)

    def drawn(self, number: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """As of `PointMass`."""
        return self.posterior.drawn(number, rng)


def by_substeps(
    model: Model, accuracy: float, clock: Callable[[int], tuple[float, Callable[[float], Array]]]
) -> Filter:
    """The exact filter of a scalar model with `between`; the clock says how long an interval is,
    and what is known in it.

    An interval gets so many sub-steps that half of them change the predicted mean and deviation of
    no trajectory by more than the accuracy, in deviations; what they change of the posteriors is in
    the stated error.

    Raises
    ------
    ModelError
        As `pointmass`.
    Unresolved
        When it runs: as `pointmass`, or an interval that needs more than `MOST` sub-steps.
    """
    moves, symbols = normal_step(model), (*model.known.symbols, H)
    # of the first order the rest is as large as what the last halving changed; of the second less
    doubt = 2 if model.between.diffusion.has(*model.x) else 1
    exact = Exact(moves, printed(replace(moves, known=Known(symbols))), accuracy)

    def at(k: int, substeps: int) -> Exact:
        """The sub-steps from t_{k-1} to t_k, and behind them the meter of t_k."""
        span, now = clock(max(k - 1, 0))
        h = span / max(substeps, 1)
        end = model.known.at(k) if k < model.known.steps else now(span)
        rows = [*([*now((i + 0.5) * h), h] for i in range(substeps)), [*end, h]]
        inputs = {s.name: row for s, row in zip(symbols, zip(*rows, strict=True), strict=True)}
        return replace(exact, model=replace(moves, known=Known(symbols, inputs=inputs)))

    def foreseen(k: int, start: State, substeps: int) -> State:
        """All sub-steps to t_k but the last, and what this would lead to as its prediction."""
        inner, state = at(k, substeps), start._replace(step=1)
        nothing = np.full((len(start.posterior.mean), 1), np.nan)
        for _ in range(substeps - 1):
            state = inner.step(state, nothing)
        return state._replace(predicted=inner.step(state, nothing).posterior)

    def ahead(k: int, start: State) -> Underway:
        coarse, substeps = None, 1
        while substeps <= MOST:
            try:
                fine = foreseen(k, start, substeps)
            except Unresolved:  # sub-steps so long that their laws are none
                fine = None
            if coarse and fine:
                error = doubt * apart(coarse.predicted, fine.predicted, model.angles.x)
                if error.max() <= accuracy:
                    return Underway(start.memory, fine, coarse, substeps)
            coarse, substeps = fine, 2 * substeps
        raise Unresolved("", reason=f"{MOST} sub-steps to the next measurement are too few")

    def init(runs: int) -> State:
        start = exact.init(runs)
        return start._replace(memory=Underway(start.memory, start, start, 0))

    def step(state: State, y: Array) -> State:
        k, memory = state.step, state.memory
        try:
            now, rough = (
                at(k, substeps).step(before._replace(step=substeps), y)
                for before, substeps in (
                    (memory.ahead, memory.substeps),
                    (memory.coarse, memory.substeps // 2),
                )
            )
            error = now.memory.error + doubt * apart(rough.posterior, now.posterior, model.angles.x)
            now = now._replace(memory=now.memory._replace(error=error))
            after = ahead(k + 1, now)
        except Unresolved as why:
            raise Unresolved(
                f"step {k} of {model}: {why.parts['reason']}; leave the exact filter out"
            ) from None
        return State(k + 1, now.posterior, after.ahead.predicted, after)

    return Filter("aof-exact", model, init, step, evidence=evidence, drawn=True)


def evidence(before: State, y: Array, after: State) -> Array:
    """ln p(y_k | y_0, ..., y_{k-1}), (runs,)."""
    return after.memory.posterior.log_likelihood


def apart(first: Gaussian, second: Gaussian, angles: Components) -> Array:
    """How far the means and deviations of two scalar laws differ, (runs,), in deviations of the
    second."""
    scale = np.sqrt(first.cov / second.cov)[:, 0, 0]
    moved = difference(first.mean, second.mean, angles) / np.sqrt(second.cov[:, 0])
    return np.abs(moved[:, 0]) + np.abs(scale - 1)
