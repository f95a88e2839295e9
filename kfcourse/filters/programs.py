"""The printed equations of a filter as what is computed for each trajectory of a scalar model:
rules, letter and value.

In `kfcourse.filters.EQUATIONS`, such as z = lambda + K (y - h), numbers take the place of matrices,
and the formulas of the model that of the structural functions.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import sympy as sp

from kfcourse.filters import notation as s
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import exact_matrix
from kfcourse.symbolic.structure import Structure

Rule = tuple[sp.Symbol, sp.Expr]

# The functions' values in the equations, and where each is taken.
_VALUES = {
    s.h_value: ("h", s.lam, s.Psi),
    s.G_value: ("G", s.lam, s.Psi),
    s.F_value: ("F", s.lam, s.Psi),
    s.tau_zp: ("tau", s.z, s.P),
    s.Theta_zp: ("Theta", s.z, s.P),
    s.tau_uT: ("tau", s.u, s.T),
    s.Theta_uT: ("Theta", s.u, s.T),
}


def scalar(
    expression: sp.Basic, inverse: Callable[[sp.Expr], sp.Expr] = lambda e: 1 / e
) -> sp.Expr:
    """An expression in matrices as one in numbers: of one component they are the same."""
    if isinstance(expression, sp.MatrixSymbol):
        return sp.Symbol(expression.name, real=True)
    if isinstance(expression, sp.Transpose):
        return scalar(expression.arg, inverse)
    if isinstance(expression, sp.Inverse):
        return inverse(scalar(expression.arg, inverse))
    if isinstance(expression, sp.MatMul | sp.MatAdd):
        parts = [scalar(part, inverse) for part in expression.args]
        return sp.Mul(*parts) if isinstance(expression, sp.MatMul) else sp.Add(*parts)
    return expression


_ARRAYS = {
    scalar(part): name
    for part, name in ((s.x_next, "next"), (s.lam_next, "lambda"), (s.Psi_next, "Psi"))
}


def array_name(symbol: sp.Symbol) -> str:
    """The array that holds a letter of the equations: "lambda" for \\lambda_{k}; predictions take
    the place of their letter."""
    return _ARRAYS.get(symbol) or "".join(
        re.findall(r"[A-Za-z]+", re.sub(r"_\{k(\+1)?\}", "", symbol.name))
    )


def function_values(structure: Structure) -> dict[sp.Symbol, sp.Expr]:
    """The formulas that stand in the equations as h(lambda, Psi), tau(z, p), ..., of a scalar
    model."""
    formulas = structure.formulas
    if formulas is None or structure.model.n != 1 or structure.model.p != 1:
        raise ValueError(
            f"only scalar models with derived structural functions are written out, not "
            f"{structure.model}"
        )
    values = {}
    for value, (function, mean, cov) in _VALUES.items():
        if function not in formulas.functions:
            continue  # tau and Theta of what moves in continuous time are integrated
        arguments = formulas.arguments(function)
        taken = dict(zip(arguments, (scalar(mean), scalar(cov)), strict=True))
        values[scalar(value)] = structure[function].subs(taken, simultaneous=True)
    return values


def in_numbers(
    equations: Sequence[sp.Eq],
    model: Model,
    structure: Structure | None,
    inverse: Callable[[sp.Expr], sp.Expr] = lambda e: 1 / e,
) -> list[Rule]:
    """The equations of a filter in numbers, letter and value, with the formulas of the model put
    in."""
    values = function_values(structure) if structure else {}
    for value, equation, state, noises, law, at in (
        (s.a_value, model.state_equation, model.x, model.v, model.state_noise, s.z),
        (s.b_value, model.meter_equation, model.x, model.w, model.meter_noise, s.lam),
    ):
        taken = {state[0]: scalar(at)} | dict(zip(noises, exact_matrix(law.mean), strict=True))
        values[scalar(value)] = equation[0].subs(taken, simultaneous=True)
    return [(scalar(part.lhs), scalar(part.rhs, inverse).xreplace(values)) for part in equations]
