"""Symbols in which the filters' equations are printed, and the printer.

The equations of each family are SymPy matrix equations (`EQUATIONS` in its file): the book and the
report print them, and a test executes them, one trajectory at a time, against the running filter.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import sympy as sp
from sympy.printing.latex import LatexPrinter

from kfcourse.symbolic.typesetting import aligned

n, p, r = sp.symbols("n p r", positive=True, integer=True)


def matrix(latex: str, rows: sp.Expr, columns: sp.Expr) -> sp.MatrixSymbol:
    """A matrix symbol that prints as the given LaTeX (braces keep SymPy from rewriting it)."""
    return sp.MatrixSymbol(latex if "{" in latex else "{" + latex + "}", rows, columns)


def equation(left: sp.Expr, right: sp.Expr) -> sp.Eq:
    """left = right as it is written: SymPy would first look whether their difference is zero, for a
    third of a start's time."""
    return sp.Eq(left, right, evaluate=False)


ONE = sp.Integer(1)
y = matrix(r"y_{k}", p, ONE)
x = matrix(r"x_{k}", n, ONE)
x_next = matrix(r"x_{k+1}", n, ONE)
z = matrix(r"z_{k}", n, ONE)
P = matrix(r"p_{k}", n, n)
lam = matrix(r"\lambda_{k}", n, ONE)
Psi = matrix(r"\Psi_{k}", n, n)
lam_next = matrix(r"\lambda_{k+1}", n, ONE)
Psi_next = matrix(r"\Psi_{k+1}", n, n)
K = matrix(r"K_{k}", n, p)
G = matrix(r"G_{k}", p, n)
F = matrix(r"F_{k}", p, p)
h = matrix(r"h_{k}", p, ONE)
h_value = matrix(r"h(\lambda_{k}, \Psi_{k})", p, ONE)
G_value = matrix(r"G(\lambda_{k}, \Psi_{k})", p, n)
F_value = matrix(r"F(\lambda_{k}, \Psi_{k})", p, p)
tau_zp = matrix(r"\tau(z_{k}, p_{k})", n, ONE)
Theta_zp = matrix(r"\Theta(z_{k}, p_{k})", n, n)
u = matrix(r"u_{k}", n, ONE)
T = matrix(r"T_{k}", n, n)
tau_uT = matrix(r"\tau(u_{k}, T_{k})", n, ONE)
Theta_uT = matrix(r"\Theta(u_{k}, T_{k})", n, n)
b_value = matrix(r"b(\lambda_{k}, m_{w})", p, ONE)
a_value = matrix(r"a(z_{k}, m_{v})", n, ONE)
Gamma = matrix(r"\Gamma_{k}", n, n)
chi = matrix(r"\chi_{k}", n, ONE)
H = matrix(r"H_{k}", n, p)
e = matrix(r"e_{k}", n, ONE)

MEASURE = (equation(h, h_value), equation(G, G_value), equation(F, F_value))
GAIN = equation(K, Psi * G.T * F.I)


def mean(of: sp.MatrixSymbol) -> sp.MatrixSymbol:
    """M[of], the ensemble mean."""
    return matrix(rf"\mathsf{{M}}\,{of.name}", of.rows, ONE)


def cov(left: sp.MatrixSymbol, right: sp.MatrixSymbol | None = None) -> sp.MatrixSymbol:
    """Cov(left, right) over the ensemble."""
    if right is None:
        return matrix(rf"\mathrm{{Cov}}({left.name})", left.rows, left.rows)
    return matrix(rf"\mathrm{{Cov}}({left.name}, {right.name})", left.rows, right.rows)


def cov_pinv(of: sp.MatrixSymbol) -> sp.MatrixSymbol:
    """Cov(of)^+, the pseudo-inverse."""
    return matrix(rf"\mathrm{{Cov}}({of.name})^{{+}}", of.rows, of.rows)


@cache  # filters of one construction have the same: half the time in which their equations are made
def regression(
    coefficient: sp.MatrixSymbol,
    offset: sp.MatrixSymbol,
    target: sp.MatrixSymbol,
    regressor: sp.MatrixSymbol,
) -> tuple[sp.Eq, sp.Eq]:
    """The two equations of an affine regression of target on regressor."""
    return (
        equation(coefficient, cov(target, regressor) * cov_pinv(regressor)),
        equation(offset, mean(target) - coefficient * mean(regressor)),
    )


class _Printer(LatexPrinter):
    """Sums in the order people write them: single symbols first, negative terms last."""

    def _print_MatAdd(self, expr: sp.MatAdd) -> str:
        def negative(term: sp.MatrixExpr) -> bool:
            return bool(term.as_coeff_mmul()[0].is_negative)

        terms = sorted(
            expr.args, key=lambda term: (negative(term), not isinstance(term, sp.MatrixSymbol))
        )
        text = self._print(terms[0])
        for term in terms[1:]:
            text += f" - {self._print(-term)}" if negative(term) else f" + {self._print(term)}"
        return text


def latex(equations: Sequence[sp.Eq], columns: int = 1) -> str:
    """The equations as one aligned LaTeX block, row by row in this number of columns."""
    printer = _Printer()
    each = [rf"{printer.doprint(q.lhs)} &= {printer.doprint(q.rhs)}" for q in equations]
    rows = [r" &\qquad ".join(each[i : i + columns]) for i in range(0, len(each), columns)]
    return aligned(rows)
