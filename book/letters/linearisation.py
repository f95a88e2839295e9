"""The letters of linearisation.md: runs of the package's extended filter of a scalar model and of
vectors, and the same filter in Western letters."""

import numpy as np
from gate.page import CONDITION, DEFINITION, NOTATION
from gate.values import Indexed, Of
from gate.worlds import BENT_LATER, BENT_SCALAR, extended_run, given
from scipy.stats import multivariate_normal


def at_k(values):
    return Of(lambda k: values[k], "k")


def _together(run, *names):
    return zip(*(run[name].values for name in names), strict=True)


def scalar(rng):
    """A run, with the slopes and the noise of the object at the step."""
    run = extended_run(rng, BENT_SCALAR)
    S = [run["S"].plain(lam) for lam in run[r"\lambda"].values]
    off = [nu**2 / (H**2 * Psi + run["D_n"]) for nu, H, Psi in _together(run, r"\nu", "H", r"\Psi")]
    at_any = {
        "x": Indexed(rng.normal(size=len(off))),
        "d": Indexed([-square / 2 for square in off]),
    }
    now = {"S'": at_k(run["H"].values), "S": at_k(S)}
    matrices = ("H", r"\Phi", "I")  # whose transpositions a scalar does not tell
    return {name: run[name] for name in run if name not in matrices} | at_any | now


def vector(rng):
    run = extended_run(rng, BENT_LATER)
    x, lam, Psi = rng.normal(size=(3, 1)), run[r"\lambda"].plain, run[r"\Psi"].plain
    y, S, D_n, H = run["y"].plain, run["S"].plain, run["D_n"], run["H"].plain

    def log_density(off, cov):
        """Of a normal law, without its constant."""
        law = multivariate_normal(cov=cov)
        return law.logpdf(off.ravel()) - law.logpdf(np.zeros(len(off)))

    def J(x):
        return log_density(x - lam, Psi) + log_density(y - S(x), D_n)

    return run | {"x": x, "J": J, "F": H @ Psi @ H.T + D_n}


def western(rng):
    own = extended_run(rng)
    x, P = given(own[r"\lambda"], own["z"]), given(own[r"\Psi"], own["p"])
    g, D_xi, H = own["g"].values, own[r"D_\xi"], own["H"].values
    S = [
        slope_ @ cov @ slope_.T + own["D_n"]
        for slope_, cov in zip(H, own[r"\Psi"].values, strict=True)
    ]
    names = {"F": r"\Phi", "R": "D_n", "v": r"\nu", "z": "y"}
    same = {name: own[name] for name in "KHIk"} | {name: own[old] for name, old in names.items()}
    return same | {
        r"\hat x": x,
        "P": P,
        "Q": Of(lambda k: g[k] @ D_xi @ g[k].T, "k"),
        "S": Indexed(S),
        "f": own["f"].plain,
        "h": own["S"].plain,
    }


even = r"""
c, g, D_\xi, D_0: pos
k: range 5
\Psi_k = c^{2k}D_0+\sum_{i=0}^kc^{2i}g^2D_\xi-c^{2k}g^2D_\xi
S(x) = \cos x
x: num
k: range 3
"""


averaged = r"""
p: in .00001 .00002
u: nodes 0 p
"""


pendulum = r"""
x: num
T = 0.2
f = x-T\sin x
g = \cos x
S = \sin x
"""


meters = r"""
p = 0.25
S'(x) = 2x
"""


LETTERS = (
    scalar,
    vector,
    western,
    even,
    averaged,
    pendulum,
    meters,
)
SAID = {
    DEFINITION: [
        r"x_{k+1}=f_k(x_k)+g_k(x_k)\,\xi_k",
        "y_k=S_k(x_k)+n_k",
        r"x_{k+1}=x_k-T\sin x_k+\cos x_k\,\xi_k",
        r"y_k=\sin x_k+n_k",
        r"x_0\sim\mathcal N(1,0.1)",
        r"p(x_{k-1}\mid y_{0:k-1})=\mathcal N(x_{k-1};z_{k-1},p_{k-1})",
        r"p(x_k\mid x_{k-1})=\mathcal N\bigl(x_k;f(x_{k-1}),g^2(x_{k-1})D_\xi\bigr)",
        r"p(y_k\mid x_k)=\mathcal N\bigl(y_k;S(x_k),D_n\bigr)",
        r"f(x_{k-1})\approx f+f'\cdot(x_{k-1}-z_{k-1})",
        r"g^2(x_{k-1})\approx g^2",
        r"S(x_k)\approx S+S'\cdot(x_k-\lambda_k)",
        "g=ex",
        "x=z+e",
        "S=x^2",
        "S(x)=x^2",
    ],
    NOTATION: [r"\mathsf{M}\,g^2(z+u)-g^2(z)-O(p^2)"],
    CONDITION: [r"\Psi^{-1}=0", "D_n=0"],
}
