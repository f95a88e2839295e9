"""Rudenko's filter of optimal structure (FOS, ФОС), in Gaussian and linearised approximation.

The FOS has the order of the object: its estimate is z_k = M[x_k | y_k, z_{k-1}], so all it carries from
step to step is z.  What z says about x is the regression of x_k on z_k over the ensemble:

    u_k = Gamma_k z_k + chi_k  with residual covariance T_k

and (u_k, T_k) take the place of the AOF's (z_k, p_k) in the prediction.  T_k is one matrix for the whole
ensemble, found off-line: on-line the filter carries no covariance equation.
"""

from __future__ import annotations

import numpy as np
import sympy as sp

from kfcourse.angles import Components, near
from kfcourse.filters import notation as s
from kfcourse.filters.designed import Design, Equations, Regression, Step
from kfcourse.laws import Array, Gaussian, Measurement, correct
from kfcourse.symbolic.structure import Structure

CONDITION = (
    *s.regression(s.Gamma, s.chi, s.x, s.z),
    sp.Eq(s.T, s.cov(s.x) - s.Gamma * s.cov(s.x, s.z).T),
    sp.Eq(s.u, s.Gamma * s.z + s.chi),
)
EQUATIONS = (
    *s.MEASURE,
    s.GAIN,
    sp.Eq(s.z, s.lam + s.K * (s.y - s.h)),
    *CONDITION,
    sp.Eq(s.lam_next, s.tau_uT),
    sp.Eq(s.Psi_next, s.Theta_uT),
)


def fos(structure: Structure, arguments: int = 2) -> Design:
    """The filter of optimal structure.

    z = lambda + K (y - h),  K = Psi G^T F^+
    u = Gamma z + chi,  T = residual                             regression of x on z
    lambda' = tau(u, T),  Psi' = Theta(u, T)

    Parameters
    ----------
    structure : Structure
    arguments : int
        2: x is regressed on z alone.  3: on (y, z).
    """
    check_arguments(arguments)
    angles = structure.model.angles

    def equations(predicted: Gaussian, y: Array, k: int) -> Equations:
        now = structure.at(k)
        measurement = now.measure(*predicted)
        posterior = correct(predicted, measurement, y)
        regressor = posterior.mean if arguments == 2 else with_measurement(y, measurement, posterior.mean, angles.y)
        fit = yield Regression(lambda x, x_next: near(x, posterior.mean, angles.x), regressor)
        return Step(posterior, now.predict(fit(regressor), fit.residual))

    return Design(f"{'fos' if arguments == 2 else 'fos3'}-{structure.name}", structure.model, equations)


def check_arguments(arguments: int) -> None:
    if arguments not in (2, 3):
        raise ValueError(f"the filter of optimal structure has 2 or 3 arguments, not {arguments!r}")


def with_measurement(y: Array, measurement: Measurement, z: Array, angles: Components) -> Array:
    """The regressor (y, z) of the three-argument form; a missing measurement is replaced by its prediction.

    In the place of components of y that are angles stand their innovations, which do not jump.
    """
    h = measurement.h
    if angles:
        turning = np.isin(np.arange(y.shape[-1]), angles)
        y, h = np.where(turning, measurement.innovation(y), y), np.where(turning, 0.0, h)
    return np.concatenate([np.where(np.isnan(y), h, y), z], axis=-1)
