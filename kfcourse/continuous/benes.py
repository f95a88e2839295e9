r"""Benes' filter (1981): a nonlinear object in continuous time whose law given its measurements is
known in closed form.

    dx = tanh(x) dt + dw,    p(x | y_0, ..., y_k) = N(x; m, P) e^(-P/2) cosh(x) / cosh(m)

Between measurements m stays and P grows by the time that passes; a measurement of x corrects (m, P)
as a Kalman filter does. As cosh is a sum of exponentials, the law is two normal ones, N(m + P, P)
and N(m - P, P), with the weights e^m and e^-m.
"""

from __future__ import annotations

import numpy as np

from kfcourse.continuous.sampling import clock
from kfcourse.errors import expect
from kfcourse.filters.base import Filter, State
from kfcourse.laws import Array, Gaussian, correct, log_density
from kfcourse.symbolic.formula import parse
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.structure import linearised


def benes_filter(model: Model) -> Filter:
    """The exact filter of dx = tanh(x) dt + dw, measured by y = c x + d w.

    M x = m + P tanh(m),    D x = P + P^2 / cosh(m)^2.  The prior's mean and variance are m and P
    before the first measurement, so that its law is normal only where its variance is 0.  Its
    `evidence` is exact too.

    Raises
    ------
    ModelError
        Another object, or a meter that is not linear in a scalar state.
    """
    expect(model, Model, "benes_filter")
    known, between, drift = model.known, model.between, parse("tanh(x)", {"x": model.x[0]})
    if between is None or [
        *between.drift.subs(model.values),
        *between.diffusion.subs(model.values),
    ] != [drift, 1]:
        raise ModelError(
            f"Benes' filter is that of dx/dt = tanh(x) + v with a unit intensity, not of {model}"
        )
    if model.p != 1 or model.meter_equation.jacobian([*model.x, *model.w]).has(*model.x, *model.w):
        raise ModelError(f"Benes' filter needs a meter that is linear in x, not {model}")
    meter = linearised(model)

    def law(m: Array, P: Array) -> Gaussian:
        slope = np.tanh(m)
        return Gaussian(m + P[..., 0] * slope, P + P**2 * (1 - slope**2)[..., None])

    def init(runs: int) -> State:
        start = Gaussian(
            np.tile(model.prior.mean, (runs, 1)), np.tile(model.prior.cov, (runs, 1, 1))
        )
        return State(0, law(*start), law(*start), start)

    def step(state: State, y: Array) -> State:
        now = correct(state.memory, meter.at(state.step).measure(*state.memory), y)
        after = Gaussian(now.mean, now.cov + clock(known, state.step)[0])
        return State(state.step + 1, law(*now), law(*after), after)

    def evidence(before: State, y: Array, after: State) -> Array:
        m, P = before.memory
        parts = [
            log_density(meter.at(before.step).measure(m + sign * P[..., 0], P), y)
            - np.logaddexp(0, -2 * sign * m[..., 0])
            for sign in (1, -1)
        ]
        return np.logaddexp(*parts)

    return Filter("benes", model, init, step, evidence=evidence)
