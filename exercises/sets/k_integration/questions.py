"""Questions of set k: an inertial system integrated with a satellite receiver.

What is derived is answered with formulas in the symbols of the arguments, what runs with arrays.
Personal numbers are in `integration_numbers`; hidden arguments are others.  The keys are in
keys.py, the known mistakes in mistakes.py.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import sympy as sp

from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.exercises.checks.question import Question
from kfcourse.exercises.checks.registry import ExerciseSet
from kfcourse.exercises.sets.k_integration.keys import (
    bias_error,
    error_meter,
    gained,
    integrate,
    lost,
    steady_state,
)
from kfcourse.exercises.sets.k_integration.mistakes import (
    WRONG_BIASES,
    WRONG_FILTERS,
    WRONG_GROWTHS,
    WRONG_IMPROVEMENTS,
    WRONG_METERS,
    WRONG_STEADY,
)
from kfcourse.exercises.sets.shared import personal

S_XI, S_N = sp.symbols("sigma_xi sigma_n", positive=True)


def integration_numbers(exercise: Exercise) -> dict[str, float]:
    """T (s), sigma_n and sigma_xi (m/s), gap: how long the receiver is lost (s)."""
    return personal(
        exercise,
        "k",
        T=(0.1, 0.05, 0.4),
        sigma_n=(0.2, 0.1, 0.5),
        sigma_xi=(0.01, 0.005, 0.025),
        gap=(60.0, 30, 90),
    )


# -- k1: the error of the slow sensor as the state


def signals(exercise: Exercise) -> list[tuple]:
    """The receiver measures the quantity itself, or a formula of it."""
    rng = exercise.rng("k1")
    a, b, c = (sp.Rational(int(number), 10) for number in rng.integers(12, 40, 3))
    y, eps = sp.symbols("y eps", real=True)
    return [
        (signal, y, eps)
        for signal in (lambda x: x, lambda x: a * x + sp.sqrt(b + x**2) + sp.sin(c * x))
    ]


# -- k3: the filter


def filter_arguments(exercise: Exercise) -> list[tuple]:
    """A run without gaps and one with."""
    rng = exercise.rng("k3")
    sigma_xi, sigma_n, p0 = rng.uniform(0.2, 0.5), rng.uniform(0.6, 0.9), rng.uniform(1.5, 3)
    V = 5 * rng.normal(size=(8, 4, 3))
    eps = np.sqrt(p0) * rng.normal(size=(4, 3)) + np.cumsum(
        sigma_xi * rng.normal(size=V.shape), axis=0
    )
    y_sr = V + sigma_n * rng.normal(size=V.shape)
    gaps = y_sr.copy()
    gaps[[2, 3, 6]] = np.nan
    return [(V + eps, received, sigma_xi, sigma_n, p0) for received in (y_sr, gaps)]


QUESTIONS = (
    Question(
        "k1",
        "the error as the state",
        "warm-up",
        error_meter,
        signals,
        WRONG_METERS,
        ("signal", "slope"),
        advice="Try S(V) = V^2 by hand: put V = y - eps in, and differentiate by eps.",
    ),
    Question(
        "k2",
        "the steady state",
        "core",
        steady_state,
        lambda e: [(S_XI, S_N)],
        WRONG_STEADY,
        ("Psi", "p", "K"),
        advice="Put your three results into the three equations of the hint: do they hold?",
    ),
    Question(
        "k3",
        "the filter",
        "core",
        integrate,
        filter_arguments,
        WRONG_FILTERS,
        ("V", "p"),
        advice=(
            "Follow one axis for two steps by hand: the prior is for the first measurement; "
            "without a "
            "measurement only the variance changes."
        ),
        axes=("step",),
    ),
    Question(
        "k4",
        "what is gained, and how soon",
        "core",
        gained,
        lambda e: [(S_XI, S_N, sp.Symbol("T", positive=True))],
        WRONG_IMPROVEMENTS,
        ("factor", "time_constant"),
        advice="Check the units: the first is a pure number, the second a time. Is the first "
        "larger than one?",
    ),
    Question(
        "k5",
        "the receiver is lost",
        "core",
        lost,
        lambda e: [(sp.Symbol("p", positive=True), S_XI, S_N, *sp.symbols("n T", positive=True))],
        WRONG_GROWTHS,
        ("deviation", "until"),
        advice=(
            "Variances grow in proportion to the number of periods; convert to a standard "
            "deviation, and "
            "periods to seconds, last."
        ),
    ),
    Question(
        "k6",
        "the receiver is biased",
        "stretch",
        bias_error,
        lambda e: [(*sp.symbols("beta K", real=True), sp.Symbol("j", integer=True, positive=True))],
        WRONG_BIASES,
        advice="Try the first and the second biased measurement by hand, then an infinite number "
        "of them.",
    ),
)

SET = ExerciseSet(
    "k",
    "Inertial system and satellite receiver",
    Path(__file__).parent,
    QUESTIONS,
    chapters=("course/integration", "beyond/four-sensors"),
    numbers=integration_numbers,
    about_variant=False,
)
