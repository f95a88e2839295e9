"""Approximations of the absolutely optimal filter (AOF, АОФ).

The AOF is the Stratonovich recursion itself: its estimate is the posterior mean.  Replacing each
density by the normal one with the same first two moments gives one predict/correct step, and the
structural functions decide which filter it is::

    linearised(model)                     the extended Kalman filter (ЛАОФ)
    gaussian(model)                       the normal filter (ГАОФ)
    unscented(model), gauss_hermite(...)  the unscented and quadrature Kalman filters

Stratonovich (1960); Jazwinski (1970); Julier and Uhlmann (2004); all of them as one step: Sarkka
and Svensson (2023).
"""

from __future__ import annotations

from kfcourse.errors import expect
from kfcourse.filters import notation as s
from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.laws import Vectors, correct
from kfcourse.symbolic.structure import Structure

EQUATIONS = (
    *s.MEASURE,
    s.GAIN,
    s.equation(s.z, s.lam + s.K * (s.y - s.h)),
    s.equation(s.P, s.Psi - s.K * s.G * s.Psi),
    s.equation(s.lam_next, s.tau_zp),
    s.equation(s.Psi_next, s.Theta_zp),
)


def aof(structure: Structure) -> Filter:
    """The Gaussian-approximated AOF with the given structural functions.

    K = Psi G^T F^+,  z = lambda + K (y - h),  p = Psi - K G Psi
    lambda' = tau(z, p),  Psi' = Theta(z, p)

    Its own covariance p (runs, n, n) is that of the approximation, not the actual one.
    """
    expect(structure, Structure, "aof")

    def step(state: State, y: Vectors) -> State:
        now = structure.at(state.step)
        expected = now.measure(*state.predicted)
        posterior = correct(state.predicted, expected, y)
        return State(state.step + 1, posterior, now.predict(*posterior), expected=expected)

    model = structure.model
    return Filter(f"aof-{structure.name}", model, initial_state(model), step, structure=structure)
