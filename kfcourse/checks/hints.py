"""What can be said of any wrong answer, whatever the question: its sign, an argument without effect, where it is right.

A hint looks at one result of an answer, called with all hidden arguments, and at what was expected; it gives its name and a
sentence that is true of the answer, or None.  The engine asks them in turn when no known mistake fits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.checks.case import Case, Said
from kfcourse.checks.dependence import same
from kfcourse.checks.equality import depends, equal
from kfcourse.checks.relations import RELATIONS

ROUGH = 1e-4  # relative difference that hints at a lower precision
ROUNDING = 1e-13  # of what cancels, beside what should be there


def _each(value: Any, change: Callable[[Any], Any]) -> Any:
    """A change of every entry; the power of a symbolic matrix would be another thing, and may take for ever."""
    return value.applyfunc(change) if isinstance(value, sp.MatrixBase) else change(value)


ROOT = "It is the square root of what it should be, as a standard deviation is of a variance."
SQUARE = "It is the square of what it should be, as a variance is of a standard deviation."
INVERSE = "It looks like the inverse of what it should be."

TRANSFORMATIONS: tuple[tuple[str, str, Callable[[Any], Any]], ...] = (
    ("sign", "The size is right, the sign is not.", lambda v: -v),
    ("transposed", "It looks transposed.", lambda v: v.T if isinstance(v, sp.MatrixBase) else np.swapaxes(v, -1, -2)),
    ("root", ROOT, lambda v: _each(v, lambda entry: entry**2)),
    ("factor-2", "It is half of what it should be.", lambda v: v * 2),
    ("factor-half", "It is twice what it should be.", lambda v: v / 2),
    ("inverse", INVERSE, lambda v: _each(v, lambda entry: 1 / entry)),
)


def vanishing(case: Case) -> Said | None:
    """Nothing, or nothing but rounding."""
    if case.numeric:
        zero = all(np.abs(a).max(initial=0.0) <= ROUNDING * np.abs(b).max(initial=0.0) for a, b in case.pairs)
        if not zero or not all(np.any(b) for b in case.expected):
            return None
    elif not case.agree(case.found, [0 * value for value in case.expected]):
        return None
    return "vanishing", "It is zero: is that what is left when all cancels, or is something multiplied by zero?"


def transformed(case: Case) -> Said | None:
    """The right result with one simple thing done to it."""
    for name, says, change in TRANSFORMATIONS:
        try:
            if case.agree([change(value) for value in case.found], case.expected):
                return name, says
        except Exception:  # this result cannot be changed so
            continue
    return None


def rounded(case: Case) -> Said | None:
    """Right, and then rounded; to whole numbers where there are several, as ones and zeros say nothing."""
    if case.numeric:
        whole = len(np.unique(np.concatenate([np.ravel(a) for a in case.found]))) > 2
        for decimals in range(0 if whole else 1, 9):
            if all(np.array_equal(a, np.round(b, decimals)) for a, b in case.pairs):
                return "precision", "It is rounded: hand in all digits."
    return None


def squared(case: Case) -> Said | None:
    """The square, or the inverse of a matrix."""
    if case.agree(case.found, [_each(b, lambda entry: entry**2) for b in case.expected]):
        return "square", SQUARE
    if case.numeric and case.agree([np.linalg.inv(a) for a in case.found], case.expected):
        return "inverse", INVERSE
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
        single = all(np.array_equal(mine, np.asarray(mine, np.float32), equal_nan=True) for mine, _ in case.pairs)
        if single and any(not np.array_equal(mine, np.round(mine), equal_nan=True) for mine, _ in case.pairs):
            return (
                "precision",
                "It is right to the 7 digits of single precision (float32): compute in double precision (float64).",
            )
        return "precision", "It is nearly right: is something rounded, or something small left out, added or divided otherwise?"
    return None


def dependence(case: Case) -> Said | None:
    """Arguments or symbols that are missing, or too many."""
    extra: list[str] = []
    if case.numeric:
        missing = case.sensitivity.unused(case.part)
        if all(
            np.array_equal(one, np.round(one)) for pair in case.pairs for one in pair
        ):  # what is rounded does not feel a small change
            missing = [name for name in missing if isinstance(case.arguments[0][case.names.index(name)], int)]
        form = "`{}`"
    else:
        mine, theirs = (_symbols(case, which) for which in (0, 1))
        given = {s.name for values in case.arguments for v in values if hasattr(v, "free_symbols") for s in v.free_symbols}
        numbers = any(not n.is_integer for side in case.formulas for f in side[0] for n in f.atoms(sp.Number))
        missing, extra = sorted((theirs & given if numbers else theirs) - mine), sorted(mine - theirs)
        form = "{}"
    if missing:
        which = ", ".join(map(form.format, missing))
        return (
            "unused",
            f"It does not depend on {which} and should: forgotten, or cancelled, or is something of the notebook used instead?",
        )
    if extra:
        return "superfluous", f"It depends on {', '.join(extra)} and should not."
    return None


def _symbols(case: Case, which: int) -> set[str]:
    """Names of the symbols on whose values a side depends."""
    formulas = [f for side in case.formulas for f in side[which]]
    return {name for f in formulas for name in depends(f, {s.name for s in f.free_symbols})}


NOT_SYMMETRIC = "The result should be symmetric and is not: is a factor missing on one side?"
DIGITS_LOST = "Some of the matrices are not symmetric, most are: are digits lost, as where something nearly singular is inverted?"


def improper(case: Case) -> Said | None:
    """A covariance that is none."""
    for found, expected in case.pairs:
        if isinstance(expected, sp.MatrixBase):
            if expected.rows == expected.cols > 1 and case.agree([expected], [expected.T]) and not case.agree([found], [found.T]):
                return "not-symmetric", NOT_SYMMETRIC
        elif case.numeric and expected.ndim > 1 and expected.shape[-1] == expected.shape[-2]:
            if not same(expected, expected.swapaxes(-1, -2)):
                return None
            if not np.allclose(found, found.swapaxes(-1, -2)):
                symmetric = np.isclose(found, found.swapaxes(-1, -2)).all(axis=(-2, -1))
                return ("digits-lost", DIGITS_LOST) if symmetric.mean() > 0.5 else ("not-symmetric", NOT_SYMMETRIC)
            own, right = (np.diagonal(matrix, axis1=-2, axis2=-1) for matrix in (found, expected))
            if (own < -1e-9 * np.max(right)).any() and (right >= 0).all():  # zero is negative at times, by rounding
                return "negative-variance", "There are negative variances in it: what is subtracted there?"
    return None


def sometimes(case: Case) -> Said | None:
    """Right for some of the hidden arguments."""
    right = [case.agree([a], [b]) for a, b in case.pairs]
    if not any(good and telling for good, telling in zip(right, case.telling, strict=True)):
        return None
    sizes = [int(np.size(b)) // (len(b) if np.ndim(b) else 1) for _, b in case.pairs] if case.numeric else [1] * len(right)
    if len(set(sizes)) > 1 and all((size == 1) == good for size, good in zip(sizes, right, strict=True)):
        return (
            "scalars-only",
            "It is right for scalars only: look at the order of the matrices, at what is transposed, "
            "and at what is done entry by entry or over all axes at once.",
        )
    return (
        "sometimes",
        f"It is right for {sum(right)} of {len(right)} hidden inputs: a case is left out, or it holds for a special one only.",
    )


def first_step(case: Case) -> Said | None:
    """A run that starts well."""
    if not case.numeric or case.axes[:1] != ("step",) or not all(b.ndim and len(b) > 3 for _, b in case.pairs):
        return None
    later = [not case.agree([a[k : k + 1]], [b[k : k + 1]]) for a, b in case.pairs for k in range(1, len(b))]
    if all(case.agree([a[:1]], [b[:1]]) for a, b in case.pairs) and 2 * sum(later) > len(later):
        return "from-second-step", "The first step is right, later ones are not: what is handed on from one step to the next?"
    return None


TERM = "It is right but for a term that is the same everywhere."


def factor_or_term(case: Case) -> Said | None:
    """A factor, or a term, that is the same everywhere."""
    if not case.numeric:
        return None
    if all(np.ndim(b) > 1 and len(b) > 2 and np.ptp(a - b, axis=0).max() < 1e-9 * np.abs(b).max() for a, b in case.pairs):
        return "term", TERM
    a, b = (np.concatenate([np.ravel(pair[which]) for pair in case.pairs]) for which in (0, 1))
    if all(np.size(b) > 2 and np.ptp(a - b) < 1e-9 * np.abs(b).max() for a, b in case.pairs):
        return "term", "It is right but for a term that is one number for all that a call gives."
    if len(b) > 1 and np.ptp(b) > 1e-3 * np.abs(b).max():
        ratio = (a @ b) / (b @ b)
        if abs(ratio) > 1e-6 and np.allclose(a, ratio * b, rtol=1e-9, atol=1e-9 * np.abs(a).max()):
            return "factor", "It is right but for a factor that is the same everywhere."
        if len(b) > 2 and np.ptp(a - b) < 1e-9 * np.abs(b).max():
            return "term", TERM
    return None


def entries(case: Case) -> Said | None:
    """Some entries of a matrix, some rows of it, or some components of a vector."""
    right = _right_entries(case)
    if right is None or not right.any() or right.all():
        return None
    if right.ndim == 1:
        return "components", f"Only component{_numbers(~right)} wrong."
    if (~right).sum() == 1:
        i, j = np.argwhere(~right)[0] + 1
        return "entry", f"Only the entry in row {i}, column {j} is wrong."
    if len(set(right.shape)) == 1 and np.array_equal(right, np.eye(len(right), dtype=bool)):
        return "off-diagonal", "The diagonal is right, the rest is not: what has one component to do with another?"
    return None


def _right_entries(case: Case) -> np.ndarray | None:
    """Which entries of a matrix, or of a vector, are right in every case and everywhere; None if it has no entries."""
    if isinstance(case.expected[0], sp.MatrixBase):
        found, expected = case.pairs[0]
        if len(expected) < 2 or len(case.pairs) > 1:
            return None
        return np.reshape([case.agree([a], [b]) for a, b in zip(found, expected, strict=True)], expected.shape)
    if not case.numeric:
        return None
    lead = len(case.axes)
    shapes = {b.shape[lead:] for _, b in case.pairs if b.ndim > lead and b.size > b.shape[0]}
    pairs = [(a, b) for a, b in case.pairs if b.shape[lead:] in shapes]
    if len(shapes) != 1 or len(shape := shapes.pop()) not in (1, 2) or max(shape) > 6 or np.prod(shape) < 2:
        return None
    right = np.ones(shape, dtype=bool)
    for place in np.ndindex(shape):
        right[place] = all(case.agree([a[(..., *place)]], [b[(..., *place)]]) for a, b in pairs)
    return right


def _numbers(wrong: Any) -> str:
    places = [str(i + 1) for i in np.flatnonzero(wrong)]
    return f" {places[0]} is" if len(places) == 1 else f"s {', '.join(places)} are"


HINTS: tuple[Callable[[Case], Said | None], ...] = (
    vanishing,
    transformed,
    rounded,
    squared,
    confused,
    rough,
    sometimes,
    dependence,
    improper,
    first_step,
    factor_or_term,
    entries,
    *RELATIONS,
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
