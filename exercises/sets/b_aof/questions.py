"""Questions of set b: the Gaussian approximation of the absolutely optimal filter, step by step.

Answers are functions of arrays over an ensemble: vectors (N, n), matrices (N, r, c).  Here are the
hidden arguments; the keys are in keys.py, the known mistakes in mistakes.py.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.exercises.checks.question import Question
from kfcourse.exercises.checks.registry import ExerciseSet
from kfcourse.exercises.checks.steps import STEP, array_functions
from kfcourse.exercises.sets.b_aof.keys import correct, covariance, gain, run_filter, step
from kfcourse.exercises.sets.b_aof.mistakes import (
    WRONG_CORRECTIONS,
    WRONG_COVARIANCES,
    WRONG_GAINS,
    WRONG_RUNS,
    WRONG_STEPS,
)
from kfcourse.exercises.sets.shared import other_functions
from kfcourse.laws import Array, Gaussian, Measurement, transpose

RUNS = 6  # hidden trajectories


def hidden_law(exercise: Exercise, name: str) -> Gaussian:
    """A hidden normal law for every trajectory, near the prior; correlated where the state has
    components."""
    rng, prior = exercise.rng(name), exercise.model.prior
    n = exercise.model.n
    scale = np.sqrt(np.diagonal(prior.cov))
    mean = prior.mean + scale * rng.normal(size=(RUNS, n))
    roots = scale[:, None] * (np.eye(n) + 0.4 * rng.normal(size=(RUNS, n, n)))
    return Gaussian(mean, 0.3 * roots @ transpose(roots))


def hidden_meter(exercise: Exercise, at: Gaussian) -> Measurement:
    """Structural functions of a hidden meter at a law, one of each for every trajectory."""
    h, G, F = structure_functions(exercise)[0](*at)
    return Measurement(h, G, F, F - G @ at.cov @ transpose(G))


def hidden_measurements(exercise: Exercise, name: str, expected: Measurement) -> Array:
    """Hidden measurements about one standard deviation from what is expected, (N, p)."""
    deviation = np.sqrt(np.diagonal(expected.F, axis1=-2, axis2=-1))
    return expected.h + deviation * exercise.rng(name).normal(size=expected.h.shape)


def structure_functions(exercise: Exercise) -> tuple[Callable, Callable]:
    """(measure, predict) of one step as students get them: h, G, F and tau, Theta, full arrays."""
    return other_functions(exercise, *array_functions(exercise.hidden.gaussian.at(STEP)))


# -- b1: the gain


def gain_arguments(exercise: Exercise) -> list[tuple]:
    """Covariances Psi, G and F of a hidden law, a trajectory each."""
    at = hidden_law(exercise, "b1")
    _, G, F, _ = hidden_meter(exercise, at)
    return [(at.cov, G, F)]


# -- b2: the correction


def correction_arguments(exercise: Exercise) -> list[tuple]:
    """A hidden law, what the hidden meter makes of it, and measurements, in units in which F is
    neither tiny nor huge.

    Else a gain that is not divided by F, and one that is multiplied by it, are nothing beside the
    state.
    """
    at = hidden_law(exercise, "b2")
    expected = hidden_meter(exercise, at)
    y = hidden_measurements(exercise, "b2-y", expected)
    unit = 10.0 ** -np.round(np.log10(np.diagonal(expected.F, axis1=-2, axis2=-1).mean(axis=0)) / 2)
    return [
        (
            at.mean,
            at.cov,
            unit * expected.h,
            unit[:, None] * expected.G,
            unit[:, None] * expected.F * unit,
            unit * y,
        )
    ]


# -- b3: a whole step


def step_arguments(exercise: Exercise) -> list[tuple]:
    """A hidden law, measurements and the hidden structural functions."""
    at = hidden_law(exercise, "b3")
    y = hidden_measurements(exercise, "b3-y", hidden_meter(exercise, at))
    return [(*at, y, *structure_functions(exercise))]


# -- b4: a whole run, with measurements missing


def run_arguments(exercise: Exercise) -> list[tuple]:
    """Measurements over six steps, without gaps and with some."""
    y = exercise.simulate(runs=RUNS, steps=6, name="b4").y
    gaps = y.copy()
    gaps[2, 1] = gaps[4, :3] = np.nan
    # not quite: where its mean is zero, or its variance one, a mistake would not show
    prior = exercise.model.prior
    mean, cov = prior.mean + 0.3 * np.sqrt(np.diagonal(prior.cov)), 1.3 * prior.cov
    return [
        (values, mean, cov, *other_functions(exercise, *exercise.hidden_functions()))
        for values in (y, gaps)
    ]


# -- b5: a covariance that rounding cannot make negative


def covariance_arguments(exercise: Exercise) -> list[tuple]:
    """A usual meter, and one so sharp that a difference loses all digits."""
    at = hidden_law(exercise, "b5")
    _, G, _, R = hidden_meter(exercise, at)
    # a scalar meter, far sharper than the prediction
    level, sharp = np.full((RUNS, 1, 1), 0.7), np.full((RUNS, 1, 1), 1e-18)
    return [
        (Psi, G, G @ Psi @ transpose(G) + R, R)
        for Psi, G, R in ((at.cov, G, R), (level, 2 * level, sharp))
    ]


QUESTIONS = (
    Question(
        "b1",
        "the gain",
        "warm-up",
        gain,
        gain_arguments,
        WRONG_GAINS,
        advice=(
            "Take one trajectory with one component by hand; then look at the shapes: which "
            "product of them gives (N, n, p)?"
        ),
        axes=("trajectory",),
    ),
    Question(
        "b2",
        "the correction",
        "core",
        correct,
        correction_arguments,
        WRONG_CORRECTIONS,
        ("z", "p"),
        advice=(
            "Try two cases: a measurement that is exactly what was expected, and a meter that "
            "tells "
            "nothing, G = 0. What must z and p be?"
        ),
        axes=("trajectory",),
    ),
    Question(
        "b3",
        "one step",
        "core",
        step,
        step_arguments,
        WRONG_STEPS,
        ("z", "p", "lam_next", "Psi_next"),
        advice=(
            "Write down which law each function is called with: what is known before the "
            "measurement, and what after it?"
        ),
        axes=("trajectory",),
    ),
    Question(
        "b4",
        "a run",
        "core",
        run_filter,
        run_arguments,
        WRONG_RUNS,
        advice=(
            "Follow one trajectory for two steps by hand; then one whose first measurement is "
            "missing: what "
            "is its estimate, and what its covariance?"
        ),
        axes=(
            "step",
            "trajectory",
        ),
    ),
    Question(
        "b5",
        "a covariance that survives rounding",
        "stretch",
        covariance,
        covariance_arguments,
        WRONG_COVARIANCES,
        tolerance=1e-6,
        advice=(
            "Write the error of the estimate as a sum of two independent parts; each has a "
            "covariance of the form M C M^T."
        ),
        axes=("trajectory",),
    ),
)

SET = ExerciseSet(
    "b",
    "Approximations of the absolutely optimal filter",
    Path(__file__).parent,
    QUESTIONS,
    chapters=(
        "course/lab-filters",
        "course/linearisation",
    ),
)
