"""Known mistakes of set r, question by question: edits of the keys, and what is said of each."""

from __future__ import annotations

from kfcourse.exercises.checks.editing import edits
from kfcourse.exercises.sets import messages
from kfcourse.exercises.sets.r_loop.keys import (
    characteristic,
    discriminator,
    lock_in,
    mean_time,
    slips,
    steady,
)

AMPLITUDE = "The amplitude enters twice: in the signal, and in its slope."
SLOW = "That is the limit of a slow loop; the exact value is asked for."
DISCRIMINANT = "Solve the quadratic equation once more: what stands under the root is wrong."
AT_THE_END = (
    "The runs that are off at the end are counted; one that has slipped and come back "
    "has slipped too."
)

# -- r1: the discriminator

WRONG_DISCRIMINATORS = edits(
    discriminator,
    (
        "innovation-sign",
        "The sign is wrong: of the innovation, what came minus what was expected, or of the "
        "derivative of a cosine?",
        "y - expected",
        "expected - y",
    ),
    (
        "slope-forgotten",
        "That is the innovation over its variance; what would a change of the phase do to the "
        "signal?",
        "slope * ",
        "",
    ),
    ("signal-for-derivative", messages.SIGNAL_FOR_DERIVATIVE, "slope * ", "expected * "),
    (
        "not-divided",
        "The noise of the meter is missing: the noisier it is, the less it says.",
        " / sigma**2",
        "",
    ),
    (
        "by-deviation",
        "It is divided by a standard deviation; the variance belongs there.",
        "sigma**2",
        "sigma",
    ),
    (
        "known-phase-forgotten",
        "The known phase of the carrier is missing.",
        "np.cos(theta + lam), -A * np.sin(theta + lam)",
        "np.cos(lam), -A * np.sin(lam)",
    ),
    (
        "measurement-for-innovation",
        "The measurement itself is multiplied by the slope; subtract what was expected.",
        "(y - expected)",
        "y",
    ),
)

# -- r2: its characteristic

WRONG_CHARACTERISTICS = edits(
    characteristic,
    ("half-forgotten", "The mean of a squared sine over a period is not one.", "(2 * D)", "D"),
    (
        "tangent",
        "That is the tangent at zero; the characteristic bends, and has the period of the carrier.",
        "sp.sin(Delta)",
        "Delta",
    ),
    (
        "cosine",
        "It is not zero without an error: the loop would run away from where it should rest.",
        "sp.sin",
        "sp.cos",
    ),
    ("amplitude-once", AMPLITUDE, "A**2", "A"),
    ("noise-squared", "D is a variance; it enters once.", "2 * D", "2 * D**2"),
    (
        "noise-of-meter",
        "That is the noise of the meter, in squared volts; the equivalent noise is one of the "
        "phase.",
        "1 / slope",
        "D",
    ),
    (
        "double-angle",
        "Its period is half of the carrier's; the loop has one stable zero in each period of the "
        "carrier.",
        "sp.sin(Delta)",
        "sp.sin(2 * Delta) / 2",
    ),
)

# -- r3: the steady state; r4: the lock-in range

WRONG_STEADY = edits(
    steady,
    ("negative-root", messages.NEGATIVE_ROOT, "q + sp.sqrt", "q - sp.sqrt"),
    ("small-noise", SLOW, "(q + sp.sqrt(q**2 + 4 * q * r)) / 2", "sp.sqrt(q * r)"),
    ("discriminant", DISCRIMINANT, "+ 4 * q * r", "+ q * r"),
    ("discriminant", DISCRIMINANT, "+ 4 * q", "- 4 * q"),
    (
        "noises-swapped",
        "Meter and object have changed places: q drives the phase, r is the noise of its "
        "measurement.",
        "    Psi =",
        "    q, r = r, q\n    Psi =",
    ),
    (
        "correction-forgotten",
        "What stands after the correction is the variance before it; what does a correction do to "
        "it?",
        "Psi - q",
        "Psi",
    ),
    (
        "prediction-added",
        "The noise of the object is added after the correction once more.",
        "Psi - q",
        "Psi + q",
    ),
)

WRONG_RANGES = edits(
    lock_in,
    ("radians", "That is in radians a second; a frequency is asked for.", "(2 * sp.pi * T)", "T"),
    (
        "per-step",
        "That is a share of a cycle in a step; a frequency is a number of cycles in a second.",
        "sp.pi * T",
        "sp.pi",
    ),
    (
        "period-multiplied",
        "It grows with the period of the samples; the fewer corrections, the less the loop can "
        "follow.",
        "(2 * sp.pi * T)",
        "(2 * sp.pi) * T",
    ),
    (
        "gain-forgotten",
        "The discriminator's output is no correction yet: what multiplies it?",
        "p * A",
        "A",
    ),
    ("gain-by-deviation", "p is a variance, and is the gain as it is.", "p * A", "sp.sqrt(p) * A"),
    (
        "half-forgotten",
        "It is twice what it should be: is the mean of a squared sine over a period taken as one, "
        "or half a cycle as a whole?",
        "(2 * D)",
        "D",
    ),
    (
        "half-a-cycle",
        "It is pi times what it should be: is the characteristic taken along its tangent to half "
        "a cycle, or pi left out?",
        "2 * sp.pi",
        "2",
    ),
    ("amplitude-once", AMPLITUDE, "A**2", "A"),
)

# -- r5: the mean time to a slip

WRONG_TIMES = edits(
    mean_time,
    (
        "bessel-once",
        "There are two integrals, over exp(V) and over exp(-V), and each gives a Bessel function.",
        "up * down",
        "np.sqrt(up * down)",
    ),
    (
        "deviation-for-variance",
        "The argument has a standard deviation where the variance belongs.",
        "np.asarray(variance)[:, None]",
        "np.sqrt(variance)[:, None]",
    ),
    (
        "limit",
        "That is the limit for a small variance; the exact value is asked for.",
        "2 * np.pi**2 / q * up * down",
        "np.pi * variance / q * np.exp(2 / variance)",
    ),
    (
        "variance-in-place",
        "The argument of the Bessel function is upside down: the surer the loop, the longer it "
        "lasts.",
        "/ np.asarray",
        "* np.asarray",
    ),
    (
        "deviation-of-phase",
        "q is the variance by which the phase wanders in a step; it is not squared or rooted.",
        "/ q",
        "/ np.sqrt(q)",
    ),
    (
        "wander-forgotten",
        "How fast the phase wanders is missing: in steps of which length is time counted?",
        " / q",
        "",
    ),
    (
        "half-a-cycle",
        "It is half of what it should be: is a loop half a cycle away taken as slipped? Every "
        "second one falls back from there.",
        "2 * np.pi**2",
        "np.pi**2",
    ),
)

# -- r6: slips counted

WRONG_SLIPS = edits(
    slips,
    (
        "rounded-down",
        "It is rounded down: a loop that is a little below zero has not lost a cycle.",
        "np.round",
        "np.floor",
    ),
    (
        "rounded-to-zero",
        "It is rounded towards zero: a loop that is a little short of a whole cycle rests there "
        "all the same.",
        "np.round",
        "np.trunc",
    ),
    (
        "not-rounded",
        "Whole cycles are asked for: the loop rests near one of its stable zeros.",
        "np.round",
        "",
    ),
    (
        "half-a-cycle",
        "A slip is counted where the loop may still fall back: it is over a whole cycle away.",
        ">= 2 * np.pi",
        ">= np.pi",
    ),
    ("one-side", "Slips to one side only are counted.", "np.abs(error)", "error"),
    ("away-at-the-end", AT_THE_END, "slipped.sum()", "np.sum(cycles != 0)"),
    (
        "slipped-runs-only",
        "Only the runs that slipped are averaged; those that lasted to the end are the good ones, "
        "and their steps count.",
        "first.sum() / slipped.sum()",
        "first[slipped].mean()",
    ),
    (
        "mean-of-all",
        "The runs without a slip are taken as if they slipped at the end: the time is too short.",
        "slipped.sum()",
        "len(first)",
    ),
    (
        "all-steps",
        "The steps after a first slip are counted too.",
        "first.sum()",
        "error.size",
    ),
)
