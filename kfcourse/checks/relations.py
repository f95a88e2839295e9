"""How a wrong answer stands to the right one: with arguments exchanged, in another order, right where something is zero.

More hints of the kind of hints.py, for answers of which nothing simpler can be said.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.checks.case import Case, Said
from kfcourse.checks.dependence import changed, scaled
from kfcourse.checks.equality import depends, like
from kfcourse.limits import OutOfTime


def limit(case: Case) -> Said | None:
    """Right where something is zero: what comes in with it is wrong."""
    where = [name for name, found, expected in _near_zero(case, 0.0) if not _empty(expected) and case.agree(found, expected)]
    if where and case.numeric:  # where nothing is brought in near zero either, that tells nothing
        near = {name for name, found, expected in _near_zero(case, 0.01) if case.agree(found, expected)}
        where = [name for name in where if name not in near]
    if not where:
        return None
    form = "`{}`" if case.numeric else "{}"
    which = " or ".join(form.format(name) for name in where[:3])
    return (
        "limit",
        f"It is right where {which} is zero: look at the part that {'this' if len(where) == 1 else 'each of these'} brings in.",
    )


def _near_zero(case: Case, factor: float) -> Iterator[tuple[str, list[Any], list[Any]]]:
    """For each argument, or symbol: both results where it is zero, or an argument is small."""
    if case.numeric:
        for place, name in enumerate(case.names):
            called = case.sensitivity.called(place, lambda value: scaled(value, factor))
            right, mine = ([pair[side][case.part] for pair in called] for side in (0, 1))
            if called and all(np.isfinite(one).all() and one.shape == two.shape for one, two in zip(mine, right, strict=True)):
                yield name, mine, right
        return
    yield from _with_symbol(case, lambda _: sp.S.Zero)


def _formulas(case: Case, which: int) -> list[sp.Expr]:
    return [f for side in case.formulas for f in side[which]]


def _with_symbol(case: Case, change: Callable[[sp.Symbol], sp.Expr]) -> Iterator[tuple[str, list[sp.Expr], list[sp.Expr]]]:
    """For each symbol of both sides: the student's formulas and the right ones with it changed."""
    sides = [_formulas(case, which) for which in (0, 1)]
    for name in sorted(set.intersection(*({s.name for f in side for s in f.free_symbols} for side in sides))):
        mine, right = ([f.xreplace({s: change(s) for s in f.free_symbols if s.name == name}) for f in side] for side in sides)
        if not any(f.has(sp.nan, sp.zoo, sp.oo) for f in (*mine, *right)):
            yield name, mine, right


def _empty(results: Sequence[Any]) -> bool:
    return all(result == 0 if isinstance(result, sp.Basic) else not np.any(result) for result in results)


def power(case: Case) -> Said | None:
    """Another power of an argument than in the right answer."""
    if not case.numeric:
        return _power_of_symbol(case)
    for place, name in enumerate(case.names):
        growth = [_growth(case, place, factor) for factor in (2.0, 4.0)]
        if all(right is not None and mine is not None for right, mine in growth):
            (right, mine), (again, more) = growth
            if abs(right - mine) > 1e-6 and np.allclose([again, more], [right**2, mine**2], rtol=1e-6):  # powers, both of them
                return "power", f"It grows with another power of `{name}` than it should: check the units."
    return None


POWERS = [sp.Rational(k, 2) for k in range(-8, 9)]


def _power_of_symbol(case: Case) -> Said | None:
    for name, mine, right in _with_symbol(case, lambda s: 2 * s):
        powers = [
            [k for k in POWERS if case.agree(changed, [2**k * f for f in _formulas(case, side)])]
            for side, changed in ((0, mine), (1, right))
        ]
        if all(len(k) == 1 for k in powers) and powers[0] != powers[1]:
            return "power", f"It grows with another power of {name} than it should: check the units."
    return None


def _growth(case: Case, place: int, factor: float) -> tuple[Any, ...]:
    """By how much the right answer and the student's grow with an argument; None where not all of it grows alike."""
    called = case.sensitivity.called(place, lambda value: scaled(value, factor))
    return tuple(
        _ratio([pair[side][case.part] for pair in called], before) for side, before in enumerate((case.expected, case.found))
    )


def _ratio(changed: Sequence[Any], before: Sequence[Any]) -> float | None:
    """By how much everything has grown, if it has grown alike."""
    pairs = list(zip(changed, before, strict=False))
    if any(np.shape(a) != np.shape(b) for a, b in pairs):
        return None
    a, b = (np.concatenate([np.ravel(pair[which]) for pair in pairs]) for which in (0, 1))
    told = np.abs(b) > 1e-9 * np.max(np.abs(b), initial=0.0)
    ratios = a[told] / b[told]
    return float(ratios[0]) if len(ratios) and np.ptp(ratios) <= 1e-7 * np.abs(ratios).max() else None


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
    more = "another is missing" if mine < theirs else "look at the rest"  # which may be right in another form, in part
    return "terms", f"Of your terms, multiplied out, {right} {'is' if len(mine & theirs) == 1 else 'are'} right; {more}."


def exchanged(case: Case) -> Said | None:
    """Right if two arguments change places."""
    (right, mine), several = case.sensitivity.answers, case.sensitivity.several
    for i, j in combinations(range(len(case.names)), 2):
        if not all(_alike(values[i], values[j]) for values in case.arguments):
            continue
        try:
            results: list[list[Any]] = [[], []]
            for values, wanted in zip(case.arguments, case.expected, strict=True):
                other = list(values)
                other[i], other[j] = other[j], other[i]
                for answer, found in zip((mine, right), results, strict=True):
                    result = answer(*copy.deepcopy(other))
                    found.append(like(result[case.part] if several else result, wanted))
        except (OutOfTime, KeyboardInterrupt):
            raise
        except BaseException:  # the answer does not work for them, or ends the program
            continue
        if case.agree(results[0], case.expected) and not case.agree(results[1], case.expected):  # they do not simply commute
            return "exchanged", f"It is right with `{case.names[i]}` and `{case.names[j]}` exchanged: which is which?"
    return None


def _alike(first: Any, second: Any) -> bool:
    if isinstance(first, sp.Basic) or isinstance(second, sp.Basic):
        return isinstance(first, sp.Symbol) and isinstance(second, sp.Symbol)
    return not callable(first) and not callable(second) and np.shape(first) == np.shape(second)


def differs(case: Case) -> Said | None:
    """Right but for a term, or a factor, that is an argument or another result."""
    known = [(f"the argument `{name}`", [values[i] for values in case.arguments]) for i, name in enumerate(case.names)]
    known += [(f"the result {name}", list(values)) for name, values in case.others]
    known += [("one", [1.0 if case.numeric else sp.S.One] * len(case.expected))]
    for what, values in known:
        if not all(_fits(value, wanted, case.numeric) for value, wanted in zip(values, case.expected, strict=True)):
            continue
        if not case.numeric:
            values = [value if isinstance(value, sp.Basic | sp.MatrixBase) else sp.sympify(value) for value in values]
        for name, says, change in (
            ("term", f"It is right but for a term that is {what}: added, or forgotten?", lambda a, v: a + v),
            ("term", f"It is right but for a term that is {what}: added, or forgotten?", lambda a, v: a - v),
            ("factor", f"It is right but for a factor that is {what}: too many, or forgotten?", lambda a, v: a * v),
            ("factor", f"It is right but for a factor that is {what}: too many, or forgotten?", lambda a, v: a / v),
        ):
            try:
                changed = [change(a, v) for a, v in zip(case.found, values, strict=True)]
                shaped = all(np.shape(a) == np.shape(b) for a, b in zip(changed, case.expected, strict=True))
                if shaped and case.agree(changed, case.expected):
                    return name, says
            except Exception:  # no such sum or product
                continue
    return None


def _fits(value: Any, wanted: Any, numeric: bool) -> bool:
    """Whether a value may be a term of a result: of the same shape, or a number."""
    if numeric:
        return not callable(value) and not isinstance(value, sp.Basic) and np.shape(value) in ((), np.shape(wanted))
    return isinstance(value, sp.Basic | int | float) or np.shape(value) == np.shape(wanted)


CHANGES: tuple[tuple[str, Callable[[Any], Any]], ...] = (
    ("twice {}", lambda v: 2 * v),
    ("half of {}", lambda v: v / 2),
    ("{} with the other sign", lambda v: -v),
    ("the square of {}", lambda v: v**2),
    ("the root of {}", lambda v: v**0.5),
    ("1 less {}", lambda v: 1 - v),
)


def replaced(case: Case) -> Said | None:
    """What the right answer gives with something else in the place of an argument, or of what an argument returns."""
    right, _ = case.sensitivity.answers
    for place, name in enumerate(case.names if case.numeric else ()):
        for words, change in CHANGES:
            for which in range(3) if callable(case.arguments[0][place]) else (None,):
                try:
                    results = []
                    for values, wanted in zip(case.arguments, case.expected, strict=True):
                        other = list(copy.deepcopy(values))
                        other[place] = changed(other[place], change, which)
                        result = right(*other)
                        results.append(like(result[case.part] if case.sensitivity.several else result, wanted))
                except (OutOfTime, KeyboardInterrupt):
                    raise
                except Exception:  # the right answer does not work for it
                    continue
                if case.agree(case.found, results) and not case.agree(case.expected, results):
                    instead = f"`{name}`" if which is None else f"result {which + 1} of `{name}`"
                    return "replaced", f"The right answer would give that with {words.format(instead)} in the place of {instead}."
    return None


def shifted(case: Case) -> Said | None:
    """A step too early or too late."""
    if case.numeric and case.axes[:1] == ("step",) and all(np.ndim(b) and len(b) > 3 for b in case.expected):
        for which, late in ((slice(1, None), slice(None, -1)), (slice(None, -1), slice(1, None))):
            if case.agree([a[which] for a in case.found], [b[late] for b in case.expected]):
                word = "late" if which.start else "early"
                return "shifted", f"The values are right, but each stands one step too {word}."
    return None


def narrow(case: Case) -> Said | None:
    """Right but for a factor, or a term, that is a number or depends on one symbol, where the right formula has more."""
    if case.numeric or any(len(side[0]) > 1 for side in case.formulas):
        return None
    pairs = [(mine, theirs) for (mine,), (theirs,) in case.formulas]
    everything = {name for _, theirs in pairs for name in _depends(theirs)}
    for what, apart in (("factor", [a / b for a, b in pairs if b != 0]), ("term", [a - b for a, b in pairs])):
        on = {name for one in apart for name in _depends(one)}
        if len(apart) == len(pairs) and on < everything and len(on) < 2:
            which = f"depends on {on.pop()} only" if on else "is a number"
            return f"{what}-of", f"It is right but for a {what} that {which}."
    return None


def _depends(formula: sp.Expr) -> list[str]:
    return depends(formula, {s.name for s in formula.free_symbols})


def direction(case: Case) -> Said | None:
    """Too large, or too small, wherever it is wrong."""
    if not case.numeric:
        return None
    a, b = (np.concatenate([np.ravel(pair[which]) for pair in case.pairs]) for which in (0, 1))
    told = np.isfinite(b) & ~np.isclose(a, b, rtol=1e-9, atol=0)
    larger = np.abs(a[told]) > np.abs(b[told])
    signs = a[told] * b[told] < 0, (a[told] < 0) & (b[told] == 0)  # below zero is not too large, whatever its size
    if np.sum(told) < 3 or np.any(signs) or larger.any() != larger.all():
        return None
    if larger.all():
        return "too-large", "It is too large wherever it is wrong: is something added that does not belong there, or not divided?"
    return "too-small", "It is too small wherever it is wrong: is something missing, or divided once too often?"


RELATIONS: tuple[Callable[[Case], Said | None], ...] = (
    exchanged,
    shifted,
    differs,
    limit,
    power,
    narrow,
    terms,
    replaced,
    direction,
)
