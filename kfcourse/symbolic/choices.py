"""Functions with kinks and jumps, Piecewise and Heaviside: constants where of the step alone, jumps where of the state."""

from __future__ import annotations

from itertools import pairwise

import sympy as sp
from sympy.core.relational import Relational


def masked(
    equation: sp.MatrixBase, known: tuple[sp.Symbol, ...], variables: list[sp.Symbol]
) -> tuple[sp.MatrixBase, dict[sp.Dummy, sp.Expr]]:
    """The equation with a symbol in the place of each function of what is known, such as Heaviside(t - 45): constants."""
    masks: dict[sp.Dummy, sp.Expr] = {}

    def mask(formula: sp.Expr) -> sp.Expr:
        if not (known and formula.has(*known)):
            return formula
        if isinstance(formula, sp.Function) and not formula.has(*variables):
            masks[found := sp.Dummy(real=True)] = formula
            return found
        return formula.func(*map(mask, formula.args)) if formula.args else formula

    return equation.applyfunc(mask), masks


def jumps(choice: sp.Piecewise, x: tuple[sp.Symbol, ...]) -> bool:
    """Whether a choice that depends on the state may jump where one formula takes over from the next."""
    for (formula, condition), (following, _) in pairwise(choice.args):
        if not condition.has(*x):
            continue
        if not isinstance(condition, Relational):
            return True  # several thresholds: not looked into
        border = next(s for s in x if condition.has(s))
        places = sp.solve(condition.lhs - condition.rhs, border)
        if not places or any(sp.simplify((formula - following).subs(border, place)) != 0 for place in places):
            return True
    return False
