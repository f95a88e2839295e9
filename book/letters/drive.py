"""The letters of drive.md: an arc at a constant yaw rate, integrated numerically, and one step of
the model by hand."""

import numpy as np
import scipy
from gate.page import DEFINITION, NOTATION
from gate.worlds import column, covariance

EAST, NORTH = (rf"\int_0^\Delta V\{function}(\psi+\omega s)\,ds" for function in ("cos", "sin"))


arc = r"""
V, \psi, \omega: num
\Delta: in .5 1.5
u = \omega\Delta/2
"""


tunnel = r"""
V, t, p_V, p_\psi, q_V, q_\psi: pos
i = \int_0^t(t-s)^2ds
D_\parallel = tp_Vt+q_Vi
D_\perp = V(tp_\psi t+q_\psi i)V
keep: V, t, p_V, p_\psi, q_V, q_\psi, D_\parallel, D_\perp
"""


def moved(rng):
    """A step of the model in place, heading and speed, and the same with the map turned and
    shifted."""
    alpha, turn, T, r = rng.uniform(0.5, 1.5, size=4)
    R = np.array([[np.cos(alpha), -np.sin(alpha)], [np.sin(alpha), np.cos(alpha)]])
    M, b = scipy.linalg.block_diag(R, np.eye(2)), column([*rng.normal(size=2), alpha, 0])

    def f(x):
        e, n, psi, V = x.ravel()
        return column(
            [e + T * V * np.cos(psi + turn), n + T * V * np.sin(psi + turn), psi + turn, V]
        )

    def tangent(x):
        psi, V = x[2, 0] + turn, x[3, 0]
        A = np.eye(4)
        A[:2, 2:] = T * np.array([[-V * np.sin(psi), np.cos(psi)], [V * np.cos(psi), np.sin(psi)]])
        return A

    x, Psi, H = column(rng.normal(size=4)), covariance(rng, 4), np.eye(2, 4)
    steps = {"f": f, "x": x, "A": tangent(x), "A'": tangent(M @ x + b), "p": covariance(rng, 4)}
    return steps | {
        "M": M,
        "b": b,
        "R": R,
        "H": H,
        r"\Psi": Psi,
        "r": r,
        "I": np.eye(2),
        "F": H @ Psi @ H.T + r * np.eye(2),
    }


long_tunnel = r"""
q_V, q_\psi, t: pos
V = \sqrt{q_V\int_0^t(t-s)^2ds/(q_\psi\int_0^t(t-s)^2ds)}
keep: q_V, q_\psi, V
"""


LETTERS = (arc, tunnel, moved, long_tunnel)
SAID = {
    DEFINITION: [r"e=\rho\cos\varphi_0\,(\ell-\ell_0)", r"n=\rho\,(\varphi-\varphi_0)"],
    NOTATION: ["e_{k+1}", "n_{k+1}", r"\psi_{k+1}", "V_{k+1}", r"\Delta"],
}
EQUALS = {
    r"\int_0^\Delta V\cos(\psi+\omega s)\,ds": r"V\Delta\cos(\psi+u)\frac{\sin u}{u}",
    r"\int_0^\Delta V\sin(\psi+\omega s)\,ds": r"V\Delta\sin(\psi+u)\frac{\sin u}{u}",
}
