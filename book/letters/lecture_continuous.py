"""The letters of lecture-continuous.md: the package's equations with second derivatives, and
differences of the likelihood."""

import importlib.util
from pathlib import Path

import numpy as np
from gate.page import CONDITION, NOTATION
from gate.worlds import column, covariance, slope
from scipy.linalg import expm
from scipy.optimize import brentq

from kfcourse import linearised
from kfcourse.continuous import to_discrete

_spec = importlib.util.spec_from_file_location(
    "letters.continuous", Path(__file__).with_name("continuous.py")
)
shared = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(shared)


def derivatives(rng):
    """The package's rates with second derivatives; the gradient and the Hessian of F by complex
    steps and differences."""
    own = shared.model(rng)
    letters, f, S = shared.rates(own, second_derivatives=True)
    y, N = letters["y"], letters["N"]

    def rate(x):
        return np.linalg.solve(N, 2 * S(x)).T @ y - S(x).T @ np.linalg.solve(N, S(x))

    def gradient(x):
        return slope(S, x).T @ np.linalg.solve(N, 2 * (y - S(x)))

    z, step = letters["z"], 1e-4
    sides = [
        [
            gradient(z + sign * step * size * e[:, None])
            for sign, size in ((1, 1), (-1, 1), (1, 2), (-1, 2))
        ]
        for e in np.eye(2)
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


sizes = r"""
D, N, S'', s: pos
S' = -s
\varepsilon = \sqrt{(2DS''/N)^2N/2/(2DS'^2/N)}
keep: D, S', S'', N, \varepsilon
"""


def step(rng):
    """A prediction of the discrete filter, and the law whose exponent is the prediction's and T F,
    by differences of it."""
    own, T = shared.model(rng), 0.1
    letters, f, _ = shared.rates(own)
    z = letters["z"]
    law = linearised(to_discrete(own, T)).predict(z.T, letters["D"][None])
    Psi, U = law.cov.reshape(2, 2), covariance(rng, 2)

    def exponent(e):
        return T * e @ U @ e / 2 - e @ np.linalg.solve(Psi, e) / 2

    # exact for a square
    bend = [[exponent(a + b) - exponent(a) - exponent(b) for b in np.eye(2)] for a in np.eye(2)]
    after = {
        r"\lambda": column(law.mean),
        r"\Psi": Psi,
        "U": U,
        "D_+": -np.linalg.inv(bend),
        "T": T,
        "f": f(z),
    }
    x = rng.normal(size=(2, 1))
    return letters | after | {"x": x, "e": x - after[r"\lambda"]}


def western(rng):
    own = shared.western(rng)
    return {name: own[name] for name in ("R", "Q", r"S_\xi", "N")}


start = r"""
m, d, z: num
"z(0)" = m
"D(0)" = d
x = z
"""


def linear_signal(rng):
    """The second derivative of the log-likelihood's rate where the signal is linear, by the slopes
    of its gradient."""
    own = shared.model(rng, ["x1 + 0.2*x2", "x2 - 0.3*x1"])
    letters, _, S = shared.rates(own)
    y, N = letters["y"], letters["N"]
    U = slope(lambda x: slope(S, letters["z"]).T @ np.linalg.solve(N, 2 * (y - S(x))), letters["z"])
    return {"U": U, "H": letters["H"], "N": N}


def ahead_of_data(rng):
    """The covariance with the data and without them, both at one moment."""
    letters, _, _ = shared.rates(shared.model(rng), second_derivatives=True)
    letters |= derivatives(rng)
    A, D, g = letters["A"], letters["D"], letters["g"]
    above = D + covariance(rng, 2)
    dot = A @ above + above @ A.T + g @ letters[r"S_\xi"] @ g.T / 2
    return letters | {
        r"\bar D": above,
        r"\dot{\bar D}": dot,
        "E": above - D,
        r"\dot E": dot - letters[r"\dot D"],
    }


even_signal = r"""
y: in -1 1
N: in 1 2
x: num
w: nodes 0 0.5
"\mathsf My" = \mathsf M\cos w
g(u) = -2(y-\cos(u))\sin(u)/N
h = 0.001
U = (8(g(h)-g(-h))-(g(2h)-g(-2h)))/(12h)
S = \cos x
keep: y, N, U, S, x, \mathsf My
"""


def blow_up(rng):
    """The scalar equation with U > 0 as the quotient of two solutions of a linear one; infinite
    where the lower one vanishes."""
    a, q, D_0, N = rng.uniform(0.5, 1, size=4)
    U, t = 2 * a**2 / q, rng.uniform(0.1, 0.2)

    def pair(t):
        return expm(np.array([[-a, q], [-U, a]]) * t) @ [D_0, 1]

    D, end = (
        pair(t)[0] / pair(t)[1],
        brentq(lambda t: pair(t)[1], 0, np.pi / np.sqrt(q * U - a**2), xtol=1e-15),
    )
    above, below = pair(t + 1e-20j)
    dot, omega = (above / below).imag / 1e-20, np.sqrt(q * U - a**2)
    names = {
        "a": a,
        "q": q,
        "U": U,
        "t": t,
        "D": D,
        r"\dot D": dot,
        "J": 1 / D,
        r"\dot J": -dot / D**2,
        r"\omega": omega,
    }
    return names | {
        r"\varphi": np.arctan2(U * D_0 - a, omega),
        "D_0": D_0,
        "t_*": end,
        "N": N,
        r"\sigma": np.sqrt(2 / N),
    }


amplitude = r"""
x: num
S = e^x
"""


near_estimate = r"""
z, e, \kappa: num
\tau: in .1 .2
s(x) = x+\kappa x^2/2
S_0 = s(z)
S_1 = 1+\kappa z
S_2 = \kappa
x = z+e
S = s(x)
T = \tau^2
keep: S_0, S_1, S_2, x, z, e, S, T, \tau
"""


LETTERS = (
    derivatives,
    likelihood,
    in_short,
    sizes,
    step,
    western,
    start,
    linear_signal,
    ahead_of_data,
    even_signal,
    blow_up,
    amplitude,
    near_estimate,
)
SAID = {
    NOTATION: [
        r"S(z)+\frac12S''D",
        r"\varepsilon",
        r"\Delta\dot z_\text{moments}",
        r"\Delta\dot D_\text{moments}",
        r"\Delta\dot z_\text{maximum}",
        r"\Delta\dot D_\text{maximum}",
        r"\text{noise in }\dot z",
        r"\text{noise in }\dot D",
        r"{\textstyle\sum_i\bigl[2N^{-1}(y-S)\bigr]_i\frac{\partial^2S_i}{\partial x^2}}",
        "{(y-S)}",
        r"{\textstyle\frac12}",
        r"{\dot{J}_{\text{Ito}}-\dot{J}}",
        "{-T(y_k-S)^TN^{-1}(y_k-S)}",
        "{Ty_k^TN^{-1}y_k}",
    ],
    CONDITION: ["U<a^2/q"],
}
EQUALS = {r"\varepsilon^2": r"\frac{DS''^2}{S'^2}"}
