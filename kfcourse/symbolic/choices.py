"""Choices between formulas, Piecewise: indicators where the step decides, jumps where the state
does."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import sympy as sp
from sympy.core.relational import Relational


def by_indicators(formula: sp.Expr, variables: Sequence[sp.Symbol]) -> sp.Expr:
    """The formula with a sum, of branches times what is 1 where they hold, for each choice that the
    variables do not decide, such as Piecewise((x, t < 45), (0, True)): a polynomial in x."""
    if not (formula.has(sp.Piecewise) and formula.has(*variables)):
        return formula
    if isinstance(formula, sp.Piecewise) and not decides(formula, variables):
        conditions = [condition for _, condition in formula.args]
        indicators = (
            sp.Piecewise(
                *((sp.Integer(i == j), condition) for j, condition in enumerate(conditions))
            )
            for i in range(len(conditions))
        )
        branches = (by_indicators(branch, variables) for branch, _ in formula.args)
        return sp.Add(*(a * b for a, b in zip(branches, indicators, strict=True)))
    return formula.func(*(by_indicators(argument, variables) for argument in formula.args))


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
