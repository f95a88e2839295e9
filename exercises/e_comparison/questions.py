"""Questions of set e: comparing filters by Monte Carlo, with standard errors.

Answers are functions of stored trajectories: x and z are (steps, N, n), p is (steps, N, n, n); results are (steps,).  The
hidden arguments are made here; the keys are in keys.py, the known mistakes in mistakes.py.
"""

from __future__ import annotations

from pathlib import Path

from kfcourse.checks.exercises import Exercise
from kfcourse.checks.question import Question, catalogue
from kfcourse.checks.registry import ExerciseSet
from kfcourse.exercises.e_comparison.keys import difference, error_variance, normalised_error, ratio, with_standard_error
from kfcourse.exercises.e_comparison.mistakes import (
    WRONG_DIFFERENCES,
    WRONG_ERRORS,
    WRONG_NORMALISED,
    WRONG_RATIOS,
    WRONG_VARIANCES,
)
from kfcourse.filters import aof
from kfcourse.laws import Array
from kfcourse.montecarlo.experiment import run

RUNS, STEPS = 40, 5


def hidden_estimates(exercise: Exercise, name: str) -> tuple[Array, Array, Array, Array]:
    """States, the estimates of two filters and the first one's covariances, on common trajectories."""
    x, y = exercise.simulate(RUNS, STEPS, name)
    first = run(aof(exercise.given.gaussian), y)
    noise = exercise.rng(f"{name}-other").normal(size=x.shape) * x.std(axis=1, keepdims=True)
    return x, first.mean + 0.03 * noise, first.mean + 0.08 * noise[::-1], first.cov


TWO = ("value", "standard_error")

QUESTIONS = (
    Question(
        "e1",
        "the error variance",
        "warm-up",
        error_variance,
        lambda e: [hidden_estimates(e, "e1")[:2]],
        catalogue(WRONG_VARIANCES),
    ),
    Question(
        "e2",
        "its standard error",
        "core",
        with_standard_error,
        lambda e: [hidden_estimates(e, "e2")[:2]],
        catalogue(WRONG_ERRORS),
        TWO,
    ),
    Question(
        "e3",
        "a paired difference",
        "core",
        difference,
        lambda e: [hidden_estimates(e, "e3")[:3]],
        catalogue(WRONG_DIFFERENCES),
        TWO,
    ),
    Question("e4", "a ratio", "stretch", ratio, lambda e: [hidden_estimates(e, "e4")[:3]], catalogue(WRONG_RATIOS), TWO),
    Question(
        "e5",
        "does the filter know its own error?",
        "core",
        normalised_error,
        lambda e: [(hidden_estimates(e, "e5")[0], hidden_estimates(e, "e5")[1], hidden_estimates(e, "e5")[3])],
        catalogue(WRONG_NORMALISED),
    ),
)

SET = ExerciseSet("e", "Comparison by Monte Carlo", Path(__file__).parent, QUESTIONS, chapters=("comparison",), angles=("y",))
