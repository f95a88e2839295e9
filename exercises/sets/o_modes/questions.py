"""Questions of set o: which mode is it?  Probabilities of modes, laws merged, the IMM's mixing, a
decision.

The set has models of its own; hidden numbers are drawn here.  The keys are in keys.py, the known
mistakes in mistakes.py.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kfcourse.exercises.checks.derived import Derivation, ToDerive
from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.exercises.checks.question import ForVariant, Question
from kfcourse.exercises.checks.registry import ExerciseSet
from kfcourse.exercises.sets.o_modes.keys import (
    GIVEN,
    SPREAD,
    chain,
    decide,
    merged,
    mixed,
    posterior,
    spread_setting,
    two_steps,
)
from kfcourse.exercises.sets.o_modes.mistakes import (
    WRONG_CHAINS,
    WRONG_DECISIONS,
    WRONG_MERGED,
    WRONG_MIXED,
    WRONG_POSTERIORS,
    WRONG_STEPS,
)
from kfcourse.exercises.sets.shared import covariance, personal
from kfcourse.laws import Array


def modes_numbers(exercise: Exercise) -> dict[str, float]:
    """a, q of the object; C of the faulty meter; how often it fails and is repaired; the cost of an
    overlooked fault."""
    return personal(
        exercise,
        "o",
        a=(0.9, 0.7, 0.95),
        q=(0.5, 0.3, 0.8),
        C=(10.0, 6, 14),
        fail=(0.025, 0.02, 0.06),
        repair=(0.1, 0.08, 0.3),
        missed=(5.0, 3, 8),
    )


def probabilities(rng: np.random.Generator, size: int) -> Array:
    """No two of them alike."""
    weights = rng.permutation(np.arange(1, size + 1)) + rng.uniform(0.1, 0.6, size)
    return weights / weights.sum()


def transitions(rng: np.random.Generator, size: int) -> Array:
    """Rows sum to one, columns do not."""
    return np.array(
        [probabilities(rng, size) + row * np.eye(size)[row] / (1 + row) for row in range(size)]
    ) / (1 + np.arange(size)[:, None] / (1 + np.arange(size)[:, None]))


def laws(rng: np.random.Generator, size: int) -> tuple[Array, Array]:
    """Means and covariances of normal laws that differ."""
    return 2 + 1.5 * rng.normal(size=(size, 2)), np.array(
        [covariance(rng, 2, rng.uniform(0.5, 2)) for _ in range(size)]
    )


def chains(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("o1")
    return [(probabilities(rng, size), transitions(rng, size)) for size in (2, 3)]


def measured(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("o2")
    return [
        (
            probabilities(rng, size),
            rng.uniform(2, 4),
            rng.uniform(0.5, 2.5, size),
            rng.uniform(0.8, 5, size),
        )
        for size in (2, 3)
    ]


def two_measurements(exercise: Exercise) -> list[tuple]:
    """A meter that is sound or faulty, and one that may fail in two ways."""
    rng = exercise.rng("o3")
    arguments = []
    for size in (2, 3):
        y = rng.uniform(2, 5) * np.array([1.0, -0.3])
        C = np.linspace(1, 3, size) * rng.uniform(0.8, 1.2, size)
        numbers = [rng.uniform(*limits) for limits in ((0.5, 1.5), (2, 4), (0.6, 0.9), (0.3, 0.8))]
        arguments.append((y, *numbers, C, transitions(rng, size), probabilities(rng, size)))
    return arguments


def to_merge(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("o4")
    return [(probabilities(rng, size), *laws(rng, size)) for size in (2, 3)]


def to_mix(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("o6")
    return [(probabilities(rng, size), transitions(rng, size), *laws(rng, size)) for size in (2, 3)]


def to_decide(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("o7")
    return [
        (rng.uniform(0.02, 0.98, 40), rng.uniform(2, 4), rng.uniform(0.5, 1.2)),
        (rng.uniform(0.02, 0.98, 40), 0.8, 2.5),
    ]


QUESTIONS = (
    Question(
        "o1",
        "the chain moves on",
        "warm-up",
        chain,
        chains,
        WRONG_CHAINS,
        ("c", "w"),
        advice="Draw an arrow for each pair of modes and write its probability on it; then add up "
        "what arrives.",
    ),
    Question(
        "o2",
        "what a measurement says of the mode",
        "core",
        posterior,
        measured,
        WRONG_POSTERIORS,
        advice="Two modes expect the same: what decides between them if y is just what was "
        "expected, and if it is far off?",
    ),
    Question(
        "o3",
        "two steps by hand",
        "core",
        two_steps,
        two_measurements,
        WRONG_STEPS,
        ("after_first", "after_second"),
        advice="After each line write down what you hold: probabilities, means, variances. Which "
        "of them has y_0 changed?",
    ),
    Question(
        "o4",
        "two laws become one",
        "core",
        merged,
        to_merge,
        WRONG_MERGED,
        ("mean", "covariance"),
        advice="Two laws without any variance, at +1 and -1, equally likely: which variance has "
        "their mixture?",
    ),
    Derivation(
        "o5",
        "the spread of the means, line by line",
        "stretch",
        ForVariant(lambda e: lambda: SPREAD, "derivation"),
        lambda e: [()],
        advice="Collect what multiplies z1^2, and then what multiplies z1*z2.",
        posed=lambda e: ToDerive(spread_setting(), "W", GIVEN, averages=False, fewest=4),
    ),
    Question(
        "o6",
        "the IMM's mixing",
        "core",
        mixed,
        to_mix,
        WRONG_MIXED,
        ("c", "means", "covariances"),
        advice="For one mode: which modes can it come from, with which weights, and what is the "
        "mixture of their laws?",
    ),
    Question(
        "o7",
        "sound or faulty?",
        "warm-up",
        decide,
        to_decide,
        WRONG_DECISIONS,
        ("called", "loss"),
        advice="For one probability: what does it cost on the average to say faulty, and what to "
        "say sound?",
    ),
)

SET = ExerciseSet(
    "o",
    "Modes: which model holds?",
    Path(__file__).parent,
    QUESTIONS,
    chapters=("beyond/models-that-jump",),
    numbers=modes_numbers,
    about_variant=False,
)
