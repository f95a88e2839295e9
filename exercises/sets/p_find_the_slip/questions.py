"""Questions of set p: a formula with a slip is shown, and the right one is typed.

The slips are those of a real program; the hidden arguments are made here.  The keys are in keys.py,
the known mistakes, the slips first, in mistakes.py.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import sympy as sp

from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.exercises.checks.question import Question
from kfcourse.exercises.checks.registry import ExerciseSet
from kfcourse.exercises.sets.p_find_the_slip import keys
from kfcourse.exercises.sets.p_find_the_slip.mistakes import (
    WRONG_FITS,
    WRONG_INTENSITIES,
    WRONG_MATRICES,
    WRONG_METERS,
    WRONG_MOMENTS,
    WRONG_SCALED,
    WRONG_SECOND,
    WRONG_SLOPES,
)
from kfcourse.exercises.sets.shared import covariance
from kfcourse.laws import Array

RUNS = 50


def ensemble(rng: np.random.Generator, n: int) -> Array:
    """Correlated components with means that are not zero, (N, n)."""
    return (
        rng.uniform(1, 3, n) + rng.normal(size=(RUNS, n)) @ np.linalg.cholesky(covariance(rng, n)).T
    )


def errors(exercise: Exercise) -> list[tuple]:
    """The filter's errors and its corrections, of one component and of two."""
    rng = exercise.rng("p6")
    arguments = []
    for n in (1, 2):
        sigma = ensemble(rng, n)
        arguments.append(
            (
                sigma @ (0.6 * np.eye(n) + 0.3 * rng.normal(size=(n, n))) + 0.4 * ensemble(rng, n),
                sigma,
            )
        )
    return arguments


def steps(exercise: Exercise) -> list[tuple]:
    """x_0, x_k and z_k: the state has moved, and z follows it."""
    rng = exercise.rng("p7")
    arguments = []
    for n in (1, 2):
        x_0 = ensemble(rng, n)
        x = 0.7 * x_0 + ensemble(rng, n)
        arguments.append((x_0, x, 0.8 * x + 0.5 * ensemble(rng, n) - 1))
    return arguments


def modes(exercise: Exercise) -> list[tuple]:
    """Two modes that are not equally frequent; three, one of which nobody is in."""
    rng = exercise.rng("p8")
    arguments = []
    for present in ((0, 1), (0, 2)):
        mode = rng.choice(present, RUNS, p=(0.7, 0.3))
        arguments.append(
            (rng.uniform(1, 2) + 2.0 * mode + (0.5 + mode) * rng.normal(size=RUNS), mode)
        )
    return arguments


def symbols(names: str) -> list[tuple]:
    """One call with these symbols."""
    return [sp.symbols(names, real=True)]


QUESTIONS = (
    Question(
        "p1",
        "a factor comes out of a mean square",
        "warm-up",
        keys.second_moment,
        lambda e: symbols("a q z p"),
        WRONG_SECOND,
        advice="Put a = 2, q = 0 and p = 0 in: what is x', and what is its square?",
    ),
    Question(
        "p2",
        "a meter that measures too little",
        "core",
        keys.scaled_meter,
        lambda e: symbols("gamma G d r"),
        WRONG_SCALED,
        advice="Multiply the bracket out before you take variances: what multiplies the noise?",
    ),
    Question(
        "p3",
        "the variance of which component?",
        "core",
        keys.noise_intensity,
        lambda e: symbols("z1 z2 p11 p12 p22"),
        WRONG_INTENSITIES,
        advice="Which component stands in B? Write the mean of its square, and nothing else.",
    ),
    Question(
        "p4",
        "moments of a measured square",
        "core",
        keys.meter_variance,
        lambda e: symbols("m1 m2 d11 d12 d22"),
        WRONG_METERS,
        advice="Check with d = 0: what is left must be the noise alone. Then put x1 = m1 + a "
        "deviation, and multiply out.",
    ),
    Question(
        "p5",
        "a derivative by the angle",
        "core",
        keys.by_angle,
        lambda e: symbols("E kappa x2"),
        WRONG_SLOPES,
        ("first", "second"),
        advice="Differentiate each of the four terms by itself, with a table of sines and cosines "
        "beside you.",
    ),
    Question(
        "p6",
        "normal equations",
        "core",
        keys.correction_matrix,
        errors,
        WRONG_MATRICES,
        advice="What must be uncorrelated with sigma, if nothing better can be made of it? Write "
        "that as an equation for H.",
    ),
    Question(
        "p7",
        "moments of which step?",
        "core",
        keys.coefficients,
        steps,
        WRONG_FITS,
        ("Gamma", "chi", "T"),
        advice="Take the mean of x - Gamma z - chi over the ensemble: it must be zero, and T is "
        "what is left of x.",
    ),
    Question(
        "p8",
        "moments over all modes",
        "stretch",
        keys.moments,
        modes,
        WRONG_MOMENTS,
        ("mean", "variance"),
        advice="Nine trajectories in one mode and one in the other: what does each of them count?",
    ),
)

SET = ExerciseSet(
    "p",
    "Find the slip",
    Path(__file__).parent,
    QUESTIONS,
    chapters=(
        "course/structural-functions",
        "beyond/filters-that-remember",
        "beyond/models-that-jump",
    ),
    about_variant=False,
)
