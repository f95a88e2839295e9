"""Questions of set f: the Stratonovich equation on a grid, for a scalar model whose noises enter
linearly.

Answers are functions of densities at the nodes x (M,), at equal distances, and of the two
conditional laws: move(x) and see(x) return mean and variance of the next state and of the
measurement, given the state x; (M,) -> (M,), (M,).

The hidden densities are smooth, resolved by their nodes, and vanish at both ends of the grid, so
that all rules of
integration agree.  Here are the hidden arguments; the keys are in keys.py, the known mistakes in
mistakes.py.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.exercises.checks.question import Question
from kfcourse.exercises.checks.registry import ExerciseSet
from kfcourse.exercises.sets.f_exact.companion import Law, companion_numbers
from kfcourse.exercises.sets.f_exact.keys import correct, moments, nodes_needed, predict, run_filter
from kfcourse.exercises.sets.f_exact.mistakes import (
    WRONG_CORRECTIONS,
    WRONG_MOMENTS,
    WRONG_NODES,
    WRONG_PREDICTIONS,
    WRONG_RUNS,
)
from kfcourse.laws import Array

# -- hidden densities and laws


def nodes(count: int = 240) -> Array:
    """Nodes at equal distances."""
    return np.linspace(-7.3, 8.1, count)


def hidden_density(exercise: Exercise, name: str) -> Array:
    """A hidden density at `nodes()`: two humps, not normalised."""
    rng, x = exercise.rng(name), nodes()
    centres, widths, weights = (
        rng.uniform([-1.2, 0.9], [-0.4, 1.6]),
        rng.uniform(0.5, 0.7, 2),
        rng.uniform([1.5, 0.6], [2.5, 1.0]),
    )
    return sum(
        w * np.exp(-((x - c) ** 2) / (2 * s**2))
        for c, s, w in zip(centres, widths, weights, strict=True)
    )


def hidden_law(exercise: Exercise, name: str) -> Law:
    """A hidden nonlinear law, with a variance that depends on the state."""
    slope, bend, level, rise = exercise.rng(name).uniform(
        [0.6, 0.3, 0.15, 0.05], [0.9, 0.5, 0.25, 0.1]
    )
    return lambda x: (
        slope * x + bend * np.sin(x) + level,
        level + rise * np.sin(x) ** 2 + rise * np.cos(x / 2) ** 2,
    )


# -- f2: the correction


def correction_arguments(exercise: Exercise) -> list[tuple]:
    """A hidden density and law, and two measurements."""
    x, see = nodes(), hidden_law(exercise, "f2")
    predicted = moments(hidden_density(exercise, "f2"), x)[0]
    return [
        (predicted, float(y), x, see)
        for y in exercise.rng("f2-y").uniform([0.5, -1.2], [1.5, -0.4])
    ]


# -- f3: the prediction


def prediction_arguments(exercise: Exercise) -> list[tuple]:
    """A hidden density and law; and the density with part of its mass lost, as beyond the ends of a
    grid."""
    x = nodes()
    posterior, law = moments(hidden_density(exercise, "f3"), x)[0], hidden_law(exercise, "f3")
    return [(posterior, x, law), (0.8 * posterior, x, law)]


# -- f4: a whole run


def run_arguments(exercise: Exercise) -> list[tuple]:
    """Six measurements, all there and with one missing."""
    x, move, see = nodes(), hidden_law(exercise, "f4-move"), hidden_law(exercise, "f4-see")
    y = exercise.rng("f4-y").uniform(0.4, 1.4, 6) * [1, -1, 1, 1, -1, 1]
    gaps = np.where(np.arange(len(y)) == 3, np.nan, y)
    return [
        (values, x, moments(hidden_density(exercise, "f4"), x)[0], move, see)
        for values in (y, gaps)
    ]


# -- f5: how many nodes


def nodes_arguments(exercise: Exercise) -> list[tuple]:
    """Three intervals, widths and errors; less and more than half of a step is left: rounding to
    the nearest must show."""
    rng, arguments = exercise.rng("f5"), []
    for exponent, part in ((3, 0.3), (6, 0.7), (9, 0.4)):
        low, high, sigma = -rng.uniform(2, 5), rng.uniform(3, 7), rng.uniform(0.002, 0.01)
        error = 10 ** -rng.uniform(exponent, exponent + 1)
        steps = (high - low) / (np.pi * sigma * np.sqrt(2 / np.log(2 / error)))
        arguments.append(
            (low, low + (high - low) * float((np.floor(steps) + part) / steps), sigma, error)
        )
    return arguments


QUESTIONS = (
    Question(
        "f1",
        "mass, mean and variance",
        "warm-up",
        moments,
        lambda e: [(hidden_density(e, "f1"), nodes())],
        WRONG_MOMENTS,
        ("density", "mean", "variance"),
        advice="Try a density that is constant over a few nodes: its integral, mean and variance "
        "are known.",
    ),
    Question(
        "f2",
        "the correction",
        "core",
        correct,
        correction_arguments,
        WRONG_CORRECTIONS,
        ("posterior", "density of y"),
        advice=(
            "Check that the posterior integrates to one, and that a measurement which tells "
            "nothing leaves "
            "the prediction as it was."
        ),
    ),
    Question(
        "f3",
        "the prediction",
        "core",
        predict,
        prediction_arguments,
        WRONG_PREDICTIONS,
        advice=(
            "Look at one entry of your matrix: from which node to which does it lead, and whose "
            "mean and variance stand in it?"
        ),
    ),
    Question(
        "f4",
        "a run",
        "core",
        run_filter,
        run_arguments,
        WRONG_RUNS,
        ("z", "p", "ln p(y)"),
        advice=(
            "Write the law before and after each measurement for the first two steps, and for a "
            "step without any measurement."
        ),
    ),
    Question(
        "f5",
        "how many nodes",
        "stretch",
        nodes_needed,
        nodes_arguments,
        WRONG_NODES,
        advice=(
            "Draw three intervals and count their nodes. Then solve the bound for the distance "
            "once more, "
            "taking logarithms of both sides."
        ),
    ),
)

SET = ExerciseSet(
    "f",
    "The exact filter on a grid",
    Path(__file__).parent,
    QUESTIONS,
    chapters=("course/stratonovich", "course/comparison"),
    numbers=companion_numbers,
    angles=("x", "y"),  # its companion has none
)
