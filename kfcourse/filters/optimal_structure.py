r"""Rudenko's filter of optimal structure (FOS, ФОС), and all that one construction makes of it.

At the end of a step such a filter remembers a vector zeta_k.  What zeta says about x is a
regression over the ensemble,

    u_k = Gamma_k zeta_k + chi_k  with residual covariance T_k

and (u_k, T_k) take the place of the AOF's (z_k, p_k) in the prediction.  T_k is one matrix for the
whole ensemble, found off-line: on-line the filter carries no covariance equation.  Two choices make
the filter:

`Memory`   zeta: the last estimates, the last measurements, or both.  The FOS has the order of the
           object: its estimate is z_k = M[x_k | y_k, z_{k-1}], so all it carries from step to step
           is z;
`Recipe`   which parts of the two steps are left to structural functions, and which are corrected by
           a regression.

Where the FOS trusts its approximate structural functions, the modified filters let a regression
over the ensemble correct them: since "change nothing" is among the admissible coefficients, each
regression can only lower the mean square error of its own step over the ensemble it was designed
on.  The two-step filters take Psi from it, too: the covariance of x given lambda, one matrix for
all.

            lambda'      Psi'         z
    FOS     s'           Theta(u, T)  lambda + sigma          s' = tau(u, T),  sigma = K (y - h)
    MFOS    L s' + n     Theta(u, T)  lambda + H sigma + e
    DFMP    L s' + n     residual     lambda + sigma
    MDFMP   L s' + n     residual     lambda + H sigma + e

Those that remember more than the last estimate; FKP and DFKP are the school's, the others come of
the construction:

    FKP, MFKP, DFKP, MDFKP   zeta_k = (y_k, y_{k-1}, ..., y_{k-l+1})     the recipes of FOS, MFOS,
                             DFMP, MDFMP
    FBP                      zeta_k = (z_k, z_{k-1}, ..., z_{k-l+1})     the recipe of the FOS

With measurements z is not fed back: what older ones knew is lost, and so are their errors.  Until
the memory is full it holds what there is.  Rudenko (2010, 2013).
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import sympy as sp

from kfcourse.angles import Components, near
from kfcourse.errors import expect, expect_sizes
from kfcourse.filters import notation as s
from kfcourse.filters.base import State
from kfcourse.filters.designed import (
    Design,
    Equations,
    Regression,
    fitted_correction,
    fitted_prediction,
)
from kfcourse.laws import Array, Gaussian, Measurement, apply, correct, gain, product, transpose
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.structure import Structure


class Recipe(NamedTuple):
    """Which parts of a step are regressions over the ensemble; the others are structural functions
    as they are."""

    mean: bool = False  # lambda' = L s' + n, not s'
    spread: bool = False  # Psi' = residual of that regression, not Theta(u, T)
    correction: bool = False  # z = lambda + H sigma + e, not lambda + sigma


FOS, MFOS = Recipe(), Recipe(mean=True, correction=True)
DFMP, MDFMP = Recipe(mean=True, spread=True), Recipe(mean=True, spread=True, correction=True)
STEPS = 4  # the school's length of memory


class Memory(NamedTuple):
    """How many of the last estimates and measurements make zeta: (y_k, y_{k-1}, ..., z_k, z_{k-1},
    ...)."""

    estimates: int = 1
    measurements: int = 0


class Remembered(NamedTuple):
    """What has been kept of both, newest first: arrays (runs, n) and (runs, p); fewer until the
    memory is full."""

    estimates: tuple[Array, ...] = ()
    measurements: tuple[Array, ...] = ()

    def and_now(self, z: Array, y: Array, memory: Memory, turning: Components) -> Remembered:
        """With the newest; the oldest drop out.  Older angles are kept within half a turn of the
        newest."""
        older = (near(estimate, z, turning) for estimate in self.estimates)
        return Remembered(
            (z, *older)[: memory.estimates], (y, *self.measurements)[: memory.measurements]
        )

    @property
    def regressor(self) -> Array:
        """zeta, (runs, r)."""
        both = (*self.measurements, *self.estimates)
        return both[0] if len(both) == 1 else np.concatenate(both, axis=-1)


def of_structure(name: str, structure: Structure, recipe: Recipe, memory: Memory) -> Design:
    """The construction: (name, structural functions, what is fitted, what is remembered) -> Design.

    Its own covariance is that of `correct`, or where the correction is a regression the residual,
    (n, n). A missing measurement is remembered as its prediction: then zeta tells, in the mean,
    what it would have told.

    Raises
    ------
    ModelError
        Measurements alone are to be remembered, but the model has angles, which jump by a turn: no
        regression fits them.
    """
    expect(structure, Structure, name)
    angles = structure.model.angles
    if not memory.estimates and (angles.x or angles.y):
        raise ModelError(
            f"{name} regresses the state on measurements, and angles jump by a turn: take a "
            f"filter that remembers estimates, "
            "fos(structure), mfos(structure) or fbp(structure, memory)"
        )

    def equations(state: State, y: Array) -> Equations:
        now, lam = structure.at(state.step), state.predicted.mean
        measurement = now.measure(*state.predicted)
        if recipe.correction:
            K = gain(product(state.predicted.cov, transpose(measurement.G)), measurement.F)
            posterior = yield from fitted_correction(
                lam, apply(K, measurement.innovation(y)), y, angles
            )
        else:
            posterior = correct(state.predicted, measurement, y)

        seen = expected_where_missing(y, measurement, angles.y) if memory.measurements else y
        remembered = (state.memory or Remembered()).and_now(posterior.mean, seen, memory, angles.x)
        zeta = remembered.regressor
        fit = yield Regression(lambda x, x_next: near(x, posterior.mean, angles.x), zeta)
        predicted = now.predict(fit(zeta), fit.residual)

        if recipe.mean:
            fitted = yield from fitted_prediction(predicted.mean, angles)
            predicted = fitted if recipe.spread else Gaussian(fitted.mean, predicted.cov)
        return State(state.step + 1, posterior, predicted, remembered)

    return Design(f"{name}-{structure.name}", structure.model, equations, structure=structure)


def expected_where_missing(y: Array, measurement: Measurement, turning: Components) -> Array:
    """What a filter remembers of a measurement: its prediction h where it is missing.

    In the place of components that are angles stand their innovations, which do not jump.
    """
    h = measurement.h
    if turning:
        which = np.isin(np.arange(y.shape[-1]), turning)
        y, h = np.where(which, measurement.innovation(y), y), np.where(which, 0.0, h)
    return np.where(np.isnan(y), h, y)


def fos(structure: Structure, arguments: int = 2) -> Design:
    """The filter of optimal structure.

    z = lambda + K (y - h),  K = Psi G^T F^+
    u = Gamma z + chi,  T = `residual`                           regression of x on z
    lambda' = tau(u, T),  Psi' = Theta(u, T)

    Parameters
    ----------
    structure : Structure
    arguments : int
        2: x is regressed on z alone.  3: on (y, z).
    """
    return _of_last_estimate("fos", structure, FOS, arguments)


def mfos(structure: Structure, arguments: int = 2) -> Design:
    """The modified filter of optimal structure (МФОС): the FOS with Pugachev's coefficients in both
    steps.

    sigma = Psi G^T F^+ (y - h),   z = lambda + H sigma + e      regression of x - lambda on sigma
    u = Gamma z + chi,  T = `residual`                           regression of x on z (or on (y, z))
    s' = tau(u, T),   lambda' = L s' + n                         regression of x' on s'
    Psi' = Theta(u, T)

    Its own covariance is the residual of the first regression, (n, n).  As in `duof`, a measurement
    of which a component is missing corrects nothing.
    """
    return _of_last_estimate("mfos", structure, MFOS, arguments)


def dfmp(structure: Structure) -> Design:
    """The two-step filter of low order (ДФМП): lambda' = L s' + n, and Psi' is the residual of that
    regression, (n, n).

    Prediction and correction are two problems of least mean square: lambda' the best from zeta,
    then z the best from y and
    lambda.  So Psi is the covariance of x given lambda.
    """
    return _of_last_estimate("dfmp", structure, DFMP)


def mdfmp(structure: Structure) -> Design:
    """The modified two-step filter of low order (МДФМП): `dfmp` whose correction is fitted as the
    MFOS's is."""
    return _of_last_estimate("mdfmp", structure, MDFMP)


def _of_last_estimate(
    family: str, structure: Structure, recipe: Recipe, arguments: int = 2
) -> Design:
    if arguments not in (2, 3):
        raise ValueError(f"the filter of optimal structure has 2 or 3 arguments, not {arguments!r}")
    name = family if arguments == 2 else f"{family}3"
    return of_structure(name, structure, recipe, Memory(estimates=1, measurements=arguments - 2))


def fkp(structure: Structure, memory: int = STEPS) -> Design:
    """The filter with finite memory.

    u = Gamma zeta + chi,  T = `residual`                        regression of x on zeta, the last
    `memory` measurements lambda' = tau(u, T),  Psi' = Theta(u, T),   z = lambda + K (y - h)

    Raises
    ------
    ValueError
        `memory` is not a positive whole number.
    ModelError
        The model has angles.
    """
    return _of_measurements("fkp", structure, FOS, memory)


def mfkp(structure: Structure, memory: int = STEPS) -> Design:
    """The modified filter with finite memory (МФКП): the steps of `mfos` with the regressor of
    `fkp`."""
    return _of_measurements("mfkp", structure, MFOS, memory)


def dfkp(structure: Structure, memory: int = STEPS) -> Design:
    """The two-step filter with finite memory (ДФКП): the steps of `dfmp` with the regressor of
    `fkp`.

    lambda' = L tau(u, T) + n.  Where tau is affine that is the regression of x' on zeta itself.
    """
    return _of_measurements("dfkp", structure, DFMP, memory)


def mdfkp(structure: Structure, memory: int = STEPS) -> Design:
    """The modified two-step filter with finite memory (МДФКП): the steps of `mdfmp` with the
    regressor of `fkp`."""
    return _of_measurements("mdfkp", structure, MDFMP, memory)


def fbp(structure: Structure, memory: int = STEPS) -> Design:
    """The filter of high order (ФБП): the steps of `fos`, with the last `memory` estimates in the
    place of z."""
    return of_structure(f"fbp{checked_memory(memory)}", structure, FOS, Memory(estimates=memory))


def _of_measurements(family: str, structure: Structure, recipe: Recipe, memory: int) -> Design:
    return of_structure(
        f"{family}{checked_memory(memory)}",
        structure,
        recipe,
        Memory(estimates=0, measurements=memory),
    )


def checked_memory(memory: int) -> int:
    """The length of a memory; ValueError if it is not a positive whole number."""
    expect_sizes(memory=memory)
    return memory


# ---------------------------------------------------------------- the same in symbols

_sigma, _eps = s.matrix(r"\sigma_{k}", s.n, s.ONE), s.matrix(r"\varepsilon_{k}", s.n, s.ONE)
_s_next = s.matrix(r"s_{k+1}", s.n, s.ONE)
_H = s.matrix(r"H_{k}", s.n, s.n)
_L, _n = s.matrix(r"L_{k+1}", s.n, s.n), s.matrix(r"n_{k+1}", s.n, s.ONE)


@cache  # each filter of a family has the same
def printed(
    recipe: Recipe, zeta: sp.MatrixSymbol = s.z, *, consists_of: sp.MatrixSymbol | None = None
) -> tuple[sp.Eq, ...]:
    """The equations of a step; `consists_of` is what zeta is made of, if it is not the estimate."""
    Gamma = s.matrix(s.Gamma.name, s.n, zeta.rows)
    equations = [*s.MEASURE]
    if recipe.correction:
        equations += [
            s.equation(_sigma, s.Psi * s.G.T * s.F.I * (s.y - s.h)),
            s.equation(_eps, s.x - s.lam),
        ]
        equations += [
            *s.regression(_H, s.e, _eps, _sigma),
            s.equation(s.z, s.lam + _H * _sigma + s.e),
        ]
    else:
        equations += [s.GAIN, s.equation(s.z, s.lam + s.K * (s.y - s.h))]
    if consists_of is not None:
        equations.append(s.equation(zeta, consists_of))
    equations += s.regression(Gamma, s.chi, s.x, zeta)
    equations += [
        s.equation(s.T, s.cov(s.x) - Gamma * s.cov(s.x, zeta).T),
        s.equation(s.u, Gamma * zeta + s.chi),
    ]
    if recipe.mean:
        equations += [
            s.equation(_s_next, s.tau_uT),
            *s.regression(_L, _n, s.x_next, _s_next),
            s.equation(s.lam_next, _L * _s_next + _n),
        ]
    else:
        equations.append(s.equation(s.lam_next, s.tau_uT))
    residual = s.cov(s.x_next) - _L * s.cov(s.x_next, _s_next).T if recipe.spread else s.Theta_uT
    return (*equations, s.equation(s.Psi_next, residual))


_zeta = s.matrix(r"\zeta_{k}", s.r, s.ONE)
MEASUREMENTS = s.matrix(r"(y_{k};\,\dots;\,y_{k-\ell+1})", s.r, s.ONE)
ESTIMATES = s.matrix(r"(z_{k};\,\dots;\,z_{k-\ell+1})", s.r, s.ONE)
EQUATIONS = {
    name: printed(recipe)
    for name, recipe in (("fos", FOS), ("mfos", MFOS), ("dfmp", DFMP), ("mdfmp", MDFMP))
}
EQUATIONS |= {
    name: printed(recipe, _zeta, consists_of=MEASUREMENTS)
    for name, recipe in (("fkp", FOS), ("mfkp", MFOS), ("dfkp", DFMP), ("mdfkp", MDFMP))
}
EQUATIONS["fbp"] = printed(FOS, _zeta, consists_of=ESTIMATES)
