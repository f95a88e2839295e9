"""Normal moments where they have no closed form: Gauss-Hermite quadrature of an order that has been checked.

A function such as x/(1 + x^2) has a mean over a normal law, but no formula for it.  How many points it takes depends on how wide
the laws are that occur, and nobody knows these beforehand.  So a pilot runs the lab's filters with some order, and at each law
that they meet compares the structural functions with those of twice the order; the order is raised until both agree.  A
model with modes has one order for all modes without formulas, checked on the laws of filters with modes and of averaged ones.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple, TypeVar

import numpy as np

from kfcourse.angles import difference
from kfcourse.filters import aof, fos, imm, logic_dynamic, logic_dynamic_fos, mfos
from kfcourse.laws import Array, Gaussian, Measurement, NegativeVariance
from kfcourse.montecarlo.designing import NotFinite, design
from kfcourse.montecarlo.ensemble import Ensemble, simulate
from kfcourse.montecarlo.experiment import run
from kfcourse.symbolic.averaging import averaged
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.moments import NoClosedForm
from kfcourse.symbolic.quadrature import QuadratureWarning, axes, gauss_hermite
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.structure import Structure, gaussian

ORDERS = (2, 3, 5, 7, 10, 20, 40, 80, 160)
# Means may change by this part of a standard deviation when the order is doubled, covariances and slopes by this part of
# themselves: root mean square over the trajectories of a step.  A prediction that is shifted by a part q of its deviation has an
# error variance other by 2 q of itself at most, 0.02 %.
CLOSE = 1e-4
RUNS, STEPS = 100, 20  # of the pilot
MOST = 200  # points together: with more, 5,000 trajectories take a quarter of an hour (343 points, D3)
PIECE = 2**15  # evaluations at once: arrays that a processor's cache holds

Law = TypeVar("Law", Gaussian, Measurement)


class Checked(NamedTuple):
    """Structures by quadrature, of each mode one; where a mode has formulas they are these.

    They are named "gaussian", as what they compute is; `order` is their number of points an axis, `points` that of all, `apart`
    the largest difference that the pilot found, in the measure of `CLOSE`.
    """

    structures: list[Structure]
    order: int
    points: int
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
    known = [_formulas(mode) for mode in modes]
    size = max(axes(mode) for mode, formulas in zip(modes, known, strict=True) if formulas is None)
    found = ""
    for order in ORDERS:
        if (points := order**size) > MOST:
            found += f"; {order} points on each of {size} axes are {points}, more than the {MOST} with which a comparison ends"
            break
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore", QuadratureWarning)  # the pilot looks at more than the prior law
                coarse, fine = (
                    [formulas or gauss_hermite(mode, n) for mode, formulas in zip(modes, known, strict=True)]
                    for n in (order, 2 * order)
                )
                apart = _apart(model, coarse, fine)
        except (ModelError, NotFinite, NegativeVariance, np.linalg.LinAlgError):
            continue
        if apart <= CLOSE:
            named = [one if one.formulas else replace(one, name="gaussian") for one in coarse]
            return Checked([_in_pieces(one, max(1, PIECE // points)) for one in named], order, points, apart)
        error = f"by {100 * apart:.2g} %" if apart < 1 else "without bound"
        found = f"; Gauss-Hermite quadrature with {order} points an axis still errs {error} on the laws that occur"
    raise NoClosedForm(f"{why}{found}", why.kind, **why.parts)


def _formulas(model: Model) -> Structure | None:
    try:
        return gaussian(model)
    except NoClosedForm:
        return None


def _apart(model: Model | JumpModel, coarse: Sequence[Structure], fine: Sequence[Structure]) -> float:
    """How far structures are from others at most, at the laws that filters by the first ones meet; of no use beyond `CLOSE`."""
    found: list[float] = []
    for _ in _meeting(model, [_watched(one, other, found) for one, other in zip(coarse, fine, strict=True)]):
        if not np.max(found) <= CLOSE:
            break
    return float(np.max(found))  # NaN, if one is


def _meeting(model: Model | JumpModel, structures: list[Structure]) -> Iterator[None]:
    """Shows the structures the laws that they meet in the lab: the prior law, then those of the filters; stops after each."""
    steps = int(min(STEPS, model.steps if isinstance(model, JumpModel) else model.known.steps))
    for one in structures:
        one.at(0).measure(model.prior.mean[None], model.prior.cov)
    yield
    y, designing = simulate(model, RUNS, steps, seed=1).y, Ensemble(model, RUNS, steps, seed=1)  # type: ignore[arg-type]
    if not np.isfinite(y).all():
        raise NotFinite("trajectories become infinite")
    if not isinstance(model, JumpModel):
        run(aof(structures[0]), y)
        yield
        design([fos(structures[0]), mfos(structures[0])], designing)
        yield
        return
    for filter_of in (logic_dynamic, imm):  # the laws of pairs, of GPB2, are narrower
        run(filter_of(structures, model, model.first), y)
        yield
    with suppress(ModelError):  # angles, transitions that depend on the state: there are no such filters
        one = averaged(model, structures)
        run(aof(one), y)
        yield
        with suppress(NotFinite):  # of modes where hardly anybody is
            design([logic_dynamic_fos(model, structures), fos(one), mfos(one)], designing)
            yield


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

    return replace(coarse, at_step=at)


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
