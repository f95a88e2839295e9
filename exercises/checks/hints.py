"""What can be said of any wrong answer, whatever the question: its sign, an argument without
effect, where it is right.

Most hints are rows of name, sentence and what would have been found if the sentence were so; one
loop compares.  The others ask where the answer is right, or how it depends on its arguments.  Each
looks at one result of an answer, called with all hidden arguments, and at what was expected.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from operator import itemgetter
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.exercises.checks.dependence import Sensitivity, same, scaled
from kfcourse.exercises.checks.editing import changed_keys
from kfcourse.exercises.checks.equality import depends, equal, like
from kfcourse.limits import OutOfTime

ROUGH = 1e-4  # relative difference that hints at a lower precision
SECONDS = 10.0  # for the search among changes of the key
ROUNDING = 1e-13  # of what cancels, beside what should be there

Agree = Callable[[Sequence[Any], Sequence[Any]], bool]
Said = tuple[str, str]


@dataclass(frozen=True)
class Case:
    """One result of a wrong answer.

    answered, expected : for every tuple of hidden arguments
    arguments, names : these, and what they are called
    part : its place among the results
    others : the other results expected, by name
    axes : what the leading axes of the results are
    """

    answered: Sequence[Any]
    expected: Sequence[Any]
    agree: Agree
    arguments: Sequence[tuple]
    names: Sequence[str]
    part: int
    others: Sequence[tuple[str, Sequence[Any]]]
    sensitivity: Sensitivity
    axes: Sequence[str] = ()

    @property
    def numeric(self) -> bool:
        return isinstance(self.expected[0], np.ndarray)

    @property
    def pairs(self) -> list[tuple[Any, Any]]:
        return list(zip(self.answered, self.expected, strict=True))

    @property
    def flat(self) -> list[np.ndarray]:
        """All numbers of both sides."""
        return [
            np.concatenate([np.ravel(values) for values in side])
            for side in (self.answered, self.expected)
        ]

    @property
    def formulas(self) -> list[tuple[list[sp.Expr], list[sp.Expr]]]:
        """Entries of both sides."""
        return [
            (list(a), list(b)) if isinstance(b, sp.MatrixBase) else ([a], [b])
            for a, b in self.pairs
        ]


Row = tuple[str, str, Callable[[], Sequence[Any]]]  # name, sentence, what would have been found


def each(value: Any, change: Callable[[Any], Any]) -> Any:
    """A change of every entry; the power of a symbolic matrix would be another thing, and may take
    for ever."""
    return value.applyfunc(change) if isinstance(value, sp.MatrixBase) else change(value)


INVERSE = "It looks like the inverse of what it should be."
OF_RESULT: tuple[tuple[str, str, Callable[[Any], Any]], ...] = (
    ("sign", "The size is right, the sign is not.", lambda v: -v),
    (
        "transposed",
        "It looks transposed.",
        lambda v: v.T if isinstance(v, sp.MatrixBase) else np.swapaxes(v, -1, -2),
    ),
    (
        "root",
        "It is the square root of what it should be, as a standard deviation is of a variance.",
        lambda v: each(
            v, lambda entry: entry**sp.S.Half if isinstance(entry, sp.Basic) else np.sqrt(entry)
        ),
    ),
    ("factor-2", "It is half of what it should be.", lambda v: v / 2),
    ("factor-half", "It is twice what it should be.", lambda v: 2 * v),
    ("inverse", INVERSE, lambda v: each(v, lambda entry: 1 / entry)),
    ("inverse", INVERSE, lambda v: np.linalg.inv(v)),
    (
        "square",
        "It is the square of what it should be, as a variance is of a standard deviation.",
        lambda v: each(v, lambda entry: entry**2),
    ),
)


def results(case: Case) -> Iterator[Row]:
    """The right result with one simple thing done to it, another result, or an argument as it
    came."""
    for name, says, change in OF_RESULT:
        yield name, says, partial(applied, change, case.expected)
    for name, expected in case.others:
        yield (
            "another-result",
            f"That is what belongs in the place of {name}.",
            partial(list, expected),
        )
    for place, name in enumerate(case.names if case.numeric else ()):
        given = [values[place] for values in case.arguments]
        if all(isinstance(value, np.ndarray) for value in given):
            yield (
                "unchanged",
                f"That is the argument `{name}`, unchanged.",
                partial(applied, np.nan_to_num, given),
            )


def arguments(case: Case) -> Iterator[Row]:
    """What the right answer gives with arguments exchanged; right but for a step, a term or a
    factor."""
    for i, j in combinations(range(len(case.names)), 2):
        if all(alike(values[i], values[j]) for values in case.arguments):
            says = (
                f"It is right with `{case.names[i]}` and `{case.names[j]}` exchanged: which is "
                f"which?"
            )
            yield "exchanged", says, partial(instead, case, {i: itemgetter(j), j: itemgetter(i)})
    known = [
        (f"the argument `{name}`", [values[i] for values in case.arguments])
        for i, name in enumerate(case.names)
    ]
    known += [(f"the result {name}", list(values)) for name, values in case.others]
    known += [("one", [1.0 if case.numeric else sp.S.One] * len(case.expected))]
    for what, values in known:
        if not all(
            fits(value, wanted, case.numeric)
            for value, wanted in zip(values, case.expected, strict=True)
        ):
            continue
        for name, change in (
            ("term", lambda b, v: b - v),
            ("term", lambda b, v: b + v),
            ("factor", lambda b, v: b / v),
            ("factor", lambda b, v: b * v),
        ):
            much = "added, or forgotten" if name == "term" else "too many, or forgotten"
            says = f"It is right but for a {name} that is {what}: {much}?"
            yield name, says, partial(applied, change, case.expected, values)


SLIPS = {
    "inner-sign": "with one sign changed: a plus for a minus, or the other way",
    "order": "with something not transposed, or two things in another order",
    "term-lost": "with one term left out",
    "factor-lost": "with one multiplication, or division, left out",
    "quotient": "with a product in the place of a quotient, or the other way",
    "power-lost": "with a power left out",
    "function-lost": "with a function, such as a root, left out",
    "number": "with another number, index or axis somewhere",
    "letter": "with one letter in the place of another",
}


def slips(case: Case) -> Iterator[Row]:
    """What the right answer gives with one thing changed in its code."""
    end = time.monotonic() + SECONDS
    for name, answer in changed_keys(case.sensitivity.answers[0]):
        if time.monotonic() > end:
            return
        says = f"The right answer would give that {SLIPS[name]}."
        yield name, says, partial(instead, case, {}, answer)


def applied(change: Callable[..., Any], *columns: Sequence[Any]) -> list[Any]:
    """The change of what stands in each place."""
    return [change(*row) for row in zip(*columns, strict=True)]


def instead(
    case: Case, other: dict[int, Callable[[Sequence[Any]], Any]], answer: Callable | None = None
) -> list[Any]:
    """What the right answer, or another one, gives with other arguments in some places."""
    values_ = []
    answer = answer or case.sensitivity.answers[0]
    for values, wanted in zip(copy.deepcopy(case.arguments), case.expected, strict=True):
        result = answer(*(other[i](values) if i in other else v for i, v in enumerate(values)))
        values_.append(like(result[case.part] if case.sensitivity.several else result, wanted))
    return values_


def alike(first: Any, second: Any) -> bool:
    if isinstance(first, sp.Basic) or isinstance(second, sp.Basic):
        return isinstance(first, sp.Symbol) and isinstance(second, sp.Symbol)
    return not callable(first) and not callable(second) and np.shape(first) == np.shape(second)


def fits(value: Any, wanted: Any, numeric: bool) -> bool:
    """Whether a value may be a term of a result: of the same shape, or a number."""
    if numeric:
        return (
            not callable(value)
            and not isinstance(value, sp.Basic)
            and np.shape(value) in ((), np.shape(wanted))
        )
    return isinstance(value, sp.Basic | int | float) or np.shape(value) == np.shape(wanted)


def compared(rows: Callable[[Case], Iterator[Row]]) -> Callable[[Case], Said | None]:
    """The hint of the first row that would have given what was found, and not what was expected."""

    def hint(case: Case) -> Said | None:
        for name, says, made in rows(case):
            try:
                would = list(made())
                shaped = all(
                    np.shape(a) == np.shape(b) for a, b in zip(case.answered, would, strict=True)
                )
                if (
                    shaped
                    and case.agree(case.answered, would)
                    and not case.agree(would, case.expected)
                ):
                    return name, says
            except (OutOfTime, KeyboardInterrupt):
                raise
            except Exception:  # there is no such result
                continue
        return None

    return hint


# -- where it is right


def vanishing(case: Case) -> Said | None:
    """Nothing, or nothing but rounding."""
    if case.numeric:
        zero = all(
            np.abs(a).max(initial=0.0) <= ROUNDING * np.abs(b).max(initial=0.0)
            for a, b in case.pairs
        )
        if not zero or not all(np.any(b) for b in case.expected):
            return None
    elif not case.agree(case.answered, [0 * value for value in case.expected]):
        return None
    return (
        "vanishing",
        "It is zero: is that what is left when all cancels, or is something multiplied by zero?",
    )


def rounded(case: Case) -> Said | None:
    """Right, and then rounded; to whole numbers where there are several, as ones and zeros say
    nothing."""
    whole = case.numeric and len(np.unique(case.flat[0])) > 2
    for decimals in range(0 if whole else 1, 9) if case.numeric else ():
        if all(np.array_equal(a, np.round(b, decimals)) for a, b in case.pairs):
            return "precision", "It is rounded: hand in all digits."
    return None


def rough(case: Case) -> Said | None:
    """Right to some digits."""
    if not case.numeric or not all(equal(a, b, ROUGH, {}) for a, b in case.pairs):
        return None
    mine, _ = case.flat
    single = np.array_equal(mine, np.asarray(mine, np.float32), equal_nan=True)
    if single and not np.array_equal(mine, np.round(mine), equal_nan=True):
        says = (
            "It is right to the 7 digits of single precision (float32): compute in double "
            "precision (float64)."
        )
    else:
        says = (
            "It is nearly right: is something rounded, or something small left out, added or "
            "divided otherwise?"
        )
    return "precision", says


def sometimes(case: Case) -> Said | None:
    """Right for some of the hidden arguments."""
    right = [case.agree([a], [b]) for a, b in case.pairs]
    if not any(right):
        return None
    sizes = [np.size(b) // (len(b) if np.ndim(b) else 1) for _, b in case.pairs if case.numeric]
    if len(set(sizes)) > 1 and [size == 1 for size in sizes] == right:
        return (
            "scalars-only",
            "It is right for scalars only: look at the order of the matrices, at what is "
            "transposed, and at what is done entry by entry or over all axes at once.",
        )
    return (
        "sometimes",
        f"It is right for {sum(right)} of {len(right)} hidden inputs: a case is left out, or it "
        f"holds for a special one only.",
    )


def first_step(case: Case) -> Said | None:
    """A run that starts well, or each step of which stands beside its place."""
    if (
        not case.numeric
        or case.axes[:1] != ("step",)
        or not all(b.ndim and len(b) > 3 for _, b in case.pairs)
    ):
        return None
    later = [
        not case.agree([a[k : k + 1]], [b[k : k + 1]])
        for a, b in case.pairs
        for k in range(1, len(b))
    ]
    if all(case.agree([a[:1]], [b[:1]]) for a, b in case.pairs) and 2 * sum(later) > len(later):
        return (
            "from-second-step",
            "The first step is right, later ones are not: what is handed on from one step to the "
            "next?",
        )
    for mine, right, word in (
        (slice(1, None), slice(None, -1), "late"),
        (slice(None, -1), slice(1, None), "early"),
    ):
        if case.agree([a[mine] for a in case.answered], [b[right] for b in case.expected]):
            return "shifted", f"The values are right, but each stands one step too {word}."
    return None


def factor_or_term(case: Case) -> Said | None:
    """A factor, or a term, that is the same everywhere, or for all that a call gives."""
    if not case.numeric:
        return None
    for axis, words in ((0, "the same everywhere"), (None, "one number for all that a call gives")):
        if all(
            (np.size(b) if axis is None else np.ndim(b) > 1 and len(b)) > 2
            and np.max(np.ptp(a - b, axis=axis)) < 1e-9 * np.abs(b).max()
            for a, b in case.pairs
        ):
            return "term", f"It is right but for a term that is {words}."
    a, b = case.flat
    if len(b) > 1 and np.ptp(b) > 1e-3 * np.abs(b).max():
        ratio = (a @ b) / (b @ b)
        if abs(ratio) > 1e-6 and np.allclose(a, ratio * b, rtol=1e-9, atol=1e-9 * np.abs(a).max()):
            return "factor", "It is right but for a factor that is the same everywhere."
    return None


def entries(case: Case) -> Said | None:
    """Some entries of a matrix, or some components of a vector."""
    if case.numeric:
        lead = len(case.axes)
        pairs = [(a, b) for a, b in case.pairs if b.ndim > lead and b.size > b.shape[0]]
    else:
        lead, pairs = (
            0,
            [
                (np.array(a), np.array(b))
                for a, b in case.pairs
                if isinstance(b, sp.MatrixBase) and len(case.pairs) == 1
            ],
        )
    shapes = {b.shape[lead:] for _, b in pairs}
    if (
        len(shapes) != 1
        or len(shape := shapes.pop()) not in (1, 2)
        or max(shape) > 6
        or np.prod(shape) < 2
    ):
        return None
    right = np.array(
        [
            all(case.agree([a[(..., *i)][()]], [b[(..., *i)][()]]) for a, b in pairs)
            for i in np.ndindex(shape)
        ]
    )
    wrong = ~right.reshape(shape)
    if wrong.all() or not wrong.any():
        return None
    places = (np.argwhere(wrong) + 1).tolist()
    if len(shape) == 1:
        which = ", ".join(str(place) for (place,) in places)
        return (
            "components",
            f"Only component{'s' * (len(places) > 1)} {which} "
            f"{'are' if len(places) > 1 else 'is'} wrong.",
        )
    if len(places) == 1:
        return "entry", f"Only the entry in row {places[0][0]}, column {places[0][1]} is wrong."
    if shape[0] == shape[1] and np.array_equal(~wrong, np.eye(len(wrong), dtype=bool)):
        return (
            "off-diagonal",
            "The diagonal is right, the rest is not: what has one component to do with another?",
        )
    return None


NOT_SYMMETRIC = "The result should be symmetric and is not: is a factor missing on one side?"
DIGITS_LOST = (
    "Some of the matrices are not symmetric, most are: are digits lost, as where "
    "something nearly singular is inverted?"
)


def improper(case: Case) -> Said | None:
    """A covariance that is none."""
    for answered, expected in case.pairs:
        if isinstance(expected, sp.MatrixBase):
            if (
                expected.rows == expected.cols > 1
                and case.agree([expected], [expected.T])
                and not case.agree([answered], [answered.T])
            ):
                return "not-symmetric", NOT_SYMMETRIC
        elif case.numeric and expected.ndim > 1 and expected.shape[-1] == expected.shape[-2]:
            if not same(expected, expected.swapaxes(-1, -2)):
                return None
            if not np.allclose(answered, answered.swapaxes(-1, -2)):
                symmetric = np.isclose(answered, answered.swapaxes(-1, -2)).all(axis=(-2, -1))
                return (
                    ("digits-lost", DIGITS_LOST)
                    if symmetric.mean() > 0.5
                    else ("not-symmetric", NOT_SYMMETRIC)
                )
            own, right = (
                np.diagonal(matrix, axis1=-2, axis2=-1) for matrix in (answered, expected)
            )
            # zero is negative at times, by rounding
            if (own < -1e-9 * np.max(right)).any() and (right >= 0).all():
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
        missing, form = case.sensitivity.unused(case.part), "`{}`"
        # it does not feel a small change
        if all(np.array_equal(array, np.round(array)) for pair in case.pairs for array in pair):
            missing = [
                name
                for name in missing
                if isinstance(case.arguments[0][case.names.index(name)], int)
            ]
    else:
        mine, theirs = (
            {name for f in formulas(case, which) for name in symbols_of(f)} for which in (0, 1)
        )
        given = {
            s.name
            for values in case.arguments
            for v in values
            if hasattr(v, "free_symbols")
            for s in v.free_symbols
        }
        numbers = any(not n.is_integer for f in formulas(case, 0) for n in f.atoms(sp.Number))
        missing, extra, form = (
            sorted((theirs & given if numbers else theirs) - mine),
            sorted(mine - theirs),
            "{}",
        )
    if missing:
        which = ", ".join(map(form.format, missing))
        what = "forgotten, or cancelled, or is something of the notebook used instead?"
        return "unused", f"It does not depend on {which} and should: {what}"
    return ("superfluous", f"It depends on {', '.join(extra)} and should not.") if extra else None


def formulas(case: Case, which: int) -> list[sp.Expr]:
    """All entries of one side."""
    return [f for side in case.formulas for f in side[which]]


def symbols_of(formula: sp.Expr) -> list[str]:
    """Names of the symbols on whose values it depends."""
    return depends(formula, {s.name for s in formula.free_symbols})


def multiplied(case: Case, factor: float) -> Iterator[tuple[str, list[Any], list[Any]]]:
    """For each argument, or symbol of both sides: the student's results and the right ones with it
    multiplied."""
    if case.numeric:
        for place, name in enumerate(case.names):
            called = case.sensitivity.called(place, lambda value: scaled(value, factor))
            right, mine = ([pair[side][case.part] for pair in called] for side in (0, 1))
            same_shapes = all(a.shape == b.shape for a, b in zip(mine, right, strict=True))
            if called and same_shapes and all(np.isfinite(array).all() for array in mine):
                yield f"`{name}`", mine, right
        return
    sides = [formulas(case, which) for which in (0, 1)]
    names = [{s.name for f in side for s in f.free_symbols} for side in sides]
    for name in sorted(names[0] & names[1]):
        mine, right = (
            [
                f.xreplace({s: sp.nsimplify(factor) * s for s in f.free_symbols if s.name == name})
                for f in side
            ]
            for side in sides
        )
        if not any(f.has(sp.nan, sp.zoo, sp.oo) for f in (*mine, *right)):
            yield name, mine, right


def limit(case: Case) -> Said | None:
    """Right where something is zero: what comes in with it is wrong."""
    where = [
        name
        for name, mine, right in multiplied(case, 0.0)
        if any(map(np.any, right)) and case.agree(mine, right)
    ]
    if where and case.numeric:  # where nothing is brought in near zero either, that tells nothing
        near = {name for name, mine, right in multiplied(case, 0.01) if case.agree(mine, right)}
        where = [name for name in where if name not in near]
    if not where:
        return None
    part = f"look at the part that {'this' if len(where) == 1 else 'each of these'} brings in"
    return "limit", f"It is right where {' or '.join(where[:3])} is zero: {part}."


def power(case: Case) -> Said | None:
    """Another power of an argument than in the right answer."""
    before = [case.answered, case.expected] if case.numeric else [formulas(case, i) for i in (0, 1)]
    grown: dict[str, list[list[float]]] = {}
    for factor in (2, 4):  # powers, if both give the same
        for name, *after in multiplied(case, factor):
            pairs = zip(after, before, strict=True)
            grown.setdefault(name, []).append([exponent(case, factor, *pair) for pair in pairs])
    for name, ((mine, right), *again) in grown.items():
        if again and abs(mine - right) > 1e-6 and np.allclose(again, [[mine, right]], atol=1e-6):
            says = f"It grows with another power of {name} than it should: check the units."
            return "power", says
    return None


def exponent(case: Case, factor: int, new: Sequence[Any], old: Sequence[Any]) -> float:
    """The power of the factor by which everything has grown; NaN if it has not grown alike."""
    if not case.numeric:
        fitting = [k for k in POWERS if case.agree(new, [factor**k * f for f in old])]
        return float(fitting[0]) if len(fitting) == 1 else np.nan
    pairs = list(zip(new, old, strict=False))
    if any(np.shape(a) != np.shape(b) for a, b in pairs):
        return np.nan
    a, b = (np.concatenate([np.ravel(pair[which]) for pair in pairs]) for which in (0, 1))
    clear = np.abs(b) > 1e-9 * np.max(np.abs(b), initial=0.0)
    ratios = a[clear] / b[clear]
    if not len(ratios) or np.ptp(ratios) > 1e-7 * np.abs(ratios).max():
        return np.nan
    return float(np.log(ratios[0]) / np.log(factor))


POWERS = [sp.Rational(k, 2) for k in range(-8, 9)]


def narrow(case: Case) -> Said | None:
    """Right but for a factor, or a term, that is a number or depends on one symbol, where the right
    formula has more."""
    if case.numeric or any(len(side[0]) > 1 for side in case.formulas):
        return None
    pairs = [(mine, theirs) for (mine,), (theirs,) in case.formulas]
    everything = {name for _, theirs in pairs for name in symbols_of(theirs)}
    for what, apart in (
        ("factor", [a / b for a, b in pairs if b != 0]),
        ("term", [a - b for a, b in pairs]),
    ):
        on = {name for difference in apart for name in symbols_of(difference)}
        if len(apart) == len(pairs) and on < everything and len(on) < 2:
            which = f"depends on {on.pop()} only" if on else "is a number"
            return f"{what}-of", f"It is right but for a {what} that {which}."
    return None


def terms(case: Case) -> Said | None:
    """Some terms of a formula, multiplied out."""
    if case.numeric or len(case.formulas) != 1 or len(case.formulas[0][0]) != 1:
        return None
    mine, theirs = (set(sp.Add.make_args(sp.expand(side[0]))) for side in case.formulas[0])
    if not mine & theirs or len(mine) > 12:
        return None
    if theirs < mine:
        return "terms", "All terms that belong there are there, and something else besides."
    right = ", ".join(sorted(map(str, mine & theirs)))
    # which may be right in another form, in part
    more = "another is missing" if mine < theirs else "look at the rest"
    return (
        "terms",
        f"Of your terms, multiplied out, {right} {'is' if len(mine & theirs) == 1 else 'are'} "
        f"right; {more}.",
    )


def direction(case: Case) -> Said | None:
    """Too large, or too small, wherever it is wrong."""
    if not case.numeric:
        return None
    a, b = case.flat
    wrong = np.isfinite(b) & ~np.isclose(a, b, rtol=1e-9, atol=0)
    larger = np.abs(a[wrong]) > np.abs(b[wrong])
    # below zero is not too large, whatever its size
    signs = a[wrong] * b[wrong] < 0, (a[wrong] < 0) & (b[wrong] == 0)
    if np.sum(wrong) < 3 or np.any(signs) or larger.any() != larger.all():
        return None
    words = ("large", "is something added that does not belong there, or not divided?")
    if not larger.all():
        words = ("small", "is something missing, or divided once too often?")
    return f"too-{words[0]}", f"It is too {words[0]} wherever it is wrong: {words[1]}"


HINTS: tuple[Callable[[Case], Said | None], ...] = (
    vanishing,
    compared(results),
    rounded,
    rough,
    unused,
    improper,
    first_step,
    factor_or_term,
    entries,
    compared(arguments),
    sometimes,
    limit,
    power,
    narrow,
    terms,
    compared(slips),
    direction,
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
