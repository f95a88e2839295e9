"""Questions of set m: looking back, what a record tells of its model, measurements that are not
believed.

m2 is answered with a formula in the symbols of its arguments, the others with numbers.  Personal
numbers are in `record_numbers`; hidden arguments are others.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import sympy as sp

from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.exercises.checks.question import Question
from kfcourse.exercises.checks.registry import ExerciseSet
from kfcourse.exercises.sets.m_smoothing.keys import (
    gate,
    log_likelihood,
    neighbours,
    new_r,
    smooth,
    step_back,
    weight,
)
from kfcourse.exercises.sets.m_smoothing.mistakes import (
    WRONG_GATES,
    WRONG_LOGARITHMS,
    WRONG_PAIRS,
    WRONG_RECORDS,
    WRONG_ROUNDS,
    WRONG_STEPS,
    WRONG_WEIGHTS,
)
from kfcourse.exercises.sets.shared import covariance, personal
from kfcourse.filters.kalman import correct, predict
from kfcourse.laws import Array, Gaussian, symmetric
from kfcourse.linear.system import LinearSystem


def record_numbers(exercise: Exercise) -> dict[str, float]:
    """Variances q of the level's steps and r of the meter, and the share of measurements that are
    missing."""
    return personal(exercise, "m", q=(1.0, 0.5, 2), r=(9.0, 4, 16), missing=(0.2, 0.1, 0.3))


def gate_arguments(exercise: Exercise) -> list[tuple]:
    """Two probabilities."""
    return [(float(beta),) for beta in exercise.rng("m1").uniform((0.85, 0.97), (0.95, 0.995))]


def _system(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """p, A, Q: A with no symmetry, so that no transposition hides."""
    A = np.array([[1.0, 0.6], [-0.25, 0.8]]) + 0.1 * rng.normal(size=(2, 2))
    return covariance(rng, 2), A, symmetric(covariance(rng, 2, 0.4))


def neighbour_arguments(exercise: Exercise) -> list[tuple]:
    """Two laws and systems."""
    rng = exercise.rng("m3")
    return [_system(rng), _system(rng)]


def step_arguments(exercise: Exercise) -> list[tuple]:
    """One step back of two components; the smoothed covariance is below the predicted one."""
    rng = exercise.rng("m4")
    arguments = []
    for _ in range(2):
        p, A, Q = _system(rng)
        z = rng.normal(size=2) + 2
        Psi = A @ p @ A.T + Q
        later_p = np.linalg.inv(np.linalg.inv(Psi) + np.linalg.inv(covariance(rng, 2)))
        S = p @ A.T @ np.linalg.inv(Psi)
        arguments.append((z, p, A @ z, Psi, A @ z + rng.normal(size=2) + 0.7, later_p, S))
    return arguments


def record_arguments(exercise: Exercise) -> list[tuple]:
    """What a Kalman filter leaves of seven steps: one component measured, one measurement
    missing."""
    rng = exercise.rng("m5")
    p, A, Q = _system(rng)
    system, law = (
        LinearSystem(A, np.array([[1.0, 0.3]]), Q, np.array([[0.5]])),
        Gaussian(rng.normal(size=2) + 1, 3 * p),
    )
    rows = []
    for k in range(7):
        after = law if k == 3 else correct(system, law, rng.normal(size=1) * 2)
        rows.append((after.mean, after.cov, law.mean, law.cov))
        law = predict(system, after)
    return [(*(np.stack(column) for column in zip(*rows, strict=True)), A, Q)]


def round_arguments(exercise: Exercise) -> list[tuple]:
    """A record of which three measurements are missing; errors with a mean of their own."""
    rng = exercise.rng("m6")
    z, p = rng.normal(size=12) + 4, rng.uniform(0.3, 0.8, 12)
    y = z + 0.5 + 1.3 * rng.normal(size=12)
    y[rng.choice(12, 3, replace=False)] = np.nan
    return [(y, z, p)]


def weight_arguments(exercise: Exercise) -> list[tuple]:
    """Two measurements of two components, of a state of three: one that fits, one far off."""
    rng = exercise.rng("m7")
    arguments = []
    for far in (1.0, 5.0):
        G = np.array([[1.0, 0.4, -0.6], [-0.3, 1.2, 0.5]]) + 0.1 * rng.normal(size=(2, 3))
        R = np.array([[1.0, 0.5], [0.5, 0.8]]) * rng.uniform(0.5, 0.8)
        arguments.append(
            (
                far * (np.array([0.9, -0.7]) + 0.2 * rng.random(2)),
                R,
                G,
                covariance(rng, 3, 0.5),
                float(rng.uniform(3, 6)),
            )
        )
    return arguments


QUESTIONS = (
    Question(
        "m1",
        "the gate",
        "warm-up",
        gate,
        gate_arguments,
        WRONG_GATES,
        advice="Let beta go to 1, then to 0: what must become of the gate?",
    ),
    Question(
        "m2",
        "the likelihood of an innovation",
        "warm-up",
        log_likelihood,
        lambda e: [(sp.Symbol("nu", real=True), sp.Symbol("F", positive=True))],
        WRONG_LOGARITHMS,
        advice="Write the normal density, and take the logarithm factor by factor.",
    ),
    Question(
        "m3",
        "two neighbours",
        "core",
        neighbours,
        neighbour_arguments,
        WRONG_PAIRS,
        ("covariance", "gain"),
        advice="Write x_{k+1} = A x_k + v, subtract the means, multiply by the error of x_k on "
        "the left, and take the mean.",
    ),
    Question(
        "m4",
        "one step back",
        "core",
        step_back,
        step_arguments,
        WRONG_STEPS,
        ("mean", "covariance"),
        advice="If the later law is just the prediction, nothing has been learned, and the law of "
        "this step must stay.",
    ),
    Question(
        "m5",
        "a whole record",
        "core",
        smooth,
        record_arguments,
        WRONG_RECORDS,
        ("mean", "covariance"),
        advice="Write down for the last three steps, by hand, which law is used where.",
        axes=("step",),
        spare=("ahead", "Psi", "Q"),  # what a filter leaves: ahead = A z, Psi = A p A^T + Q
    ),
    Question(
        "m6",
        "a round for the meter's variance",
        "core",
        new_r,
        round_arguments,
        WRONG_ROUNDS,
        advice="What would r be if the states were seen? Then take the mean of that over what the "
        "smoother does not know.",
    ),
    Question(
        "m7",
        "the weight of a doubtful measurement",
        "stretch",
        weight,
        weight_arguments,
        WRONG_WEIGHTS,
        advice="Let the degrees grow without end: then every measurement must count in full.",
    ),
)

SET = ExerciseSet(
    "m",
    "Smoothing and likelihood",
    Path(__file__).parent,
    QUESTIONS,
    chapters=("beyond/looking-back", "beyond/what-the-data-say", "beyond/outliers"),
    numbers=record_numbers,
    about_variant=False,
)
