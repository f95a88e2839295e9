"""Questions of set i: a track in the plane, and numerical care.

What is derived is answered with formulas in the symbols of the arguments, what runs with arrays.
Personal numbers are in `track_numbers`; hidden arguments are others, so an answer holds for any.

The keys are in keys.py, the known mistakes in mistakes.py.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import sympy as sp

from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.exercises.checks.question import Question
from kfcourse.exercises.checks.registry import ExerciseSet
from kfcourse.exercises.sets.i_track.keys import (
    correct_root,
    matrices,
    process_noise,
    start_up,
    step,
)
from kfcourse.exercises.sets.i_track.mistakes import (
    WRONG_MATRICES,
    WRONG_NOISES,
    WRONG_ROOTS,
    WRONG_STARTS,
    WRONG_STEPS,
)
from kfcourse.exercises.sets.shared import covariance, personal


def track_numbers(exercise: Exercise) -> dict[str, float]:
    """dt (s), sigma (px), sigma_a (px/s^2), and the number of the hand's track."""
    numbers = personal(
        exercise,
        "i",
        dt=(0.01, 0.008, 0.02),
        sigma=(8.0, 5, 12),
        sigma_a=(7100.0, 4000, 9000),
        track=(7, 10, 99),
    )
    return numbers | {"track": int(numbers["track"])}


# -- i4: one step of the filter with a known input


def step_arguments(exercise: Exercise) -> list[tuple]:
    """A law, an input, a measurement and matrices without zeros or ones."""
    rng = exercise.rng("i4")
    A, B, H = (np.array(m, dtype=float) for m in matrices(rng.uniform(0.2, 0.6)))
    # no zeros, no ones
    A, B, H = (matrix + 0.2 * rng.normal(size=matrix.shape) for matrix in (A, B, H))
    z, u, y = rng.normal(size=4), rng.normal(size=2), rng.normal(size=2)
    return [(z, covariance(rng, 4), u, y, A, B, H, covariance(rng, 4), covariance(rng, 2))]


# -- i5: a square root that never forms the covariance


def root_arguments(exercise: Exercise) -> list[tuple]:
    """A regular case; a meter so sharp that 1 - K H rounds to 0; components so nearly dependent
    that S S^T rounds to singular.

    An orthogonal transformation keeps 7 digits of the last two (rounding over 3e-9), a covariance
    none: hence the tolerance.
    """
    rng = exercise.rng("i5")
    S = np.tril(0.4 * rng.normal(size=(4, 4)), -1) + np.diag(rng.uniform(0.6, 1.6, 4))
    regular = (
        rng.normal(size=4),
        S,
        rng.normal(size=2),
        rng.normal(size=(2, 4)),
        covariance(rng, 2),
    )
    size, share, small = rng.uniform(0.5, 1.5), rng.uniform(0.5, 2), 3e-9
    sharp = (
        np.array([0.3]),
        np.array([[size]]),
        np.array([0.4]),
        np.array([[2.0]]),
        np.array([[share * small**2]]),
    )
    root = size * np.array([[1.0, 0.0], [1.0, small]])
    dependent = (
        np.array([0.3, -0.2]),
        root,
        np.array([1.7]),
        np.array([[1.0, -1.0]]),
        np.array([[share * (size * small) ** 2]]),
    )
    return [regular, sharp, dependent]


QUESTIONS = (
    Question(
        "i1",
        "the matrices of the model",
        "warm-up",
        matrices,
        lambda e: [(sp.Symbol("dt", positive=True),)],
        WRONG_MATRICES,
        ("A", "B", "H"),
        advice=(
            "Put a state of one component, all others zero, and one interval: where is the point "
            "afterwards, and how fast?"
        ),
    ),
    Question(
        "i2",
        "the noise of the object",
        "core",
        process_noise,
        lambda e: [sp.symbols("dt sigma_a", positive=True)],
        WRONG_NOISES,
        advice=(
            "Take one axis: two components, one push. Their covariance has three different "
            "entries; what are their units?"
        ),
    ),
    Question(
        "i3",
        "start-up from three samples",
        "core",
        start_up,
        lambda e: [(*sp.symbols("y0 y1 y2", real=True), sp.Symbol("dt", positive=True))],
        WRONG_STARTS,
        ("r", "v", "a"),
        advice=(
            "Try the motion r = t^2: three samples, and position, velocity and acceleration at "
            "the third are known."
        ),
    ),
    Question(
        "i4",
        "one step with a known input",
        "core",
        step,
        step_arguments,
        WRONG_STEPS,
        ("lam", "Psi", "z", "p"),
        advice=(
            "Take all matrices as numbers and do one step by hand; then look at which of the two "
            "laws each line needs."
        ),
    ),
    Question(
        "i5",
        "a square root instead of the covariance",
        "stretch",
        correct_root,
        root_arguments,
        WRONG_ROOTS,
        ("z", "S"),
        tolerance=1e-5,
        advice="Multiply your array by its own transpose: which blocks come out? Then compare "
        "with X, Y, Z.",
    ),
)

SET = ExerciseSet(
    "i",
    "A track in the plane, and numerical care",
    Path(__file__).parent,
    QUESTIONS,
    chapters=(
        "course/track-2d",
        "course/numerics",
    ),
    numbers=track_numbers,
    about_variant=False,
)
