"""The two equations of a model as functions of arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import sympy as sp

from kfcourse.laws import Array
from kfcourse.symbolic.model import Model

# a(x, v) or b(x, w), (x (..., n), v (..., r)) -> (..., n) or (..., p); of a model that depends on
# the step, at step k: equation(x, v, k).
Equation: TypeAlias = Callable[..., Array]


def compile_model(model: Model) -> tuple[Equation, Equation]:
    """The state and meter equations as functions of arrays: (x (..., n), v (..., r)) -> (..., n).

    Those of a model that depends on the step need it: `state(x, v, k)`.
    """
    meter = _compiled(model.meter_equation, model.w, model)
    if model.between is not None:
        return model.between.motion(model), meter
    return _compiled(model.state_equation, model.v, model), meter


def compile_noiseless(model: Model) -> tuple[Equation, Equation]:
    """a(x, m_v) and b(x, m_w), the equations with the noises at their means: x (..., n) -> (...,
    n), (..., p)."""
    state, meter = compile_model(model)
    v, w = model.state_noise.mean, model.meter_noise.mean
    return lambda x, k=None: state(x, v, k), lambda x, k=None: meter(x, w, k)


def _compiled(equation: sp.MatrixBase, noise: tuple[sp.Symbol, ...], model: Model) -> Equation:
    function = model.compiled([model.x, noise], [list(equation)])
    return lambda x, noise, k=None: function(x, noise, k=k)[0]
