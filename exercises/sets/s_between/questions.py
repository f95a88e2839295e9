"""Questions of set s: between measurements.

Answers are functions of numbers and arrays. The keys are in keys.py, the known mistakes in
mistakes.py.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.exercises.checks.question import Question
from kfcourse.exercises.checks.registry import ExerciseSet
from kfcourse.exercises.sets.s_between.keys import (
    discretised,
    gain_rate,
    moment_rates,
    next_estimate,
)
from kfcourse.exercises.sets.s_between.mistakes import (
    WRONG_DISCRETE,
    WRONG_ESTIMATES,
    WRONG_LIMITS,
    WRONG_RATES,
)

RUNS = 6

# dx = -a x dt + sqrt(q) dw, y = x + w with the variance r/T if measured every T; c is the damping
# of a velocity: from, to.
NUMBERS = {"a": (0.3, 0.9), "q": (0.5, 1.6), "r": (0.2, 0.7), "c": (0.4, 1.2)}


def between_numbers(exercise: Exercise) -> dict[str, float]:
    """Numbers of the variant's object."""
    rng = exercise.rng("between")
    return {name: round(float(rng.uniform(*limits)), 2) for name, limits in NUMBERS.items()}


def rates_arguments(exercise: Exercise) -> list[tuple]:
    """Means, variances, and coefficients of drift and noise."""
    rng = exercise.rng("s1")
    z, p = rng.uniform(0.4, 1.6, RUNS), rng.uniform(0.3, 1.1, RUNS)
    low, high = [-0.9, -0.5, 0.6, 0.3], [-0.4, -0.2, 1.2, 0.7]
    return [(z, p, *map(float, rng.uniform(low, high)))]


def discrete_arguments(exercise: Exercise) -> list[tuple]:
    """Damping, intensity, interval: three times."""
    rng = exercise.rng("s2")
    return [tuple(map(float, rng.uniform([0.5, 1.3, 0.6], [1.4, 2.6, 1.7]))) for _ in range(3)]


def estimate_arguments(exercise: Exercise) -> list[tuple]:
    """Estimates, variances, measurements of which one is missing, times since the last one."""
    rng = exercise.rng("s3")
    z, y = rng.normal(size=(2, RUNS)) + 0.5
    y[2] = np.nan
    p, tau = rng.uniform(0.4, 1.3, RUNS), rng.uniform(0.3, 1.6, RUNS)
    return [(z, p, y, tau, *map(float, rng.uniform([0.4, 0.6, 0.3], [0.9, 1.5, 0.8])))]


def limit_arguments(exercise: Exercise) -> list[tuple]:
    """Three objects and intervals."""
    rng = exercise.rng("s4")
    low, high = [0.3, 0.6, 0.3, 0.2], [0.9, 1.7, 0.8, 0.7]
    return [tuple(map(float, rng.uniform(low, high))) for _ in range(3)]


QUESTIONS = (
    Question(
        "s1",
        "moment equations",
        "warm-up",
        moment_rates,
        rates_arguments,
        WRONG_RATES,
        ("z_rate", "p_rate"),
        advice="Let p be zero, then a3 and b1: which terms are left, and are they the plain ones?",
        axes=("trajectory",),
    ),
    Question(
        "s2",
        "an exact discretisation",
        "core",
        discretised,
        discrete_arguments,
        WRONG_DISCRETE,
        ("F", "Q"),
        advice="Let c become small: Q must become that of a velocity that only noise changes.",
    ),
    Question(
        "s3",
        "a measurement at an instant",
        "core",
        next_estimate,
        estimate_arguments,
        WRONG_ESTIMATES,
        ("z", "p"),
        advice="Try no time at all between the instants, then a very long one.",
        axes=("trajectory",),
    ),
    Question(
        "s4",
        "the limit of the gain",
        "stretch",
        gain_rate,
        limit_arguments,
        WRONG_LIMITS,
        ("p", "K_rate"),
        advice="One prediction and one correction must lead from your p to itself.",
    ),
)

SET = ExerciseSet(
    "s",
    "Between measurements",
    Path(__file__).parent,
    QUESTIONS,
    chapters=("beyond/between-measurements", "beyond/stratonovich-continuous"),
    numbers=between_numbers,
    about_variant=False,
)
