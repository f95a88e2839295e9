"""The letters of better-than-a-tangent.md: moments of signals over a normal law, by quadrature and by the package."""

import numpy as np
from gate.page import DEFINITION, NOTATION
from gate.values import Operator
from gate.worlds import normal_nodes

from kfcourse import Model, gaussian


def line(rng):
    """J of a sine and a line, from moments."""
    m, d = rng.normal(), rng.uniform(0.2, 0.5)
    x, mean = normal_nodes(m, d)
    S, covariance = mean(np.sin(x)), mean(np.sin(x) * (x - m))
    variance = mean(np.sin(x) ** 2) - S**2
    alpha, beta = rng.normal(size=2)

    def J(a, b):
        return variance + (S - a) ** 2 - 2 * b * covariance + b**2 * d

    return {"J": J, r"\alpha": alpha, r"\beta": beta, r"\mathsf M": Operator(mean), "S": np.sin, "x": x, "m": m}


def corrected(h, G, F, lam, Psi, y):
    """What any correction does with h, G and F."""
    K = Psi * G / F
    return {"h": h, "G": G, "F": F, "K": K, "z": lam + (y - h) * K, "p": Psi - K**2 * F, r"\lambda": lam, r"\Psi": Psi, "y": y}


def second_order(rng):
    """A parabola, whose moments are exact."""
    lam, Psi, D_n, first, second, y = *rng.uniform(0.2, 0.9, size=3), *rng.normal(size=3)
    x, mean = normal_nodes(lam, Psi)
    values = 0.3 + first * (x - lam) + second * (x - lam) ** 2 / 2
    h = mean(values)
    own = corrected(h, mean(values * (x - lam)) / Psi, mean((values - h) ** 2) + D_n, lam, Psi, y)
    return own | {"S": 0.3, "S'": first, "S''": second, "D_n": D_n}


def statistical(rng):
    """A sine in the package's Gaussian structure."""
    lam, Psi, D_n, y = *rng.uniform(0.2, 0.9, size=3), rng.normal()
    model = Model.define("x + v", "sin(x) + r*w", {"r": np.sqrt(D_n)})
    at = gaussian(model).measure(np.full((1, 1), lam), np.full((1, 1, 1), Psi))
    x, mean = normal_nodes(lam, Psi)
    own = corrected(at.h.item(), at.G.item(), at.F.item(), lam, Psi, y)
    spread = {r"\mathsf M": Operator(mean), r"\mathsf D": Operator(lambda values: mean(values**2) - mean(values) ** 2)}
    western = {"C": mean((x - lam) * np.sin(x)), "P^-": Psi}
    return own | spread | western | {"S": np.sin, "S'": np.cos, "x": x, "D_n": D_n}


LETTERS = (line, second_order, statistical)
SAID = {
    DEFINITION: [r"x\sim\mathcal N(\lambda,\Psi)"],
    NOTATION: [r"g^2D_\xi", r"(\Theta-G^2p)_{1}", r"(\Theta-G^2p)_{2}", r"\mathsf{M}[e^2]"],
}
