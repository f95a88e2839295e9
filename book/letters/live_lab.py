"""The letters of live-lab.md: the arguments of a gain, which is that of the best line through its
law."""

import numpy as np
from gate.page import DEFINITION, NOTATION
from numpy.polynomial.hermite_e import hermegauss
from scipy.optimize import minimize_scalar

NODES, WEIGHTS = hermegauss(5)  # exact for polynomials up to degree 9


def gain(f, lam, Psi):
    """Of the best line for y = x + f x^2 w over x ~ N(lambda, Psi), by quadrature."""
    x, w = (axis.ravel() for axis in np.meshgrid(lam + np.sqrt(Psi) * NODES, NODES))
    weight = np.outer(WEIGHTS, WEIGHTS).ravel() / WEIGHTS.sum() ** 2
    y = x + f * x**2 * w
    return weight @ ((x - lam) * (y - weight @ y)) / (weight @ (y - weight @ y) ** 2)


def best_line(rng):
    """A gain, and the largest one, looked for over all variances."""
    f, lam = rng.uniform(0.1, 0.5), rng.uniform(1, 3)
    largest = -minimize_scalar(
        lambda Psi: -gain(f, lam, Psi), bounds=(0.01, lam**2), method="bounded"
    ).fun
    return {
        "K": gain(f, lam, rng.uniform(0.1, 5)),
        r"\max_{\Psi}K": largest,
        "f": f,
        r"\lambda": lam,
    }


LETTERS = (best_line,)
SAID = {
    DEFINITION: ["x_{k+1}=cx_k+ex_kv_k", "y_k=gx_k+fx_k^2w_k"],
    NOTATION: [r"\lambda", r"\Psi", "1/K", r"1/K\,\big|_{\Psi=\lambda^2/\sqrt3}"],
}
