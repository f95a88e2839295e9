"""Normal moments where they have no closed form: Gauss-Hermite quadrature of an order that has been checked.

A function such as x/(1 + x^2) has a mean over a normal law, but no formula for it.  How many points
it takes depends on how wide the laws are that occur.  So a pilot runs the AOF with some order, and
at the laws that it meets compares the structural functions with those of twice the order; the order
is raised until both agree.  A model with modes has one order for all modes without formulas, each
checked on trajectories of its own.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kfcourse.angles import difference
from kfcourse.errors import ModelError, NoClosedForm, NotFinite
from kfcourse.filters import aof
from kfcourse.laws import Array, NegativeVariance
from kfcourse.montecarlo.ensemble import simulate
from kfcourse.montecarlo.experiment import run
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.quadrature import QuadratureWarning, axes, gauss_hermite
from kfcourse.symbolic.structure import Structure, gaussian

ORDERS = (2, 3, 5, 7, 10, 20, 40, 80, 160)
# Means may change by this part of a standard deviation when the order is doubled, covariances by
# this part of themselves: root mean square over the trajectories of a step.  A prediction that is
# shifted by a part q of its deviation has an error variance other by 2 q of itself at most, 0.02 %.
CLOSE = 1e-4
RUNS, STEPS = 100, 20  # of the pilot
MOST = 200  # points together: with more, a comparison takes a quarter of an hour (343 points, D3)


class Checked(NamedTuple):
    """Structures by quadrature, of each mode one; where a mode has formulas they are these.

    They are named "gaussian", as what they compute is; `order` is their number of points an axis,
    `apart` the largest difference that the pilot found, in the measure of `CLOSE`.
    """

    structures: list[Structure]
    order: int
    apart: float

    @property
    def says(self) -> str:
        return (
            f"no closed form: means over normal laws by Gauss-Hermite quadrature, {self.order} points an axis; on the laws of a "
            f"pilot twice as many change nothing by more than {self.apart:.0e} of a standard deviation"
        )


def of_checked_order(model: Model | JumpModel, why: NoClosedForm) -> Checked:
    """The Gaussian structural functions of a model for which there are no formulas, as `why` says.

    Raises
    ------
    NoClosedForm
        No order does; the message tells how far the highest one tried is from twice that order.
    """
    modes = model.modes if isinstance(model, JumpModel) else (model,)
    structures = [_formulas(mode) for mode in modes]
    without = [j for j, structure in enumerate(structures) if structure is None]
    size = max(axes(modes[j]) for j in without)
    found = ""
    for order in ORDERS:
        if (points := order**size) > MOST:
            found += f"; {order} points on each of {size} axes are {points}, more than the {MOST} with which a comparison ends"
            break
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore", QuadratureWarning)  # the pilot looks at more than the prior law
                coarse = {j: replace(gauss_hermite(modes[j], order), name="gaussian") for j in without}
                apart = float(np.max([_apart(one, gauss_hermite(one.model, 2 * order)) for one in coarse.values()]))
        except (ModelError, NotFinite, NegativeVariance, np.linalg.LinAlgError):
            continue
        if apart <= CLOSE:
            whole = [structure or coarse[j] for j, structure in enumerate(structures)]
            return Checked(whole, order, apart)
        error = f"by {100 * apart:.2g} %" if apart < 1 else "without bound"
        found = f"; Gauss-Hermite quadrature with {order} points an axis still errs {error} on the laws that occur"
    raise NoClosedForm(f"{why}{found}", why.kind, **why.parts)


def _formulas(model: Model) -> Structure | None:
    try:
        return gaussian(model)
    except NoClosedForm:
        return None


def _apart(coarse: Structure, fine: Structure) -> float:
    """How far structures are from finer ones at most, at the laws that the AOF by the first meets."""
    model, distances = coarse.model, []
    steps = int(min(STEPS, model.known.steps))
    y = simulate(model, RUNS, steps, seed=1).y
    if not np.isfinite(y).all():
        raise NotFinite("trajectories become infinite")
    laws = run(aof(coarse), y)
    mean, cov = np.broadcast_to(model.prior.mean, laws.mean[0].shape), model.prior.cov
    for k in range(steps):
        less, more = coarse.at(k).measure(mean, cov), fine.at(k).measure(mean, cov)
        sd = _deviations(more.F, more.h)
        distances.append(_mean_square(difference(less.h, more.h, model.angles.y) / sd))
        distances.append(_mean_square((less.F - more.F) / (sd[..., :, None] * sd[..., None, :])))
        slope = (less.G - more.G) * _deviations(cov, mean)[..., None, :]
        distances.append(_mean_square(slope / sd[..., :, None]))
        (mean, cov), (tau, theta) = (one.at(k).predict(laws.mean[k], laws.cov[k]) for one in (coarse, fine))
        sd = _deviations(theta, tau)
        distances.append(_mean_square(difference(mean, tau, model.angles.x) / sd))
        distances.append(_mean_square((cov - theta) / (sd[..., :, None] * sd[..., None, :])))
    return float(np.max(distances))  # NaN, if one is: no order is close then


def _deviations(cov: Array, mean: Array) -> Array:
    """Standard deviations; what does not vary has no size of its own but that of rounding."""
    return np.sqrt(np.maximum(np.diagonal(cov, axis1=-2, axis2=-1), 0.0)) + 1e-12 * (1 + np.abs(mean))


def _mean_square(deviation: Array) -> float:
    """The largest root mean square over trajectories of the components."""
    return float(np.sqrt((deviation**2).mean(axis=0)).max())
