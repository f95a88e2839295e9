"""Normal moments where they have no closed form: Gauss-Hermite quadrature of an order that has been
checked.

A function such as x/(1 + x^2) has a mean over a normal law, but no formula for it.  How many points
it takes depends on how wide the laws are that occur.  So the AOF runs over a pilot's trajectories
with some order and with twice that order; the order is raised until both estimate the same.  A
model with modes has one order for all modes, each checked on trajectories of its own.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kfcourse.errors import ModelError, NoClosedForm, NotFinite
from kfcourse.filters import aof
from kfcourse.filters.exact.laws import modes_of
from kfcourse.laws import NegativeVariance
from kfcourse.montecarlo.ensemble import simulate
from kfcourse.montecarlo.experiment import run
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.quadrature import QuadratureWarning, apart, axes, gauss_hermite
from kfcourse.symbolic.structure import Structure

ORDERS = (2, 3, 5, 7, 10, 20, 40, 80, 160)
# Estimates may change by this part of their deviation when the order is doubled, variances by this
# part of themselves: root mean square over the trajectories of a step.  The error variance then
# changes by 0.02 % at most.
CLOSE = 1e-4
RUNS, STEPS = 100, 20  # of the pilot
MOST = 1500  # points together of the rule that checks: with more, a pilot takes minutes


class Checked(NamedTuple):
    """Structures by quadrature, a structure for each mode.

    They are named "gaussian", as what they compute is; `order` is their number of points an axis,
    `apart` the largest difference that the pilot found, in the measure of `CLOSE`.
    """

    structures: list[Structure]
    order: int
    apart: float

    @property
    def says(self) -> str:
        return (
            f"no closed form: means over normal laws by Gauss-Hermite quadrature, {self.order} "
            f"points an axis; on the laws of a "
            f"pilot twice as many change nothing by more than {self.apart:.0e} of a standard "
            f"deviation"
        )


def of_checked_order(model: Model | JumpModel, why: NoClosedForm) -> Checked:
    """The Gaussian structural functions of a model for which there are no formulas, as `why` says.

    Raises
    ------
    NoClosedForm
        No order does; the message tells how far the highest order tried is from twice that order.
    """
    modes = modes_of(model)
    size = max(map(axes, modes))
    problem = f"; Gauss-Hermite quadrature on {size} axes takes too long"
    for order in (order for order in ORDERS if (2 * order) ** size <= MOST):
        try:
            structures, errors = zip(*(_tried(mode, order) for mode in modes), strict=True)
        except (ModelError, NotFinite, NegativeVariance, np.linalg.LinAlgError):
            continue
        apart = float(np.max(errors))
        if apart <= CLOSE:
            return Checked([*structures], order, apart)
        error = f"by {100 * apart:.2g} %" if apart < 1 else "without bound"
        problem = (
            f"; Gauss-Hermite quadrature with {order} points an axis still errs {error} on "
            f"the laws that occur, and finer ones take too long"
        )
    raise NoClosedForm(f"{why}{problem}", why.kind, **why.parts)


def _tried(model: Model, order: int) -> tuple[Structure, float]:
    """The structure of an order, and how far it is from that of twice the order."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        # the pilot looks at more than the prior law
        warnings.simplefilter("ignore", QuadratureWarning)
        coarse = replace(gauss_hermite(model, order), name="gaussian")
        return coarse, _apart(coarse, gauss_hermite(model, 2 * order))


def _apart(coarse: Structure, fine: Structure) -> float:
    """How far the AOF by the first is from that by the second at most, in the measure of `CLOSE`;
    NaN if an estimate is."""
    model = coarse.model
    y = simulate(model, RUNS, int(min(STEPS, model.known.steps)), seed=1).y
    if not np.isfinite(y).all():
        raise NotFinite("trajectories become infinite")
    less, more = (run(aof(structure), y) for structure in (coarse, fine))
    parts = apart(less, more, model.angles.x)
    return float(np.max([np.sqrt((part**2).mean(axis=1)).max() for part in parts]))
