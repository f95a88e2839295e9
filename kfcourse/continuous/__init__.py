r"""Continuous time: white noise of given spectral density, simulation, and the extended Kalman-Bucy
filter.

    dx/dt = f(x) + g(x) xi(t)        xi: white, one-sided spectral density S_xi, intensity S_xi / 2
    y(t)  = S(x) + n(t)              n:  white, one-sided spectral density N,    intensity N / 2

in Ito's sense: over a short step T the state changes by T f + g times a normal number of variance
S_xi T / 2, with f and g at the *beginning* of the step.  That is what a discrete model turns into
when T -> 0; `symmetrised_drift` is the difference from the other (symmetrised, Stratonovich) sense.

White noise has no values, only means over intervals: a stored measurement is y_k = (1/T) Integral y
dt over step k, with the noise variance N / (2 T).  A continuous filter is therefore an ordinary
`Filter` of this y_k, made for one step T; it tends to its differential equations as T -> 0.

model        `ContinuousModel`, and `to_discrete`: the discrete model with the same limit
paths        `simulate`
equations    `log_likelihood_rate`, `filter_equations`: the filter's formulas, derived
bucy         `extended_kalman_bucy`: the filter
stationary   `steady_state` of a linear model

An object that moves in continuous time may be measured at instants only; then it is a `Model` as
every other:

sampling     `sampled`: such a model, with unit intensity of its Wiener processes
integration  `moment_equations` between two measurements, derived; they are integrated with an error
             control
exact        `pointmass` of a scalar one, by sub-steps between measurements
benes        `benes_filter`: exact where the drift is tanh(x)
"""

from kfcourse.continuous.benes import benes_filter
from kfcourse.continuous.bucy import extended_kalman_bucy
from kfcourse.continuous.equations import (
    FilterEquations,
    filter_equations,
    log_likelihood_rate,
    symmetrised_drift,
)
from kfcourse.continuous.integration import MomentEquations, moment_equations
from kfcourse.continuous.model import ContinuousModel, to_discrete
from kfcourse.continuous.paths import Path, simulate
from kfcourse.continuous.sampling import sampled
from kfcourse.continuous.stationary import Linear, Steady, linear_matrices, steady_state

__all__ = [
    "ContinuousModel",
    "FilterEquations",
    "Linear",
    "MomentEquations",
    "Path",
    "Steady",
    "benes_filter",
    "extended_kalman_bucy",
    "filter_equations",
    "linear_matrices",
    "log_likelihood_rate",
    "moment_equations",
    "sampled",
    "simulate",
    "steady_state",
    "symmetrised_drift",
    "to_discrete",
]
