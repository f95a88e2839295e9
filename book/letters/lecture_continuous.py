"""The letters of lecture-continuous.md: the package's equations with second derivatives, and differences of the likelihood."""

import importlib.util
from pathlib import Path

import numpy as np

from kfcourse import linearised
from kfcourse.continuous import to_discrete
from kfcourse.pages.letters import column, covariance, slope
from kfcourse.pages.relations import NOTATION

_spec = importlib.util.spec_from_file_location("letters.continuous", Path(__file__).with_name("continuous.py"))
shared = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(shared)


def derivatives(rng):
    """The package's rates with second derivatives; the gradient and the Hessian of F by complex steps and differences."""
    own = shared.model(rng)
    letters, f, S = shared.rates(own, second_derivatives=True)
    y, N = letters["y"], letters["N"]

    def rate(x):
        return np.linalg.solve(N, 2 * S(x)).T @ y - S(x).T @ np.linalg.solve(N, S(x))

    def gradient(x):
        return slope(S, x).T @ np.linalg.solve(N, 2 * (y - S(x)))

    z, step = letters["z"], 1e-4
    sides = [
        [gradient(z + sign * step * size * e[:, None]) for sign, size in ((1, 1), (-1, 1), (1, 2), (-1, 2))] for e in np.eye(2)
    ]
    U = np.hstack([(8 * (a - b) - (c - d)) / (12 * step) for a, b, c, d in sides])  # fourth order
    row = slope(rate, z)
    found = {
        "u": gradient(z),
        "U": U,
        r"\frac{\partial F}{\partial x}": row,
        r"\partial F/\partial x": row,
        r"\partial u/\partial x": U,
    }
    hessian = {
        r"\frac{\partial}{\partial x}\Bigl(\frac{\partial F}{\partial x}\Bigr)^T": U,
        r"\partial f/\partial x": letters["A"],
    }
    return letters | found | hessian | {"f": f(z)}


def likelihood(rng):
    own = shared.model(rng)
    letters, _, S = shared.rates(own)
    x, y, N = rng.normal(size=(2, 1)), letters["y"], letters["N"]
    of_phase = {"S": lambda phi, t: S(shared.C.T @ phi), "y": lambda t: y, "c": shared.C}

    def F(x, t):
        """What is left of -(y - S)^T N^-1 (y - S) without its part in y alone."""
        return y.T @ np.linalg.solve(N, y) - (y - S(x)).T @ np.linalg.solve(N, y - S(x))

    return {"x": x, "t": 0.0, "N": N, "F": F} | of_phase


def in_short(rng):
    own = likelihood(rng)
    return own | {"S": own["S"](shared.C @ own["x"], 0), "y": own["y"](0)}


def sizes(rng):
    """The relative change of D: its factor squared, times intensity, times the filter's time."""
    D, first, second, N = *rng.uniform(0.5, 2, size=2), -rng.uniform(0.5, 2), rng.uniform(0.5, 2)
    share = (D * second * 2 / N) ** 2 * (N / 2) / (D * first**2 * 2 / N)
    return {"D": D, "S'": first, "S''": second, "N": N, r"\varepsilon": np.sqrt(share)}


def step(rng):
    """A prediction of the discrete filter, and the law whose exponent is the prediction's and T F, by differences of it."""
    own, T = shared.model(rng), 0.1
    letters, f, _ = shared.rates(own)
    z = letters["z"]
    law = linearised(to_discrete(own, T)).predict(z.T, letters["D"][None])
    Psi, U = law.cov.reshape(2, 2), covariance(rng, 2)

    def exponent(e):
        return T * e @ U @ e / 2 - e @ np.linalg.solve(Psi, e) / 2

    bend = [[exponent(a + b) - exponent(a) - exponent(b) for b in np.eye(2)] for a in np.eye(2)]  # exact for a square
    after = {r"\lambda": column(law.mean), r"\Psi": Psi, "U": U, "D_+": -np.linalg.inv(bend), "T": T, "f": f(z)}
    x = rng.normal(size=(2, 1))
    return letters | after | {"x": x, "e": x - after[r"\lambda"]}


def western(rng):
    own = shared.western(rng)
    return {name: own[name] for name in ("R", "Q", r"S_\xi", "N")}


def start(rng):
    d, m, z = rng.normal(size=3)
    return {"z(0)": m, "m": m, "D(0)": d, "d": d, "x": z, "z": z}


LETTERS = (derivatives, likelihood, in_short, sizes, step, western, start)
SAID = {
    latex: NOTATION
    for latex in (
        r"S(z)+\frac12S''D",
        r"\varepsilon",
        r"\Delta\dot z_\text{moments}",
        r"\Delta\dot D_\text{moments}",
        r"\Delta\dot z_\text{maximum}",
        r"\Delta\dot D_\text{maximum}",
        r"\text{noise in }\dot z",
        r"\text{noise in }\dot D",
    )
}
EQUALS = {r"\varepsilon^2": r"\frac{DS''^2}{S'^2}"}
SAID |= dict.fromkeys(
    (
        r"{\textstyle\sum_i\bigl[2N^{-1}(y-S)\bigr]_i\frac{\partial^2S_i}{\partial x^2}}",
        r"{(y-S)}",
        r"{\textstyle\frac12}",
        r"{\dot{J}_{\text{Ito}}-\dot{J}}",
        r"{-T(y_k-S)^TN^{-1}(y_k-S)}",
        r"{Ty_k^TN^{-1}y_k}",
    ),
    NOTATION,
)
