"""Is a variant well posed, and how hard is it?  Found by a small Monte Carlo and from the formulas, not by eye.

A variant is well posed if it is

* bounded: its moments do not explode over the lab's steps, the filters stay finite, and so do trajectories when all deviations
  are `STRESS` times larger (which shows what would happen to a few of a million);
* observable: the best filter's error variance is clearly below the variance without measurements, for each component, and the
  meter, linearised along typical trajectories, sees all directions of the state;
* such that the filters differ by more than the statistical error; those of a linear variant are equal by design, and need not;
* solvable: the structural functions have a closed form of sensible length, and every question of the exercises can be posed.

`examine(variant)` gives a `Quality`, a value; `table` renders it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import joblib
import numpy as np
from tqdm import tqdm

from kfcourse.filters import Design, Filter
from kfcourse.lab.admission import admissions
from kfcourse.lab.criteria import (
    UNMEASURED,
    Finding,
    bounded,
    differences,
    kurtosis,
    measured,
    not_diverging,
    observable,
    shares,
    solvable,
    unmeasured,
)
from kfcourse.lab.difficulty import Hardness, hardness
from kfcourse.lab.short_names import LAB, Structures, has_exact, title
from kfcourse.lab.variant_tables import RUNS
from kfcourse.lab.variants import Variant
from kfcourse.laws import Array, Gaussian
from kfcourse.limits import OutOfTime, time_limit
from kfcourse.linear.system import is_linear
from kfcourse.montecarlo.batches import FEWEST
from kfcourse.montecarlo.comparison import Comparison
from kfcourse.montecarlo.designing import NotFinite
from kfcourse.montecarlo.ensemble import simulate
from kfcourse.montecarlo.experiment import compare
from kfcourse.montecarlo.parallel import cluster
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model

VECTOR = 8  # a vector model takes that much longer, and gets that many times fewer
STRESS = 1.5  # factor of all deviations
HEAVY = 20.0  # kurtosis worth a remark; 3 is the normal law's
SECONDS = 60.0  # for the derivation
FAILURES = (NotFinite, np.linalg.LinAlgError)  # a filter left the finite numbers, or a decomposition did not converge for it
NOT_EXAMINED = Finding(None, "not examined")

Ask = Callable[[Variant], Finding | None]


@dataclass(frozen=True)
class Quality:
    """What was found out about a variant.

    Attributes
    ----------
    name : str
    bounded, observable, differ, solvable : Finding
        The criteria; their values are described in `kfcourse.lab.criteria`.
    linear : bool
        Linear equations with additive noises: the filters are equal by design.
    hardness : Hardness or None
        None if there is no closed form.
    remarks, fragile : tuple of str
        Worth knowing, and no fault; and signs that another ensemble may show a fault.
    """

    name: str
    bounded: Finding
    observable: Finding
    differ: Finding
    solvable: Finding
    linear: bool = False
    hardness: Hardness | None = None
    remarks: tuple[str, ...] = ()
    fragile: tuple[str, ...] = ()

    @property
    def faults(self) -> dict[str, str]:
        """The criteria that fail, and why; not those that could not be examined.  A linear variant's filters need not differ."""
        criteria = {"bounded": self.bounded, "observable": self.observable, "solvable": self.solvable}
        if not self.linear:
            criteria["filters differ"] = self.differ
        return {name: finding.says for name, finding in criteria.items() if finding.ok is False}

    @property
    def well_posed(self) -> bool:
        return not self.faults


def examine(variant: Variant, runs: int = RUNS, seed: int = 1, ask: Ask | None = None) -> Quality:
    """Check a variant.

    Parameters
    ----------
    variant : Variant
    runs : int
        Trajectories, at least 256; a vector model gets an eighth of them.
    seed : int
    ask : callable, optional
        Variant -> the question of the exercises that cannot be posed, as a `Finding`, or None; `kfcourse.checks.posing.unposed`.

    Raises
    ------
    ValueError
        Too few trajectories.
    """
    if runs < FEWEST:
        raise ValueError(f"standard errors need at least {FEWEST} trajectories, got {runs}")
    if isinstance(variant.model, JumpModel):
        return _of_modes(variant, variant.model, runs, seed)
    model = variant.model
    structures = Structures(model)
    try:
        with time_limit(SECONDS):
            answers = solvable(structures)
    except OutOfTime:
        answers = Finding(False, f"the structural functions are not found in {SECONDS:g} s; simplify the equations")
        return Quality(variant.name, NOT_EXAMINED, NOT_EXAMINED, NOT_EXAMINED, answers)
    found = Quality(variant.name, NOT_EXAMINED, NOT_EXAMINED, NOT_EXAMINED, answers, is_linear(model))
    with np.errstate(all="ignore"):  # what diverges is told in the findings
        if answers.ok:
            found = dataclasses.replace(found, solvable=(ask(variant) if ask else None) or answers, hardness=hardness(structures))
        return _simulated(found, structures, runs if model.n == 1 else max(runs // VECTOR, FEWEST), variant.steps, seed)


def _of_modes(variant: Variant, model: JumpModel, runs: int, seed: int) -> Quality:
    """Of a model that jumps only whether its moments stay finite: the exercises know no modes."""
    with np.errstate(all="ignore"):
        moments = bounded(simulate(model, runs, int(min(variant.steps, model.steps)), seed).x)
    remark = f"has {len(model.modes)} modes: only whether it is bounded is checked, and the exercises do not ask about it"
    return Quality(variant.name, moments, NOT_EXAMINED, NOT_EXAMINED, NOT_EXAMINED, remarks=(remark,))


def _simulated(found: Quality, structures: Structures, runs: int, steps: int, seed: int) -> Quality:
    """The criteria that need trajectories, and what is remarked about them."""
    model, harsh = structures.model, _harsh(structures.model)
    filters = [one.one for one in admissions(model, LAB) if one.one]
    x = simulate(model, runs, steps, seed).x
    moments = bounded(x)
    if moments.ok and not np.isfinite(simulate(harsh, runs, steps, seed).x).all():
        rare = f"trajectories become infinite when deviations are {STRESS:g} times larger, so a few of very many will"
        moments = Finding(False, rare, moments.value)
    found = dataclasses.replace(found, bounded=moments)
    if not moments.ok or not filters:
        return found
    try:
        result = compare([*filters, unmeasured(model, x)], model, runs, steps, seed, wide=1, threads=1, progress=False)
    except FAILURES as error:
        return dataclasses.replace(found, bounded=Finding(False, str(error), moments.value))
    return dataclasses.replace(
        found,
        bounded=not_diverging(result) or moments,
        observable=observable(model, result, x),
        differ=differences(result, [one.name for one in filters if isinstance(one, Design)]),
        remarks=tuple(_remarks(model, x, found.linear)),
        fragile=tuple(_fragile(result, x, filters, harsh, seed)),
    )


def _harsh(model: Model) -> Model:
    """The model with all deviations STRESS times larger."""

    def larger(law: Gaussian) -> Gaussian:
        return Gaussian(law.mean, STRESS**2 * law.cov)

    return dataclasses.replace(
        model, prior=larger(model.prior), state_noise=larger(model.state_noise), meter_noise=larger(model.meter_noise)
    )


def _remarks(model: Model, x: Array, linear: bool) -> Iterator[str]:
    if linear:
        yield "linear: the Kalman filter is exact"
    if (x.var(axis=1)[-1] < 1e-3 * x.var(axis=1)[0]).any():
        yield "decays to a constant"
    if model.n == 1 and not has_exact(model):
        yield "no exact AOF"


def _fragile(result: Comparison, x: Array, filters: Sequence[Filter | Design], harsh: Model, seed: int) -> Iterator[str]:
    if (heavy := kurtosis(x).max()) > HEAVY:
        yield f"heavy tails (kurtosis {heavy:.0f})"
    if worse := [title(one) for one in measured(result) if shares(result, one).value.max() > 1]:
        yield f"worse than {UNMEASURED}: {', '.join(worse)}"
    try:
        compare(filters, harsh, max(result.runs // 4, FEWEST), result.steps, seed, wide=1, threads=1, progress=False)
    except FAILURES:
        yield f"a filter diverges when deviations are {STRESS:g} times larger"


def examine_all(
    variants: Sequence[Variant],
    runs: int = RUNS,
    seed: int = 1,
    jobs: int = 2,
    ask: Ask | None = None,
    dask: str | None = None,
) -> Iterator[Quality]:
    """`examine` every variant, in order, in so many processes, on which no number depends; with a progress bar.

    `dask` is the address of a Dask scheduler whose workers do it instead.
    """
    with cluster(dask) as far:
        if far is None:
            parallel = joblib.Parallel(n_jobs=max(1, min(jobs, len(variants))), return_as="generator")
            done = parallel(joblib.delayed(examine)(one, runs, seed, ask) for one in variants)
        else:
            done = far.executor.map(partial(examine, runs=runs, seed=seed, ask=ask), variants)
        yield from tqdm(done, desc="checking", total=len(variants), unit="variant", disable=None)


LEGEND = """
observable      error variance of the best filter in per cent of the variance without measurements, worst component
filters differ  the largest significant difference of two filters' error variances, relative
hardness        points: length of the formulas, degree, functions, state-dependent noise, dimension, nonlinearity"""


def table(found: Sequence[Quality]) -> str:
    """What `kfcourse variants --check` prints: a line for each variant, then why some are not well posed."""
    rows = [("variant", "bounded", "observable", "filters differ", "solvable", "hardness", "remarks"), *map(_row, found)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    reasons = [f"variant {one.name} is not well posed, {fault}: {why}" for one in found for fault, why in one.faults.items()]
    return "\n".join([*lines, LEGEND, *([""] if reasons else []), *reasons])


def _row(one: Quality) -> tuple[str, ...]:
    def cell(finding: Finding) -> str:
        return {True: "yes", False: "NO", None: "-"}[finding.ok]

    def percent(finding: Finding) -> str:
        return cell(finding) + (f" {100 * finding.value:.3g} %" if finding.value > 0 else "")

    differ = "equal" if one.linear and one.differ.ok is False else percent(one.differ)
    hard = f"{one.hardness.level} {one.hardness.score:.1f}" if one.hardness else "-"
    remarks = "; ".join(one.remarks + one.fragile)
    return one.name, cell(one.bounded), percent(one.observable), differ, cell(one.solvable), hard, remarks
