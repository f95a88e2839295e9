"""The letters of filters-that-remember.md: a filter that remembers two measurements, as a plain
program with NumPy's fits."""

import numpy as np
from gate.page import DEFINITION, NOTATION
from gate.values import Indexed

STEPS, RUNS = 6, 80


def tau(z, p):
    return 0.9 * z + 0.2 * np.sin(z) * np.exp(-p / 2)


def Theta(z, p):
    return (0.9 + 0.2 * np.cos(z)) ** 2 * p + 0.09


def measure(lam, Psi):
    G = 1 + 0.2 * lam
    return lam + 0.1 * (lam**2 + Psi), G, G**2 * Psi + 0.02 * Psi**2 + 0.16


def fitted(target, *regressors):
    """Slopes (1, r), offset and the variance left, by least squares."""
    rows = np.vstack([*regressors, np.ones(RUNS)])
    fit = np.linalg.lstsq(rows.T, target, rcond=None)[0]
    return fit[None, :-1], fit[-1], np.var(target - fit @ rows)


def windowed(rng):
    """All parts fitted, but the variance."""
    x = rng.normal(size=RUNS)
    lam, Psi, zeta, rows = np.zeros(RUNS), np.ones(RUNS), [], []
    ahead = None
    for _ in range(STEPS):
        y = x + 0.1 * x**2 + 0.4 * rng.normal(size=RUNS)
        h, G, F = measure(lam, Psi)
        sigma = Psi * G / F * (y - h)
        H, e, _ = fitted(x - lam, sigma)
        z = lam + H.item() * sigma + e
        zeta = [y, *zeta][:2]
        Gamma, chi, T = fitted(x, *zeta)
        u = Gamma @ np.array(zeta) + chi
        following = 0.9 * x + 0.2 * np.sin(x) + 0.3 * rng.normal(size=RUNS)
        L, n, _ = fitted(following, tau(u[0], T))
        before = ahead or (1.0, 0.0)
        row = {r"\lambda": lam, r"\Psi": Psi, r"\sigma": sigma, "H": H.item(), "e": e, "z": z}
        row |= {"y": y, "h": h, "G": G, "F": F, "L": before[0], "n": before[1], "u": u, "T": T}
        window = {r"\zeta": np.array(zeta), r"\Gamma": Gamma, r"\chi": np.full((1, RUNS), chi)}
        rows.append(row | window)
        ahead = L.item(), n
        lam, Psi, x = ahead[0] * tau(u[0], T) + n, Theta(u[0], T), following
    every = {name: Indexed([row[name] for row in rows]) for name in rows[0]}
    return every | {
        r"\tau": lambda u, T: tau(u[0], T),
        r"\Theta": lambda u, T: Theta(u[0], T),
        "k": range(1, STEPS - 1),
    }


def lengthened(rng):
    """The variance left by a regression on l measurements at once, and on so many that one more
    changes nothing."""
    c, q, R = rng.uniform(0.8, 0.9), *rng.uniform(0.5, 1.5, 2)
    P = q / (1 - c**2)

    def left(length):
        lag = np.abs(np.subtract.outer(np.arange(length), np.arange(length)))
        with_x = P * c ** np.arange(length)
        return P - with_x @ np.linalg.solve(P * c**lag + R * np.eye(length), with_x)

    end = left(100)
    kept = c * R / (c**2 * end + q + R)  # c (1 - K)
    variances = Indexed([P, *(left(length) for length in range(1, 6))])
    other = -q * R / (c**2 * end)  # the product of the roots
    numbers = {"p": variances, "p_*": end, "p_-": other, r"\varrho": kept**2, r"\ell": range(1, 5)}
    return numbers | {"D": lambda p: c**2 * p + q + R}


def slow(rng):
    """A state that hardly forgets, by the recursion over the length of its window."""
    c, q, R = 1 - 1e-6, rng.uniform(1, 2) * 1e-4, rng.uniform(1, 2)
    p = [0.0, R / (1 + R * (1 - c**2) / q)]
    for _ in range(5_000):
        Psi = c**2 * p[-1] + q
        p.append(Psi * R / (Psi + R))
    gone = c * R / (c**2 * p[-1] + q + R)
    return {"p": Indexed(p), "p_*": p[-1], r"\varrho": gone**2, r"\ell": range(200, 202)}


LETTERS = (windowed, lengthened, slow)
SAID = {
    DEFINITION: ["H=1", "e=0", "L=1", "n=0"],
    NOTATION: [
        r"p_k\text{ of the filter begun anew}",
        r"\frac{\partial p_{k+1}}{\partial p_k}",
        r"\Psi_{k+1}",
        r"\mathsf M\,\Theta(u_k,T_k)",
    ],
}
