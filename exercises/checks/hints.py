"""What can be said of any wrong answer, whatever the question: its sign, an argument without
effect, where it is right.

Most hints are rows of name, sentence and what would have been found if the sentence were so; one
loop compares.  The others ask where the answer is right, or how it depends on its arguments.  Each
looks at one result of an answer, called with all hidden arguments, and at what was expected.
"""

from __future__ import annotations

import operator
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.exercises.checks.case import Case, changed
from kfcourse.exercises.checks.editing import changed_keys
from kfcourse.exercises.checks.equality import depends, equal, like, with_values
from kfcourse.exercises.checks.reference import symbols

ROUGH = 1e-4  # relative difference that hints at a lower precision
SECONDS = 10.0  # for the search among changes of the key
ROUNDING = 1e-13  # of what cancels, beside what should be there

Said = tuple[str, str]
Row = tuple[str, str, Callable[[], Iterable[Any]]]  # name, sentence, what would have been found


def each(value: Any, change: Callable[[Any], Any]) -> Any:
    """A change of every entry; the power of a symbolic matrix would be another thing, and may take
    for ever."""
    return value.applyfunc(change) if isinstance(value, sp.MatrixBase) else change(value)


def transposed(value: Any) -> Any:
    return value.T if isinstance(value, sp.MatrixBase) else np.swapaxes(value, -1, -2)


def root(value: Any) -> Any:
    return value**sp.S.Half if isinstance(value, sp.Basic) else np.sqrt(value)


INVERSE = "It looks like the inverse of what it should be."
# A name says what is wrong, with spaces for hyphens: overviews of a course count them.
OF_RESULT: tuple[tuple[str, str, Callable[[Any], Any]], ...] = (
    ("wrong-sign", "The size is right, the sign is not.", operator.neg),
    ("transposed", "It looks transposed.", transposed),
    (
        "root-of-it",
        "It is the square root of what it should be, as a standard deviation is of a variance.",
        lambda v: each(v, root),
    ),
    ("half-of-it", "It is half of what it should be.", lambda v: v / 2),
    ("twice-of-it", "It is twice what it should be.", lambda v: 2 * v),
    ("inverse", INVERSE, lambda v: each(v, lambda entry: 1 / entry)),
    ("inverse", INVERSE, np.linalg.inv),
    (
        "square-of-it",
        "It is the square of what it should be, as a variance is of a standard deviation.",
        lambda v: each(v, lambda entry: entry**2),
    ),
)


def results(case: Case) -> Iterator[Row]:
    """The right result with one simple thing done to it, another result, or an argument as it
    came."""
    values = case.posed.values
    mine, right = map(symbols, (case.answered, case.expected))
    if {s.name for s in values} & right - mine:
        yield (
            "numbers-for-symbols",
            "Right in numbers, but the parameters are asked for as symbols: type their letters "
            "where their values stand.",
            partial(map, lambda formula: with_values(formula, values), case.expected),
        )
    yield (
        "is-zero",
        "It is zero: is that what is left when all cancels, or is something multiplied by zero?",
        partial(map, nothing, case.answered, case.expected),
    )
    for name, says, change in OF_RESULT:
        yield name, says, partial(map, change, case.expected)
    for decimals in range(1, 9) if case.numeric else ():
        yield (
            "low-precision",
            "It is rounded: hand in all digits.",
            partial(map, partial(np.round, decimals=decimals), case.expected),
        )
    for name, expected in case.others:
        yield (
            "another-result",
            f"That is what belongs in the place of {name}.",
            expected.copy,
        )
    for place, name in enumerate(case.posed.names):
        given = [values[place] for values in case.posed.arguments]
        if all(isinstance(value, np.ndarray) for value in given):
            yield (
                "argument-unchanged",
                f"That is the argument `{name}`, unchanged.",
                partial(map, np.nan_to_num, given),
            )


def nothing(mine: Any, right: Any) -> Any:
    """Zero; with its rounding, where that is all there is."""
    if isinstance(mine, np.ndarray) and np.abs(mine).max() <= ROUNDING * np.abs(right).max():
        return mine
    return 0 * right


def arguments(case: Case) -> Iterator[Row]:
    """What the right answer gives with arguments exchanged; right but for a step, a term or a
    factor."""
    names, calls = case.posed.names, case.posed.arguments
    for i, j in combinations(range(len(names)), 2):
        says = f"It is right with `{names[i]}` and `{names[j]}` exchanged: which is which?"
        order = [*range(len(names))]
        order[i], order[j] = j, i
        exchanged = [[values[k] for k in order] for values in calls]
        yield "arguments-exchanged", says, partial(instead, case, case.posed.key, exchanged)
    known = [
        (f"the argument `{name}`", [values[i] for values in calls]) for i, name in enumerate(names)
    ]
    known += [(f"the result {name}", values) for name, values in case.others]
    known += [("one", [1] * len(case.expected))]
    for what, values in known:
        if np.shape(values[0]) not in ((), np.shape(case.expected[0])):
            continue
        for kind, of, change in (
            ("term", "", operator.sub),
            ("term", "", operator.add),
            ("factor", "", operator.truediv),
            ("factor", "", operator.mul),
            ("factor", "the square of ", lambda b, v: b / v**2),
            ("factor", "the square of ", lambda b, v: b * v**2),
        ):
            much = "added, or forgotten" if kind == "term" else "too many, or forgotten"
            says = f"It is right but for a {kind} that is {of}{what}: {much}?"
            yield f"wrong-{kind}", says, partial(map, change, case.expected, values)


SLIPS = {
    "one-sign-wrong": "with one sign changed: a plus for a minus, or the other way",
    "other-order": "with something not transposed, or two things in another order",
    "term-lost": "with one term left out",
    "factor-lost": "with one multiplication, or division, left out",
    "product-for-quotient": "with a product in the place of a quotient, or the other way",
    "power-lost": "with a power left out",
    "function-lost": "with a function, such as a root, left out",
    "other-number": "with another number, index or axis somewhere",
    "other-letter": "with one letter in the place of another",
}


def slips(case: Case) -> Iterator[Row]:
    """What the right answer gives with one thing changed in its code."""
    end = time.monotonic() + SECONDS
    for name, answer in changed_keys(case.posed.key):
        if time.monotonic() > end:
            return
        says = f"The right answer would give that {SLIPS[name]}."
        yield name, says, partial(instead, case, answer, case.posed.arguments)


def instead(case: Case, answer: Callable, calls: Sequence[Sequence[Any]]) -> Iterable[Any]:
    """What another answer gives, or the right one for other arguments, in the form expected."""
    return map(like, case.given_by(answer, calls), case.expected)


def compared(rows: Callable[[Case], Iterator[Row]]) -> Callable[[Case], Said | None]:
    """The hint of the first row that would have given what was found, and not what was expected."""

    def hint(case: Case) -> Said | None:
        for name, says, made in rows(case):
            try:
                would = list(made())
                if case.agree(case.answered, would) and not case.agree(would, case.expected):
                    return name, says
            except Exception:  # there is no such result
                continue
        return None

    return hint


# -- where it is right


def rough(case: Case) -> Said | None:
    """Right to some digits."""
    if not case.numeric or not all(equal(a, b, ROUGH, {}) for a, b in case.pairs):
        return None
    return (
        "low-precision",
        "It is nearly right: is something rounded, or computed in single precision (float32), or "
        "something small left out, added or divided otherwise?",
    )


def sometimes(case: Case) -> Said | None:
    """Right for some of the hidden arguments."""
    right = [case.agree([a], [b]) for a, b in case.pairs]
    if not any(right):
        return None
    sizes = [np.size(b) // (len(b) if np.ndim(b) else 1) for _, b in case.pairs if case.numeric]
    if len(set(sizes)) > 1 and [size == 1 for size in sizes] == right:
        return (
            "right-for-scalars-only",
            "It is right for scalars only: look at the order of the matrices, at what is "
            "transposed, and at what is done entry by entry or over all axes at once.",
        )
    return (
        "right-for-some-inputs",
        f"It is right for {sum(right)} of {len(right)} hidden inputs: a case is left out, or it "
        f"holds for a special one only.",
    )


def first_step(case: Case) -> Said | None:
    """A run that starts well, or each step of which stands beside its place."""
    if case.posed.question.axes[:1] != ("step",) or min(map(len, case.expected)) < 4:
        return None
    later = [
        not case.agree([a[k : k + 1]], [b[k : k + 1]])
        for a, b in case.pairs
        for k in range(1, len(b))
    ]
    if all(case.agree([a[:1]], [b[:1]]) for a, b in case.pairs) and 2 * sum(later) > len(later):
        return (
            "wrong-from-second-step",
            "The first step is right, later ones are not: what is handed on from one step to the "
            "next?",
        )
    after, before = slice(1, None), slice(None, -1)
    for mine, right, word in ((after, before, "late"), (before, after, "early")):
        if case.agree([a[mine] for a in case.answered], [b[right] for b in case.expected]):
            return "one-step-off", f"The values are right, but each stands one step too {word}."
    return None


def factor_or_term(case: Case) -> Said | None:
    """A factor that is the same everywhere, or a term for all that a call gives."""
    if not case.numeric:
        ((mine, *more), (right, *_)) = case.formulas
        for kind, rest in (("factor", mine / right), ("term", mine - right)):
            on = depends(rest)
            if not more and on < depends(right) and len(on) < 2:
                which = f"depends on {on.pop()} only" if on else "is a number"
                return f"wrong-{kind}", f"It is right but for a {kind} that {which}."
        return None
    if all(b.size > 2 and np.ptp(a - b) < 1e-9 * np.abs(b).max() for a, b in case.pairs):
        return "wrong-term", "It is right but for a term that is one number for the whole result."
    a, b = (np.concatenate([*map(np.ravel, side)]) for side in (case.answered, case.expected))
    if len(b) > 1 and np.ptp(b) > 1e-3 * np.abs(b).max():
        ratio = (a @ b) / (b @ b)
        if abs(ratio) > 1e-6 and equal(a, ratio * b, 1e-9, {}):
            return "wrong-factor", "It is right but for a factor that is the same everywhere."
    return None


def entries(case: Case) -> Said | None:
    """Some entries of a matrix, or some components of a vector."""
    lead = len(case.posed.question.axes) if case.numeric else 0
    pairs = [tuple(map(np.asarray, pair)) for pair in case.pairs]
    shapes = {b.shape[lead:] for _, b in pairs}
    shape = shapes.pop()
    if shapes or len(shape) not in (1, 2) or max(shape) > 6:
        return None
    if case.numeric and len(shape) + lead == 1:  # it may be anything: trajectories, modes
        return None
    wrong = [
        place
        for place in np.ndindex(shape)
        if not all(case.agree([a[(..., *place)][()]], [b[(..., *place)][()]]) for a, b in pairs)
    ]
    if len(wrong) not in (1, 2, 3) or len(wrong) == np.prod(shape):
        return None
    names = [
        f"the entry in row {place[0] + 1}, column {place[1] + 1}"
        if len(shape) == 2
        else f"component {place[0] + 1}"
        for place in wrong
    ]
    verb = "is" if len(names) == 1 else "are"
    return "some-entries-wrong", f"Only {' and '.join(names)} {verb} wrong."


def improper(case: Case) -> Said | None:
    """A covariance that is none."""
    for mine, right in case.pairs:
        if len(set(right.shape[-2:])) != 1 or not case.agree([right], [transposed(right)]):
            return None
        # where digits are lost some of many are not symmetric, and no factor is missing
        other = np.isclose(mine, transposed(mine)) if case.numeric else np.array(False)
        if not case.agree([mine], [transposed(mine)]) and not other.all(axis=(-2, -1)).mean() > 0.5:
            return (
                "not-symmetric",
                "The result should be symmetric and is not: is a factor missing on one side?",
            )
        own, good = (np.diagonal(matrix, axis1=-2, axis2=-1) for matrix in (mine, right))
        # zero is negative at times, by rounding
        if case.numeric and (own < -1e-9 * np.max(good)).any() and (good >= 0).all():
            return (
                "negative-variance",
                "There are negative variances in it: what is subtracted there?",
            )
    return None


# -- how it depends on what it is made of


def unused(case: Case) -> Said | None:
    """Arguments or symbols that are missing, or symbols that are too many."""
    extra: list[str] = []
    if case.numeric:
        form = "`{}`"
        # what is counted does not feel a small change
        whole = all(np.array_equal(array, np.round(array)) for pair in case.pairs for array in pair)
        missing = [
            name
            for place, name in enumerate(case.posed.names)
            if name not in case.posed.question.spare
            and (not whole or isinstance(case.posed.arguments[0][place], int))
            and case.feels(place) == [False, True]
        ]
    else:
        form = "{}"
        mine, right = (set().union(*map(depends, side)) for side in case.formulas)
        numbers = any(not n.is_integer for f in case.formulas[0] for n in f.atoms(sp.Number))
        missing = sorted((right & case.posed.given if numbers else right) - mine)
        extra = sorted(mine - right)
    if missing:
        which = ", ".join(map(form.format, missing))
        what = "forgotten, or cancelled, or is something of the notebook used instead?"
        return "argument-unused", f"It does not depend on {which} and should: {what}"
    if extra:
        return "symbol-superfluous", f"It depends on {', '.join(extra)} and should not."
    return None


def multiplied(case: Case, factor: sp.Rational) -> Iterator[str]:
    """Arguments, or symbols, that leave the result right when they are multiplied."""
    if case.numeric:
        for place, name in enumerate(case.posed.names):
            mine, right = case.with_changed(
                place, lambda value: changed(value, lambda entry: float(factor) * entry)
            )
            if any(map(np.any, right)) and case.agree(mine, right):
                yield f"`{name}`"
        return
    for name in sorted(set.intersection(*map(symbols, case.formulas))):
        mine, right = (
            [f.xreplace({s: factor * s for s in f.free_symbols if s.name == name}) for f in side]
            for side in case.formulas
        )
        if any(right) and case.agree(mine, right):
            yield name


def limit(case: Case) -> Said | None:
    """Right where something is zero: what comes in with it is wrong."""
    where = list(multiplied(case, sp.S.Zero))
    if where:  # where nothing is brought in near zero either, that tells nothing
        near = set(multiplied(case, sp.Rational(1, 100)))
        where = [name for name in where if name not in near]
    if not where:
        return None
    part = f"look at the part that {'this' if len(where) == 1 else 'each of these'} brings in"
    return "one-part-wrong", f"It is right where {' or '.join(where[:3])} is zero: {part}."


def terms(case: Case) -> Said | None:
    """Some terms of a formula, multiplied out."""
    if case.numeric or len(case.formulas[0]) != 1:
        return None
    mine, theirs = (set(sp.Add.make_args(sp.expand(formula))) for (formula,) in case.formulas)
    if not mine & theirs or len(mine) > 12:
        return None
    if theirs < mine:
        return (
            "some-terms-wrong",
            "All terms that belong there are there, and something else besides.",
        )
    right = ", ".join(sorted(map(str, mine & theirs)))
    # which may be right in another form, in part
    more = "another is missing" if mine < theirs else "look at the rest"
    return (
        "some-terms-wrong",
        f"Of your terms, multiplied out, {right} {'is' if len(mine & theirs) == 1 else 'are'} "
        f"right; {more}.",
    )


HINTS: tuple[Callable[[Case], Said | None], ...] = (
    compared(results),
    rough,
    unused,
    improper,
    first_step,
    factor_or_term,
    entries,
    compared(arguments),
    sometimes,
    limit,
    terms,
    compared(slips),
)


def general(case: Case) -> Said | None:
    """The first hint that has something to say."""
    for hint in HINTS:
        try:
            says = hint(case)
        except Exception:  # nonsense of many kinds
            continue
        if says:
            return says
    return None
