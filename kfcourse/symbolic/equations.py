"""The two equations of a model as functions of arrays."""

from __future__ import annotations

from collections.abc import Callable

import sympy as sp

from kfcourse.laws import Array
from kfcourse.symbolic.codegen import compile_function
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import exact_matrix


def compile_model(model: Model) -> tuple[Callable[[Array, Array], Array], Callable[[Array, Array], Array]]:
    """The state and meter equations as functions of arrays: (x (..., n), v (..., r)) -> (..., n)."""
    state = _compile_equation("state", model.state_equation, {"x": model.x, "v": model.v}, model)
    meter = _compile_equation("meter", model.meter_equation, {"x": model.x, "w": model.w}, model)
    return lambda x, v: state(x, v)[0], lambda x, w: meter(x, w)[0]


def compile_noiseless(model: Model) -> tuple[Callable[[Array], Array], Callable[[Array], Array]]:
    """a(x, m_v) and b(x, m_w), the equations with the noises at their means: x (..., n) -> (..., n), (..., p)."""
    state_equation = model.state_equation.subs(dict(zip(model.v, exact_matrix(model.state_noise.mean), strict=True)))
    meter_equation = model.meter_equation.subs(dict(zip(model.w, exact_matrix(model.meter_noise.mean), strict=True)))
    state = _compile_equation("state", state_equation, {"x": model.x}, model)
    meter = _compile_equation("meter", meter_equation, {"x": model.x}, model)
    return lambda x: state(x)[0], lambda x: meter(x)[0]


def _compile_equation(
    name: str, equation: sp.MatrixBase, arguments: dict[str, tuple[sp.Symbol, ...]], model: Model
) -> Callable[..., tuple[Array]]:
    matrices = {key: sp.Matrix(symbols) for key, symbols in arguments.items()}
    numeric = equation.subs(model.values)
    return compile_function(name, matrices, {name: numeric}, [*arguments, name], f"{name} equation of {model}").function
