"""Choices between formulas, Piecewise, by the state: have they slopes, do they jump?"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import sympy as sp
from sympy.core.relational import Relational


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
