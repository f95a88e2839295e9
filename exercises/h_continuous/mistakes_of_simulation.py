"""Known mistakes in a simulation: variances of means of white noise (h1), a step (h2)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.h_continuous.keys import simulation_with

# -- h1: variances of means over a step


def both(change: Callable[[float, float], float]) -> Answer:
    """(density, T) -> the variance, for both noises."""
    return lambda S_xi, N, T: (change(S_xi, T), change(N, T))


WRONG_VARIANCES: tuple[tuple[str, str, Answer], ...] = (
    ("one-sided", messages.BOTH_ONE_SIDED, both(lambda density, T: density / T)),
    (
        "factor-wrong-way",
        "From a one-sided density to an intensity the factor goes the other way.",
        both(lambda density, T: 2 * density / T),
    ),
    (
        "times-step",
        "Multiplied by the step; the longer a mean is taken over, the less it varies.",
        both(lambda density, T: density * T / 2),
    ),
    ("step-forgotten", "The step is missing: that is an intensity, with other units.", both(lambda density, T: density / 2)),
    ("deviation", messages.DEVIATION_FOR_VARIANCE, both(lambda density, T: np.sqrt(density / (2 * T)))),
    (
        "step-squared",
        "Divided by the step once too often: the variance of an integral over a step is proportional to the step.",
        both(lambda density, T: density / (2 * T**2)),
    ),
)


# -- h2: a step of a simulation

WRONG_SIMULATIONS: tuple[tuple[str, str, Answer], ...] = (
    (
        "noise-times-step",
        "The noise grows with the step like the drift; over a step its variance does, its size with the root of it.",
        simulation_with(shake=lambda S_xi, T: T * np.sqrt(S_xi / 2), noise=lambda N, T: np.sqrt(N / 2) / T),
    ),
    (
        "one-sided",
        messages.BOTH_ONE_SIDED,
        simulation_with(shake=lambda S_xi, T: np.sqrt(S_xi * T), noise=lambda N, T: np.sqrt(N / T)),
    ),
    (
        "mean-for-integral",
        "That is the mean of the noise over the step; the state changes by its integral.",
        simulation_with(shake=lambda S_xi, T: np.sqrt(S_xi / (2 * T))),
    ),
    (
        "integral-for-mean",
        "The noise of the measurement grows with the step; a mean over a longer step varies less.",
        simulation_with(noise=lambda N, T: np.sqrt(N * T / 2)),
    ),
    (
        "variance-for-deviation",
        "A variance multiplies the standard normal number; its root belongs there.",
        simulation_with(shake=lambda S_xi, T: S_xi * T / 2, noise=lambda N, T: N / (2 * T)),
    ),
    (
        "step-forgotten-in-noise",
        "The step is missing in the noise.",
        simulation_with(shake=lambda S_xi, T: np.sqrt(S_xi / 2), noise=lambda N, T: np.sqrt(N / 2)),
    ),
    (
        "step-forgotten-in-drift",
        "The drift is a velocity: over a step the state changes by it times the step.",
        simulation_with(drift=lambda f, T: f),
    ),
    ("state-forgotten", "That is the change of the state; add it to the state.", simulation_with(kept=0.0)),
    ("drift-forgotten", "The state is only shaken: the drift is missing.", simulation_with(drift=lambda f, T: 0 * f)),
    ("factor-forgotten", "The factor of the noise is missing.", simulation_with(factor=lambda g, x, ahead: np.ones_like(x))),
    (
        "factor-at-end",
        "The factor of the noise is taken at the end of the step; in Ito's sense it does not know this step's noise yet.",
        simulation_with(factor=lambda g, x, ahead: g(ahead)),
    ),
    (
        "measured-at-end",
        "The signal is taken after the step; y_k belongs to the step that starts at x.",
        simulation_with(seen=lambda x, x_next: x_next),
    ),
)
