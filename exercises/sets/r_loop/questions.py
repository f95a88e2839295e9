"""Questions of set r: a loop that tracks a phase, how large an offset it follows, and how long it
lasts before it slips.

The set has a model of its own; hidden arguments are made here.  The keys are in keys.py, the known
mistakes in mistakes.py.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import sympy as sp

from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.exercises.checks.question import Question
from kfcourse.exercises.checks.registry import ExerciseSet
from kfcourse.exercises.sets.r_loop import keys
from kfcourse.exercises.sets.r_loop.mistakes import (
    WRONG_CHARACTERISTICS,
    WRONG_DISCRIMINATORS,
    WRONG_RANGES,
    WRONG_SLIPS,
    WRONG_STEADY,
    WRONG_TIMES,
)
from kfcourse.exercises.sets.shared import personal

DELTA = (sp.Symbol("Delta", real=True), *sp.symbols("A D", positive=True))
NOISES, LOOP = sp.symbols("q r", positive=True), sp.symbols("p A D T", positive=True)


def loop_numbers(exercise: Exercise) -> dict[str, float]:
    """sigma of the meter (V, the amplitude is 1 V), s_phi by which the phase wanders (rad a step),
    rate of the samples (kHz)."""
    return personal(
        exercise, "r", sigma=(2.0, 1.6, 2.4), s_phi=(0.2, 0.17, 0.24), rate=(8.0, 4, 12)
    )


def samples(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("r1")
    phases = rng.uniform(-3, 3, (2, 20))
    return [
        (
            phases[0],
            2 * rng.normal(size=20),
            phases[1],
            rng.uniform(1.2, 1.8),
            rng.uniform(0.5, 0.8),
        )
    ]


def variances(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("r5")
    return [(rng.uniform(0.2, 1.5, 6), rng.uniform(0.01, 0.05))]


def paths(exercise: Exercise) -> list[tuple]:
    """Errors of loops that rest near whole cycles, and slip to either side: 60 steps, nine runs;
    six slip, one of them back."""
    rng = exercise.rng("r6")
    error = 0.9 * np.sin(rng.normal(size=(60, 9)))
    # beyond the unstable zero, and back
    error[rng.integers(5, 20, 9), np.arange(9)] = 4.2 * rng.choice((-1, 1), 9)
    for run, cycles in enumerate(rng.permutation([1, -1, 2, -1, 1])):
        error[rng.integers(22, 50) :, run] += 2 * np.pi * cycles
    error[30:40, 5] = 2 * np.pi + np.abs(error[30:40, 5])  # and is where it was, at the end
    error[-1] = 2 * np.pi * np.round(error[-1] / (2 * np.pi)) + 0.4 * rng.permutation(
        [1, -1, 1, -1, 1, -1, 1, -1, -1]
    )
    return [(error,)]


QUESTIONS = (
    Question(
        "r1",
        "the discriminator",
        "warm-up",
        keys.discriminator,
        samples,
        WRONG_DISCRIMINATORS,
        advice="Write the log-likelihood of the phase down, and differentiate it by the phase.",
        axes=("sample",),
    ),
    Question(
        "r2",
        "its characteristic",
        "core",
        keys.characteristic,
        lambda e: [DELTA],
        WRONG_CHARACTERISTICS,
        ("U", "slope", "noise"),
        advice="Put y in without its noise, and write products of sine and cosine as sums: which "
        "are left after a period?",
    ),
    Question(
        "r3",
        "the steady state of the loop",
        "core",
        keys.steady,
        lambda e: [NOISES],
        WRONG_STEADY,
        ("Psi", "p"),
        advice="Put your two results into both equations of the hint: do they hold? Try q = 1, r "
        "= 2.",
    ),
    Question(
        "r4",
        "the lock-in range",
        "core",
        keys.lock_in,
        lambda e: [LOOP],
        WRONG_RANGES,
        advice="By how much can one correction move the phase at most? By how much does an offset "
        "move it between two samples?",
    ),
    Question(
        "r5",
        "how long until a slip?",
        "core",
        keys.mean_time,
        variances,
        WRONG_TIMES,
        advice="Check a sure loop against the exponential formula of the chapter, and an unsure "
        "one against a free random walk.",
    ),
    Question(
        "r6",
        "slips counted",
        "core",
        keys.slips,
        paths,
        WRONG_SLIPS,
        ("cycles", "time"),
        advice="Take two runs of ten steps by hand: one slips at step 4, the other never. How "
        "many steps were without a slip?",
    ),
)

SET = ExerciseSet(
    "r",
    "Loop, lock-in, slips",
    Path(__file__).parent,
    QUESTIONS,
    chapters=("course/discriminator", "beyond/cycle-slips"),
    numbers=loop_numbers,
    about_variant=False,
)
