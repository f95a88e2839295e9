"""Questions of set e: comparing filters by Monte Carlo, with standard errors.

Answers are functions of stored trajectories: x and z are (steps, N, n), p is (steps, N, n, n);
results are (steps,).  The hidden arguments are made here; the keys are in keys.py, the known
mistakes in mistakes.py.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.exercises.checks.question import Question
from kfcourse.exercises.checks.registry import ExerciseSet
from kfcourse.exercises.sets.e_comparison.keys import (
    difference,
    error_variance,
    normalised_error,
    ratio,
    with_standard_error,
)
from kfcourse.exercises.sets.e_comparison.mistakes import (
    WRONG_DIFFERENCES,
    WRONG_ERRORS,
    WRONG_NORMALISED,
    WRONG_RATIOS,
    WRONG_VARIANCES,
)
from kfcourse.filters import aof
from kfcourse.laws import Array, transpose
from kfcourse.montecarlo.experiment import run

RUNS, STEPS = 40, 5


def hidden_estimates(exercise: Exercise, name: str) -> tuple[Array, Array, Array, Array]:
    """States, the estimates of two filters and the first one's covariances, on common
    trajectories."""
    x, y = exercise.simulate(RUNS, STEPS, name)
    first = run(aof(exercise.given.gaussian), y)
    rng = exercise.rng(f"{name}-other")
    noise = rng.normal(size=x.shape) * x.std(axis=1, keepdims=True)
    # a linear model's filter has one covariance for all trajectories
    each = rng.uniform(0.7, 1.3, (*x.shape[:2], 1, 1))
    return x, first.mean + 0.03 * noise, first.mean + 0.08 * noise[::-1], each * first.cov


def asked(name: str, *places: int) -> Callable[[Exercise], list[tuple]]:
    """Arguments at these places of the hidden estimates; of a scalar variant also with two
    components, which are correlated."""

    def arguments(exercise: Exercise) -> list[tuple]:
        estimates = hidden_estimates(exercise, name)
        cases = [estimates]
        if exercise.model.n == 1:
            other = hidden_estimates(exercise, f"{name}-second")
            x, first, second, _ = (
                np.concatenate(pair[:2], axis=-1) for pair in zip(estimates, other, strict=True)
            )
            rng = exercise.rng(f"{name}-covariance")
            roots = (np.eye(2) + 0.4 * rng.normal(size=(*x.shape, 2))) * np.abs(x - first).mean()
            cases.append((x, first, second, roots @ transpose(roots)))
        return [tuple(case[place] for place in places) for case in cases]

    return arguments


TWO = ("value", "standard_error")

QUESTIONS = (
    Question(
        "e1",
        "the error variance",
        "warm-up",
        error_variance,
        asked("e1", 0, 1),
        WRONG_VARIANCES,
        advice="Look at the axes: over which of them is a sum taken, over which a mean, and which "
        "one is left?",
        axes=("step",),
    ),
    Question(
        "e2",
        "its standard error",
        "core",
        with_standard_error,
        asked("e2", 0, 1),
        WRONG_ERRORS,
        TWO,
        advice=(
            "The standard error belongs to a mean of N numbers. Which numbers, how much do they "
            "scatter, "
            "and how does a mean of N scatter?"
        ),
        axes=("step",),
    ),
    Question(
        "e3",
        "a paired difference",
        "core",
        difference,
        asked("e3", 0, 1, 2),
        WRONG_DIFFERENCES,
        TWO,
        advice=(
            "Make one number of each trajectory that holds all you want to average; then question "
            "2 applies to it."
        ),
        axes=("step",),
    ),
    Question(
        "e4",
        "a ratio",
        "stretch",
        ratio,
        asked("e4", 0, 1, 2),
        WRONG_RATIOS,
        TWO,
        advice=(
            "Change the mean above a little, then the mean below: how does the ratio change? Keep "
            "each "
            "trajectory's two changes together."
        ),
        axes=("step",),
    ),
    Question(
        "e5",
        "does the filter know its own error?",
        "core",
        normalised_error,
        asked("e5", 0, 1, 3),
        WRONG_NORMALISED,
        advice=(
            "Take one trajectory at one step: a vector, a matrix and a number. Then average the "
            "numbers "
            "over the trajectories, and look at the 1/n."
        ),
        axes=("step",),
    ),
)

SET = ExerciseSet(
    "e",
    "Comparison by Monte Carlo",
    Path(__file__).parent,
    QUESTIONS,
    chapters=("course/comparison",),
    angles=("y",),
)
