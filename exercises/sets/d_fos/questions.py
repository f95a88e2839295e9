"""Questions of set d: filters of optimal structure (FOS, MFOS), whose coefficients are regressions
over an ensemble.

Answers are functions of arrays: vectors of N trajectories (N, n), matrices (r, c), covariances (n,
n) or (N, n, n).  Here are the hidden arguments; the keys are in keys.py, the known mistakes in
mistakes.py.
"""

from __future__ import annotations

from pathlib import Path

from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.exercises.checks.question import Question
from kfcourse.exercises.checks.registry import ExerciseSet
from kfcourse.exercises.checks.steps import STEP, array_functions, full
from kfcourse.exercises.sets.d_fos.keys import condition, condition_on_both, fos_step, mfos_step
from kfcourse.exercises.sets.d_fos.mistakes import (
    WRONG_BOTH,
    WRONG_CONDITIONS,
    WRONG_FOS_STEPS,
    WRONG_MFOS_STEPS,
)
from kfcourse.exercises.sets.shared import RUNS, ensemble, other_functions, predicted, regression

# -- d1: what the estimate says of the state


def condition_arguments(exercise: Exercise) -> list[tuple]:
    """States and estimates of another scale and with a bias."""
    x, _, _ = ensemble(exercise, "d1")
    return [(x, 0.2 + predicted(exercise, "d1-z", 1.3 * x))]


# -- d2: one step of the FOS


def fos_arguments(exercise: Exercise, name: str = "d2") -> list[tuple]:
    """Predictions, their covariances, states and measurements at one step of the design."""
    x, y, _ = ensemble(exercise, name)
    lam = predicted(exercise, f"{name}-lam", x)
    Psi = full(regression(x - lam, 0 * x)[2], RUNS) * (
        1 + 0.3 * exercise.rng(f"{name}-Psi").random((RUNS, 1, 1))
    )
    return [
        (
            lam,
            Psi,
            x,
            y,
            *other_functions(exercise, *array_functions(exercise.hidden.gaussian.at(STEP))),
        )
    ]


# -- d3: one step of the MFOS


def mfos_arguments(exercise: Exercise) -> list[tuple]:
    """The same with the next states."""
    x, y, x_next = ensemble(exercise, "d3")
    lam, Psi, _, _, measure, predict = fos_arguments(exercise, "d3")[0]
    return [(lam, Psi, x, y, x_next, measure, predict)]


# -- d4: three arguments


def both_arguments(exercise: Exercise) -> list[tuple]:
    """States, measurements and estimates."""
    x, y, _ = ensemble(exercise, "d4")
    return [(x, y, predicted(exercise, "d4-z", x))]


QUESTIONS = (
    Question(
        "d1",
        "what the estimate says of the state",
        "warm-up",
        condition,
        condition_arguments,
        WRONG_CONDITIONS,
        ("u", "T"),
        advice=(
            "The estimate is taken as any other measurement here: a regression of the state on it "
            "tells "
            "both the mean and what is left."
        ),
    ),
    Question(
        "d2",
        "one step of the FOS",
        "core",
        fos_step,
        fos_arguments,
        WRONG_FOS_STEPS,
        ("z", "lam_next", "Psi_next"),
        advice=(
            "Compare with one step of the AOF line by line: the correction is the same. Which law "
            "does the "
            "prediction begin from here?"
        ),
        axes=("trajectory",),
    ),
    Question(
        "d3",
        "one step of the MFOS",
        "core",
        mfos_step,
        mfos_arguments,
        WRONG_MFOS_STEPS,
        ("z", "lam_next", "Psi_next"),
        advice=(
            "Count the regressions, and write target and regressor of each beside it; then check "
            "that each "
            "uses the newest estimate there is."
        ),
        axes=("trajectory",),
    ),
    Question(
        "d4",
        "three arguments",
        "stretch",
        condition_on_both,
        both_arguments,
        WRONG_BOTH,
        ("u", "T"),
        advice=(
            "One regression with a longer regressor. Try it with a measurement that tells "
            "nothing: question 1 must come out."
        ),
    ),
)

SET = ExerciseSet(
    "d",
    "Filters of optimal structure",
    Path(__file__).parent,
    QUESTIONS,
    chapters=("course/lab-filters",),
)
