"""Continuous time: white noise of given spectral density, simulation, and the extended Kalman-Bucy filter."""

from kfcourse.continuous.model import (
    ContinuousModel,
    FilterEquations,
    Linear,
    Path,
    Steady,
    coarsen,
    extended_kalman_bucy,
    filter_equations,
    linear_matrices,
    log_likelihood_rate,
    simulate,
    steady_state,
    symmetrised_drift,
    to_discrete,
)

__all__ = [
    "ContinuousModel",
    "FilterEquations",
    "Linear",
    "Path",
    "Steady",
    "coarsen",
    "extended_kalman_bucy",
    "filter_equations",
    "linear_matrices",
    "log_likelihood_rate",
    "simulate",
    "steady_state",
    "symmetrised_drift",
    "to_discrete",
]
