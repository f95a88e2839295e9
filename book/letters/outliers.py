"""The letters of outliers.md: one correction of a plain program, with a weight that has settled."""

import numpy as np
from gate.page import CONDITION, NOTATION
from gate.worlds import column, covariance


def doubting(rng, states=3, m=2):
    """Student's weight by going round until nothing changes."""
    G, s = rng.normal(size=(m, states)), 3.7
    Psi, R, h, lam, y = covariance(rng, states), covariance(rng, m), *(column(rng.normal(size=n)) for n in (m, states, m))
    nu, w = y - h, 1.0
    for _ in range(500):
        K = np.linalg.solve(G @ Psi @ G.T + R / w, G @ Psi).T
        z, p = lam + K @ nu, Psi - K @ G @ Psi
        r = nu - G @ (z - lam)
        w = (s + m) / (s + (r.T @ np.linalg.solve(R, r)).item() + np.trace(np.linalg.solve(R, G @ p @ G.T)))
    F = G @ Psi @ G.T + R
    letters = {r"\nu": nu, "y": y, "h": h, "F": F, "G": G, r"\Psi": Psi, "R": R, "w": w, "K": K, "z": z, "p": p, "r": r}
    return letters | {r"\lambda": lam, "s": s, "m": m, r"\operatorname{tr}": np.trace}


def scalar(rng, w=1.0):
    """A fix of one component."""
    Psi, R, nu = rng.uniform(0.5, 2, size=3)
    F = Psi + R / w
    left = np.linalg.inv([[1 / Psi + w / R]]).item()
    return {r"\Psi": Psi, "R": R, "w": w, "F": F, "K": left * w / R, "p": left, r"\nu": nu, "s": nu / F**0.5}


def doubtful(rng):
    return scalar(rng, 0.3)


LETTERS = (doubting, scalar, doubtful)
SAID = {
    NOTATION: [
        "w=1",
        r"\mathsf P(\nu^TF^{-1}\nu<\gamma)",
        r"\mathsf P\big|_{\gamma=-2\ln(1-\beta)}",
        r"z\,(\text{from } y_1)",
        r"\lim_{R_{22}\to\infty}z\,(\text{from } y_1,y_2)",
        r"\Delta t_k",
        "p(e)",
        r"\mathsf M[u\mid e]",
        r"w\big|_{t>c}",
        r"\frac{d\rho}{dt}",
    ],
    CONDITION: [r"\nu^TF^{-1}\nu>\gamma"],
}
