"""Questions of set c: Pugachev's two-step conditionally optimal filter (DUOF), its coefficients
regressions over an ensemble.

Answers are functions of arrays: vectors of N trajectories (N, n), matrices (r, c), covariances (n,
n).  Here are the hidden arguments; the keys are in keys.py, the known mistakes in mistakes.py.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.exercises.checks.question import Question
from kfcourse.exercises.checks.registry import ExerciseSet
from kfcourse.exercises.checks.steps import STEP, Function, at_step, of_steps
from kfcourse.exercises.sets.c_duof.keys import design_and_run, design_step, structure
from kfcourse.exercises.sets.c_duof.mistakes import (
    WRONG_DUOF_RUNS,
    WRONG_DUOF_STEPS,
    WRONG_REGRESSIONS,
    WRONG_STRUCTURES,
)
from kfcourse.exercises.sets.shared import RUNS, ensemble, other_equations, predicted, regression


def noiseless(exercise: Exercise) -> tuple[Callable, Callable]:
    """Hidden a(x) and b(x) at one step, (N, n) -> (N, n) and (N, p)."""
    a, b = other_equations(exercise, *exercise.hidden_noiseless)
    return at_step(a, STEP), at_step(b, STEP)


# -- c1: the structure


def structure_arguments(exercise: Exercise) -> list[tuple]:
    """Predictions, estimates and measurements at one step."""
    x, y, _ = ensemble(exercise, "c1")
    return [
        (predicted(exercise, "c1-lam", x), predicted(exercise, "c1-z", x), y, *noiseless(exercise))
    ]


# -- c2: regression over the ensemble


def regression_arguments(exercise: Exercise) -> list[tuple]:
    """A correlated sample; the same with a regressor that never varies."""
    rng = exercise.rng("c2")
    n, p = exercise.model.n, exercise.model.p
    regressor = 0.7 + rng.normal(size=(RUNS, p))
    target = regressor @ rng.normal(size=(p, n)) + 1.3 + 0.5 * rng.normal(size=(RUNS, n))
    # a component that never varies
    constant = np.concatenate([regressor, np.full((RUNS, 1), 2.0)], axis=1)
    return [(target, regressor), (target, constant)]


# -- c3: one step of the design


def duof_arguments(exercise: Exercise) -> list[tuple]:
    """Predictions, states and measurements at one step of the design."""
    x, y, x_next = ensemble(exercise, "c3")
    return [(predicted(exercise, "c3-lam", x), x, y, x_next, *noiseless(exercise))]


# -- c4: coefficients found on one ensemble, used on another


def bent(function: Function) -> Function:
    """The function of x and k, bent otherwise at every step: the offsets would make good an added
    input of a wrong step."""
    return of_steps(
        lambda x, k: function(x, k) + np.sin(1.7 * k + 0.6) * np.sin(x).sum(axis=-1, keepdims=True)
    )


def duof_run_arguments(exercise: Exercise) -> list[tuple]:
    """An ensemble to design on, and measurements of other trajectories."""
    x, y = exercise.simulate(RUNS, 4, "c4-design")
    functions = other_equations(exercise, *exercise.hidden_noiseless)
    prior = exercise.model.prior  # not quite: where its mean is zero, a start at zero would pass
    mean = prior.mean + 0.4 * np.sqrt(np.diagonal(prior.cov))
    return [
        (
            x,
            y,
            exercise.simulate(5, 4, "c4").y,
            mean,
            *(map(bent, functions) if exercise.model.timed else functions),
        )
    ]


QUESTIONS = (
    Question(
        "c1",
        "innovation and alpha",
        "warm-up",
        structure,
        structure_arguments,
        WRONG_STRUCTURES,
        ("omega", "alpha"),
        advice=(
            "One of the two results is about the measurement of this step, the other about the "
            "next state: "
            "from what is each known?"
        ),
        axes=("trajectory",),
    ),
    Question(
        "c2",
        "regression over the ensemble",
        "core",
        regression,
        regression_arguments,
        WRONG_REGRESSIONS,
        ("matrix", "offset", "residual"),
        advice=(
            "Try a target that is exactly an affine function of the regressor: what must the "
            "three results be?"
        ),
    ),
    Question(
        "c3",
        "one step of the design",
        "core",
        design_step,
        duof_arguments,
        WRONG_DUOF_STEPS,
        ("z", "lam_next"),
        advice=(
            "Say for each regression what is to be estimated, and from what; then put the "
            "regression's "
            "result where the formula of the filter has it."
        ),
        axes=("trajectory",),
    ),
    Question(
        "c4",
        "designed on one ensemble, run on another",
        "core",
        design_and_run,
        duof_run_arguments,
        WRONG_DUOF_RUNS,
        advice=(
            "Two ensembles go through the same steps: only one of them has known states, and both "
            "use the same coefficients."
        ),
        axes=(
            "step",
            "trajectory",
        ),
    ),
)

SET = ExerciseSet(
    "c",
    "The two-step conditionally optimal filter",
    Path(__file__).parent,
    QUESTIONS,
    chapters=("course/lab-filters",),
)
