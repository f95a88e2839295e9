"""Which filter may I use?  For a model and each filter: whether it can be built, and what is known of it before any comparison.

A filter is refused if it cannot be built: no closed form, equations that cannot be differentiated, a vector state.  It is
warned of if it can be built and will not do: points that do not integrate the equations or do not see a noise, a slope that is
zero, a meter so sharp that hardly a particle survives, and what leaves the finite numbers on a trial.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass

import numpy as np

from kfcourse.errors import NoClosedForm, NotFinite, Reason, Refused
from kfcourse.filters import Design, Filter, pointmass
from kfcourse.filters.particles import particle
from kfcourse.lab.checked_quadrature import Checked
from kfcourse.lab.short_names import FILTERS, JUMP_FILTERS, OF_BEST, JumpStructures, Structures, check_names, has_exact, title
from kfcourse.limits import OutOfTime, time_limit
from kfcourse.montecarlo.ensemble import simulate
from kfcourse.montecarlo.experiment import compare
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.quadrature import QuadratureWarning, gauss_hermite, unscented
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.structure import Structure

RUNS, STEPS, SLOW = 512, 20, 16  # of a trial; trajectories of a slow filter
PARTICLES, FEW, OFTEN = 1000, 10.0, 0.05  # fewer effective particles than FEW at so many corrections are too few
SOME = 32  # trajectories, with some 600 corrections, that tell how often
BLIND = 0.5  # of the unexplained variance, that must be seen


@dataclass(frozen=True)
class Admission:
    """What is known of a filter for a model.

    Attributes
    ----------
    name : str
        Short name.
    one : Filter or Design or None
        None if it cannot be built.
    reason : str or Exception
        Why not; empty if it can.
    warnings : tuple of str
        Why it will not do well, or not at all.
    remarks : tuple of str
        Worth knowing.
    """

    name: str
    one: Filter | Design | None
    reason: Reason = ""
    warnings: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """Whether it may be used: "yes", "no", or "poor" if it can be built, but there are warnings."""
        return "no" if self.one is None else "poor" if self.warnings else "yes"

    @property
    def says(self) -> str:
        return "; ".join([str(self.reason)] if self.reason else [*self.warnings, *self.remarks])


def admissions(
    model: Model | JumpModel,
    names: Sequence[str] | None = None,
    seconds: float | None = None,
    known: Sequence[Admission] = (),
) -> list[Admission]:
    """Which of the filters, all by default, can be built for the model, and what to know of them; each as the lab builds it.

    With `seconds`, the formulas of each must be derived in that time.  What is `known` of a filter is not found out again.

    Raises
    ------
    ValueError
        An unknown name; the message lists the known ones.
    """
    there = JUMP_FILTERS if isinstance(model, JumpModel) else FILTERS
    names = list(there if names is None else names)
    check_names(names, there)
    structures = JumpStructures(model) if isinstance(model, JumpModel) else Structures(model)
    found = {one.name: one for one in known}
    # filters with the same structural functions share the time
    too_long = {_kind(one.name): one.reason for one in known if getattr(one.reason, "kind", "") == "too_long"}
    for name in names:
        if name in found:
            continue
        if (reason := too_long.get(_kind(name))) is None:
            try:
                with nullcontext() if seconds is None else time_limit(seconds):
                    found[name] = _admitted(name, structures)
                continue
            except OutOfTime:
                reason = too_long[_kind(name)] = Refused(_TOO_LONG.format(seconds), "too_long", seconds=f"{seconds:g}")
        found[name] = Admission(name, None, reason)
    return [found[name] for name in dict.fromkeys(names)]


def _kind(name: str) -> str:
    """Which structural functions a filter takes, by its name."""
    return name.split("-")[-1]


_TOO_LONG = (
    "its formulas are not derived within {:g} s, as the model's are too long; simplify them, or take filters without formulas, "
    "aof-unscented and duof"
)


def _admitted(name: str, structures: Structures | JumpStructures) -> Admission:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", QuadratureWarning)
        try:
            if isinstance(structures, JumpStructures):
                one = JUMP_FILTERS[name].build(structures)
                return Admission(name, one, remarks=tuple(_with_modes(name, structures)))
            one = FILTERS[name].build(structures)
        except (NoClosedForm, ModelError) as error:
            return Admission(name, None, error.with_traceback(None))
    found = [str(warning.message) for warning in caught]
    with np.errstate(all="ignore"):
        found += [text for kind, look in _LOOKS.items() if kind in name for text in look(structures)]
        remarks = [text for kind, look in _REMARKS.items() if name.endswith(kind) and not found for text in look(structures)]
    return Admission(name, one, "", tuple(found), tuple(remarks))


def on_trial(model: Model | JumpModel, found: Sequence[Admission]) -> list[Admission]:
    """The same after a small comparison: a filter that leaves the finite numbers, or a slow one that fails, is warned of."""
    last = int(min(STEPS, model.steps if isinstance(model, JumpModel) else model.known.steps))
    tried = []
    for one in found:
        failure = _failure(model, one.one, last) if one.one else ""
        tried.append(dataclasses.replace(one, warnings=(*one.warnings, failure)) if failure else one)
    return tried


def _failure(model: Model | JumpModel, one: Filter | Design, steps: int) -> str:
    """What goes wrong on a few hundred trajectories; empty if nothing."""
    runs = SLOW if one.slow else RUNS
    try:
        compare([one], model, runs, steps, seed=1, jobs=1, progress=False)
    except (NotFinite, np.linalg.LinAlgError) as error:
        with np.errstate(all="ignore"):
            finite = np.isfinite(simulate(model, runs, steps, seed=1).x).all()
        return f"on a trial of {runs} trajectories it left the finite numbers" if finite and not one.slow else str(error)
    return ""


# ---------------------------------------------------------------- what can be seen without a trial


def _flat(structures: Structures) -> Iterator[str]:
    """A meter whose tangent at the prior's mean is level."""
    model = structures.model
    slope = structures.linearised.at(0).measure(model.prior.mean, model.prior.cov).G
    for name, row in zip(model.measured, np.broadcast_to(slope, (model.p, model.n)), strict=True):
        if not row.any():
            yield f"the tangent of {name} at the prior's mean is level: the first measurement tells it nothing"


def _blind(structures: Structures) -> Iterator[str]:
    """Points on the axes, which see no product of state and noise, nor of two components."""
    model = structures.model
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", QuadratureWarning)
        try:
            points, better = unscented(model), _reference(structures)
        except ModelError:
            return
    mean, cov = model.prior
    (_, theta), (_, _, _, R) = points.at(0).predict(mean, cov), points.at(0).measure(mean, cov)
    (_, theta_of_all), (_, _, _, R_of_all) = better.at(0).predict(mean, cov), better.at(0).measure(mean, cov)
    sides = (
        ("the measurement that the state does not explain", R, R_of_all),
        ("the next state", theta, theta_of_all),
    )
    for what, seen, there in sides:
        share = np.diagonal(np.broadcast_to(seen, there.shape)) / np.diagonal(there)
        if (worst := np.nanmin(share, initial=1.0)) < BLIND:
            yield (
                f"its points lie on the axes and see {100 * max(worst, 0.0):.0f} % of the variance of {what} at the prior law: "
                "products such as x**2*w are 0 on them; aof-gauss-hermite sees them"
            )


def _reference(structures: Structures) -> Structure:
    try:
        return structures.gaussian
    except NoClosedForm:
        return gauss_hermite(structures.model, 7)


def _starved(structures: Structures) -> Iterator[str]:
    """A meter so much sharper than the prediction that hardly a particle falls where the measurement says."""
    model = structures.model
    if (share := _share_starved(model, guided=True)) > OFTEN:
        instead = "; use aof-exact" if has_exact(model) else ""
        yield f"the meter is sharp: at {100 * share:.0f} % of the corrections {_TOO_FEW}{instead}"


def _bootstrap(structures: Structures) -> Iterator[str]:
    """The same for particles that do not look at the measurement."""
    if (share := _share_starved(structures.model, guided=False)) > OFTEN:
        yield (
            f"a bootstrap filter, guided=False, would fail: the meter is sharp, and at {100 * share:.0f} % of the corrections "
            f"{_TOO_FEW}"
        )


_TOO_FEW = f"fewer than {FEW:.0f} of {PARTICLES} particles count"


def _share_starved(model: Model, guided: bool) -> float:
    """Share of the corrections of some trajectories after which too few particles count."""
    steps = int(min(STEPS, model.known.steps))
    one, y = particle(model, PARTICLES, guided=guided), simulate(model, SOME, steps, seed=1).y
    state, effective = one.init(SOME), np.empty((steps, SOME))
    for k, measured in enumerate(y):
        state = one.step(state, measured)
        effective[k] = state.memory.effective
    return float((effective < FEW).mean())


def _by_particles(structures: Structures) -> Iterator[str]:
    """The exact filter where point masses do not reach."""
    if not has_exact(structures.model):
        yield from _starved(structures)


def _by_quadrature(structures: Structures | JumpStructures) -> Iterator[str]:
    """Gaussian structural functions that are no formulas."""
    if isinstance(structures.quadrature, Checked):
        yield structures.quadrature.says


def _with_modes(name: str, structures: JumpStructures) -> Iterator[str]:
    """What to know of a filter for models that jump."""
    of_best = name in OF_BEST
    if name == "aof-exact":
        yield from _not_by_points(structures)
    elif of_best or name.endswith("-gaussian"):
        yield from _by_quadrature(structures)
    if of_best and structures.best is structures.linearised:
        yield "with linearised structural functions, as Gaussian ones cannot be had: see aof-jump-gaussian"


def _not_by_points(structures: Structures | JumpStructures) -> Iterator[str]:
    """Why the exact filter is one of particles."""
    try:
        pointmass(structures.model)
    except ModelError as error:
        yield f"by particles: {error}"


# By a part of the short name.
_LOOKS: dict[str, Callable[[Structures], Iterator[str]]] = {
    "linearised": _flat,
    "unscented": _blind,
    "particle": _starved,
    "aof-exact": _by_particles,
}
# By how it ends.
_REMARKS: dict[str, Callable[[Structures], Iterator[str]]] = {
    "-gaussian": _by_quadrature,
    "particle": _bootstrap,
    "aof-exact": _not_by_points,
}


def table(found: Sequence[Admission]) -> str:
    """What `kfcourse filters` prints: a line for each filter."""
    rows = [(one.name, title(one.name), one.verdict, one.says) for one in found]
    widths = [max(map(len, column)) for column in list(zip(*rows, strict=True))[:3]]
    return "\n".join("  ".join([*(cell.ljust(w) for cell, w in zip(row, widths, strict=False)), row[3]]).rstrip() for row in rows)
