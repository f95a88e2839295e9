"""Questions of set n: a record of one's own: intervals, missing cells, a gate, and judging a filter
without a truth.

Everything is answered with arrays.  Personal numbers are in `record_numbers`; hidden arguments are
others.  The keys are in keys.py, the known mistakes in mistakes.py.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.exercises.checks.question import Question
from kfcourse.exercises.checks.registry import ExerciseSet
from kfcourse.exercises.sets.n_own_data.keys import (
    follow,
    gate,
    held_out,
    intervals,
    neighbours,
    process_noise,
)
from kfcourse.exercises.sets.n_own_data.mistakes import (
    WRONG_FILTERS,
    WRONG_GATES,
    WRONG_INTERVALS,
    WRONG_JUDGEMENTS,
    WRONG_NEIGHBOURS,
    WRONG_NOISES,
)
from kfcourse.exercises.sets.shared import covariance, personal


def record_numbers(exercise: Exercise) -> dict[str, float]:
    """q (m^2/s^3), sigma (m), shortest and longest interval (s), part of outliers and their size
    (m), part missing."""
    return personal(
        exercise,
        "n",
        q=(0.5, 0.2, 1.0),
        sigma=(2.0, 1.5, 4),
        shortest=(0.1, 0.1, 0.3),
        longest=(1.5, 1.2, 2.0),
        outliers=(0.05, 0.03, 0.07),
        size=(60.0, 40, 90),
        missing=(0.15, 0.1, 0.25),
    )


def _times(rng: np.random.Generator, steps: int) -> np.ndarray:
    return 3.0 + np.cumsum(rng.uniform(0.3, 2.6, steps))


def filter_arguments(exercise: Exercise) -> list[tuple]:
    """Nine rows: two missing in the middle, then one alone."""
    rng = exercise.rng("n3")
    times, m, P = _times(rng, 9), rng.normal(size=2), covariance(rng, 2)
    y = 5 * rng.normal(size=9)
    y[[3, 4, 7]] = np.nan
    return [(times, y, float(rng.uniform(0.4, 0.8)), float(rng.uniform(1.6, 2.4)), m, P)]


def gate_arguments(exercise: Exercise) -> list[tuple]:
    """Six innovations of three components, correlated."""
    rng = exercise.rng("n4")
    F = np.stack([covariance(rng, 3) for _ in range(6)])
    return [(2 * rng.normal(size=(6, 3)), F, float(rng.uniform(0.9, 0.98)))]


def held_out_arguments(exercise: Exercise) -> list[tuple]:
    """Seven errors in the plane, each with its own covariance."""
    rng = exercise.rng("n5")
    return [
        (
            1 + 3 * rng.normal(size=(7, 2)),
            np.stack([covariance(rng, 2) * scale for scale in rng.uniform(0.5, 4, 7)]),
        )
    ]


def neighbour_arguments(exercise: Exercise) -> list[tuple]:
    """Twenty innovations of unequal variances, each like the one before; four are missing, two of
    them in a row."""
    rng = exercise.rng("n6")
    F = rng.uniform(1.5, 6, 20)
    white = rng.normal(size=21)
    nu = np.sqrt(F) * (white[1:] + 0.7 * white[:-1])
    nu[[4, 9, 10, 15]] = np.nan
    return [(nu, F)]


QUESTIONS = (
    Question(
        "n1",
        "intervals",
        "warm-up",
        intervals,
        lambda e: [(_times(e.rng("n1"), 7),)],
        WRONG_INTERVALS,
        advice="Write down three times, and the length of the step that begins at each of them.",
        axes=("step",),
    ),
    Question(
        "n2",
        "the noise of an interval",
        "core",
        process_noise,
        lambda e: [(e.rng("n2").uniform(0.3, 2.6, 4), float(e.rng("n2").uniform(1.3, 2)))],
        WRONG_NOISES,
        advice="Two intervals one after the other must add as much as the whole one: A Q A^T + Q. "
        "Try it with your Q.",
    ),
    Question(
        "n3",
        "a filter over unequal steps",
        "core",
        follow,
        filter_arguments,
        WRONG_FILTERS,
        ("z", "p"),
        advice="Follow three rows by hand, the second of them empty: correct, predict, predict, "
        "correct.",
        axes=("step",),
    ),
    Question(
        "n4",
        "a gate",
        "core",
        gate,
        gate_arguments,
        WRONG_GATES,
        ("size", "edge"),
        advice="For a single component the size is nu^2 / F, and the edge for 95 % is 1.96 "
        "squared: try that first.",
    ),
    Question(
        "n5",
        "what was held out",
        "core",
        held_out,
        held_out_arguments,
        WRONG_JUDGEMENTS,
        ("rms", "claimed", "nis"),
        advice="Take F = I for all: then the second is the root of 2, and the third is the square "
        "of the first.",
    ),
    Question(
        "n6",
        "are they white?",
        "stretch",
        neighbours,
        neighbour_arguments,
        WRONG_NEIGHBOURS,
        ("correlation", "deviation"),
        advice="First make a list without gaps, of innovations with the variance 1; then count "
        "the pairs in it.",
    ),
)

SET = ExerciseSet(
    "n",
    "Your own data",
    Path(__file__).parent,
    QUESTIONS,
    chapters=("beyond/drive",),
    numbers=record_numbers,
    about_variant=False,
)
