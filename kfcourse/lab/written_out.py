"""The Gaussian and the linearised AOF of a scalar model, with its structural functions put into the filter's equations."""

from __future__ import annotations

from collections.abc import Callable

import sympy as sp

from kfcourse.filters import EQUATIONS
from kfcourse.filters import notation as s
from kfcourse.symbolic.structure import Structure
from kfcourse.symbolic.typesetting import WIDTH, joined, symbols
from kfcourse.symbolic.writing import formula_latex, formula_lines

SHORT = WIDTH // 3  # symbols of h and G that are put into K and z; longer ones keep their own lines

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


def scalar_equations(structure: Structure) -> list[tuple[sp.Symbol, sp.Expr]]:
    """K_k, z_k, p_k, lambda_{k+1}, Psi_{k+1}, and before them F_k: name and formula, in the order of computing.

    Those of the filter, `kfcourse.filters.EQUATIONS`, with the formulas of the structure; h_k and G_k have lines of their own
    only where they are long.
    """
    values = function_values(structure)
    found: list[tuple[sp.Symbol, sp.Expr]] = []
    short: dict[sp.Symbol, sp.Expr] = {}
    for equation in EQUATIONS["aof"]:
        name, formula = scalar(equation.lhs), scalar(equation.rhs).xreplace(values).xreplace(short)
        if name in (scalar(s.h), scalar(s.G)) and symbols(formula_latex(formula, _VARIABLES)) <= SHORT:
            short[name] = formula
        else:
            found.append((name, formula))
    return found


def function_values(structure: Structure) -> dict[sp.Symbol, sp.Expr]:
    """The formulas that stand in the equations as h(lambda, Psi), tau(z, p), ..., of a scalar model."""
    formulas = structure.formulas
    if formulas is None or structure.model.n != 1 or structure.model.p != 1:
        raise ValueError(f"only scalar models with derived structural functions are written out, not {structure.model}")
    values = {}
    for value, (function, mean, cov) in _VALUES.items():
        arguments = formulas.meter_arguments if function in "hGF" else formulas.state_arguments
        taken = dict(zip(arguments, (scalar(mean), scalar(cov)), strict=True))
        values[scalar(value)] = structure[function].subs(taken, simultaneous=True)
    return values


def written_lines(structure: Structure) -> list[str]:
    """The same as lines of an `aligned` block."""
    lines = []
    for name, formula in scalar_equations(structure):
        if formula.has(scalar(s.K)):  # lambda + K (y - h): what is corrected comes first
            terms = sorted(sp.Add.make_args(formula), key=lambda term: term.has(scalar(s.K)))
            first, *further = joined([formula_latex(term, _VARIABLES) for term in terms])
        else:
            first, *further = formula_lines(formula, _VARIABLES)
        lines += [f"{sp.latex(name)} &= {first}", *(rf"&\quad {line}" for line in further)]
    return lines


def scalar(expression: sp.Basic, inverse: Callable[[sp.Expr], sp.Expr] = lambda e: 1 / e) -> sp.Expr:
    """An expression in matrices as one in numbers: of one component they are the same."""
    if isinstance(expression, sp.MatrixSymbol):
        return sp.Symbol(expression.name, real=True)
    if isinstance(expression, sp.Transpose):
        return scalar(expression.arg, inverse)
    if isinstance(expression, sp.Inverse):
        return inverse(scalar(expression.arg, inverse))
    if isinstance(expression, sp.MatMul | sp.MatAdd):
        parts = [scalar(one, inverse) for one in expression.args]
        return sp.Mul(*parts) if isinstance(expression, sp.MatMul) else sp.Add(*parts)
    return expression


# In the order in which a product is written.
_VARIABLES = [scalar(one) for one in (s.K, s.lam, s.z, s.Psi, s.P, s.G, s.F, s.y, s.h)]
