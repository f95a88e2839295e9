"""Pugachev's two-step conditionally optimal filter (DUOF, ДУОФ).

The structure of both steps is given, taken from the model itself, and the coefficients minimise the
mean square error at each step over the ensemble: two affine regressions.  Pugachev (1979); Pugachev
and Sinitsyn (1987).
"""

from __future__ import annotations

import numpy as np

from kfcourse.angles import difference
from kfcourse.errors import expect
from kfcourse.filters import notation as s
from kfcourse.filters.base import State
from kfcourse.filters.designed import Design, Equations, fitted_correction, fitted_prediction
from kfcourse.laws import Array
from kfcourse.symbolic.equations import Equation, compile_noiseless
from kfcourse.symbolic.model import Model

_omega, _eps = s.matrix(r"\omega_{k}", s.p, s.ONE), s.matrix(r"\varepsilon_{k}", s.n, s.ONE)
_alpha = s.matrix(r"\alpha_{k}", s.n, s.ONE)
_F, _g = s.matrix(r"F_{k}", s.n, s.n), s.matrix(r"g_{k}", s.n, s.ONE)

EQUATIONS = (
    s.equation(_omega, s.y - s.b_value),
    s.equation(_eps, s.x - s.lam),
    *s.regression(s.H, s.e, _eps, _omega),
    s.equation(s.z, s.lam + s.H * _omega + s.e),
    s.equation(_alpha, s.a_value),
    *s.regression(_F, _g, s.x_next, _alpha),
    s.equation(s.lam_next, _F * _alpha + _g),
)


def duof(model: Model, equations: tuple[Equation, Equation] | None = None) -> Design:
    """The two-step conditionally optimal filter.

        omega = y - b(lambda, m_w),   z = lambda + H omega + e       H, e: of x - lambda on omega
        alpha = a(z, m_v),            lambda' = F alpha + g          F, g: of x' on alpha

    with the coefficients of two regressions over the ensemble.  Its own covariance is the residual
    of each regression, (n, n): one for the whole ensemble, whether y came or not.  A measurement of
    which a component is missing corrects nothing: H is that of whole ones.  Given `equations` take
    the place of a(z, m_v) and b(lambda, m_w).
    """
    expect(model, Model, "duof")
    (a, b), angles = equations or compile_noiseless(model), model.angles

    def step(state: State, y: Array) -> Equations:
        lam, k = state.predicted.mean, state.step
        omega = difference(y, b(lam, k), angles.y)
        posterior = yield from fitted_correction(lam, omega, y, angles)
        alpha = np.broadcast_to(a(posterior.mean, k), lam.shape)
        predicted = yield from fitted_prediction(alpha, angles)
        return State(k + 1, posterior, predicted)

    return Design("duof", model, step)
