"""The letters of extended-kalman.md: a run of the package's extended filter, and the same filter in
Western letters."""

import numpy as np
from gate.page import CONDITION, DEFINITION, NOTATION
from gate.values import Indexed, Of
from gate.worlds import BENT_LATER, extended_run, given
from scipy.stats import multivariate_normal


def course(rng):
    found = extended_run(rng, BENT_LATER)
    x, lam, Psi = rng.normal(size=(3, 1)), found[r"\lambda"].plain, found[r"\Psi"].plain
    y, S, D_n = found["y"].plain, found["S"].plain, found["D_n"]

    def log_density(off, cov):
        """Of a normal law, without its constant."""
        law = multivariate_normal(cov=cov)
        return law.logpdf(off.ravel()) - law.logpdf(np.zeros(len(off)))

    def J(x):
        return log_density(x - lam, Psi) + log_density(y - S(x), D_n)

    return found | {"x": x, "J": J, "F": found["H"].plain @ Psi @ found["H"].plain.T + D_n}


def western(rng):
    own = extended_run(rng)
    x, P = given(own[r"\lambda"], own["z"]), given(own[r"\Psi"], own["p"])
    g, D_xi, H = own["g"].values, own[r"D_\xi"], own["H"].values
    S = [
        slope_ @ cov @ slope_.T + own["D_n"]
        for slope_, cov in zip(H, own[r"\Psi"].values, strict=True)
    ]
    return {
        r"\hat x": x,
        "P": P,
        "K": own["K"],
        "H": own["H"],
        "F": own[r"\Phi"],
        "I": own["I"],
        "R": own["D_n"],
        "k": own["k"],
        "Q": Of(lambda k: g[k] @ D_xi @ g[k].T, "k"),
        "S": Indexed(S),
        "v": own[r"\nu"],
        "z": own["y"],
        "f": own["f"].plain,
        "h": own["S"].plain,
    }


beams = r"""
\theta: nums 3
i: range 1 3
D_i = 1+\theta_i^2/2
H_i = \begin{pmatrix}\cos\theta_i&\sin\theta_i\end{pmatrix}
"""


perfect = r"""
H: any 2 3
\Psi: cov 3
F = H\Psi H^T
p = \Psi-\Psi H^T(H\Psi H^T)^{-1}H\Psi
"""


no_prior = r"""
H: any 4 3
D_n: cov 4
\nu, a: any 4
\lambda: any 3
\Psi: cov 3
z = \lambda+(H^TD_n^{-1}H)^{-1}H^TD_n^{-1}\nu
F = HH^T+D_n
"""


tangents = r"""
z: in .2 .4
e: in .2 .3
p: in .1 .2
f(x) = \sin x
S(x) = \sin x
g(x) = p
\xi = 1
\Phi = \cos z
H = \cos z
\lambda = z
x = z+e
"x_{k+1}" = \sin(z+e)+p
keep: \Phi, e, g, \xi, f, x_{k+1}, S, H, \lambda, z, x
"""


across = r"""
r: in 4 5
t: in 3 4
\sigma_t: in 1 2
\sigma_r = \sigma_t^2/(2r)
"""


LETTERS = (course, western, beams, perfect, no_prior, tangents, across)
SAID = {
    DEFINITION: [r"x_{k+1}=f_k(x_k)+g_k(x_k)\,\xi_k", "y_k=S_k(x_k)+n_k", "x=z+e"],
    NOTATION: [
        r"\Phi",
        "H",
        "{p^{-1}}",
        r"{\frac{\partial J}{\partial x}}",
        r"{-\frac{\partial^2J}{\partial x^2}}",
        r"{\textstyle\sum_i\frac{\partial^2S_i}{\partial x^2}\bigl(D_n^{-1}\nu\bigr)_i}",
        "g_{k-1}=g_{k-1}(z_{k-1})",
    ],
    CONDITION: [r"\Psi^{-1}=0", "D_n^{-1}=0"],
}
EQUALS = {
    r"\bigl(\Psi^{-1}+H^TD_n^{-1}H\bigr)\bigl(\Psi-\Psi H^TF^{-1}H\Psi\bigr)": "I",
    r"\bigl(\Psi-\Psi H^TF^{-1}H\Psi\bigr)H^TD_n^{-1}": r"\Psi H^TF^{-1}",
    "p_k": r"\Psi_k-K_kH_k\Psi_k",
    "K_k": "p_kH_k^TD_n^{-1}",
    r"\det\textstyle\sum_iH_i^TH_i/D_i": r"\frac{\sin^2(\theta_1-\theta_2)}{D_1D_2}",
}
