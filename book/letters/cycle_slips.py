"""The letters of cycle-slips.md: the mean time to a slip by Pontryagin's equation, the loop by iteration."""

import numpy as np
from scipy.integrate import quad
from scipy.special import iv

from kfcourse.pages.reader import Of
from kfcourse.pages.relations import DEFINITION, NOTATION


def slips(rng):
    """tau(0) = 1/q int_0^{2 pi} e^V(x) int_0^x e^-V(s) ds dx, the solution with tau = 0 at +-2 pi."""
    variance, q = rng.uniform(0.06, 0.12), rng.uniform(0.01, 0.1)

    def V(x):
        return (1 - np.cos(x)) / variance

    inner = lambda x: quad(lambda s: np.exp(-V(s)), 0, x, epsabs=0, epsrel=1e-12, limit=200)[0]  # noqa: E731
    tau = quad(lambda x: np.exp(V(x)) * inner(x), 0, 2 * np.pi, epsabs=0, epsrel=1e-11, limit=400)[0] / q
    return {r"\tau": tau, "q": q, r"\sigma_\varphi": np.sqrt(variance), "V": Of(V, r"\Delta"), "I_0": lambda x: iv(0, x)}


def loop(rng):
    """The covariance of a scalar phase that is measured directly, until it repeats itself; U by its mean over a period."""
    A, D_n, q = rng.uniform(0.5, 2), rng.uniform(0.5, 2), rng.uniform(0.01, 0.1)
    theta = 2 * np.pi * np.arange(64) / 64
    slope = np.mean((A * np.sin(theta)) ** 2) / D_n
    Psi = 1.0
    for _ in range(5000):
        p = 1 / (1 / Psi + slope)
        Psi = p + q
    numbers = {"A": A, "D_n": D_n, "q": q, "r": 1 / slope, "p": p, r"\Psi": Psi, r"\sigma_\varphi": np.sqrt((p + Psi) / 2)}
    return numbers | {"U'": lambda at: slope * np.cos(at)}


LETTERS = (slips, loop)
SAID = {
    r"\Delta_{k+1}=\Delta_k-p\,U(\Delta_k)-p\,\tilde n_k+s_\varphi v_k": DEFINITION,
    "2D_n/A^2": NOTATION,
    r"1/\sigma_\varphi^2": NOTATION,
}
