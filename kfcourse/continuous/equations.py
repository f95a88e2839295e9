"""The equations of the extended Kalman-Bucy filter, derived."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import sympy as sp

from kfcourse.continuous.model import ContinuousModel
from kfcourse.symbolic.reading import exact_matrix, fresh, normal_symbols, numbered


def log_likelihood_rate(
    signal: sp.MatrixBase, y: sp.MatrixBase, noise_density: sp.MatrixBase
) -> sp.Expr:
    """F(x, t) = 2 S^T N^-1 (y - S / 2), what the log-likelihood gains in unit time: (p, 1), (p, 1),
    (p, p) -> scalar."""
    return (2 * signal.T * noise_density.inv() * (y - signal / 2))[0]


def symmetrised_drift(
    rates: sp.MatrixBase,
    state: Sequence[sp.Symbol],
    noise: Sequence[sp.Symbol],
    intensity: sp.MatrixBase,
) -> sp.ImmutableMatrix:
    """What is added to ds/dt = rates(s, noise) in Ito's sense to give the same in the symmetrised
    (Stratonovich) sense, (n, 1).

    1/2 sum_lm q_lm db_l/ds b_m    q the intensity, b_l the derivative of the rates by noise l
    g g' S_xi / 4                  of g(x) xi
    """
    b, q = rates.jacobian(sp.Matrix(noise)), range(len(noise))
    terms = [
        intensity[i, j] / 2 * b.col(i).jacobian(sp.Matrix(state)) * b.col(j) for i in q for j in q
    ]
    return sp.ImmutableMatrix(sum(terms, sp.zeros(len(rates), 1)))


class FilterEquations(NamedTuple):
    """The extended Kalman-Bucy filter in formulas, parameters as symbols.

    dz/dt = f + D u,     dD/dt = A D + D A^T + Q + D U D,     u = (dF/dx)^T,  U = d^2 F / dx^2  at x
    = z

    Attributes
    ----------
    z, D, y : sympy.Matrix
        Symbols: estimate (n, 1), covariance (n, n), measurement (p, 1).
    f, A, Q : sympy.Matrix
        f(z), df/dx, g S_xi g^T / 2.
    S, H : sympy.Matrix
        S(z), dS/dx.
    F : sympy expression
        The gain of the log-likelihood in unit time, at z.
    u, U : sympy.Matrix
        Its derivatives.  Without second derivatives of S, U is its noise-free part -H^T 2 N^-1 H.
    """

    z: sp.ImmutableMatrix
    D: sp.ImmutableMatrix
    y: sp.ImmutableMatrix
    f: sp.ImmutableMatrix
    A: sp.ImmutableMatrix
    Q: sp.ImmutableMatrix
    S: sp.ImmutableMatrix
    H: sp.ImmutableMatrix
    F: sp.Expr
    u: sp.ImmutableMatrix
    U: sp.ImmutableMatrix


def filter_equations(model: ContinuousModel, second_derivatives: bool = True) -> FilterEquations:
    """Derive the filter's equations from f, g, S and F(x, t).

    The second derivatives of S enter U times y - S, so without them U is U at y = S.
    """
    z, D = normal_symbols(model.n, "z", "D", model.taken)
    y = sp.ImmutableMatrix([fresh(name, model.taken) for name in numbered("y", model.p)])
    at = dict(zip(model.x, z, strict=True))
    f, g, S = (
        sp.ImmutableMatrix(matrix.subs(at, simultaneous=True))
        for matrix in (model.drift, model.diffusion, model.signal)
    )
    F = log_likelihood_rate(S, y, exact_matrix(model.noise_density))
    U = sp.ImmutableMatrix(sp.hessian(F, list(z)))
    if not second_derivatives:
        U = without_noise(U, y, S)
    Q = g * exact_matrix(model.spectral_density) * g.T / 2
    return FilterEquations(
        z, D, y, f, f.jacobian(z), Q, S, S.jacobian(z), F, sp.ImmutableMatrix([F]).jacobian(z).T, U
    )


def without_noise(U: sp.MatrixBase, y: sp.MatrixBase, S: sp.MatrixBase) -> sp.ImmutableMatrix:
    return sp.ImmutableMatrix(U.subs(dict(zip(y, S, strict=True)))).applyfunc(sp.expand)
