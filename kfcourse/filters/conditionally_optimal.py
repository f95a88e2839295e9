"""Pugachev's two-step conditionally optimal filter (DUOF, ДУОФ).

The structure of both steps is given, taken from the model itself, and the coefficients minimise the
mean square error at each step over the ensemble: two affine regressions.
"""

from __future__ import annotations

import numpy as np
import sympy as sp

from kfcourse.angles import difference, near
from kfcourse.filters import notation as s
from kfcourse.filters.designed import Design, Equations, Regression, Step
from kfcourse.laws import Array, Gaussian, where_measured
from kfcourse.symbolic.equations import compile_noiseless
from kfcourse.symbolic.model import Model

_omega, _eps = s.matrix(r"\omega_{k}", s.p, s.ONE), s.matrix(r"\varepsilon_{k}", s.n, s.ONE)
_alpha = s.matrix(r"\alpha_{k}", s.n, s.ONE)
_F, _g = s.matrix(r"F_{k}", s.n, s.n), s.matrix(r"g_{k}", s.n, s.ONE)

EQUATIONS = (
    sp.Eq(_omega, s.y - s.b_value),
    sp.Eq(_eps, s.x - s.lam),
    *s.regression(s.H, s.e, _eps, _omega),
    sp.Eq(s.z, s.lam + s.H * _omega + s.e),
    sp.Eq(_alpha, s.a_value),
    *s.regression(_F, _g, s.x_next, _alpha),
    sp.Eq(s.lam_next, _F * _alpha + _g),
)


def duof(model: Model) -> Design:
    """The two-step conditionally optimal filter.

    omega = y - b(lambda, m_w),   z = lambda + H omega + e       H, e: regression of x - lambda on omega
    alpha = a(z, m_v),            lambda' = F alpha + g          F, g: regression of x' on alpha

    Its own covariance is the residual of each regression, (n, n): one for the whole ensemble.
    """
    (a, b), angles = compile_noiseless(model), model.angles

    def equations(predicted: Gaussian, y: Array, k: int) -> Equations:
        lam = predicted.mean
        omega = difference(y, b(lam, k), angles.y)
        fit = yield Regression(lambda x, x_next: difference(x, lam, angles.x), omega)
        posterior = Gaussian(lam + where_measured(y, fit(omega)), fit.residual)

        alpha = np.broadcast_to(a(posterior.mean, k), lam.shape)
        fit = yield Regression(lambda x, x_next: near(x_next, alpha, angles.x), alpha)
        return Step(posterior, Gaussian(fit(alpha), fit.residual))

    return Design("duof", model, equations)
