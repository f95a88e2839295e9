"""The Gaussian and the linearised AOF of a scalar model, with its structural functions put into the filter's equations."""

from __future__ import annotations

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
}


def scalar_equations(structure: Structure) -> list[tuple[sp.Symbol, sp.Expr]]:
    """K_k, z_k, p_k, lambda_{k+1}, Psi_{k+1}, and before them F_k: name and formula, in the order of computing.

    Those of the filter, `kfcourse.filters.EQUATIONS`, with the formulas of the structure; h_k and G_k have lines of their own
    only where they are long.
    """
    formulas = structure.formulas
    if formulas is None or structure.model.n != 1 or structure.model.p != 1:
        raise ValueError(f"only scalar models with derived structural functions are written out, not {structure.model}")
    values = {}
    for value, (function, mean, cov) in _VALUES.items():
        arguments = formulas.meter_arguments if function in "hGF" else formulas.state_arguments
        taken = dict(zip(arguments, (_scalar(mean), _scalar(cov)), strict=True))
        values[_scalar(value)] = structure[function].subs(taken, simultaneous=True)
    found: list[tuple[sp.Symbol, sp.Expr]] = []
    short: dict[sp.Symbol, sp.Expr] = {}
    for equation in EQUATIONS["aof"]:
        name, formula = _scalar(equation.lhs), _scalar(equation.rhs).xreplace(values).xreplace(short)
        if name in (_scalar(s.h), _scalar(s.G)) and symbols(formula_latex(formula, _VARIABLES)) <= SHORT:
            short[name] = formula
        else:
            found.append((name, formula))
    return found


def written_lines(structure: Structure) -> list[str]:
    """The same as lines of an `aligned` block."""
    lines = []
    for name, formula in scalar_equations(structure):
        if formula.has(_scalar(s.K)):  # lambda + K (y - h): what is corrected comes first
            terms = sorted(sp.Add.make_args(formula), key=lambda term: term.has(_scalar(s.K)))
            first, *further = joined([formula_latex(term, _VARIABLES) for term in terms])
        else:
            first, *further = formula_lines(formula, _VARIABLES)
        lines += [f"{sp.latex(name)} &= {first}", *(rf"&\quad {line}" for line in further)]
    return lines


def _scalar(expression: sp.Basic) -> sp.Expr:
    """An expression in matrices as one in numbers: of one component they are the same."""
    if isinstance(expression, sp.MatrixSymbol):
        return sp.Symbol(expression.name, real=True)
    if isinstance(expression, sp.Transpose):
        return _scalar(expression.arg)
    if isinstance(expression, sp.Inverse):
        return 1 / _scalar(expression.arg)
    if isinstance(expression, sp.MatMul):
        return sp.Mul(*map(_scalar, expression.args))
    return sp.Add(*map(_scalar, expression.args)) if isinstance(expression, sp.MatAdd) else expression


# In the order in which a product is written.
_VARIABLES = [_scalar(one) for one in (s.K, s.lam, s.z, s.Psi, s.P, s.G, s.F, s.y, s.h)]
