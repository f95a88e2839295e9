"""The two equations of a model as functions of arrays."""

from __future__ import annotations

from typing import Protocol

import sympy as sp

from kfcourse.laws import Array
from kfcourse.symbolic.known import Stepwise
from kfcourse.symbolic.model import Model


class Equation(Protocol):
    """a(x, v) or b(x, w), (x (..., n), v (..., r)) -> (..., n) or (..., p); of a model that depends
    on the step, at step k."""

    def __call__(self, x: Array, noise: Array, k: int | None = None) -> Array: ...


class Noiseless(Protocol):
    """a(x, m_v) or b(x, m_w), x (..., n) -> (..., n) or (..., p); of a model that depends on the
    step, at step k."""

    def __call__(self, x: Array, k: int | None = None) -> Array: ...


def compile_model(model: Model) -> tuple[Equation, Equation]:
    """The state and meter equations as functions of arrays: (x (..., n), v (..., r)) -> (..., n).

    Those of a model that depends on the step need it: `state(x, v, k)`.
    """
    meter = _compiled("meter", model.meter_equation, {"x": model.x, "w": model.w}, model)
    if model.between is not None:
        return model.between.motion(model), lambda x, w, k=None: meter.at(k)(x, w)[0]
    state = _compiled("state", model.state_equation, {"x": model.x, "v": model.v}, model)
    return lambda x, v, k=None: state.at(k)(x, v)[0], lambda x, w, k=None: meter.at(k)(x, w)[0]


def compile_noiseless(model: Model) -> tuple[Noiseless, Noiseless]:
    """a(x, m_v) and b(x, m_w), the equations with the noises at their means: x (..., n) -> (...,
    n), (..., p)."""
    state, meter = compile_model(model)
    v, w = model.state_noise.mean, model.meter_noise.mean
    return lambda x, k=None: state(x, v, k), lambda x, k=None: meter(x, w, k)


def _compiled(
    name: str, equation: sp.MatrixBase, arguments: dict[str, tuple[sp.Symbol, ...]], model: Model
) -> Stepwise:
    matrices = {key: sp.Matrix(symbols) for key, symbols in arguments.items()}
    numeric = equation.subs(model.values)
    return Stepwise.compile(model.known, name, matrices, {name: numeric}, [*arguments, name])
