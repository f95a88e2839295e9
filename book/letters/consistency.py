"""The letters of consistency.md: squares of errors and innovations, in both notations."""

import numpy as np
from gate.page import CONDITION, DEFINITION, NOTATION
from gate.worlds import covariance

course = r"""
k: range 4
F: list 4 pos
\nu: nums 4
s_k = \nu_k/\sqrt{F_k}
"""


western = r"""
k: range 4
p: list 4 cov 3
e: list 4 any 3
S: list 4 cov 2
\nu: list 4 any 2
\epsilon_k = \operatorname{tr}(p_k^{-1}e_ke_k^T)
\epsilon^\nu_k = \operatorname{tr}(S_k^{-1}\nu_k\nu_k^T)
"P_{k\mid k}" of k = p_k
"\tilde x_{k\mid k}" of k = e_k
"""


constant_gain = r"""
K: in .2 .8
Q, R: pos
P = Q
p_f = 1
again:
P = (1-K)^2(P+Q)+K^2R
F = P+Q+R
p_f = 1/(1/(p_f+K^2F)+1/((1-K)F))   # R_f = (1 - K) F, Q_f = K^2 F has the gain K and innovations of the variance F
then:
c = P+Q-KF
\mathrm{NEES} = P/p_f
keep: K, P, F, p_f, c, \mathrm{NEES}
"""


def spread(cov):
    """Points with equal weights whose mean is zero and whose covariance is `cov`."""
    root = np.linalg.cholesky(len(cov) * cov)
    return [sign * root[:, [i]] for i in range(len(cov)) for sign in (1, -1)]


def of_points(rng):
    """Means over points that have the covariances of the normal laws."""
    p, P, K, H = covariance(rng, 2), covariance(rng, 3), rng.normal(size=(2, 1)), rng.normal(size=2)
    Phi, mixed = rng.normal(size=(2, 2)), covariance(rng, 2)
    H = H[None]
    joint = np.block([[P[:2, :2], np.zeros((2, 1))], [np.zeros((1, 2)), P[2:, 2:]]])
    pairs = []
    for point in spread(joint):
        e, n = point[:2], point[2:]
        nu = H @ e + n
        pairs.append(((H @ Phi @ (e - K @ nu)) * nu, nu * nu, e * nu))
    product, F, gain = (np.mean(values, axis=0) for values in zip(*pairs, strict=True))
    nees = [e.T @ np.linalg.solve(p, e) for e in spread(mixed)]
    traces = [np.trace(np.linalg.solve(p, e @ e.T)) for e in spread(mixed)]
    means = {
        r"\mathsf M(e^Tp^{-1}e)": np.mean(nees),
        r"\mathsf M\operatorname{tr}(p^{-1}ee^T)": np.mean(traces),
        r"\mathsf M(\nu_{k+1}\nu_k)": product.item(),
    }
    known = {"p": p, "P": mixed, "H": H, r"\Phi": Phi, "K": K, "F": F.item(), "K_*": gain / F}
    return known | means | {r"\operatorname{tr}": np.trace}


LETTERS = (course, western, constant_gain, of_points)
SAID = {
    NOTATION: [
        r"\chi^2_{N\dim x}/N",
        "Q/R",
        r"\mathsf P(e^Tp^{-1}e<\rho^2)",
        r"\operatorname{tr}(p^{-1}P)",
    ],
    DEFINITION: [
        r"x_{k+1}=0.95\,x_k+0.3\,v_k",
        "y_k=x_k+w_k",
        r"x_0\sim\mathcal N\Bigl(0,\frac{0.3^2}{1-0.95^2}\Bigr)",
    ],
    CONDITION: [r"H\Phi K>0"],
}
