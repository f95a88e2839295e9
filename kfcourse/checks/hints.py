"""What can be said of any wrong answer, whatever the question: its sign, an argument without effect, where it is right.

A hint looks at one result of an answer, called with all hidden arguments, and at what was expected; it gives its name and a
sentence that is true of the answer, or None.  The engine asks them in turn when no known mistake fits.
"""

from __future__ import annotations

import copy
import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import sympy as sp

from kfcourse.checks.equality import equal
from kfcourse.limits import OutOfTime

Agree: TypeAlias = Callable[[Sequence[Any], Sequence[Any]], bool]
Said: TypeAlias = tuple[str, str]

ROUGH = 1e-4  # relative difference that hints at a lower precision


CALLS = 3  # with which dependence on an argument is looked for


@dataclass(frozen=True)
class Sensitivity:
    """Which results depend on which argument: of the right answer, and of the student's.

    By value: an argument counts as used if the result changes with it in one of the calls, for one of its changes.

    answers : (right, student's)
    arguments : hidden arguments, a tuple a call
    results : what both give for each call, each as a list of parts
    several : whether answers have several results
    """

    names: Sequence[str]
    answers: tuple[Callable, Callable]
    arguments: Sequence[tuple]
    results: Sequence[tuple[list[Any], ...]]
    several: bool

    @cached_property
    def _table(self) -> list[tuple[str, list[bool], list[bool]]]:
        rows = []
        for place, name in enumerate(self.names):
            seen = [row for which in range(min(CALLS, len(self.arguments))) for row in self._changes(place, which)]
            if seen:
                right, mine = ([any(column) for column in zip(*side, strict=True)] for side in zip(*seen, strict=True))
                rows.append((name, right, mine))
        return rows

    def _changes(self, place: int, which: int) -> list[tuple[list[bool], list[bool]]]:
        """Which parts change, of the right answer and of the student's, for each change of an argument that both take."""
        arguments, found = self.arguments[which], []
        for other in nudged(arguments[place]):
            values = [*arguments[:place], other, *arguments[place + 1 :]]
            try:
                right, mine = (
                    [not _same(a, b) for a, b in zip(self._parts(answer, values), before, strict=True)]
                    for answer, before in zip(self.answers, self.results[which], strict=True)
                )
            except (OutOfTime, KeyboardInterrupt):
                raise
            except BaseException:  # the answer does not work for such an argument, or ends the program
                continue
            found.append((right, mine))
        return found

    def _parts(self, answer: Callable, values: Sequence[Any]) -> list[Any]:
        result = answer(*copy.deepcopy(values))
        return list(result) if self.several else [result]

    def unused(self, part: int) -> list[str]:
        """Arguments that the part should depend on and does not."""
        return [name for name, right, mine in self._table if right[part] and not mine[part]]

    def superfluous(self, part: int) -> list[str]:
        """Arguments that it depends on and should not, as another part does.

        An argument that changes no result of the right answer may stand in its formula all the same, and cancel there.
        """
        return [name for name, right, mine in self._table if mine[part] and any(right) and not right[part]]


def names_of(answer: Callable, count: int) -> list[str]:
    """Names of the arguments."""
    try:
        names = list(inspect.signature(answer).parameters)
    except (TypeError, ValueError):
        names = []
    return names if len(names) == count else [f"number {place}" for place in range(1, count + 1)]


def nudged(value: Any) -> list[Any]:
    """A hidden argument changed a little, covariances to covariances; nothing if it cannot be changed so."""
    if isinstance(value, int | np.integer):
        return [] if isinstance(value, bool) else [value + 1, value + 2, value + 3]
    if isinstance(value, float | np.floating):
        return [value * 1.05, value * 0.9]
    if isinstance(value, np.ndarray) and value.dtype.kind == "f":
        if value.ndim >= 2 and value.shape[-1] == value.shape[-2]:
            scale = 1.03 + 0.01 * np.arange(value.shape[-1])
            return [scale[:, None] * value * scale]
        return [value * np.linspace(1.03, 1.07, value.size).reshape(value.shape)]
    if inspect.isroutine(value):

        def changed(*arguments: Any) -> Any:
            result = value(*arguments)
            # a factor alone may cancel: a regression on it is the same
            return tuple(1.05 * part for part in result) if isinstance(result, tuple) else 1.05 * result + 0.01 * result**2

        changed.__dict__.update(getattr(value, "__dict__", {}))  # whether it takes the step
        return [changed]
    return []


def _same(first: Any, second: Any) -> bool:
    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    return a.shape == b.shape and bool(np.allclose(a, b, rtol=1e-12, atol=1e-12 * np.max(np.abs(b), initial=0.0), equal_nan=True))


@dataclass(frozen=True)
class Case:
    """One result of a wrong answer.

    found, expected : for every tuple of hidden arguments
    arguments, names : these, and what they are called
    part : its place among the results
    others : the other results expected, by name
    telling : for every tuple of hidden arguments, whether usual mistakes show there
    axes : what the leading axes of the results are
    """

    found: Sequence[Any]
    expected: Sequence[Any]
    agree: Agree
    arguments: Sequence[tuple]
    names: Sequence[str]
    part: int
    others: Sequence[tuple[str, Sequence[Any]]]
    telling: Sequence[bool]
    sensitivity: Sensitivity
    axes: Sequence[str] = ()

    @property
    def numeric(self) -> bool:
        return isinstance(self.expected[0], np.ndarray)

    @property
    def pairs(self) -> list[tuple[Any, Any]]:
        return list(zip(self.found, self.expected, strict=True))

    @property
    def formulas(self) -> list[tuple[list[sp.Expr], list[sp.Expr]]]:
        """Entries of both sides."""
        return [(list(a), list(b)) if isinstance(b, sp.MatrixBase) else ([a], [b]) for a, b in self.pairs]


def _each(value: Any, change: Callable[[Any], Any]) -> Any:
    """A change of every entry; the power of a symbolic matrix would be another thing, and may take for ever."""
    return value.applyfunc(change) if isinstance(value, sp.MatrixBase) else change(value)


TRANSFORMATIONS: tuple[tuple[str, str, Callable[[Any], Any]], ...] = (
    ("sign", "The size is right, the sign is not.", lambda v: -v),
    ("transposed", "It looks transposed.", lambda v: v.T if isinstance(v, sp.MatrixBase) else np.swapaxes(v, -1, -2)),
    ("root", "It looks like a standard deviation where a variance belongs.", lambda v: _each(v, lambda entry: entry**2)),
    ("square", "It looks like a variance where a standard deviation belongs.", lambda v: _each(v, lambda entry: entry**0.5)),
    ("factor-2", "It is half of what it should be.", lambda v: v * 2),
    ("factor-half", "It is twice what it should be.", lambda v: v / 2),
    ("inverse", "It looks like the inverse of what it should be.", lambda v: _each(v, lambda entry: 1 / entry)),
)


def transformed(case: Case) -> Said | None:
    """The right result with one simple thing done to it."""
    for name, says, change in TRANSFORMATIONS:
        try:
            if case.agree([change(value) for value in case.found], case.expected):
                return name, says
        except Exception:  # this result cannot be changed so
            continue
    return None


def signs_lost(case: Case) -> Said | None:
    """Right but for the signs of some entries."""
    if case.numeric and case.agree([np.abs(a) for a in case.found], [np.abs(b) for b in case.expected]):
        return "some-signs", "All sizes are right, some signs are not."
    return None


def confused(case: Case) -> Said | None:
    """Another of the results, or an argument as it came."""
    for name, expected in case.others:
        if [np.shape(a) for a in case.found] == [np.shape(b) for b in expected] and case.agree(case.found, expected):
            return "another-result", f"That is what belongs in the place of {name}."
    for place, name in enumerate(case.names):
        given = [values[place] for values in case.arguments]
        alike = all(isinstance(a, np.ndarray) and a.shape == np.shape(b) for a, b in zip(given, case.found, strict=True))
        if case.numeric and alike and case.agree(case.found, [np.nan_to_num(value) for value in given]):
            return "unchanged", f"That is the argument `{name}`, unchanged."
    return None


def rough(case: Case) -> Said | None:
    """Right to some digits."""
    if case.numeric and all(equal(a, b, ROUGH, {}) for a, b in case.pairs):
        if all(np.array_equal(mine, np.asarray(mine, np.float32), equal_nan=True) for mine, _ in case.pairs):
            return (
                "precision",
                "It is right to the 7 digits of single precision (float32): compute in double precision (float64).",
            )
        return "precision", "It is right to a few digits only: is something rounded?"
    return None


def dependence(case: Case) -> Said | None:
    """Arguments or symbols that are missing, or too many."""
    if case.numeric:
        missing, extra = case.sensitivity.unused(case.part), case.sensitivity.superfluous(case.part)
        form = "`{}`"
    else:
        mine, theirs = (_symbols(case, which) for which in (0, 1))
        given = {s.name for values in case.arguments for v in values if hasattr(v, "free_symbols") for s in v.free_symbols}
        numbers = any(not n.is_integer for side in case.formulas for f in side[0] for n in f.atoms(sp.Number))
        missing, extra = sorted((theirs & given if numbers else theirs) - mine), sorted(mine - theirs)
        form = "{}"
    if missing:
        which = ", ".join(map(form.format, missing))
        return "unused", f"It does not depend on {which} and should: forgotten, or is something of the notebook used instead?"
    if extra:
        return "superfluous", f"It depends on {', '.join(map(form.format, extra))} and should not."
    return None


def _symbols(case: Case, which: int) -> set[str]:
    """Names of the symbols on whose values a side depends."""
    formulas = [f for side in case.formulas for f in side[which]]
    found = set().union(*(f.free_symbols for f in formulas))
    return {s.name for s in found if not all(equal(f.xreplace({s: s + 1}), f, 0, {}) for f in formulas if s in f.free_symbols)}


def improper(case: Case) -> Said | None:
    """A covariance that is none."""
    for found, expected in case.pairs:
        if isinstance(expected, sp.MatrixBase):
            if expected.rows == expected.cols > 1 and case.agree([expected], [expected.T]) and not case.agree([found], [found.T]):
                return "not-symmetric", "The result should be symmetric and is not: is a factor missing on one side?"
        elif case.numeric and expected.ndim > 1 and expected.shape[-1] == expected.shape[-2]:
            if not _same(expected, expected.swapaxes(-1, -2)):
                return None
            if not np.allclose(found, found.swapaxes(-1, -2)):
                return "not-symmetric", "The result should be symmetric and is not: is a factor missing on one side?"
            diagonals = (np.diagonal(matrix, axis1=-2, axis2=-1) for matrix in (found, expected))
            if (next(diagonals) < 0).any() and (next(diagonals) >= 0).all():
                return "negative-variance", "There are negative variances in it: what is subtracted there?"
    return None


def sometimes(case: Case) -> Said | None:
    """Right for some of the hidden arguments."""
    right = [case.agree([a], [b]) for a, b in case.pairs]
    if not any(good and telling for good, telling in zip(right, case.telling, strict=True)):
        return None
    sizes = [int(np.size(b)) // (len(b) if np.ndim(b) else 1) for _, b in case.pairs] if case.numeric else [1] * len(right)
    if len(set(sizes)) > 1 and all((size == 1) == good for size, good in zip(sizes, right, strict=True)):
        return "scalars-only", "It is right for scalars only: look at the order of the matrices, and at what is transposed."
    return (
        "sometimes",
        f"It is right for {sum(right)} of {len(right)} hidden inputs: a case is left out, or it holds for a special one only.",
    )


def first_step(case: Case) -> Said | None:
    """A run that starts well."""
    if not case.numeric or case.axes[:1] != ("step",) or not all(b.ndim and len(b) > 3 for _, b in case.pairs):
        return None
    if all(case.agree([a[:1]], [b[:1]]) for a, b in case.pairs):
        return "from-second-step", "The first step is right, later ones are not: what is handed on from one step to the next?"
    return None


TERM = "It is right but for a term that is the same everywhere."


def scaled(case: Case) -> Said | None:
    """A factor, or a term, that is the same everywhere."""
    if not case.numeric:
        return None
    if all(np.ndim(b) > 1 and len(b) > 2 and np.ptp(a - b, axis=0).max() < 1e-9 * np.abs(b).max() for a, b in case.pairs):
        return "term", TERM
    a, b = (np.concatenate([np.ravel(pair[which]) for pair in case.pairs]) for which in (0, 1))
    if len(b) > 1 and np.ptp(b) > 1e-3 * np.abs(b).max():
        ratio = (a @ b) / (b @ b)
        if abs(ratio) > 1e-6 and np.allclose(a, ratio * b, rtol=1e-9, atol=1e-9 * np.abs(a).max()):
            return "factor", "It is right but for a factor that is the same everywhere."
        if len(b) > 2 and np.ptp(a - b) < 1e-9 * np.abs(b).max():
            return "term", TERM
    return None


def entries(case: Case) -> Said | None:
    """Some rows of a matrix of formulas."""
    found, expected = case.pairs[0]
    if not isinstance(expected, sp.MatrixBase) or len(expected) < 2 or len(case.pairs) > 1:
        return None
    wrong = [
        (i + 1, j + 1)
        for i in range(expected.rows)
        for j in range(expected.cols)
        if not case.agree([found[i, j]], [expected[i, j]])
    ]
    rows = sorted({i for i, _ in wrong})
    if len(wrong) == 1:
        return "entry", f"Only the entry in row {wrong[0][0]}, column {wrong[0][1]} is wrong."
    if len(rows) < expected.rows:
        one = len(rows) == 1
        return "rows", f"Only row{'' if one else 's'} {', '.join(map(str, rows))} {'is' if one else 'are'} wrong."
    return None


HINTS: tuple[Callable[[Case], Said | None], ...] = (
    transformed,
    signs_lost,
    confused,
    rough,
    sometimes,
    dependence,
    improper,
    first_step,
    scaled,
    entries,
)


def general(case: Case) -> Said | None:
    """The first hint that has something to say."""
    for hint in HINTS:
        try:
            said = hint(case)
        except Exception:  # nonsense of many kinds
            continue
        if said:
            return said
    return None
