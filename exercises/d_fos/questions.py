"""Questions of set d: filters of optimal structure (FOS, MFOS), whose coefficients are regressions over an ensemble.

Answers are functions of arrays: vectors of N trajectories (N, n), matrices (r, c), covariances (n, n) or (N, n, n).  Here are the
hidden arguments; the keys are in keys.py, the known mistakes in mistakes.py.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kfcourse.checks.exercises import Exercise
from kfcourse.checks.question import Question, catalogue
from kfcourse.checks.registry import ExerciseSet
from kfcourse.checks.steps import STEP, array_functions, full
from kfcourse.exercises import follow_on
from kfcourse.exercises.d_fos.keys import condition, condition_on_both, fos_step, mfos_step
from kfcourse.exercises.d_fos.mistakes import WRONG_CONDITIONS, WRONG_FOS_STEPS, WRONG_MFOS_STEPS
from kfcourse.exercises.shared import RUNS, covariance_of, ensemble, other_functions, predicted

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
    Psi = full(covariance_of(x - lam, x - lam), RUNS) * (1 + 0.3 * exercise.rng(f"{name}-Psi").random((RUNS, 1, 1)))
    return [(lam, Psi, x, y, *other_functions(exercise, *array_functions(exercise.hidden.gaussian.at(STEP))))]


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


OF_ANY_REGRESSION = (  # mistakes of d1 that are possible here too
    "explained-added",
    "explained-only",
    "residual-is-variance",
    "deviation-for-variance",
    "means-not-subtracted",
    "offset-forgotten",
    "residual-returned",
    "unbiased-residual",
    "sum-for-mean",
    "not-divided",
)

QUESTIONS = (
    Question(
        "d1",
        "what the estimate says of the state",
        "warm-up",
        condition,
        condition_arguments,
        catalogue(WRONG_CONDITIONS),
        ("u", "T"),
        advice=(
            "The estimate is taken as any other measurement here: a regression of the state on it tells "
            "both the mean and what is left."
        ),
    ),
    Question(
        "d2",
        "one step of the FOS",
        "core",
        fos_step,
        fos_arguments,
        catalogue(WRONG_FOS_STEPS),
        ("z", "lam_next", "Psi_next"),
        advice=(
            "Compare with one step of the AOF line by line: the correction is the same. Which law does the "
            "prediction begin from here?"
        ),
        axes=("trajectory",),
        on=follow_on.fos_step,
    ),
    Question(
        "d3",
        "one step of the MFOS",
        "core",
        mfos_step,
        mfos_arguments,
        catalogue(WRONG_MFOS_STEPS),
        ("z", "lam_next", "Psi_next"),
        advice=(
            "Count the regressions, and write target and regressor of each beside it; then check that each "
            "uses the newest estimate there is."
        ),
        axes=("trajectory",),
        on=follow_on.mfos_step,
    ),
    Question(
        "d4",
        "three arguments",
        "stretch",
        condition_on_both,
        both_arguments,
        catalogue(
            (
                (
                    "measurement-unused",
                    "Only the estimate is used; the measurement may tell more.",
                    lambda x, y, z: condition(x, z),
                ),
                (
                    "estimate-unused",
                    "Only the measurement is used; the estimate knows the past.",
                    lambda x, y, z: condition(x, y),
                ),
                (
                    "one-after-the-other",
                    "What the estimate leaves is fitted on the measurement afterwards; they are correlated: fit them together.",
                    lambda x, y, z: (
                        condition(x, z)[0] + condition(x - condition(x, z)[0], y)[0],
                        condition(x - condition(x, z)[0], y)[1],
                    ),
                ),
                (
                    "residual-of-one",
                    "T is what the estimate alone leaves; both together leave less.",
                    lambda x, y, z: (condition_on_both(x, y, z)[0], condition(x, z)[1]),
                ),
                *(
                    (name, says, lambda x, y, z, wrong=wrong: wrong(x, np.concatenate([y, z], axis=1)))
                    for name, says, wrong in WRONG_CONDITIONS
                    if name in OF_ANY_REGRESSION
                ),
                (
                    "mean-of-both",
                    "The two regressions are averaged; fit both together.",
                    lambda x, y, z: ((condition(x, y)[0] + condition(x, z)[0]) / 2, condition_on_both(x, y, z)[1]),
                ),
                (
                    "product-as-regressor",
                    "The product of measurement and estimate is one regressor; put them side by side.",
                    lambda x, y, z: condition(x, y[:, :1] * z),
                ),
            )
        ),
        ("u", "T"),
        advice=(
            "One regression with a longer regressor. Try it with a measurement that tells nothing: question 1 must come out."
        ),
    ),
)

SET = ExerciseSet("d", "Filters of optimal structure", Path(__file__).parent, QUESTIONS, chapters=("lab-filters",))
