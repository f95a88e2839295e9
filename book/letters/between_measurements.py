"""The letters of between-measurements.md: a linear object, its moments by the matrix exponential
and differences in time."""

import numpy as np
from gate.page import DEFINITION, NOTATION
from gate.worlds import column, covariance
from scipy.linalg import expm


def course(rng):
    """A linear object after half a second, rates by differences; then a correction in information
    form."""
    A, B, p = rng.normal(size=(2, 2)), rng.normal(size=(2, 2)), covariance(rng, 2)
    c, start, h = column(rng.normal(size=2)), column(rng.normal(size=2)), 1e-3
    whole = np.block(
        [[A, B @ B.T, c], [np.zeros((2, 2)), -A.T, np.zeros((2, 1))], [np.zeros((1, 5))]]
    )

    def at(t):
        moved = expm(whole * t)
        Phi = moved[:2, :2]
        return Phi @ start + moved[:2, 4:], Phi, moved[:2, 2:4] @ Phi.T

    z, Phi, Q = at(0.5)
    ahead, after, behind, before = (at(0.5 + step * h) for step in (2, 1, -2, -1))
    rates = [
        (8 * (b - c) - (a - d)) / (12 * h)
        for a, b, d, c in zip(ahead, after, behind, before, strict=True)
    ]
    names = {
        "A": A,
        "p": p,
        r"\Phi": Phi,
        "Q": Q,
        "I": np.eye(2),
        r"\mathsf MBB^T": B @ B.T,
        r"\mathsf Ma": A @ z + c,
    }
    return (
        names
        | dict(zip((r"\dot z", r"\dot\Phi", r"\dot Q"), rates, strict=True))
        | {r"\Psi": Phi @ p @ Phi.T + Q}
    )


correction = r"""
\Psi, R: cov 2
G: any 2 2
\lambda, y, h: any 2 1
p = (\Psi^{-1}+G^TR^{-1}G)^{-1}
K = pG^TR^{-1}
z = \lambda+K(y-h)
"""


LETTERS = (course, correction)
SAID = {
    DEFINITION: [r"dx=a(x,t)\,dt+B(x,t)\,dw", "y_k=b(x(t_k),w_k)"],
    NOTATION: [
        r"\Phi p\Phi^T+Q",
        r"\mathsf{M}B^2",
        r"\mathsf{M}BB^T",
        r"\partial p/\partial t",
        r"-\partial(\tanh(x')\,p)/\partial x'+\tfrac12\,\partial^2p/\partial x'^2",
    ],
}
