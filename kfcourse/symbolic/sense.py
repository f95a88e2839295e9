"""Whether numbers and laws make sense: sizes that floats can hold, variances that are any,
something random to filter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import sympy as sp
from sympy.core.relational import Relational

from kfcourse.laws import Array
from kfcourse.symbolic.formula import LARGEST, NO_NUMBERS, UNDECIDED, undecided

if TYPE_CHECKING:
    from kfcourse.symbolic.model import Model


def is_covariance(cov: Array) -> bool:
    """Whether a symmetric matrix has no negative eigenvalue, in whatever units its components
    are."""
    variances = cov.diagonal()
    scale = 1 / np.sqrt(np.where(variances > 0, variances, 1.0))
    correlations = cov * scale[:, None] * scale
    rounding = 1e-12 * len(cov)  # of eigvalsh, and of a covariance that was itself computed
    return bool((variances >= 0).all() and np.linalg.eigvalsh(correlations).min() >= -rounding)


def not_computable(
    equation: sp.MatrixBase,
    values: Mapping[sp.Symbol, sp.Expr],
    noise_means: Mapping[sp.Symbol, sp.Expr],
) -> str:
    """Why an equation with the parameters' values in it cannot be computed with; empty if it
    can."""
    for formula in equation:
        try:
            if _has_undecided(formula, {**values, **noise_means}):
                return (
                    f"{_short(formula)}: {UNDECIDED}; change the parameters or write without "
                    f"the choice"
                )
            problem = _unusable(formula.subs(values))
            formula.subs(values).subs(noise_means)  # as filters need it
        except (TypeError, ValueError):  # SymPy's; the second of a step at a complex number
            problem = (
                "compares what has no real value, with these parameters or where the noises "
                "are at their means"
            )
        if problem:
            return f"{_short(formula)} {problem}"
    return ""


def _has_undecided(formula: sp.Expr, values: Mapping[sp.Symbol, sp.Expr]) -> bool:
    """Whether one of its conditions cannot be decided with these values; inner ones first, as an
    outer one waits for them."""
    return any(
        undecided(condition.subs(values))
        for condition in sorted(formula.atoms(Relational), key=sp.count_ops)
    )


def nothing_random(model: Model) -> str:
    """Why there is nothing to filter in a model: too little of it is random; empty if there is
    enough."""
    moving = _noisy(model.state_equation.subs(model.values), model.v, model.state_noise.cov)
    if not moving and not model.prior.cov.any():
        return (
            f"the state is known exactly: neither the prior nor a noise of the state equation "
            f"{list(model.state_equation)} "
            "has a variance; give one of them a variance above 0"
        )
    if not moving and not _noisy(
        model.meter_equation.subs(model.values), model.w, model.meter_noise.cov
    ):
        return (
            f"no noise enters the state equation {list(model.state_equation)} or the meter "
            f"{list(model.meter_equation)}: "
            "after some measurements nothing would be left to estimate; add a noise to one of them"
        )
    return ""


def _unusable(formula: sp.Expr) -> str:
    if formula.has(*NO_NUMBERS):
        return "has no finite real value with these parameters"
    for part in sp.preorder_traversal(formula):
        if not part.is_number:
            continue
        size = abs(part if part.is_Rational else part.evalf(15))
        if part.is_real is False or not (size.is_Rational or size.is_Float):
            return f"has no finite real value with these parameters: {_short(part)}"
        if size and not 1 / LARGEST <= size <= LARGEST:
            return (
                f"holds the number {_short(sp.N(part, 3))} with these parameters, beyond "
                f"1e-100 to 1e100; change the units"
            )
    return ""


def _short(formula: sp.Expr) -> str:
    text = str(formula)
    return text if len(text) <= 100 else f"{text[:97]}..."


def _noisy(equation: sp.MatrixBase, noises: Sequence[sp.Symbol], cov: Array) -> bool:
    """Whether a noise that has a variance enters an equation."""
    return any(
        equation.has(noise)
        for noise, variance in zip(noises, cov.diagonal(), strict=True)
        if variance
    )
