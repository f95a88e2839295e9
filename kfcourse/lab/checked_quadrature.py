"""Normal moments where they have no closed form: Gauss-Hermite quadrature of an order that has been checked.

A function such as x/(1 + x^2) has a mean over a normal law, but no formula for it.  How many points it takes depends on how wide
the laws are that occur, and nobody knows these beforehand.  So a pilot runs the lab's filters with some order, and at each law
that they meet compares the structural functions with those of twice the order; the order is raised until both agree.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple, TypeVar

import numpy as np

from kfcourse.angles import difference
from kfcourse.filters import aof, fos, mfos
from kfcourse.laws import Array, Gaussian, Measurement, NegativeVariance
from kfcourse.montecarlo.designing import NotFinite, design
from kfcourse.montecarlo.ensemble import Ensemble, simulate
from kfcourse.montecarlo.experiment import run
from kfcourse.reasons import Reason
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.moments import NoClosedForm
from kfcourse.symbolic.quadrature import QuadratureWarning, gauss_hermite
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.structure import Structure

ORDERS = (5, 10, 20, 40, 80, 160)
# Means may change by this part of a standard deviation when the order is doubled, covariances and slopes by this part of
# themselves: root mean square over the trajectories of a step.  A prediction that is shifted by a part q of its deviation has an
# error variance other by 2 q of itself at most, 0.02 %.
CLOSE = 1e-4
RUNS, STEPS = 200, 20  # of the pilot
MOST = 400  # points together: beyond it a comparison takes hours
PIECE = 2**19  # evaluations at once: arrays of some megabytes

Law = TypeVar("Law", Gaussian, Measurement)


class Checked(NamedTuple):
    """A structure by quadrature.

    `structure` is named "gaussian", as what it computes is; `order` is its number of points an axis, `apart` the largest
    difference that the pilot found, in the measure of `CLOSE`.
    """

    structure: Structure
    order: int
    apart: float

    @property
    def says(self) -> str:
        return (
            f"no closed form: means over normal laws by Gauss-Hermite quadrature, {self.order} points an axis; on the laws of a "
            f"pilot twice as many change nothing by more than {self.apart:.0e} of a standard deviation"
        )


def of_checked_order(model: Model, why: NoClosedForm) -> Checked:
    """The Gaussian structural functions of a model for which there are no formulas, as `why` says.

    Raises
    ------
    NoClosedForm
        No order does; the message tells how far the highest one tried is from twice that order.
    """
    found = ""
    for order in ORDERS:
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore", QuadratureWarning)  # the pilot looks at more than the prior law
                coarse, fine = gauss_hermite(model, order), gauss_hermite(model, 2 * order)
                if (points := _points(model, order)) > MOST:
                    break
                apart = _apart(coarse, fine)
        except (ModelError, NotFinite, NegativeVariance, np.linalg.LinAlgError):
            continue
        if apart <= CLOSE:
            return Checked(_in_pieces(replace(coarse, name="gaussian"), max(1, PIECE // points)), order, apart)
        size = f"by {100 * apart:.2g} %" if apart < 1 else "without bound"
        found = f"; Gauss-Hermite quadrature with {order} points an axis still errs {size} on the laws that occur"
    raise NoClosedForm(Reason.of(why).reworded(f"{why}{found}"))


def _points(model: Model, order: int) -> int:
    """An upper bound of the points of a rule: over the state and the noises of one equation."""
    return order ** (model.n + max(_multiplied(model)))


def _multiplied(model: Model) -> Iterator[int]:
    """How many noises of each equation are not only added with a constant factor."""
    for equation, noises in ((model.state_equation, model.v), (model.meter_equation, model.w)):
        yield sum(equation.diff(noise).has(*model.x, *noises) for noise in noises)


def _apart(coarse: Structure, fine: Structure) -> float:
    """How far two structures are from each other at most, at the laws that filters by the first one meet."""
    model = coarse.model
    steps = int(min(STEPS, model.known.steps))
    found: list[float] = []
    watched = _watched(coarse, fine, found)
    run(aof(watched), simulate(model, RUNS, steps, seed=1).y)
    design([fos(watched), mfos(watched)], Ensemble(model, RUNS, steps, seed=1).by_step())  # type: ignore[arg-type]
    return float(np.max(found))  # NaN, if one is


def _watched(coarse: Structure, fine: Structure, found: list[float]) -> Structure:
    """The first structure; each time it is called, how far the second is from it goes into the list."""
    angles = coarse.model.angles

    def at(k: int) -> Structure:
        one, other = coarse.at(k), fine.at(k)

        def predict(z: Array, p: Array) -> Gaussian:
            (mean, cov), (tau, theta) = one.predict(z, p), other.predict(z, p)
            sd = _deviations(theta, tau)
            found.append(_mean_square(difference(mean, tau, angles.x) / sd))
            found.append(_mean_square((cov - theta) / (sd[..., :, None] * sd[..., None, :])))
            return Gaussian(mean, cov)

        def measure(m: Array, d: Array) -> Measurement:
            less, more = one.measure(m, d), other.measure(m, d)
            sd = _deviations(more.F, more.h)
            found.append(_mean_square(difference(less.h, more.h, angles.y) / sd))
            found.append(_mean_square((less.F - more.F) / (sd[..., :, None] * sd[..., None, :])))
            found.append(_mean_square((less.G - more.G) * _deviations(d, m)[..., None, :] / sd[..., :, None]))
            return less

        return replace(one, predict=predict, measure=measure)

    return Structure(coarse.name, coarse.model, coarse.predict, coarse.measure, coarse.transition, at_step=at)


def _deviations(cov: Array, mean: Array) -> Array:
    """Standard deviations; what does not vary has no size of its own but that of rounding."""
    return np.sqrt(np.maximum(np.diagonal(cov, axis1=-2, axis2=-1), 0.0)) + 1e-12 * (1 + np.abs(mean))


def _mean_square(deviation: Array) -> float:
    """The largest root mean square over trajectories of the components."""
    return float(np.sqrt((deviation**2).mean(axis=0)).max())


def _in_pieces(structure: Structure, size: int) -> Structure:
    """The structure, so many trajectories at a time: arrays over trajectories and points stay small."""

    def pieces(function: Callable[[Array, Array], Law]) -> Callable[[Array, Array], Law]:
        def computed(mean: Array, cov: Array) -> Law:
            if mean.ndim < 2 or len(mean) <= size:
                return function(mean, cov)
            covs = np.broadcast_to(cov, (*mean.shape, mean.shape[-1]))
            parts = [function(mean[i : i + size], covs[i : i + size]) for i in range(0, len(mean), size)]
            return type(parts[0])(*(np.concatenate(each) for each in zip(*parts, strict=True)))

        return computed

    def at(k: int) -> Structure:
        now = structure.at(k)
        return replace(now, predict=pieces(now.predict), measure=pieces(now.measure), at_step=None)

    if structure.at_step is None:
        return at(0)
    return replace(structure, at_step=at)
