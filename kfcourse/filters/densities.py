"""Conditional densities of a model whose noises enter linearly: what exact and particle filters
need.

x_{k+1} | x_k ~ N(a(x, m_v), a_v D_v a_v^T),    y_k | x_k ~ N(b(x, m_w), b_w D_w b_w^T)

A scalar meter whose noise enters nonlinearly but can be solved for, such as y = exp(x + w), has
with w = omega(x, y) the density p(y | x) = phi(omega(x, y)) |d omega / dy|, phi that of N(m_w,
D_w): the exact filter takes it.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product as cartesian
from typing import NamedTuple, TypeAlias

import numpy as np
import sympy as sp

from kfcourse.angles import TURN, Components, difference
from kfcourse.laws import Array, Gaussian, Measurement, log_density
from kfcourse.symbolic.codegen import Compiled
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError, exact_matrix
from kfcourse.symbolic.sides import decides

# states on which formulas are tried; eigenvalue of correlations that is none
TRIALS, ROUNDING = 50, 1e-12
DIGITS = 1e-6  # of a noise's deviation, to which a solution must give the noise back
Y = sp.Dummy("y", real=True)
MOST_TURNS = 50  # of an angle whose noise is so large that it tells nothing
REMEDY = "use the Gaussian filters (gaussian, unscented, gauss_hermite)"


# (y (..., p), x (..., n)) -> ln p(y | x) (...); the step follows where the model depends on it.
LogLikelihood: TypeAlias = Callable[..., Array]


class ScalarFormulas(NamedTuple):
    """Means and deviations of the next state and of the measurement, given x: formulas of x and
    parameters.

    Of a meter whose noise is solved for, those of y with ln p(y | x) = -(y - mean)^2 / (2
    deviation^2) - ln(sqrt(2 pi) deviation): they contain y, the symbol `Y`.
    """

    mean: sp.Expr
    deviation: sp.Expr
    meter: sp.Expr
    meter_deviation: sp.Expr


def scalar_formulas(model: Model) -> ScalarFormulas:
    """Both laws of a model of one state and one measurement; ModelError for another, or without a
    noise."""
    if model.n != 1 or model.p != 1:
        raise ModelError(
            f"the exact filter is for scalar models: the state has dimension {model.n}, the "
            f"measurement {model.p}: "
            "use particle(model)"
        )
    mean, variance = law_given_state(
        model, "object", model.difference_equation("a density"), model.v, model.state_noise
    )
    if omega := noise_of_meter(model):
        z = (omega - model.meter_noise.mean[0]) / sp.Float(np.sqrt(model.meter_noise.cov[0, 0]))
        deviation = 1 / sp.Abs(z.diff(Y))
        return ScalarFormulas(mean[0], sp.sqrt(variance[0]), Y - z * deviation, deviation)
    meter, meter_variance = law_given_state(
        model, "meter", model.meter_equation, model.w, model.meter_noise
    )
    return ScalarFormulas(mean[0], sp.sqrt(variance[0]), meter[0], sp.sqrt(meter_variance[0]))


def likelihood(model: Model) -> LogLikelihood:
    """(y (..., p), x (..., n)) -> log p(y | x) (...); what of y is missing (NaN) does not enter, 0
    where all is.

    The law of a component that is an angle is wound around the circle: the densities of y and of y
    plus whole turns add up.
    """
    mean, cov = law_given_state(model, "meter", model.meter_equation, model.w, model.meter_noise)
    law = model.compiled([model.x], [list(mean), cov])
    if model.p > 1 and _singular(law, model):
        raise ModelError(
            f"{list(model.meter_equation)}: the noises of these components depend on one another, "
            f"so a combination of them has "
            f"no noise and there is no likelihood density; leave a component out, or {REMEDY}",
            "no_density",
        )

    def log_likelihood(y: Array, x: Array, k: int | None = None) -> Array:
        mean, cov = law(x, k=k)
        away, missing = difference(y, mean, model.angles.y), np.isnan(y)
        sd = np.sqrt(np.diagonal(cov, axis1=-2, axis2=-1).reshape(-1, model.p).max(axis=0))
        of_zero = Measurement(np.zeros(model.p), cov, cov, cov)

        def after(turns: Array) -> Array:
            # what is missing is counted once, in no turn
            twice = (missing & (turns != 0)).any(axis=-1)
            return np.where(twice, -np.inf, log_density(of_zero, away + turns))

        return wound(after, sd, model.angles.y)

    return log_likelihood


def wound(density: Callable[[Array], Array], sd: Array, angles: Components) -> Array:
    """log of the density of angles: the sum over all turns (p,) of the density of what was measured
    plus these turns.

    Eight standard deviations (p,) are covered, and one turn at least.
    """
    if not angles:
        return density(np.zeros(len(sd)))
    most = np.clip(np.ceil((8 * sd + np.pi) / TURN), 1, MOST_TURNS).astype(int)
    total = np.array(-np.inf)
    for numbers in cartesian(
        *(range(-most[i], most[i] + 1) if i in angles else (0,) for i in range(len(sd)))
    ):
        total = np.logaddexp(total, density(TURN * np.array(numbers)))
    return total


def law_given_state(
    model: Model, what: str, equation: sp.MatrixBase, noise: tuple[sp.Symbol, ...], law: Gaussian
) -> tuple[sp.MatrixBase, sp.MatrixBase]:
    """Mean and covariance of what an equation gives, as formulas; ModelError if they are not those
    of a density."""
    B = equation.jacobian(sp.Matrix(noise))
    if B.has(*noise) or decides(equation, noise):
        raise ModelError(
            f"{list(equation)}: the noise enters nonlinearly, so there is no simple density; "
            f"{REMEDY}",
            "no_density",
        )
    mean = equation.subs(dict(zip(noise, exact_matrix(law.mean), strict=True)))
    cov = B * exact_matrix(law.cov) * B.T
    if cov.subs(model.values).is_zero_matrix:
        raise ModelError(
            f"{list(equation)}: no noise enters the {what}, so there is no density; {REMEDY}",
            "no_density",
        )
    return mean, cov


def _singular(law: Compiled, model: Model) -> bool:
    """Whether the covariance is singular at all states tried: the determinant of long formulas
    takes SymPy minutes."""
    with np.errstate(all="ignore"):
        cov = law(_states(model), k=0)[1]
        deviation = np.sqrt(np.diagonal(cov, axis1=-2, axis2=-1))
        correlation = cov / (deviation[..., :, None] * deviation[..., None, :])
    good = np.isfinite(correlation).all(axis=(-2, -1))
    return not (np.linalg.eigvalsh(correlation[good])[..., 0] > ROUNDING).any()


def _states(model: Model) -> Array:
    away = np.random.default_rng(0).standard_normal((TRIALS, model.n))
    return model.prior.mean + away * np.sqrt(np.diagonal(model.prior.cov))


def noise_of_meter(model: Model) -> sp.Expr | None:
    """omega(x, Y), the noise of a scalar meter in which it enters nonlinearly; None if it is linear
    or not to be had.

    SymPy solves; which of its solutions is the noise, trials tell.
    """
    if model.p != 1 or len(model.w) != 1 or model.timed or model.angles.y:
        return None
    w, equation = model.w[0], model.meter_equation[0].subs(model.values)
    deviation = float(np.sqrt(model.meter_noise.cov[0, 0]))
    if not (equation.diff(w).has(w) and deviation > 0):
        return None
    try:
        solutions = sp.solve(equation - Y, w)
    except NotImplementedError:
        return None
    states = _states(model).T
    noises = model.meter_noise.mean + deviation * np.random.default_rng(1).standard_normal(TRIALS)
    for solution in solutions:
        try:
            with np.errstate(all="ignore"):
                y = sp.lambdify([*model.x, w], equation)(*states, noises)
                back = sp.lambdify([*model.x, Y], solution)(*states, y)
        # a solution that cannot be computed, such as Lambert's function
        except (NameError, TypeError):
            continue
        if not solution.has(sp.I) and np.all(np.abs(back - noises) <= DIGITS * deviation):
            return solution
    return None


def has_object_noise(model: Model) -> bool:
    """Whether any noise enters the object."""
    B = model.difference_equation("a density").jacobian(sp.Matrix(model.v)) * exact_matrix(
        model.state_noise.cov
    )
    return not B.subs(model.values).is_zero_matrix
