"""Known mistakes of set r, question by question, and what is said of each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy
import sympy as sp

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.r_loop.keys import characteristic, discriminator, lock_in, mean_time, slips, steady
from kfcourse.laws import Array

SIGN = "The sign is wrong: of the innovation, what came minus what was expected, or of the derivative of a cosine?"
HALF = "The mean of a squared sine over a period is not one."
AMPLITUDE = "The amplitude enters twice: in the signal, and in its slope."
SLOW = "That is the limit of a slow loop; the exact value is asked for."
DISCRIMINANT = "Solve the quadratic equation once more: what stands under the root is wrong."
AT_THE_END = "The runs that are off at the end are counted; one that has slipped and come back has slipped too."
ROUNDED_DOWN = "It is rounded down: a loop that is a little below zero has not lost a cycle."

# -- r1: the discriminator

WRONG_DISCRIMINATORS: tuple[tuple[str, str, Answer], ...] = (
    ("innovation-sign", SIGN, lambda lam, y, theta, A, s: -discriminator(lam, y, theta, A, s)),
    (
        "slope-forgotten",
        "That is the innovation over its variance; what would a change of the phase do to the signal?",
        lambda lam, y, theta, A, s: (y - A * np.cos(theta + lam)) / s**2,
    ),
    (
        "signal-for-derivative",
        messages.SIGNAL_FOR_DERIVATIVE,
        lambda lam, y, theta, A, s: A * np.cos(theta + lam) * (y - A * np.cos(theta + lam)) / s**2,
    ),
    (
        "not-divided",
        "The noise of the meter is missing: the noisier it is, the less it says.",
        lambda lam, y, theta, A, s: s**2 * discriminator(lam, y, theta, A, s),
    ),
    (
        "by-deviation",
        "It is divided by a standard deviation; the variance belongs there.",
        lambda lam, y, theta, A, s: s * discriminator(lam, y, theta, A, s),
    ),
    (
        "known-phase-forgotten",
        "The known phase of the carrier is missing.",
        lambda lam, y, theta, A, s: discriminator(lam, y, 0 * theta, A, s),
    ),
    (
        "measurement-for-innovation",
        "The measurement itself is multiplied by the slope; subtract what was expected.",
        lambda lam, y, theta, A, s: -A * np.sin(theta + lam) * y / s**2,
    ),
)

# -- r2: its characteristic

WRONG_CHARACTERISTICS: tuple[tuple[str, str, Answer], ...] = (
    (
        "half-forgotten",
        HALF,
        lambda x, A, D: (A**2 / D * sp.sin(x), A**2 / D, D / A**2),
    ),
    (
        "tangent",
        "That is the tangent at zero; the characteristic bends, and has the period of the carrier.",
        lambda x, A, D: (A**2 / (2 * D) * x, A**2 / (2 * D), 2 * D / A**2),
    ),
    (
        "cosine",
        "It is not zero without an error: the loop would run away from where it should rest.",
        lambda x, A, D: (A**2 / (2 * D) * sp.cos(x), A**2 / (2 * D), 2 * D / A**2),
    ),
    ("amplitude-once", AMPLITUDE, lambda x, A, D: (A / (2 * D) * sp.sin(x), A / (2 * D), 2 * D / A)),
    (
        "noise-squared",
        "D is a variance; it enters once.",
        lambda x, A, D: (A**2 / (2 * D**2) * sp.sin(x), A**2 / (2 * D**2), 2 * D**2 / A**2),
    ),
    (
        "noise-not-inverted",
        "The steeper the characteristic, the smaller the equivalent noise.",
        lambda x, A, D: (*characteristic(x, A, D)[:2], A**2 / (2 * D)),
    ),
    (
        "noise-of-meter",
        "That is the noise of the meter, in squared volts; the equivalent noise is one of the phase.",
        lambda x, A, D: (*characteristic(x, A, D)[:2], D),
    ),
    (
        "double-angle",
        "Its period is half of the carrier's; the loop has one stable zero in each period of the carrier.",
        lambda x, A, D: (A**2 / (4 * D) * sp.sin(2 * x), A**2 / (2 * D), 2 * D / A**2),
    ),
)

# -- r3: the steady state


def _root(inside: Callable[[sp.Expr, sp.Expr], sp.Expr], sign: int = 1) -> Answer:
    def answer(q: sp.Expr, r: sp.Expr) -> tuple[sp.Expr, ...]:
        Psi = (q + sign * sp.sqrt(inside(q, r))) / 2
        return Psi, Psi - q

    return answer


WRONG_STEADY: tuple[tuple[str, str, Answer], ...] = (
    ("negative-root", messages.NEGATIVE_ROOT, _root(lambda q, r: q**2 + 4 * q * r, -1)),
    ("small-noise", SLOW, lambda q, r: (sp.sqrt(q * r), sp.sqrt(q * r) - q)),
    ("small-noise", SLOW, lambda q, r: (sp.sqrt(q * r), sp.sqrt(q * r))),
    ("discriminant", DISCRIMINANT, _root(lambda q, r: q**2 + q * r)),
    ("discriminant", DISCRIMINANT, _root(lambda q, r: q**2 - 4 * q * r)),
    (
        "noises-swapped",
        "Meter and object have changed places: q drives the phase, r is the noise of its measurement.",
        lambda q, r: steady(r, q),
    ),
    ("before-and-after", "Before a correction the variance is larger than after it.", lambda q, r: steady(q, r)[::-1]),
    (
        "correction-forgotten",
        "What stands after the correction is the variance before it; what does a correction do to it?",
        lambda q, r: (steady(q, r)[0],) * 2,
    ),
    (
        "prediction-added",
        "The noise of the object is added after the correction once more.",
        lambda q, r: (steady(q, r)[0], steady(q, r)[0] + q),
    ),
)

# -- r4: the lock-in range

WRONG_RANGES: tuple[tuple[str, str, Answer], ...] = (
    ("radians", "That is in radians a second; a frequency is asked for.", lambda p, A, D, T: 2 * sp.pi * lock_in(p, A, D, T)),
    (
        "per-step",
        "That is a share of a cycle in a step; a frequency is a number of cycles in a second.",
        lambda p, A, D, T: T * lock_in(p, A, D, T),
    ),
    (
        "period-multiplied",
        "It grows with the period of the samples; the fewer corrections, the less the loop can follow.",
        lambda p, A, D, T: T**2 * lock_in(p, A, D, T),
    ),
    (
        "gain-forgotten",
        "The discriminator's output is no correction yet: what multiplies it?",
        lambda p, A, D, T: lock_in(p, A, D, T) / p,
    ),
    ("gain-by-deviation", "p is a variance, and is the gain as it is.", lambda p, A, D, T: lock_in(p, A, D, T) / sp.sqrt(p)),
    (
        "half-forgotten",
        "It is twice what it should be: is the mean of a squared sine over a period taken as one, or half a cycle as a whole?",
        lambda p, A, D, T: 2 * lock_in(p, A, D, T),
    ),
    (
        "half-a-cycle",
        "It is pi times what it should be: is the characteristic taken along its tangent to half a cycle, or pi left out?",
        lambda p, A, D, T: sp.pi * lock_in(p, A, D, T),
    ),
    ("amplitude-once", AMPLITUDE, lambda p, A, D, T: lock_in(p, A, D, T) / A),
)

# -- r5: the mean time to a slip

WRONG_TIMES: tuple[tuple[str, str, Answer], ...] = (
    (
        "bessel-once",
        "There are two integrals, over exp(V) and over exp(-V), and each gives a Bessel function.",
        lambda s, q: 2 * np.pi**2 / q * scipy.special.iv(0, 1 / s),
    ),
    (
        "deviation-for-variance",
        "The argument has a standard deviation where the variance belongs.",
        lambda s, q: 2 * np.pi**2 / q * scipy.special.iv(0, 1 / np.sqrt(s)) ** 2,
    ),
    (
        "limit",
        "That is the limit for a small variance; the exact value is asked for.",
        lambda s, q: np.pi * s / q * np.exp(2 / s),
    ),
    (
        "variance-in-place",
        "The argument of the Bessel function is upside down: the surer the loop, the longer it lasts.",
        lambda s, q: 2 * np.pi**2 / q * scipy.special.iv(0, s) ** 2,
    ),
    (
        "deviation-of-phase",
        "q is the variance by which the phase wanders in a step; it is not squared or rooted.",
        lambda s, q: 2 * np.pi**2 / np.sqrt(q) * scipy.special.iv(0, 1 / s) ** 2,
    ),
    (
        "wander-forgotten",
        "How fast the phase wanders is missing: in steps of which length is time counted?",
        lambda s, q: 2 * np.pi**2 * scipy.special.iv(0, 1 / s) ** 2,
    ),
    (
        "half-a-cycle",
        "It is half of what it should be: is a loop half a cycle away taken as slipped? Every second one falls back from there.",
        lambda s, q: mean_time(s, q) / 2,
    ),
    ("wrong-bessel", "It is the Bessel function of order zero.", lambda s, q: 2 * np.pi**2 / q * scipy.special.iv(1, 1 / s) ** 2),
    ("limit-of-unsure", "That is a phase that wanders freely, without a loop.", lambda s, q: 2 * np.pi**2 / q + 0 * s),
)

# -- r6: slips counted


def slips_with(
    whole: Callable[[Array], Array] = np.round, border: float = 2 * np.pi, size: Callable[[Array], Array] = np.abs
) -> Answer:
    """Cycles rounded otherwise, a slip counted from another error on, or on one side only."""

    def answer(error: Array) -> tuple[Array, Array]:
        away = size(error) >= border
        first = np.where(away.any(axis=0), away.argmax(axis=0), len(error))
        return whole(error[-1] / (2 * np.pi)), first.sum() / away.any(axis=0).sum()

    return answer


def _first(error: Array) -> tuple[Array, Array]:
    away = np.abs(error) >= 2 * np.pi
    return away.argmax(axis=0), np.asarray(away.any(axis=0))


def _lasted(error: Array, back: Array | bool = False) -> Array:
    """Steps of each run before its first slip; all of them of those that come back, if these are given."""
    first, slipped = _first(error)
    return np.where(slipped & ~np.asarray(back), first, len(error))


WRONG_SLIPS: tuple[tuple[str, str, Answer], ...] = (
    ("rounded-down", ROUNDED_DOWN, slips_with(whole=np.floor)),
    (
        "rounded-to-zero",
        "It is rounded towards zero: a loop that is a little short of a whole cycle rests there all the same.",
        slips_with(whole=np.trunc),
    ),
    ("not-rounded", "Whole cycles are asked for: the loop rests near one of its stable zeros.", slips_with(whole=lambda c: c)),
    (
        "half-a-cycle",
        "A slip is counted where the loop may still fall back: it is over a whole cycle away.",
        slips_with(border=np.pi),
    ),
    ("sign-lost", "A loop may slip to either side: say which.", slips_with(whole=lambda c: np.abs(np.round(c)))),
    ("one-side", "Slips to one side only are counted.", slips_with(size=lambda e: e)),
    (
        "away-at-the-end",
        AT_THE_END,
        lambda error: (slips(error)[0], _lasted(error).sum() / np.sum(slips(error)[0] != 0)),
    ),
    (
        "away-at-the-end",
        AT_THE_END,
        lambda error: (slips(error)[0], _lasted(error, slips(error)[0] == 0).sum() / np.sum(slips(error)[0] != 0)),
    ),
    (
        "slipped-runs-only",
        "Only the runs that slipped are averaged; those that lasted to the end are the good ones, and their steps count.",
        lambda error: (slips(error)[0], _first(error)[0][_first(error)[1]].mean()),
    ),
    (
        "mean-of-all",
        "The runs without a slip are taken as if they slipped at the end: the time is too short.",
        lambda error: (slips(error)[0], np.where(_first(error)[1], _first(error)[0], len(error)).mean()),
    ),
    (
        "all-steps",
        "The steps after a first slip are counted too.",
        lambda error: (slips(error)[0], error.size / _first(error)[1].sum()),
    ),
)
