"""Questions of set h: the filter in continuous time, for white noises of given one-sided spectral
densities.

Answers are functions of numbers, of arrays (one number for each run, or matrices), and in the last
question of formulas. The keys are in keys.py, the known mistakes in mistakes.py.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import sympy as sp

from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.exercises.checks.question import Question
from kfcourse.exercises.checks.registry import ExerciseSet
from kfcourse.exercises.sets.h_continuous.keys import (
    derivatives,
    filter_step,
    noise_variances,
    riccati,
    simulate_step,
    steady_state,
)
from kfcourse.exercises.sets.h_continuous.mistakes import (
    WRONG_DERIVATIVES,
    WRONG_RATES,
    WRONG_SIMULATIONS,
    WRONG_STEADY,
    WRONG_STEPS,
    WRONG_VARIANCES,
)
from kfcourse.exercises.sets.shared import Map, covariance

RUNS = 6

# dx/dt = -a x + s xi, y = h x + n or h sin(x) + n; densities S_xi, N; d is the variance of x(0):
# from, to.
NUMBERS = {
    "a": (0.4, 0.9),
    "s": (0.6, 1.1),
    "h": (0.7, 1.3),
    "S_xi": (1.5, 2.5),
    "N": (0.15, 0.4),
    "d": (0.8, 1.5),
}


def continuous_numbers(exercise: Exercise) -> dict[str, float]:
    """Numbers of the variant's continuous model."""
    rng = exercise.rng("continuous")
    return {name: round(float(rng.uniform(*limits)), 2) for name, limits in NUMBERS.items()}


# -- h1: variances of means over a step


def variances_arguments(exercise: Exercise) -> list[tuple]:
    """Densities of both noises and a step, three times."""
    rng = exercise.rng("h1")
    return [
        tuple(round(float(v), 3) for v in rng.uniform([1.2, 0.2, 0.01], [4, 0.9, 0.3]))
        for _ in range(3)
    ]


# -- h2: a step of a simulation


def curve(rng: np.random.Generator, slope: float) -> tuple[Map, Map]:
    """A hidden smooth function of a number, and its derivative."""
    a, b, c, d = rng.uniform([0.8, 0.3, 0.4, 0.2], [1.2, 0.5, 0.8, 0.6])
    return (
        lambda x: slope * (a * x + b * np.sin(x + c) + d),
        lambda x: slope * (a + b * np.cos(x + c)),
    )


def positive(rng: np.random.Generator) -> Map:
    """A hidden positive function of a number."""
    level, swing, shift = rng.uniform([0.6, 0.2, 0.3], [0.9, 0.4, 0.9])
    return lambda x: level + swing * np.sin(x + shift)


def simulation_arguments(exercise: Exercise) -> list[tuple]:
    """States, standard normal numbers, a step and hidden functions."""
    rng = exercise.rng("h2")
    x, xi, n = rng.normal(size=(3, RUNS))
    return [
        (
            x,
            xi,
            n,
            rng.uniform(0.05, 0.2),
            curve(rng, -0.7)[0],
            positive(rng),
            curve(rng, 1.1)[0],
            *rng.uniform([1.4, 0.2], [2.6, 0.5]),
        )
    ]


# -- h3: the Riccati equation


def rate_arguments(exercise: Exercise) -> list[tuple]:
    """A covariance and matrices without symmetry."""
    rng = exercise.rng("h3")
    A, G, H = rng.normal(size=(3, 3)), rng.normal(size=(3, 3)), rng.normal(size=(2, 3))
    return [(covariance(rng, 3), A, G, H, covariance(rng, 3), covariance(rng, 2, 0.4))]


# -- h4: the steady state of dx/dt = -a x + s xi, y = h x + n


def steady_arguments(exercise: Exercise) -> list[tuple]:
    """Three scalar models."""
    rng = exercise.rng("h4")
    low, high = [0.3, 0.6, 1.3, 1.3, 0.15], [0.7, 0.9, 1.8, 2.6, 0.5]
    return [tuple(round(float(v), 3) for v in rng.uniform(low, high)) for _ in range(3)]


# -- h5: a step of the filter


def step_arguments(exercise: Exercise) -> list[tuple]:
    """Estimates, variances, measurements and hidden functions with their slopes."""
    rng = exercise.rng("h5")
    z, y = rng.normal(size=(2, RUNS))
    D, T = rng.uniform(0.4, 1.2, RUNS), rng.uniform(0.01, 0.03)
    return [
        (
            z,
            D,
            y,
            T,
            *curve(rng, -0.7),
            positive(rng),
            *curve(rng, 1.3),
            *rng.uniform([1.4, 0.2], [2.6, 0.5]),
        )
    ]


# -- h6: derivatives of the log-likelihood


def derivatives_arguments(exercise: Exercise) -> list[tuple]:
    """Three signals of x."""
    x, y, N = sp.symbols("x y N_n", real=True)
    a, b, c = (sp.Rational(int(k), 10) for k in exercise.rng("h6").integers(3, 10, 3))
    return [
        (signal, x, y, N)
        for signal in (sp.sin(x + a) + b * x, sp.exp(c * x) + b * x**2, x + a * x**3)
    ]


QUESTIONS = (
    Question(
        "h1",
        "white noise on a computer",
        "warm-up",
        noise_variances,
        variances_arguments,
        WRONG_VARIANCES,
        ("D_xi", "D_n"),
        advice="Check the units, and what becomes of the mean when the step is longer.",
    ),
    Question(
        "h2",
        "a step of a simulation",
        "core",
        simulate_step,
        simulation_arguments,
        WRONG_SIMULATIONS,
        ("x_next", "y"),
        advice=(
            "Check the variances: after a step without drift that of the state grows in "
            "proportion to T, that of y falls with T."
        ),
        axes=("trajectory",),
    ),
    Question(
        "h3",
        "the Riccati equation",
        "core",
        riccati,
        rate_arguments,
        WRONG_RATES,
        advice=(
            "Try one component: the equation of the chapter has three terms. Then ask for each "
            "product of "
            "matrices whether it is symmetric."
        ),
    ),
    Question(
        "h4",
        "the steady state",
        "core",
        steady_state,
        steady_arguments,
        WRONG_STEADY,
        ("D", "K"),
        advice=(
            "Put your D into the Riccati equation: is the derivative zero? Then let the meter "
            "become "
            "useless: which D must come out?"
        ),
    ),
    Question(
        "h5",
        "a step of the extended filter",
        "core",
        filter_step,
        step_arguments,
        WRONG_STEPS,
        ("z", "D"),
        advice=(
            "Leave out the noises, then the meter: what remains must be the plain equation x' = "
            "f(x) and its variance."
        ),
        axes=("trajectory",),
    ),
    Question(
        "h6",
        "derivatives of the log-likelihood",
        "stretch",
        derivatives,
        derivatives_arguments,
        WRONG_DERIVATIVES,
        ("u", "U"),
        advice="Differentiate F as a product; S and its derivatives are functions of x, y is not.",
    ),
)

SET = ExerciseSet(
    "h",
    "The continuous-time filter",
    Path(__file__).parent,
    QUESTIONS,
    chapters=("course/continuous",),
    numbers=continuous_numbers,
    about_variant=False,
)
