"""Hidden smooth functions with their Jacobians, and hidden laws, in dimensions of the variant and
in others.

Where the variant's own Jacobian is constant, or has one entry, one taken at a wrong point, or
transposed, would pass.
"""

from __future__ import annotations

import numpy as np

from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.exercises.checks.steps import of_steps
from kfcourse.exercises.sets.g_extended.companion import Functions
from kfcourse.exercises.sets.shared import Map, covariance
from kfcourse.laws import Array, Gaussian, symmetric

RUNS, STEPS = 6, 5

DIMENSIONS = (3, 3, 2)  # states, noises of the object, measurements: besides the variant's


def curved(rng: np.random.Generator, rows: int, n: int, size: float) -> tuple[Map, Map]:
    """A smooth function (..., n) -> (..., rows), about `size` times its argument, and its Jacobian
    (..., rows, n)."""
    A, B = (factor * size * rng.normal(size=(rows, n)) / np.sqrt(n) for factor in (0.7, 1.0))
    A[:, 0] += 0.5 * size * np.sign(A[:, 0])  # nothing near zero where there is but one entry
    B += 0.3 * size * np.sign(B)
    shift, level = rng.uniform(0.3, 1.2, rows), rng.normal(size=rows)
    return (
        lambda x: x @ A.T + 0.5 * np.sin(x @ B.T + shift) + level,
        lambda x: A + 0.5 * np.cos(x @ B.T + shift)[..., :, None] * B,
    )


def varying(rng: np.random.Generator, matrix: Array, n: int) -> Map:
    """The matrix (r, c) times a positive function of the state: (..., n) -> (..., r, c)."""
    direction = rng.normal(size=n)
    return lambda x: matrix * (1 + 0.4 * np.sin(x @ direction + 0.7))[..., None, None]


def hidden_functions(exercise: Exercise, name: str, n: int, r: int, p: int) -> Functions:
    """Hidden functions with n states, r noises of the object, p measurements."""
    rng = exercise.rng(f"{name}-functions-{n}-{r}-{p}")
    f, Phi = curved(rng, n, n, 0.7)
    S, H = curved(rng, p, n, 1.2)
    g = varying(rng, 0.3 + 0.6 * rng.uniform(size=(n, r)) + np.eye(n, r), n)
    return Functions(
        f, Phi, g, covariance(rng, r, 0.2), S, H, varying(rng, covariance(rng, p, 0.3), n)
    )


def changing(functions: Functions) -> Functions:
    """The same functions times factors that change from step to step, as functions of x and k."""

    def times(function: Map, phase: float) -> Map:
        return of_steps(lambda x, k: (1 + 0.3 * np.sin(1.7 * k + phase)) * function(x))

    f, Phi, g, D_v, S, H, D_n = functions
    return Functions(
        times(f, 0.4),
        times(Phi, 0.4),
        times(g, 1.1),
        D_v,
        times(S, 2.0),
        times(H, 2.0),
        times(D_n, 2.9),
    )


def sizes(exercise: Exercise) -> tuple[tuple[int, int, int], ...]:
    """Dimensions that answers are called with."""
    return DIMENSIONS, (exercise.model.n, len(exercise.model.v), exercise.model.p)


def hidden_law(rng: np.random.Generator, n: int) -> Gaussian:
    """A normal law for every trajectory."""
    return Gaussian(
        rng.normal(size=(RUNS, n)), np.array([covariance(rng, n, 0.4) for _ in range(RUNS)])
    )


def cases(exercise: Exercise, name: str) -> list[tuple[Functions, np.random.Generator, int, int]]:
    """Hidden functions, random numbers, n and p for each of the dimensions."""
    return [
        (hidden_functions(exercise, name, n, r, p), exercise.rng(f"{name}-{place}"), n, p)
        for place, (n, r, p) in enumerate(sizes(exercise))
    ]


def root(R: Array) -> Array:
    """A square root of a covariance."""
    return np.linalg.cholesky(symmetric(R))
