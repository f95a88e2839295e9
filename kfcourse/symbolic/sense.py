"""Whether numbers and laws make sense: sizes that floats can hold, variances that are any,
something random to filter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import sympy as sp
from sympy.core.relational import Relational

from kfcourse.errors import ModelError
from kfcourse.laws import Array
from kfcourse.symbolic.codegen import check_numbers
from kfcourse.symbolic.formula import UNDECIDED, undecided

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


def check_computable(
    what: str,
    equation: sp.MatrixBase,
    values: Mapping[sp.Symbol, sp.Expr],
    noise_means: Mapping[sp.Symbol, sp.Expr],
) -> None:
    """ModelError if an equation with the parameters' values in it cannot be computed with."""
    for formula in equation:
        try:
            problem = UNDECIDED if _has_undecided(formula, {**values, **noise_means}) else ""
            if not problem:
                numeric = formula.subs(values)
                check_numbers(
                    f"{what}, {formula!s:.100}, with these parameters", sp.Matrix([numeric])
                )
                numeric.subs(noise_means)  # as filters need it
        except ModelError:
            raise
        except (TypeError, ValueError):  # SymPy's; the second of a step at a complex number
            problem = "it compares what has no real value"
        if problem:
            raise ModelError(
                f"{what}, {formula!s:.100}, with these parameters or where the noises are at their "
                f"means: {problem}; change the parameters or write without the choice"
            )


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
    moving = _noisy(model.state_equation, model.v, model.state_noise.cov, model)
    if not moving and not model.prior.cov.any():
        return (
            f"the state is known exactly: neither the prior nor a noise of the state equation "
            f"{list(model.state_equation)} has a variance; give one of them a variance above 0"
        )
    if not moving and not _noisy(model.meter_equation, model.w, model.meter_noise.cov, model):
        return (
            f"no noise enters the state equation {list(model.state_equation)} or the meter "
            f"{list(model.meter_equation)}: after some measurements nothing would be left to "
            "estimate; add a noise to one of them"
        )
    return ""


def _noisy(equation: sp.MatrixBase, noises: Sequence[sp.Symbol], cov: Array, model: Model) -> bool:
    """Whether a noise that has a variance enters an equation."""
    pairs = zip(noises, cov.diagonal(), strict=True)
    numeric = equation.subs(model.values)
    return any(variance and numeric.has(noise) for noise, variance in pairs)
