"""The letters of sigma-points.md: a correction that is iterated, and one by points, as plain
programs."""

import numpy as np
from gate.page import DEFINITION
from gate.values import Indexed, Of, Operator, Unread
from gate.worlds import column, covariance, slope


def S(x):
    a, b, c = np.ravel(x)
    return np.array([[a + 0.2 * b**2], [b * c + c]])


def given(rng):
    return (
        column(rng.normal(size=3)),
        covariance(rng, 3) / 9,
        column(rng.normal(size=2)),
        covariance(rng, 2) / 9,
    )


def iterated(rng, rounds=3):
    lam, Psi, y, D_n = given(rng)
    places, slopes, gains = [lam], [], []
    for _ in range(rounds):
        H = slope(S, places[-1])
        p = np.linalg.inv(np.linalg.inv(Psi) + H.T @ np.linalg.inv(D_n) @ H)
        slopes.append(H)
        gains.append(p @ H.T @ np.linalg.inv(D_n))
        places.append(lam + gains[-1] @ (y - S(places[-1]) - H @ (lam - places[-1])))
    slopes, gains = (Of(lambda i, rows=rows: rows[i], "i") for rows in (slopes, gains))
    at_i = {"H": slopes, "K": gains, r"\partial S(x_i)/\partial x": slopes, "x": Indexed(places)}
    return at_i | {r"\lambda": lam, r"\Psi": Psi, "D_n": D_n, "S": S, "y": y, "i": range(rounds)}


def settled(rng):
    """The end of the iteration, and what is made of it."""
    own = iterated(rng, 200)
    *_, z, x = own["x"].values
    H, Psi, D_n = slope(S, x), own[r"\Psi"], own["D_n"]
    p = np.linalg.inv(np.linalg.inv(Psi) + H.T @ np.linalg.inv(D_n) @ H)
    K = p @ H.T @ np.linalg.inv(D_n)
    known = {"z": z, "x": own["x"], "i": range(200, 201), r"\Psi": Psi}
    return known | {"p": p, "I": np.eye(3), "K": K, "H": H}


def points(rng):
    lam, Psi, y, D_n = given(rng)
    n, kappa = 3, 0.7
    roots = np.sqrt(n + kappa) * np.linalg.cholesky(Psi)

    def chi(i):
        return lam + np.sign(i) * roots[:, [abs(i) - 1]] if i else lam

    def w(i):
        if i not in every:
            raise Unread(f"point {i} of {n} on each side")
        return 1 / (2 * (n + kappa)) if i else kappa / (n + kappa)

    every = range(-n, n + 1)
    h = sum(w(i) * S(chi(i)) for i in every)
    F = sum(w(i) * S(chi(i)) @ S(chi(i)).T for i in every) - h @ h.T + D_n
    C = sum(w(i) * chi(i) @ S(chi(i)).T for i in every) - lam @ h.T
    K = np.linalg.solve(F, C.T).T
    law = {r"\lambda": lam, r"\Psi": Psi, "y": y, "D_n": D_n, "S": S}
    law |= {"h": h, "F": F, "C": C, "K": K, "G": np.linalg.solve(Psi, C).T}
    law |= {"z": lam + K @ (y - h), "p": Psi - C @ np.linalg.solve(F, C.T)}
    places = {r"\chi": Indexed(chi), "w": Indexed(w), "n": n, r"\kappa": kappa}
    return law | places | {"j": every, "i": range(1, n + 1)}


posterior = r"""
A: any 2 3
b, y: any 2
x, \lambda: any 3
\Psi: cov 3
D_n: cov 2
S(x) = Ax+bx^Tx
J(x) = \ln(\mathcal N(x;\lambda,\Psi)\mathcal N(y;S(x),D_n)/(\mathcal N(x;x,\Psi)\mathcal N(y;y,D_n)))
"""


def one_component(rng):
    """Three points of one component as an ensemble; kappa = 2 is where they have the fourth
    moment."""
    lam, sigma, kappa = rng.normal(), rng.uniform(0.5, 1.5), 2.0
    reach = np.sqrt(1 + kappa) * sigma
    weights = np.array([kappa, 0.5, 0.5]) / (1 + kappa)
    return {
        r"\mathsf M": Operator(lambda values: float(weights @ values)),
        "x": lam + reach * np.array([0, 1, -1]),
        r"\lambda": lam,
        r"\sigma": sigma,
    }


fourth_moment = r"""
n = 3
\kappa = 2\cdot3/2-n      # (n + kappa)^2 2 w - 1 = 2, with the weight w = 1 / (2 (n + kappa))
"|x|" = \sqrt{n+\kappa}
"""


LETTERS = (iterated, settled, points, posterior, one_component, fourth_moment)
SAID = {
    DEFINITION: [
        r"S(x)=\begin{pmatrix}\sqrt{s^2+a^2}\\\operatorname{atan2}(a,s)\end{pmatrix}",
        "y_k=S(x_k)+n_k",
    ],
}
EQUALS = {
    "x_{i+1}": r"\lambda+K\bigl(y-S(x_i)-H(\lambda-x_i)\bigr)",
    r"\mathsf M\,x": r"\lambda",
    r"\mathsf M(x-\lambda)^2": r"\sigma^2",
    r"\mathsf M(x-\lambda)^4\big|_{\kappa=2}": r"3\sigma^4",
}
