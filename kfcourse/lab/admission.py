"""Which filter may I use?  For a model and each filter: whether it can be built, and what is known
of it before any comparison.

A filter is refused if it cannot be built: no closed form, equations that cannot be differentiated,
no density.  It is warned of if it can be built and will not do: points that do not integrate the
equations or do not see a noise, a slope that is zero.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass

import numpy as np

from kfcourse.errors import NoClosedForm, Reason, Refused
from kfcourse.filters import Design, Filter
from kfcourse.lab.checked_quadrature import Checked
from kfcourse.lab.short_names import (
    FILTERS,
    JUMP_FILTERS,
    Entry,
    Structures,
    check_names,
    has_exact,
    title,
)
from kfcourse.limits import OutOfTime, time_limit
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.quadrature import QuadratureWarning, unscented
from kfcourse.symbolic.reading import ModelError

BLIND = 0.5  # of the unexplained variance, that must be seen
TOO_LONG = (
    "its formulas are not derived within {:g} s, as the model's are too long; simplify them, or "
    "take filters without formulas, "
    "aof-unscented and duof"
)


@dataclass(frozen=True)
class Admission:
    """What is known of a filter for a model.

    Attributes
    ----------
    name : str
        Short name.
    built : Filter or Design or None
        None if it cannot be built.
    reason : str or Exception
        Why not; empty if it can.
    poor : bool
        Whether it can be built, but will not do well.
    notes : tuple of str
        Why it will not; else what is worth knowing of it.
    """

    name: str
    built: Filter | Design | None
    reason: Reason = ""
    poor: bool = False
    notes: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """Whether it may be used: "yes", "no" or "poor"."""
        return "no" if self.built is None else "poor" if self.poor else "yes"

    @property
    def says(self) -> str:
        return str(self.reason) if self.reason else "; ".join(self.notes)


def admissions(
    model: Model | JumpModel, names: Sequence[str] | None = None, seconds: float | None = None
) -> list[Admission]:
    """Which of the filters, all by default, can be built for the model, and what to know of them;
    each as the lab builds it.

    With `seconds`, the formulas of each must be derived in that time; filters with the same
    structural functions share the time.

    Raises
    ------
    ValueError
        An unknown name; the message lists the known ones.
    """
    entries = JUMP_FILTERS if isinstance(model, JumpModel) else FILTERS
    names = list(dict.fromkeys(entries if names is None else names))
    check_names(names, entries)
    structures = Structures.of(model)
    answers, late = [], set()
    for name in names:
        functions = entries[name].functions
        try:
            if functions in late:
                raise OutOfTime
            with nullcontext() if seconds is None else time_limit(seconds):
                answers.append(_admitted(name, entries[name], structures))
        except OutOfTime:
            late.add(functions)
            reason = Refused(TOO_LONG.format(seconds), "too_long", seconds=f"{seconds:g}")
            answers.append(Admission(name, None, reason))
    return answers


def _admitted(name: str, entry: Entry, structures: Structures) -> Admission:
    with warnings.catch_warnings(record=True) as caught, np.errstate(all="ignore"):
        warnings.simplefilter("always", QuadratureWarning)
        try:
            built = entry.build(structures)
        except (NoClosedForm, ModelError) as error:
            return Admission(name, None, error.with_traceback(None))
        faults = [str(warning.message) for warning in caught]
        if not structures.jumps and entry.functions in LOOKS:
            faults += LOOKS[entry.functions](structures)
        notes = faults or _remarks(entry, structures)
        return Admission(name, built, poor=bool(faults), notes=tuple(notes))


def _remarks(entry: Entry, structures: Structures) -> Iterator[str]:
    """What is worth knowing of a filter that was built."""
    if entry.functions == "exact" and not has_exact(structures.model):
        yield "by particles, as point masses do not reach this model"
    if entry.functions in ("gaussian", "best", "averaged"):
        if isinstance(structures.quadrature, Checked):
            yield structures.quadrature.says
        elif structures.quadrature is not None:
            yield (
                "with linearised structural functions, as Gaussian ones cannot be had: see "
                "aof-jump-gaussian"
            )


def _flat(structures: Structures) -> Iterator[str]:
    """A meter whose tangent at the prior's mean is level."""
    model = structures.model
    slope = structures.linearised.at(0).measure(model.prior.mean, model.prior.cov).G
    for name, row in zip(model.measured, np.broadcast_to(slope, (model.p, model.n)), strict=True):
        if not row.any():
            yield (
                f"the tangent of {name} at the prior's mean is level: the first measurement "
                f"tells it nothing"
            )


def _blind(structures: Structures) -> Iterator[str]:
    """Points on the axes, which see no product of state and noise, nor of two components."""
    model, law = structures.model, structures.model.prior
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", QuadratureWarning)
        try:
            points, full = unscented(model).at(0), structures.normal.at(0)
        except NoClosedForm:
            return
    unexplained = "the measurement that the state does not explain"
    for what, part, whole in (
        (unexplained, points.measure(*law).R, full.measure(*law).R),
        ("the next state", points.predict(*law).cov, full.predict(*law).cov),
    ):
        share = np.diagonal(np.broadcast_to(part, whole.shape)) / np.diagonal(whole)
        if (worst := np.nanmin(share, initial=1.0)) < BLIND:
            yield (
                f"its points lie on the axes and see {100 * max(worst, 0.0):.0f} % of the "
                f"variance of {what} at the prior law: products such as x**2*w are 0 on them; "
                "aof-gauss-hermite sees them"
            )


# Of filters with these structural functions: what they may not see.
LOOKS = {"linearised": _flat, "unscented": _blind}


def table(answers: Sequence[Admission]) -> str:
    """What `kfcourse filters` prints: a line for each filter."""
    rows = [(answer.name, title(answer.name), answer.verdict, answer.says) for answer in answers]
    return "\n".join(aligned(rows))


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """The lines of a table for terminals."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
