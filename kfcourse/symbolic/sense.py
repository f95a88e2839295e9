"""Whether laws make sense: variances that are any, something random to filter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import sympy as sp

from kfcourse.laws import Array

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
