"""Meters whose noise enters nonlinearly, but can be solved for: y = exp(x + w), y = x*exp(w), y = sinh(x + w).

With w = omega(x, y) the density of y is that of the noise by a change of variable,

    p(y | x) = phi(omega(x, y)) |d omega / dy|,    phi the density N(m_w, D_w)

SymPy solves; which of its solutions is the noise, trials tell.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import sympy as sp

from kfcourse.laws import Array
from kfcourse.symbolic.codegen import compile_function
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError

TRIALS = 200  # states and noises with which a solution must give the noise back
DIGITS = 1e-6  # to which it must


def by_change_of_variable(model: Model) -> Callable[[Array, Array], Array] | None:
    """(y (..., 1), x (..., n)) -> log p(y | x) (...); None if the noise cannot be solved for.

    For one measurement with one noise, that does not depend on the step and is no angle.
    """
    if model.p != 1 or len(model.w) != 1 or model.timed or model.angles.y:
        return None
    y, w = sp.Symbol("y", real=True), model.w[0]
    equation = model.meter_equation[0].subs(model.values)
    try:
        solutions = sp.solve(equation - y, w)
    except NotImplementedError:
        return None
    forward = _compiled("forward", model, w, equation)
    rng = np.random.default_rng(0)
    deviation = float(np.sqrt(model.meter_noise.cov[0, 0]))
    states = model.prior.mean + rng.standard_normal((TRIALS, model.n)) * np.sqrt(np.diagonal(model.prior.cov))
    noises = model.meter_noise.mean + deviation * rng.standard_normal((TRIALS, 1))
    for solution in solutions:
        if solution.has(sp.I) or not deviation > 0:
            continue
        try:
            found = _compiled("noise", model, y, solution, sp.log(sp.Abs(solution.diff(y))))
        except ModelError:  # a solution that cannot be computed, such as Lambert's function
            continue
        with np.errstate(all="ignore"):
            back = found(states, forward(states, noises)[..., :1])[..., 0]
            good = np.abs(back - noises[:, 0]) <= DIGITS * deviation
        if good.all():
            return _density(found, float(model.meter_noise.mean[0]), deviation)
    return None


def _compiled(name: str, model: Model, other: sp.Symbol, *formulas: sp.Expr) -> Callable[[Array, Array], Array]:
    """Formulas of x and of one more symbol, as a function of arrays (..., n) and (..., 1)."""
    arguments = {"x": sp.Matrix(model.x), "other": sp.Matrix([other])}
    function = compile_function(name, arguments, {"found": sp.Matrix(formulas)}, ["x", "other", "found"]).function
    return lambda x, value: function(x, value)[0]


def _density(found: Callable[[Array, Array], Array], mean: float, deviation: float) -> Callable[[Array, Array], Array]:
    def log_likelihood(y: Array, x: Array) -> Array:
        with np.errstate(all="ignore"):  # y that no noise makes
            noise, log_slope = np.moveaxis(found(x, y), -1, 0)
            value = -0.5 * ((noise - mean) / deviation) ** 2 - np.log(deviation * np.sqrt(2 * np.pi)) + log_slope
        return np.where(np.isnan(y[..., 0]), 0.0, np.where(np.isnan(value), -np.inf, value))

    return log_likelihood
