"""The letters of structural-functions.md: the structures of the package, and means by
quadrature."""

import numpy as np
from gate.page import DEFINITION, NOTATION
from gate.values import Operator
from gate.worlds import normal_nodes, world

from kfcourse import Model, gaussian, linearised

MODEL = Model.define(
    "c*x + 0.2*x**2 + e*x*v + 0.1*v", "g*x + f*x**2*w + 0.3*w", dict(c=0.9, e=0.5, g=1.2, f=0.4)
)


def a(x, v):
    return 0.9 * x + 0.2 * x**2 + 0.5 * x * v + 0.1 * v


def b(x, w):
    return 1.2 * x + 0.4 * x**2 * w + 0.3 * w


def of_package(structure, z, p):
    """The five functions at one law."""
    at = structure.measure(np.full((1, 1), z), np.full((1, 1, 1), p))
    moved = structure.predict(np.full((1, 1), z), np.full((1, 1, 1), p))
    names = (r"\tau", r"\Theta", "h", "G", "F")
    return dict(zip(names, (value.item() for value in (*moved, at.h, at.G, at.F)), strict=True))


def by_tangents(rng):
    z, p = rng.uniform(0.2, 0.9, size=2)
    slopes = {
        r"\frac{\partial a}{\partial x}": 0.9 + 0.4 * z,
        r"\frac{\partial a}{\partial v}": 0.5 * z + 0.1,
        r"\frac{\partial b}{\partial x}": 1.2,
        r"\frac{\partial b}{\partial w}": 0.4 * z**2 + 0.3,
    }
    return (
        of_package(linearised(MODEL), z, p)
        | slopes
        | {"a": a, "z": z, "m_v": 0.0, "p": p, "D_v": 1.0}
        | {"b": b, "m": z, "m_w": 0.0, "d": p, "D_w": 1.0}
    )


def of_a_sine(rng):
    m, d = rng.uniform(0.2, 0.9, size=2)
    return of_package(gaussian(Model.define("x + v", "sin(x) + w")), m, d) | {"m": m, "d": d}


over_noise = r"""
x: num
V: nodes 0 1
W = V
a(x, v) = 0.9x+0.2x^2+0.5xv+0.1v
b(x, w) = 1.2x+0.4x^2w+0.3w
\alpha(x) = 0.9x+0.2x^2
\gamma(x) = (0.9x+0.2x^2)^2+(0.5x+0.1)^2
\beta(x) = 1.2x
\eta(x) = 1.44x^2+(0.4x^2+0.3)^2
keep: x, V, W, a, b, \mathsf M, \alpha, \beta, \gamma, \eta
"""


in_short = r"""
x: num
V: nodes 0 1
W = V
a(x, v) = 0.9x+0.2x^2+0.5xv+0.1v
b(x, w) = 1.2x+0.4x^2w+0.3w
\alpha(x) = 0.9x+0.2x^2
\gamma(x) = (0.9x+0.2x^2)^2+(0.5x+0.1)^2
\beta(x) = 1.2x
\eta(x) = 1.44x^2+(0.4x^2+0.3)^2
\alpha = \alpha(x)
\beta = \beta(x)
\gamma = \gamma(x)
\eta = \eta(x)
a = a(x, V)
b = b(x, V)
keep: a, b, \mathsf M, \alpha, \beta, \gamma, \eta
"""


def over_state(rng):
    """Means over the state, and the package's exact structure; G by a difference of means."""
    m, d = rng.uniform(0.2, 0.9, size=2)
    x, mean = normal_nodes(m, d)
    functions = world(over_noise)(rng)
    values = {name: functions[name](x) for name in (r"\alpha", r"\beta", r"\gamma", r"\eta")}
    C = mean(values[r"\beta"] * (x - m))
    western = {"C": C, r"\mathrm{Cov}(x,y)": C, "d": d}
    moved, mean_there = normal_nodes(m + 1e-6, d)
    G = (mean_there(functions[r"\beta"](moved)) - mean(values[r"\beta"])) / 1e-6
    slope = {r"\frac{\partial h}{\partial m}": G, r"\partial h/\partial m": G}
    return (
        of_package(gaussian(MODEL), m, d)
        | values
        | slope
        | western
        | {r"\mathsf M": Operator(mean)}
    )


moments = r"""
m, d: in .2 .9
x: nodes m d
n: range 8
q_n = \mathsf Mx^n
n: range 1 6
keep: q, n, m, d
"""


def variant(rng):
    """Variant 53 in both structures."""
    e, f, g, p = *rng.uniform(0.3, 0.6, size=3), rng.uniform(0.3, 0.6)
    z = rng.normal()
    own = Model.define("0.9*x + e*x*v", "g*x + f*x**2*w", dict(e=e, f=f, g=g))
    both = {
        "Gaussian": of_package(gaussian(own), z, p),
        "linearised": of_package(linearised(own), z, p),
    }
    values = {
        rf"{name}_\text{{{way}}}": functions[key]
        for way, functions in both.items()
        for name, key in ((r"\Theta", r"\Theta"), ("F", "F"))
    }
    return values | {"e": e, "f": f, "p": p, "d": p, "m": z}


LETTERS = (by_tangents, of_a_sine, over_noise, in_short, over_state, moments, variant)
SAID = {
    DEFINITION: [
        "x_{k+1}=cx_k+ex_kv_k",
        "y_k=gx_k+fx_k^2w_k",
        r"w_k\sim\mathcal N(0,1)",
        "x_{k+1}=a(x_k,v_k)",
        "y_k=b(x_k,w_k)",
        r"x\sim\mathcal N(z,p)",
        r"x\sim\mathcal N(m,d)",
    ],
    NOTATION: [r"\mathsf M(x_{k+1}-\tau)^3"],
}
EQUALS = {
    "3f^2d(2m^2+d)": r"F_\text{Gaussian}-F_\text{linearised}",
    r"\Theta_\text{Gaussian}-\Theta_\text{linearised}": "e^2p",
    r"F_\text{Gaussian}-F_\text{linearised}": "3df^2(2m^2+d)",
}
