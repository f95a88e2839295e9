"""Is a variant well posed?  Found by a small Monte Carlo and from the formulas, not by eye.

A variant is well posed if it is

* bounded: its moments do not explode over the lab's steps, the filters stay finite, and so do
  trajectories when all deviations are `STRESS` times larger (a few of a million are as large);
* observable: the best filter's error variance is clearly below the variance without measurements,
  for each component;
* such that the filters differ by more than the statistical error; those of a linear variant are
  equal by design, and need not;
* solvable: the structural functions have a closed form of sensible length, and every question of
  the exercises can be posed.

`examine(variant)` gives a `Quality`, a value; `table` renders it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import joblib
import numpy as np
from tqdm import tqdm

from kfcourse.errors import NoClosedForm, NotFinite
from kfcourse.lab.admission import admissions, aligned
from kfcourse.lab.short_names import LAB, Structures, operations, title
from kfcourse.lab.variants import RUNS, Variant
from kfcourse.laws import Array
from kfcourse.limits import OutOfTime, time_limit
from kfcourse.linear.system import is_linear
from kfcourse.montecarlo import FEWEST
from kfcourse.montecarlo.comparison import Comparison
from kfcourse.montecarlo.ensemble import simulate
from kfcourse.montecarlo.experiment import compare
from kfcourse.montecarlo.statistics import ratio
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model

VECTOR = 8  # a vector model takes that much longer, and gets that many times fewer trajectories
STRESS = 1.5  # factor of all deviations
SECONDS = 60.0  # for the derivation
GROWTH = 10.0  # of a second moment over the second half of the steps: an unknown velocity has 4
CARRIERS = 10.0  # trajectories, at least, that carry a second moment
DIVERGED = 10.0  # a filter's error variance over that without measurements
# the best filter's error variance over that without measurements, when the meter tells too little
UNSEEN = 0.9
LONGEST = 600  # operations of the Gaussian structural functions; the van der Pol oscillator has 309
CRITERIA = ("bounded", "observable", "filters differ", "solvable")


class Finding(NamedTuple):
    """One criterion: whether it holds, a sentence, and what was measured (NaN if nothing).

    `ok` is None if it could not be examined, because another criterion fails.
    """

    ok: bool | None
    says: str
    value: float = float("nan")


NOT_EXAMINED = Finding(None, "not examined")
Ask = Callable[[Variant], Finding | None]


@dataclass(frozen=True)
class Quality:
    """What was found out about a variant: a finding for each criterion that was examined.

    `linear`: linear equations with additive noises; the filters are equal by design.
    """

    name: str
    findings: Mapping[str, Finding]
    linear: bool = False
    remarks: tuple[str, ...] = ()

    @property
    def faults(self) -> dict[str, str]:
        """The criteria that fail, and why; a linear variant's filters need not differ."""
        return {
            name: finding.says
            for name, finding in self.findings.items()
            if finding.ok is False and not (self.linear and name == "filters differ")
        }

    @property
    def well_posed(self) -> bool:
        return not self.faults


def examine(variant: Variant, runs: int = RUNS, seed: int = 1, ask: Ask | None = None) -> Quality:
    """Check a variant.

    Parameters
    ----------
    variant : Variant
    runs : int
        Trajectories, at least 128; a vector model gets an eighth of them.
    seed : int
    ask : callable, optional
        Variant -> the question of the exercises that cannot be posed, as a `Finding`, or None;
        `kfcourse.exercises.checks.posing.unposed`.
    """
    model = variant.model
    with np.errstate(all="ignore"):  # what diverges is said in the findings
        if isinstance(model, JumpModel):
            moments = bounded(simulate(model, runs, int(min(variant.steps, model.steps)), seed).x)
            remark = f"has {len(model.modes)} modes: only whether it is bounded is checked"
            return Quality(variant.name, {"bounded": moments}, remarks=(remark,))
        try:
            with time_limit(SECONDS):
                answers = solvable(Structures(model))
        except OutOfTime:
            late = (
                f"the structural functions are not found in {SECONDS:g} s; simplify the equations"
            )
            return Quality(variant.name, {"solvable": Finding(False, late)})
        if answers.ok and ask:
            answers = ask(variant) or answers
        x = simulate(
            model, runs if model.n == 1 else max(runs // VECTOR, FEWEST), variant.steps, seed
        ).x
        linear = model.between is None and is_linear(model)
        remarks = ["linear: the Kalman filter is exact"] * linear
        if (x.var(axis=1)[-1] < 1e-3 * x.var(axis=1)[0]).any():
            remarks.append("decays to a constant")
        findings = _simulated(model, x, seed) | {"solvable": answers}
        return Quality(variant.name, findings, linear, tuple(remarks))


def _simulated(model: Model, x: Array, seed: int) -> dict[str, Finding]:
    """The criteria that need trajectories x (steps, runs, n)."""
    steps, runs = x.shape[:2]
    filters = [answer.built for answer in admissions(model, LAB) if answer.built]
    moments = bounded(x)
    if moments.ok:
        laws = {name: getattr(model, name) for name in ("prior", "state_noise", "meter_noise")}
        larger = {name: law._replace(cov=STRESS**2 * law.cov) for name, law in laws.items()}
        far = simulate(dataclasses.replace(model, **larger), runs, steps, seed).x
        if not np.isfinite(far).all():
            rare = f"trajectories become infinite when deviations are {STRESS:g} times larger"
            moments = Finding(False, f"{rare}, so a few of very many will", moments.value)
    if not moments.ok or not filters:
        return {"bounded": moments}
    try:
        result = compare(filters, model, runs, steps, seed, jobs=1, progress=False)
        failure = next(iter(result.left_out.values()), "")
    except NotFinite as error:
        failure = error
    if failure:
        return {"bounded": Finding(False, str(failure), moments.value)}
    return {
        "bounded": not_diverging(result, x) or moments,
        "observable": observable(result, x),
        "filters differ": differences(result),
    }


def examine_all(
    variants: Sequence[Variant],
    runs: int = RUNS,
    seed: int = 1,
    jobs: int = 2,
    ask: Ask | None = None,
) -> Iterator[Quality]:
    """`examine` every variant, in order, in so many processes, on which no number depends."""
    parallel = joblib.Parallel(n_jobs=jobs, return_as="generator")
    done = parallel(joblib.delayed(examine)(variant, runs, seed, ask) for variant in variants)
    yield from tqdm(done, desc="checking", total=len(variants), unit="variant", disable=None)


LEGEND = """
observable
    error variance of the best filter, % of the variance without measurements, worst component
filters differ  the largest significant difference of two filters' error variances, relative"""


def table(qualities: Sequence[Quality]) -> str:
    """What `kfcourse variants --check` prints: a line for each variant, then what is not well
    posed."""
    rows = [("variant", *CRITERIA, "remarks"), *map(_row, qualities)]
    reasons = [
        f"variant {quality.name} is not well posed, {fault}: {why}"
        for quality in qualities
        for fault, why in quality.faults.items()
    ]
    return "\n".join([*aligned(rows), LEGEND, *([""] if reasons else []), *reasons])


def _row(quality: Quality) -> tuple[str, ...]:
    cells = []
    for name in CRITERIA:
        ok, _, value = quality.findings.get(name, NOT_EXAMINED)
        equal = name == "filters differ" and quality.linear and not ok
        cell = "equal" if equal else {True: "yes", False: "NO", None: "-"}[ok]
        if name in ("observable", "filters differ") and value > 0:
            cell += f" {100 * value:.3g} %"
        cells.append(cell)
    return quality.name, *cells, "; ".join(quality.remarks)


def bounded(x: Array) -> Finding:
    """Whether the second moments of trajectories x (steps, runs, n) stay in bounds.  Value: their
    growth.

    The maximum of M x_k^2 over the second half of the steps is at most GROWTH times that over the
    first half, for every component; and the sum of squared deviations u = x - M x is not that of a
    few trajectories,
    (sum u^2)^2 / sum u^4 >= CARRIERS.
    """
    finite = np.isfinite(x**4).all(axis=(1, 2))
    if not finite.all():
        when = f"trajectories become infinite (step {int(np.argmin(finite))})"
        return Finding(False, when, float("inf"))
    square, half = (x**2).mean(axis=1), (len(x) + 1) // 2
    # of a single step 0
    growth = float(
        ratio(square[half:].max(axis=0, initial=0.0), square[:half].max(axis=0), 0.0).max()
    )
    grows = (
        f"the second moment grows {growth:.3g} times from the first half of the steps to the second"
    )
    u = x - x.mean(axis=1, keepdims=True)
    carriers = ratio((u**2).sum(axis=1) ** 2, (u**4).sum(axis=1), CARRIERS)[varies(x)].min(
        initial=np.inf
    )
    few = (
        f"the second moment is that of {carriers:.1f} trajectories of {x.shape[1]}: too heavy tails"
    )
    fits = carriers >= CARRIERS or growth > GROWTH
    return Finding(growth <= GROWTH and fits, grows if fits else few, growth)


def varies(x: Array) -> Array:
    """Whether a component of x (steps, runs, n) varies at a step, by more than rounding: (steps,
    n)."""
    return np.asarray(x.std(axis=1) > 1e-12 * np.abs(x).max(axis=1))


def shares(result: Comparison, x: Array) -> Array:
    """Error variances of the filters over those of trajectories x (steps, runs, n), which no
    measurement makes smaller: means over the steps at which a component varies, (filters, n)."""
    used = varies(x)
    errors = np.stack([result.component_variance(name).value for name in result.names])
    each = np.where(used, ratio(errors, x.var(axis=1), 0.0), 0.0)
    return np.asarray(each.sum(axis=1) / np.maximum(used.sum(axis=0), 1))


def not_diverging(result: Comparison, x: Array) -> Finding | None:
    """The filter that is DIVERGED times worse than no measurements; None if there is none."""
    worst, name = max(zip(shares(result, x).max(axis=1), result.names, strict=True))
    if worst <= DIVERGED:
        return None
    claim = f"its error variance is {worst:.3g} times that without measurements"
    return Finding(False, f"{title(name)} diverges: {claim}", float(worst))


def observable(result: Comparison, x: Array) -> Finding:
    """Whether the meter tells something about every component of the state.  Value: the worst
    component's share.

    The share of the best filter, see `shares`, is below UNSEEN.
    """
    best, names = shares(result, x).min(axis=0), result.model.x
    constant = ~varies(x).any(axis=0)
    if constant.any():
        still = f"{names[int(np.argmax(constant))]} does not vary, there is nothing to estimate"
        return Finding(False, still)
    worst = int(np.argmax(best))
    left = f"the best filter leaves {100 * best[worst]:.3g} % of the variance of {names[worst]}"
    ok = bool(best[worst] < UNSEEN)
    return Finding(ok, left if ok else f"the meter hardly tells: {left}", float(best[worst]))


def differences(result: Comparison) -> Finding:
    """Whether the least accurate filter is significantly worse than the most accurate at some step
    (`Comparison.verdicts`).  Value: the largest such difference over the error variance of the
    control."""
    control = result.error_variance(result.control).value
    gaps = [
        (float(result.difference(worst, best).value[k] / control[k]), title(best), title(worst), k)
        for k, (best, _, worst) in enumerate(result.verdicts())
        if worst
    ]
    if not gaps:
        error = f"the statistical error of {result.runs} trajectories"
        return Finding(False, f"no two filters differ by more than {error}", 0.0)
    largest, best, worst, k = max(gaps)
    says = f"{best} and {worst} differ by {100 * largest:.2g} % at step {k}"
    return Finding(True, says, largest)


def solvable(structures: Structures) -> Finding:
    """Whether the structural functions have a closed form of sensible length.  Value: operations of
    the Gaussian ones."""
    try:
        count = operations(structures.gaussian)
        _ = structures.linearised
    except NoClosedForm as error:
        return Finding(False, str(error))
    says = f"closed form, {count} operations in the Gaussian structural functions"
    too_long = f", more than {LONGEST}" if count > LONGEST else ""
    return Finding(not too_long, says + too_long, float(count))
