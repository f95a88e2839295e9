"""The Kalman filter: the textbook step, and the filter of a linear model made of it.

    x_{k+1} = A x_k + v_k,  v ~ N(0, Q)
    y_k     = H x_k + w_k,  w ~ N(0, R)

Read this file first.  Every filter of the course is this correction and prediction with other
functions in the place of the matrices; on a linear model with normal noises each must give these
numbers, and the tests pin it.  What rounding does to the step, and the forms that stand it better,
is in `kfcourse.linear.arithmetic`.  Kalman (1960).
"""

from __future__ import annotations

from kfcourse.angles import near
from kfcourse.errors import expect
from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.laws import (
    Gaussian,
    Vectors,
    any_missing,
    apply,
    regression,
    transpose,
    without_missing,
)
from kfcourse.linear.system import LinearSystem, linear_systems
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import linearised


def correct(system: LinearSystem, predicted: Gaussian, y: Vectors) -> Gaussian:
    """The law of the state after a measurement y, (..., p); its missing components (NaN) tell
    nothing.

    K = P^- H^T (H P^- H^T + R)^-1,   z = x^- + K (y - H x^-),   P = P^- - K H P^-

    P is evaluated as `kfcourse.laws.regression` does: a difference would lose the digits of a
    variance that is far smaller than that of the prediction.
    """
    x, P = predicted
    H, R = system.H, system.R
    innovation = y - apply(H, x)
    if any_missing(innovation):
        innovation, H, R, _ = without_missing(innovation, H, R, R)
    K, cov = regression(P, H, H @ P @ transpose(H) + R, R)
    return Gaussian(x + apply(K, innovation), cov)


def predict(system: LinearSystem, posterior: Gaussian) -> Gaussian:
    """The law of the next state, x^- = A z, P^- = A P A^T + Q."""
    z, P = posterior
    return Gaussian(apply(system.A, z), system.A @ P @ system.A.T + system.Q)


def kalman_filter(model: Model) -> Filter:
    """The Kalman filter of a linear model, whose matrices may depend on the step.

    As long as no measurement is missing, there is one covariance (n, n) for all runs.

    Raises
    ------
    ModelError
        The model is not linear.
    """
    expect(model, Model, "kalman_filter")
    system_at = linear_systems(model)

    def step(state: State, y: Vectors) -> State:
        # and the constants of the object and of the meter
        system, shift, offset = system_at(state.step)
        expected = apply(system.H, state.predicted.mean)
        posterior = correct(system, state.predicted, near(y - offset, expected, model.angles.y))
        mean, cov = predict(system, posterior)
        return State(state.step + 1, posterior, Gaussian(mean + shift, cov))

    return Filter("kalman", model, initial_state(model), step, structure=linearised(model))
