"""The Gaussian and the linearised AOF of a scalar model, with its structural functions put into the
filter's equations."""

from __future__ import annotations

import sympy as sp

from kfcourse.filters import EQUATIONS
from kfcourse.filters import notation as s
from kfcourse.filters.programs import function_values, scalar
from kfcourse.symbolic.structure import Structure
from kfcourse.symbolic.typesetting import WIDTH, joined, symbols
from kfcourse.symbolic.writing import formula_latex, formula_lines

SHORT = WIDTH // 3  # symbols of h and G that are put into K and z; longer ones keep their own lines


def scalar_equations(structure: Structure) -> list[tuple[sp.Symbol, sp.Expr]]:
    """K_k, z_k, p_k, lambda_{k+1}, Psi_{k+1}, and before them F_k: name and formula, in the order
    of computing.

    Those of the filter, `kfcourse.filters.EQUATIONS`, with the formulas of the structure; h_k and
    G_k have lines of their own only where they are long.
    """
    values = function_values(structure)
    equations: list[tuple[sp.Symbol, sp.Expr]] = []
    short: dict[sp.Symbol, sp.Expr] = {}
    for equation in EQUATIONS["aof"]:
        name, formula = scalar(equation.lhs), scalar(equation.rhs).xreplace(values).xreplace(short)
        if (
            name in (scalar(s.h), scalar(s.G))
            and symbols(formula_latex(formula, _VARIABLES)) <= SHORT
        ):
            short[name] = formula
        else:
            equations.append((name, formula))
    return equations


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


# In the order in which a product is written.
_VARIABLES = [scalar(symbol) for symbol in (s.K, s.lam, s.z, s.Psi, s.P, s.G, s.F, s.y, s.h)]
