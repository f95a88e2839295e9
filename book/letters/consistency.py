"""The letters of consistency.md: a run of the package's Kalman filter, in both notations."""

import numpy as np
from gate.page import CONDITION, NOTATION
from gate.values import Indexed
from gate.worlds import kalman_run


def course(rng):
    """Whitened innovations by the eigenvectors of a root: any root will do for the words, one
    measurement has only one."""
    run = kalman_run(rng, seen=1)
    whitened = [nu / np.sqrt(F) for nu, F in zip(run[r"\nu"].values, run["F"].values, strict=True)]
    return run | {"s": Indexed(whitened)}


def western(rng):
    run = kalman_run(rng, seen=2)
    error = [rng.normal(size=(3, 1)) for _ in run["p"].values]
    nees = [
        (one.T @ np.linalg.solve(cov, one)).item()
        for one, cov in zip(error, run["p"].values, strict=True)
    ]
    nis = [
        (one.T @ np.linalg.solve(cov, one)).item()
        for one, cov in zip(run[r"\nu"].values, run["F"].values, strict=True)
    ]
    ours = {
        "P": Indexed(lambda k, _: run["p"].values[k]),
        r"\tilde x": Indexed(lambda k, _: error[k]),
    }
    return ours | {
        r"\epsilon": Indexed(nees),
        r"\epsilon^\nu": Indexed(nis),
        r"\nu": run[r"\nu"],
        "S": run["F"],
        "k": run["k"],
    }


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


LETTERS = (course, western, constant_gain)
SAID = {
    NOTATION: [
        r"\chi^2_{N\dim x}/N",
        "Q/R",
        r"\mathsf P(e^Tp^{-1}e<\rho^2)",
        r"\mathsf M(e^Tp^{-1}e)\big|_{P=p}",
        r"\mathsf M(\nu_{k+1}\nu_k)",
        r"\mathsf{M}(e^Tp^{-1}e)",
        r"\operatorname{tr}(p^{-1}P)",
    ],
    CONDITION: [r"H\Phi K>0"],
}
