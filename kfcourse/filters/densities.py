"""Conditional densities of a model whose noises enter linearly: what exact and particle filters
need.

x_{k+1} | x_k ~ N(a(x, m_v), a_v D_v a_v^T),    y_k | x_k ~ N(b(x, m_w), b_w D_w b_w^T)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
import sympy as sp

from kfcourse.angles import difference
from kfcourse.laws import Array, Gaussian, without_missing
from kfcourse.symbolic.choices import decides
from kfcourse.symbolic.known import Stepwise
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError, exact_matrix

TINY = 1e-300  # in place of a variance of exactly 0
# states on which formulas are tried; eigenvalue of correlations that is none
TRIALS, ROUNDING = 50, 1e-12
REMEDY = "use the Gaussian filters (gaussian, unscented, gauss_hermite)"


class LogLikelihood(Protocol):
    """(y (..., p), x (..., n)) -> log p(y | x) (...); of a model that depends on the step, at step
    k."""

    def __call__(self, y: Array, x: Array, k: int | None = None) -> Array: ...


class ScalarFormulas(NamedTuple):
    """Means and deviations of the next state and of the measurement, given x: formulas of x and
    parameters."""

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
    mean, variance = _law(
        model, "object", model.difference_equation("a density"), model.v, model.state_noise
    )
    meter, meter_variance = _law(model, "meter", model.meter_equation, model.w, model.meter_noise)
    return ScalarFormulas(mean[0], sp.sqrt(variance[0]), meter[0], sp.sqrt(meter_variance[0]))


def transition(model: Model) -> Callable[..., Gaussian]:
    """x (..., n), and the step if the model has one -> law of the next state; ModelError if there
    is none."""
    law = _compiled(
        model,
        "transition",
        _law(model, "object", model.difference_equation("a density"), model.v, model.state_noise),
    )
    return lambda x, k=None: Gaussian(*law.at(k)(x))


def likelihood(model: Model) -> LogLikelihood:
    """(y (..., p), x (..., n)) -> log p(y | x) (...); what of y is missing (NaN) does not enter, 0
    where all is; of an angle the short way round counts."""
    law = _compiled(
        model, "likelihood", _law(model, "meter", model.meter_equation, model.w, model.meter_noise)
    )
    if model.p > 1 and _singular(law, model):
        raise _no_density(
            f"{list(model.meter_equation)}: the noises of these components depend on one another, "
            f"so a combination of them has "
            f"no noise and there is no likelihood density; leave a component out, or {REMEDY}"
        )

    def log_likelihood(y: Array, x: Array, k: int | None = None) -> Array:
        mean, cov = law.at(k)(x)
        innovation, missing = difference(y, mean, model.angles.y), np.isnan(y)
        if missing.any():  # what is missing counts as N(0; 0, 1), which is taken off again
            innovation, _, cov, _ = without_missing(innovation, cov, cov, cov)
        value = log_normal(innovation, cov) + 0.5 * np.log(2 * np.pi) * missing.sum(axis=-1)
        return np.where(missing.all(axis=-1), 0.0, value)

    return log_likelihood


def log_normal(innovation: Array, cov: Array) -> Array:
    """ln N(innovation; 0, cov), (...), of innovations (..., p)."""
    size = innovation.shape[-1]
    # an innovation infinitely many sigmas away has log-density -inf
    with np.errstate(over="ignore"):
        if size == 1:
            variance = np.maximum(cov[..., 0, 0], TINY)
            return -0.5 * (innovation[..., 0] ** 2 / variance + np.log(2 * np.pi * variance))
        square = (innovation * np.linalg.solve(cov, innovation[..., None])[..., 0]).sum(axis=-1)
        return -0.5 * (square + np.linalg.slogdet(cov)[1] + size * np.log(2 * np.pi))


def _law(
    model: Model, what: str, equation: sp.MatrixBase, noise: tuple[sp.Symbol, ...], law: Gaussian
) -> tuple[sp.MatrixBase, sp.MatrixBase]:
    """Mean and covariance of what an equation gives, as formulas; ModelError if they are not those
    of a density."""
    B = equation.jacobian(sp.Matrix(noise))
    if B.has(*noise) or decides(equation, noise):
        raise _no_density(
            f"{list(equation)}: the noise enters nonlinearly, so there is no simple density; "
            f"measure what is linear in the noise, such as ln y of y = exp(x + w), or {REMEDY}"
        )
    mean = equation.subs(dict(zip(noise, exact_matrix(law.mean), strict=True)))
    cov = B * exact_matrix(law.cov) * B.T
    if cov.subs(model.values).is_zero_matrix:
        raise _no_density(
            f"{list(equation)}: no noise enters the {what}, so there is no density; {REMEDY}"
        )
    return mean, cov


def _compiled(model: Model, name: str, law: tuple[sp.MatrixBase, sp.MatrixBase]) -> Stepwise:
    mean, cov = (part.subs(model.values) for part in law)
    arguments, outputs = {"x": sp.Matrix(model.x)}, {"mean": mean, "cov": cov}
    return Stepwise.compile(model.known, name, arguments, outputs, ["x", "mean"])


def _singular(law: Stepwise, model: Model) -> bool:
    """Whether the covariance is singular at all states tried: the determinant of long formulas
    takes SymPy minutes."""
    away = np.random.default_rng(0).standard_normal((TRIALS, model.n))
    with np.errstate(all="ignore"):
        cov = law.at(0)(model.prior.mean + away * np.sqrt(np.diagonal(model.prior.cov)))[1]
        deviation = np.sqrt(np.diagonal(cov, axis1=-2, axis2=-1))
        correlation = cov / (deviation[..., :, None] * deviation[..., None, :])
    good = np.isfinite(correlation).all(axis=(-2, -1))
    return not (np.linalg.eigvalsh(correlation[good])[..., 0] > ROUNDING).any()


def has_object_noise(model: Model) -> bool:
    """Whether any noise enters the object."""
    B = model.difference_equation("a density").jacobian(sp.Matrix(model.v)) * exact_matrix(
        model.state_noise.cov
    )
    return not B.subs(model.values).is_zero_matrix


def _no_density(message: str) -> ModelError:
    return ModelError(message, "no_density")
