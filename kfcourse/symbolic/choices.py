"""Functions with kinks and jumps, Piecewise and Heaviside: constants where of the step alone, jumps
where of the state."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import sympy as sp
from sympy.core.relational import Relational


def masked(
    equation: sp.MatrixBase, known: tuple[sp.Symbol, ...], variables: list[sp.Symbol]
) -> tuple[sp.MatrixBase, dict[sp.Dummy, sp.Expr]]:
    """The equation with a symbol in the place of each function of what is known, such as
    Heaviside(t - 45): constants."""
    masks: dict[sp.Dummy, sp.Expr] = {}

    def mask(formula: sp.Expr) -> sp.Expr:
        if not (known and formula.has(*known)):
            return formula
        if isinstance(formula, sp.Function) and not formula.has(*variables):
            masks[symbol := sp.Dummy(real=True)] = formula
            return symbol
        if isinstance(formula, sp.Piecewise) and not decides(formula, variables):
            return sp.Add(
                *(mask(branch) * mask(indicator) for branch, indicator in _by_indicators(formula))
            )
        return formula.func(*map(mask, formula.args)) if formula.args else formula

    return equation.applyfunc(mask), masks


def _by_indicators(choice: sp.Piecewise) -> list[tuple[sp.Expr, sp.Expr]]:
    """The formulas of a choice, and for each what is 1 where it holds and 0 elsewhere."""
    conditions = [condition for _, condition in choice.args]
    return [
        (
            branch,
            sp.Piecewise(
                *((sp.Integer(i == j), condition) for j, condition in enumerate(conditions))
            ),
        )
        for i, (branch, _) in enumerate(choice.args)
    ]


def decides(formula: sp.Basic, variables: Sequence[sp.Symbol]) -> bool:
    """Whether a choice between formulas depends on one of the variables: derivatives by it do not
    tell."""
    return any(
        condition.has(*variables)
        for choice in formula.atoms(sp.Piecewise)
        for _, condition in choice.args
    )


def jumps(choice: sp.Piecewise, x: Sequence[sp.Symbol]) -> bool:
    """Whether a choice that depends on these variables may jump where one formula takes over from
    the next."""
    for (formula, condition), (following, _) in pairwise(choice.args):
        if not condition.has(*x):
            continue
        if not isinstance(condition, Relational):
            return True  # several thresholds: not looked into
        border = next(s for s in x if condition.has(s))
        try:
            places = sp.solve(condition.lhs - condition.rhs, border)
        except NotImplementedError:  # SymPy cannot tell where
            return True
        if not places or any(
            sp.simplify((formula - following).subs(border, place)) != 0 for place in places
        ):
            return True
    return False
