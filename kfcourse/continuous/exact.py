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
# |u| below which phi is its series, to 1e-17; the closed form is right to 1e-12 above, and loses
# digits below
SMALL = sp.Rational(1, 50)
COUNTS = tuple(2**i for i in range(10))  # of sub-steps between two measurements


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
    substeps : int
        That led there.
    """

    posterior: PointMass
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

    An interval gets so many sub-steps that mean and deviation of no posterior behind it err by more
    than the accuracy, in deviations.  What half of them change tells; the stated error takes it for
    twice what is left, or three times.

    Raises
    ------
    ModelError
        As `pointmass`.
    Unresolved
        When it runs: as `pointmass`, or an interval that needs more sub-steps than the last of
        `COUNTS`.
    """
    moves, symbols = normal_step(model), (*model.known.symbols, H)
    # what is left of the first order is what the last halving changed, of the second a third of it
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

    def moved(state: State, y: Array, substeps: int) -> State:
        """By so many sub-steps to the next measurement, and corrected by it."""
        inner, nothing = at(state.step, substeps), np.full_like(y, np.nan)
        now = state._replace(step=min(state.step, 1), memory=state.memory.posterior)
        for _ in range(substeps - 1):
            now = inner.step(now, nothing)
        return inner.step(now, y)

    def init(runs: int) -> State:
        start = exact.init(runs)
        return start._replace(memory=Underway(start.memory, 0))

    def step(state: State, y: Array) -> State:
        coarse, reason = None, ""
        for substeps in COUNTS if state.step else (0,):
            try:
                fine = moved(state, y, substeps)
            except Unresolved as why:  # sub-steps may be so long that their laws are none
                coarse, reason = None, why.parts["reason"]
                continue
            coarse = fine if substeps == 0 else coarse
            if coarse:
                error = doubt * apart(coarse.posterior, fine.posterior, model.angles.x)
                if error.max() <= 2 * accuracy:
                    posterior = fine.memory._replace(error=fine.memory.error + error)
                    return fine._replace(step=state.step + 1, memory=Underway(posterior, substeps))
            coarse, reason = fine, "they are too few"
        raise Unresolved(
            f"step {state.step} of {model}, by {substeps} sub-steps: {reason}; leave the exact "
            f"filter out"
        )

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
