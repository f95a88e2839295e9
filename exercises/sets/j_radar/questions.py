"""Questions of set j: an alpha-beta filter on a radar track.

What is derived is answered with formulas in the symbols of the arguments, what runs with arrays.
Personal numbers are in `radar_numbers`; hidden arguments are others, so an answer holds for any.

The keys are in keys.py, the known mistakes in mistakes.py.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import sympy as sp

from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.exercises.checks.question import Question
from kfcourse.exercises.checks.registry import ExerciseSet
from kfcourse.exercises.sets.j_radar.keys import (
    alpha_beta,
    cartesian,
    lag,
    meter_jacobian,
    noise_left,
    steady_gain,
)
from kfcourse.exercises.sets.j_radar.mistakes import (
    WRONG_CARTESIANS,
    WRONG_FILTERS,
    WRONG_GAINS,
    WRONG_JACOBIANS,
    WRONG_LAGS,
    WRONG_SHARES,
)
from kfcourse.exercises.sets.shared import personal
from kfcourse.filters.alphabeta import steady_beta


def radar_numbers(exercise: Exercise) -> dict[str, float]:
    """T (s), sigma (m), alpha, and the radius of the first circle (m)."""
    return personal(
        exercise,
        "j",
        T=(0.8, 0.5, 1.5),
        sigma=(100.0, 50, 150),
        alpha=(0.095, 0.07, 0.25),
        radius=(6000.0, 4500, 7500),
    )


# -- j4: the filter


def filter_arguments(exercise: Exercise) -> list[tuple]:
    """Measurements of four tracks in space that accelerate."""
    rng = exercise.rng("j4")
    T, alpha, beta = rng.uniform(1.3, 2.2), rng.uniform(0.3, 0.6), rng.uniform(0.1, 0.25)
    r, v = 10 * rng.normal(size=3), rng.normal(size=3)
    time = T * np.arange(7)[:, None, None]
    y = r + v * time + 0.3 * time**2 + 2 * rng.normal(size=(7, 4, 3))
    return [(y, T, alpha, beta, r, v)]


# -- j5, j6: lag and noise


def several(
    name: str, limits: tuple[tuple[float, float], ...]
) -> Callable[[Exercise], list[tuple]]:
    """Three sets of hidden numbers."""

    def arguments(exercise: Exercise) -> list[tuple]:
        rng = exercise.rng(name)
        return [tuple(float(rng.uniform(*limit)) for limit in limits) for _ in range(3)]

    return arguments


def share_arguments(exercise: Exercise) -> list[tuple]:
    """Gains that are not those of a stationary Kalman filter: any stable pair is asked for."""
    numbers = several("j6", ((0.1, 0.6), (0.6, 1.6)))(exercise)
    return [(alpha, factor * steady_beta(alpha)) for alpha, factor in numbers]


QUESTIONS = (
    Question(
        "j1",
        "what the radar measures",
        "warm-up",
        cartesian,
        lambda e: [sp.symbols("r phi eps", positive=True)],
        WRONG_CARTESIANS,
        ("x", "y", "z"),
        advice="Try the horizon, the zenith, and an azimuth of zero and of a right angle.",
    ),
    Question(
        "j2",
        "the meter's derivatives",
        "core",
        meter_jacobian,
        lambda e: [sp.symbols("x y z", positive=True)],
        WRONG_JACOBIANS,
        advice=(
            "Differentiate one measurement at a time, by x, y, z in turn; each row has the unit "
            "of its measurement over a length."
        ),
    ),
    Question(
        "j3",
        "the constant gain",
        "core",
        steady_gain,
        several("j3", ((0.15, 0.7),)),
        WRONG_GAINS,
        ("beta", "index"),
        advice=(
            "Put your beta into the three equations of the hint: do they hold? For small alpha, "
            "beta is about alpha^2/2."
        ),
    ),
    Question(
        "j4",
        "the filter",
        "core",
        alpha_beta,
        filter_arguments,
        WRONG_FILTERS,
        ("r", "v"),
        advice=(
            "Follow the first two steps by hand: what is given is the prediction for the first "
            "measurement already."
        ),
        axes=(
            "step",
            "trajectory",
        ),
    ),
    Question(
        "j5",
        "the lag in a turn",
        "core",
        lag,
        lambda e: [sp.symbols("a T alpha beta", positive=True)],
        WRONG_LAGS,
        ("position", "velocity"),
        advice="Put your two lags into the two equations of the hint: do they repeat themselves?",
    ),
    Question(
        "j6",
        "the noise that is left",
        "stretch",
        noise_left,
        share_arguments,
        WRONG_SHARES,
        advice=(
            "Try alpha = 1 with a small beta: the estimate is the measurement itself; and check "
            "that the "
            "answer is below one for a small alpha."
        ),
    ),
)

SET = ExerciseSet(
    "j",
    "Alpha-beta filter and radar track",
    Path(__file__).parent,
    QUESTIONS,
    chapters=(
        "course/radar-tracking",
        "beyond/models-that-jump",
    ),
    numbers=radar_numbers,
    about_variant=False,
)
