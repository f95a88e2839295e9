"""Questions of set l: sensors of different rates, late and by clocks of their own.

What is derived is answered with formulas in the symbols of the arguments, what runs with arrays.
Personal numbers are in `timing_numbers`; hidden arguments are others.  The keys are in keys.py, the
known mistakes in mistakes.py.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import sympy as sp

from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.exercises.checks.question import Question
from kfcourse.exercises.checks.registry import ExerciseSet
from kfcourse.exercises.sets.l_time_tags.keys import (
    correct,
    cost,
    dimension,
    fit_clock,
    fuse,
    move,
    own_time,
)
from kfcourse.exercises.sets.l_time_tags.mistakes import (
    WRONG_CORRECTIONS,
    WRONG_COSTS,
    WRONG_DIMENSIONS,
    WRONG_FITS,
    WRONG_FUSIONS,
    WRONG_MOVES,
    WRONG_TIMES,
)
from kfcourse.exercises.sets.shared import covariance, personal


def timing_numbers(exercise: Exercise) -> dict[str, float]:
    """speed (m/s), acceleration (m/s^2), period, latency and jitter (s) and sigma (m) of the
    receiver, ratio of the rates."""
    numbers = personal(
        exercise,
        "l",
        speed=(250.0, 120, 300),
        acceleration=(3.0, 1.5, 4),
        period=(0.1, 0.1, 0.3),
        latency=(0.12, 0.08, 0.3),
        jitter=(0.04, 0.02, 0.1),
        sigma=(3.0, 2, 6),
        ratio=(40, 10, 60),
    )
    return numbers | {"ratio": int(numbers["ratio"])}


# -- l1: two rates in one vector; l2: two time scales


def dimension_arguments(exercise: Exercise) -> list[tuple]:
    """Two series; in the second a whole period passes before the first measurement of the
    receiver."""
    rng = exercise.rng("l1")
    # steps of a period: first, its neighbours and -first are different ones
    ratio, first = int(rng.choice((8, 9))), int(rng.integers(2, 4))
    return [(4 * ratio + 1, ratio, first), (3 * ratio, ratio, first + ratio)]


# -- l3: a correction of varying dimension


def correction_arguments(exercise: Exercise) -> list[tuple]:
    """All three components there; the second missing; only the last there; none there."""
    rng = exercise.rng("l3")
    m, P, H, R = rng.normal(size=3), covariance(rng, 3), rng.normal(size=(3, 3)), covariance(rng, 3)
    y = H @ m + rng.normal(size=3)
    missing: tuple[list[int], ...] = ([], [1], [0, 1], [0, 1, 2])
    return [(m, P, np.where(np.isin(np.arange(3), gone), np.nan, y), H, R) for gone in missing]


# -- l4: over any interval; l5: late measurements


def move_arguments(exercise: Exercise) -> list[tuple]:
    """Three laws, intervals and intensities."""
    rng = exercise.rng("l4")
    return [
        (rng.normal(size=2), covariance(rng, 2), float(dt), float(rng.uniform(1.3, 2)))
        for dt in rng.uniform(0.3, 2.6, 3)
    ]


def fusion_arguments(exercise: Exercise) -> list[tuple]:
    """Eight measurements, the first soon: the third and fourth arrive in the reverse order; the
    sixth has not arrived yet."""
    rng = exercise.rng("l5")
    tags = np.cumsum(rng.uniform([0.1, *[0.7] * 7], [0.4, *[1.3] * 7]))
    arrivals = tags + rng.uniform(0.2, 0.5, 8)
    arrivals[2] = arrivals[3] + rng.uniform(0.1, 0.3)
    now = arrivals[7] + 0.1
    arrivals[5] = now + 0.2
    m, P, q, r = (
        np.array([2.0, 3.0]),
        covariance(rng, 2),
        float(rng.uniform(0.3, 0.6)),
        float(rng.uniform(0.5, 0.9)),
    )
    values = m[0] + m[1] * tags + 0.4 * tags**2 + rng.normal(size=8)
    order = np.argsort(arrivals)
    return [(tags[order], arrivals[order], values[order], m, P, q, r, float(now))]


# -- l6: what ignoring the tag costs; l7: the clock from edges


def fit_arguments(exercise: Exercise) -> list[tuple]:
    """Pairs of edge and stamp, the edges late."""
    rng = exercise.rng("l7")
    times = np.sort(rng.uniform(3, 40, 9))
    return [(times + rng.uniform(0, 4, 9), rng.uniform(1.1, 1.4) * times + rng.uniform(2, 5))]


QUESTIONS = (
    Question(
        "l1",
        "two rates",
        "warm-up",
        dimension,
        dimension_arguments,
        WRONG_DIMENSIONS,
        advice="Write out k = 0, 1, 2, ... for a ratio of three and a first step of four, and "
        "count by hand.",
        axes=("step",),
    ),
    Question(
        "l2",
        "two time scales",
        "warm-up",
        own_time,
        lambda e: [sp.symbols("reading rate shift", positive=True)],
        WRONG_TIMES,
        advice="Try a clock that is right but for a shift, then one that only runs twice as fast.",
    ),
    Question(
        "l3",
        "a measurement of varying dimension",
        "core",
        correct,
        correction_arguments,
        WRONG_CORRECTIONS,
        ("m", "P"),
        advice=(
            "Choose the components that are there first, of everything that has a component for "
            "each; then "
            "it is the usual correction."
        ),
    ),
    Question(
        "l4",
        "over an interval of any length",
        "core",
        move,
        move_arguments,
        WRONG_MOVES,
        ("m", "P"),
        advice="Two intervals one after the other must give the same as the whole one: try it "
        "with your Q.",
    ),
    Question(
        "l5",
        "late and out of order",
        "core",
        fuse,
        fusion_arguments,
        WRONG_FUSIONS,
        ("m", "P"),
        advice=(
            "Draw the times on a line: captured, arrived, now. Which measurements may be used, in "
            "which "
            "order, and over which intervals do you move?"
        ),
    ),
    Question(
        "l6",
        "what ignoring the tag costs",
        "core",
        cost,
        lambda e: [sp.symbols("V a tau", positive=True)],
        WRONG_COSTS,
        ("position", "velocity"),
        advice="Expand s(-tau) and its derivative for a motion that you can follow by hand, such "
        "as V = 0.",
    ),
    Question(
        "l7",
        "the clock from edges",
        "stretch",
        fit_clock,
        fit_arguments,
        WRONG_FITS,
        ("rate", "shift"),
        advice=(
            "Which of the two has an error? That one is the target of the fit; then solve the "
            "line for the other."
        ),
    ),
)

SET = ExerciseSet(
    "l",
    "Rates and time tags",
    Path(__file__).parent,
    QUESTIONS,
    chapters=("course/time-tags", "beyond/four-sensors"),
    numbers=timing_numbers,
    about_variant=False,
)
