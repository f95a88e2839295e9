"""Questions of set g: the extended Kalman filter from its Jacobians, and whether it is right about
its own errors.

Answers are functions of arrays: vectors (..., n), matrices (..., r, c), trajectories first.  They
are called with the hidden functions of hidden.py.  The keys are in keys.py, the known mistakes in
mistakes.py.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.exercises.checks.question import Question
from kfcourse.exercises.checks.registry import ExerciseSet
from kfcourse.exercises.checks.steps import at_step
from kfcourse.exercises.sets.g_extended.hidden import (
    RUNS,
    STEPS,
    cases,
    changing,
    curved,
    hidden_law,
    root,
)
from kfcourse.exercises.sets.g_extended.keys import (
    bounds,
    consistency,
    correct,
    information,
    jacobian,
    predict,
    run_filter,
)
from kfcourse.exercises.sets.g_extended.mistakes import (
    WRONG_BOUNDS,
    WRONG_CORRECTIONS,
    WRONG_INFORMATION,
    WRONG_JACOBIANS,
    WRONG_NORMALISED,
    WRONG_PREDICTIONS,
    WRONG_RUNS,
)
from kfcourse.exercises.sets.shared import covariance
from kfcourse.laws import apply

# -- g1: a Jacobian by differences


def jacobian_arguments(exercise: Exercise) -> list[tuple]:
    """Hidden functions of three components, and of as many as the variant has."""
    rng = exercise.rng("g1")
    return [
        (curved(rng, n, n, 1.0)[0], rng.normal(size=(RUNS, n)), step)
        for n, step in ((3, 0.02), (exercise.model.n, 0.05))
    ]


# -- g2: bounds


def bounds_arguments(exercise: Exercise) -> list[tuple]:
    """Degrees of freedom, runs and a confidence, twice."""
    rng = exercise.rng("g2")
    return [
        (int(rng.integers(2, 7)), int(rng.integers(8, 60)), float(rng.uniform(*limits)))
        for limits in ((0.85, 0.93), (0.96, 0.99))
    ]


# -- g3: the prediction


def prediction_arguments(exercise: Exercise) -> list[tuple]:
    """Estimates, covariances and the functions of the object."""
    return [
        (*hidden_law(rng, n), functions.f, functions.Phi, functions.g, functions.D_xi)
        for functions, rng, n, _ in cases(exercise, "g3")
    ]


# -- g4: the correction


def correction_arguments(exercise: Exercise) -> list[tuple]:
    """Predictions, covariances, measurements and the functions of the meter."""
    arguments = []
    for functions, rng, n, p in cases(exercise, "g4"):
        lam, Psi = hidden_law(rng, n)
        arguments.append(
            (
                lam,
                Psi,
                functions.S(lam) + rng.normal(size=(RUNS, p)),
                functions.S,
                functions.H,
                functions.D_n,
            )
        )
    return arguments


# -- g5: a whole run


def run_arguments(exercise: Exercise) -> list[tuple]:
    """Measurements of hidden trajectories, the prior and all functions; of the step too where the
    variant's depend on it."""
    arguments = []
    for functions, rng, n, p in cases(exercise, "g5"):
        functions = changing(functions) if exercise.model.timed else functions
        mean, cov = rng.normal(size=n), covariance(rng, n, 0.6)
        x = mean + rng.normal(size=(RUNS, n)) @ np.linalg.cholesky(cov).T
        y = []
        for k in range(STEPS):
            f, g, S, D_n = (
                at_step(function, k)
                for function in (functions.f, functions.g, functions.S, functions.D_n)
            )
            y.append(S(x) + apply(root(D_n(x)), rng.normal(size=(RUNS, p))))
            x = f(x) + apply(
                g(x) @ root(functions.D_xi), rng.normal(size=(RUNS, len(functions.D_xi)))
            )
        arguments.append((np.array(y), mean, cov, *functions))
    return arguments


# -- g6: NEES and NIS


def normalised_arguments(exercise: Exercise) -> list[tuple]:
    """States, estimates, predictions with their covariances, and measurements."""
    arguments = []
    for functions, rng, n, p in cases(exercise, "g6"):
        shape = (STEPS, RUNS)
        z, lam = rng.normal(size=(2, *shape, n))
        p_, Psi = (
            np.array([[covariance(rng, n, scale) for _ in range(RUNS)] for _ in range(STEPS)])
            for scale in (0.2, 0.5)
        )
        x, y = z + 0.4 * rng.normal(size=z.shape), functions.S(lam) + rng.normal(size=(*shape, p))
        arguments.append((x, z, p_, y, lam, Psi, functions.S, functions.H, functions.D_n))
    return arguments


# -- g7: the information form


def information_arguments(exercise: Exercise) -> list[tuple]:
    """Information matrices, the first of them zero, and a meter with more components than the
    state."""
    arguments = []
    for place, (n, p) in enumerate(((3, 4), (exercise.model.n, exercise.model.n + 1))):
        rng = exercise.rng(f"g7-{place}")
        W = np.array([covariance(rng, n, 1.5) for _ in range(RUNS)])
        W[0] = 0.0  # nothing known before
        H = rng.normal(size=(RUNS, p, n)) + np.sign(rng.normal(size=(RUNS, p, n)))
        D_n = np.array([covariance(rng, p, 0.4) for _ in range(RUNS)])
        arguments.append((W, H, D_n))
    return arguments


TWO = ("z", "p")

QUESTIONS = (
    Question(
        "g1",
        "a Jacobian by differences",
        "warm-up",
        jacobian,
        jacobian_arguments,
        WRONG_JACOBIANS,
        tolerance=1e-8,
        advice=(
            "Try it on a linear function, whose derivative you know, and on a quadratic one: for "
            "both, "
            "central differences are exact."
        ),
        axes=("trajectory",),
    ),
    Question(
        "g2",
        "bounds",
        "warm-up",
        bounds,
        bounds_arguments,
        WRONG_BOUNDS,
        ("low", "high"),
        advice=(
            "What is the law of the sum? Then of the mean? For many runs the bounds must close in "
            "on the degrees of freedom."
        ),
    ),
    Question(
        "g3",
        "the prediction",
        "core",
        predict,
        prediction_arguments,
        WRONG_PREDICTIONS,
        ("lam", "Psi"),
        advice="Say of each function at which point it is taken, and check with a linear model "
        "and no noise.",
        axes=("trajectory",),
    ),
    Question(
        "g4",
        "the correction, in the gain form",
        "core",
        correct,
        correction_arguments,
        WRONG_CORRECTIONS,
        TWO,
        advice=(
            "Try two cases: y equal to what was expected, and a meter that tells nothing. Then "
            "look at "
            "where S and where H belongs."
        ),
        axes=("trajectory",),
    ),
    Question(
        "g5",
        "a run",
        "core",
        run_filter,
        run_arguments,
        WRONG_RUNS,
        ("z", "p", "lam", "Psi"),
        advice="Follow the first two steps by hand: which law is compared with y_0, and which "
        "with y_1?",
        axes=(
            "step",
            "trajectory",
        ),
    ),
    Question(
        "g6",
        "NEES and NIS",
        "core",
        consistency,
        normalised_arguments,
        WRONG_NORMALISED,
        ("NEES", "NIS"),
        advice=(
            "For each of the two: which error, and the covariance of that very error? For a right "
            "filter the means are n and p."
        ),
        axes=("step",),
    ),
    Question(
        "g7",
        "the information form",
        "stretch",
        information,
        information_arguments,
        WRONG_INFORMATION,
        ("p", "K"),
        advice="Compare with the gain form for one component by hand: which inverses are there, "
        "and of what?",
        axes=("trajectory",),
    ),
)

SET = ExerciseSet(
    "g",
    "The extended Kalman filter and its consistency",
    Path(__file__).parent,
    QUESTIONS,
    chapters=("course/linearisation", "course/consistency"),
)
