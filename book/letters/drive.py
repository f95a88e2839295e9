"""The letters of drive.md: an arc at a constant yaw rate, integrated numerically, and one step of the model by hand."""

import numpy as np
import scipy
from gate.page import DEFINITION, NOTATION
from gate.worlds import column, covariance

EAST, NORTH = (rf"\int_0^\Delta V\{function}(\psi+\omega s)\,ds" for function in ("cos", "sin"))


def arc(rng):
    V, psi, omega, Delta = *rng.normal(size=3), rng.uniform(0.5, 1.5)

    def integral(function):
        return scipy.integrate.quad(lambda s: V * function(psi + omega * s), 0, Delta)[0]

    return {
        "V": V, r"\psi": psi, r"\omega": omega, r"\Delta": Delta, "u": omega * Delta / 2,
        EAST: integral(np.cos), NORTH: integral(np.sin),
    }  # fmt: skip


def tunnel(rng):
    """Variances of the place after a straight tunnel: pushes of speed and heading, each carried to the end."""
    V, t, p_V, p_psi, q_V, q_psi = rng.uniform(0.5, 2, 6)
    pushes = scipy.integrate.quad(lambda s: (t - s) ** 2, 0, t)[0]
    return {
        "V": V, "t": t, "p_V": p_V, r"p_\psi": p_psi, "q_V": q_V, r"q_\psi": q_psi,
        r"D_\parallel": t * p_V * t + q_V * pushes, r"D_\perp": V * (t * p_psi * t + q_psi * pushes) * V,
    }  # fmt: skip


def moved(rng):
    """A step of the model in place, heading and speed, and the same with the map turned and shifted."""
    alpha, turn, T, r = rng.uniform(0.5, 1.5, size=4)
    R = np.array([[np.cos(alpha), -np.sin(alpha)], [np.sin(alpha), np.cos(alpha)]])
    M, b = scipy.linalg.block_diag(R, np.eye(2)), column([*rng.normal(size=2), alpha, 0])

    def f(x):
        e, n, psi, V = x.ravel()
        return column([e + T * V * np.cos(psi + turn), n + T * V * np.sin(psi + turn), psi + turn, V])

    def tangent(x):
        psi, V = x[2, 0] + turn, x[3, 0]
        A = np.eye(4)
        A[:2, 2:] = T * np.array([[-V * np.sin(psi), np.cos(psi)], [V * np.cos(psi), np.sin(psi)]])
        return A

    x, Psi, H = column(rng.normal(size=4)), covariance(rng, 4), np.eye(2, 4)
    steps = {"f": f, "x": x, "A": tangent(x), "A'": tangent(M @ x + b), "p": covariance(rng, 4)}
    return steps | {"M": M, "b": b, "R": R, "H": H, r"\Psi": Psi, "r": r, "I": np.eye(2), "F": H @ Psi @ H.T + r * np.eye(2)}


def long_tunnel(rng):
    """The speed at which pushes of speed and heading err alike."""
    q_V, q_psi, t = rng.uniform(0.5, 2, 3)
    along, across = (q * scipy.integrate.quad(lambda s: (t - s) ** 2, 0, t)[0] for q in (q_V, q_psi))
    return {"q_V": q_V, r"q_\psi": q_psi, "V": np.sqrt(along / across)}


LETTERS = (arc, tunnel, moved, long_tunnel)
SAID = {
    DEFINITION: [r"e=\rho\cos\varphi_0\,(\ell-\ell_0)", r"n=\rho\,(\varphi-\varphi_0)"],
    NOTATION: ["e_{k+1}", "n_{k+1}", r"\psi_{k+1}", "V_{k+1}", r"\Delta"],
}
EQUALS = {
    r"\int_0^\Delta V\cos(\psi+\omega s)\,ds": r"V\Delta\cos(\psi+u)\frac{\sin u}{u}",
    r"\int_0^\Delta V\sin(\psi+\omega s)\,ds": r"V\Delta\sin(\psi+u)\frac{\sin u}{u}",
}
