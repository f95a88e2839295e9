"""The modified filter of optimal structure (MFOS, МФОС): the FOS with Pugachev's coefficients in both steps.

Where the FOS trusts its approximate structural functions, the MFOS lets a regression over the ensemble
correct them: since "change nothing" is among the admissible coefficients, each regression can only
lower the mean square error of its own step over the ensemble it was designed on.
"""

from __future__ import annotations

import sympy as sp

from kfcourse.angles import difference, near
from kfcourse.filters import notation as s
from kfcourse.filters.designed import Design, Equations, Regression, Step
from kfcourse.filters.optimal_structure import CONDITION, check_arguments, with_measurement
from kfcourse.laws import Array, Gaussian, apply, gain, product, transpose, where_measured
from kfcourse.symbolic.structure import Structure

_sigma, _eps = s.matrix(r"\sigma_{k}", s.n, s.ONE), s.matrix(r"\varepsilon_{k}", s.n, s.ONE)
_s_next = s.matrix(r"s_{k+1}", s.n, s.ONE)
_H = s.matrix(r"H_{k}", s.n, s.n)
_L, _n = s.matrix(r"L_{k+1}", s.n, s.n), s.matrix(r"n_{k+1}", s.n, s.ONE)

EQUATIONS = (
    *s.MEASURE,
    sp.Eq(_sigma, s.Psi * s.G.T * s.F.I * (s.y - s.h)),
    sp.Eq(_eps, s.x - s.lam),
    *s.regression(_H, s.e, _eps, _sigma),
    sp.Eq(s.z, s.lam + _H * _sigma + s.e),
    *CONDITION,
    sp.Eq(_s_next, s.tau_uT),
    *s.regression(_L, _n, s.x_next, _s_next),
    sp.Eq(s.lam_next, _L * _s_next + _n),
    sp.Eq(s.Psi_next, s.Theta_uT),
)


def mfos(structure: Structure, arguments: int = 2) -> Design:
    """The modified filter of optimal structure.

    sigma = Psi G^T F^+ (y - h),   z = lambda + H sigma + e      regression of x - lambda on sigma
    u = Gamma z + chi,  T = residual                             regression of x on z (or on (y, z))
    s' = tau(u, T),   lambda' = L s' + n                         regression of x' on s'
    Psi' = Theta(u, T)

    Its own covariance is the residual of the first regression, (n, n).
    """
    check_arguments(arguments)
    angles = structure.model.angles

    def equations(predicted: Gaussian, y: Array, k: int) -> Equations:
        (lam, Psi), now = predicted, structure.at(k)
        measurement = now.measure(lam, Psi)
        K = gain(product(Psi, transpose(measurement.G)), measurement.F)
        sigma = apply(K, measurement.innovation(y))
        fit = yield Regression(lambda x, x_next: difference(x, lam, angles.x), sigma)
        posterior = Gaussian(lam + where_measured(y, fit(sigma)), fit.residual)

        regressor = posterior.mean if arguments == 2 else with_measurement(y, measurement, posterior.mean, angles.y)
        fit = yield Regression(lambda x, x_next: near(x, posterior.mean, angles.x), regressor)
        s_next, Psi_next = now.predict(fit(regressor), fit.residual)
        fit = yield Regression(lambda x, x_next: near(x_next, s_next, angles.x), s_next)
        return Step(posterior, Gaussian(fit(s_next), Psi_next))

    return Design(f"{'mfos' if arguments == 2 else 'mfos3'}-{structure.name}", structure.model, equations)
