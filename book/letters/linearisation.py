"""The letters of linearisation.md: runs of the package's extended filter of a scalar model, and of
several states."""

from functools import partial
from itertools import product

import numpy as np
from gate.page import DEFINITION, NOTATION
from gate.values import Indexed, Of, Operator
from gate.worlds import BENT_SCALAR, BENT_SCALAR_LATER, column, extended_run, slope

from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import linearised


class AtEstimate(np.ndarray):
    """g at the estimate, with and without its argument."""

    def __call__(self, z):
        return np.asarray(self)


def course(rng):
    run = extended_run(rng, BENT_SCALAR_LATER)
    H, Phi, g = (run[name].values for name in ("H", r"\Phi", "g"))
    functions = Indexed([now.view(AtEstimate) for now in g])
    others = {"S'": Of(lambda k: H[k], "k"), "f'": Of(lambda k: Phi[k], "k")}
    others |= {"m_0": column(BENT_SCALAR_LATER.prior.mean), "D_0": BENT_SCALAR_LATER.prior.cov}
    return run | others | {"g": functions}


def scalar(rng):
    """Functions that stay the same, their slopes anywhere, and the noise of the object in both
    notations."""
    run = extended_run(rng, BENT_SCALAR)
    at_k = {
        letter: Of(lambda k, one=run[name].values: one[k], "k")
        for letter, name in (("S'", "H"), ("f'", r"\Phi"))
    }
    g = run["g"].values
    at_k |= {"g": Of(lambda k: g[k], "k"), "Q": Of(lambda k: g[k] ** 2 * run[r"D_\xi"], "k")}
    same = {f"{name}_k'": partial(slope, run[name].plain) for name in "Sf"}
    return at_k | same | {name: run[name] for name in (r"\lambda", "z", r"D_\xi", "k")}


def western(rng):
    run = extended_run(rng)
    H, Phi, g = (run[name].values for name in ("H", r"\Phi", "g"))
    at_k = {
        "H": Of(lambda k: H[k], "k"),
        r"\partial h/\partial x": Of(lambda k: H[k], "k"),
        "F": Of(lambda k: Phi[k], "k"),
        r"\partial f/\partial x": Of(lambda k: Phi[k], "k"),
        "Q": Of(lambda k: g[k] @ run[r"D_\xi"] @ g[k].T, "k"),
        "g": Of(lambda k: g[k], "k"),
    }
    same = {
        "K": run["K"],
        "y": run["y"],
        "m^-": run[r"\lambda"],
        "m": run["z"],
        "P^-": run[r"\Psi"],
        "P": run["p"],
        "R": run["D_n"],
    }
    return (
        at_k
        | same
        | {"h": run["S"].plain, "f": run["f"].plain, "I": run["I"], "k": run["k"]}
        | {n: run[n] for n in (r"D_\xi", "D_n")}
    )


even = r"""
c, g, D_\xi, D_0: pos
k: range 5
\Psi_k = c^{2k}D_0+\sum_{i=0}^kc^{2i}g^2D_\xi-c^{2k}g^2D_\xi
S(x) = \cos x
x: num
k: range 3
"""


def multiplied(rng):
    """The package's filter without measurements, and the truth by all signs that the state and the
    noises can have."""
    c, e, m, p_0 = rng.uniform(0.85, 0.95), *rng.uniform(0.6, 0.8, size=3)
    ahead = linearised(Model.define("c*x + e*x*v", "x + w", {"c": c, "e": e}))
    signs = np.array(list(product((-1, 1), repeat=5)))
    x, laws = [m + np.sqrt(p_0) * signs[:, 0]], [(np.array([[m]]), np.array([[[p_0]]]))]
    for sign in signs.T[1:]:
        x.append((c + e * sign) * x[-1])
        laws.append(ahead.predict(*laws[-1]))
    u = np.sqrt(p_0) * signs[:, 0]
    return {
        "c": c,
        "e": e,
        "m": m,
        "p": Indexed([law[1].item() for law in laws], p_0),
        "z": Indexed([law[0].item() for law in laws]),
        "x": Indexed(x),
        "u": u,
        "V": Indexed([np.var(one) for one in x]),
        r"\mathsf M": Operator(np.mean),
        "k": range(4),
    }


exponent = r"""
a: num
c: pos
b = -c
n = \int e^{ax+bx^2}dx
m_\text{e} = \int xe^{ax+bx^2}dx/n
v_\text{e} = \int(x-m_\text{e})^2e^{ax+bx^2}dx/n
keep: a, b, m_\text{e}, v_\text{e}
"""


LETTERS = (course, scalar, western, even, multiplied, exponent)
SAID = {
    DEFINITION: [
        r"x_{k+1}=f_k(x_k)+g_k(x_k)\,\xi_k",
        "y_k=S_k(x_k)+n_k",
        "g=ex",
        r"\ln p(x_{k-1}\mid y_{0:k-1})",
        r"\ln p(x_k\mid x_{k-1})",
        r"\ln p(y_k\mid x_k)",
    ],
    NOTATION: [
        r"f_{k-1}(x_{k-1})-O\bigl((x_{k-1}-z_{k-1})^2\bigr)",
        "g_{k-1}^2(x_{k-1})-O(x_{k-1}-z_{k-1})",
        r"S_{k}(x_k)-O\bigl((x_k-\lambda_k)^2\bigr)",
        r"\mathsf{M}\,g^2(z+u)-g^2(z)-O(p^2)",
    ],
}
EQUALS = {"-1/(2b)": r"v_\text{e}", "-a/(2b)": r"m_\text{e}"}
