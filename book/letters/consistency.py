"""The letters of consistency.md: a run of the package's Kalman filter, in both notations."""

import numpy as np
from gate.page import CONDITION, NOTATION
from gate.values import Indexed
from gate.worlds import kalman_run


def course(rng):
    """Whitened innovations by the eigenvectors of a root: any root will do for the words, one measurement has only one."""
    run = kalman_run(rng, seen=1)
    whitened = [nu / np.sqrt(F) for nu, F in zip(run[r"\nu"].values, run["F"].values, strict=True)]
    return run | {"s": Indexed(whitened)}


def western(rng):
    run = kalman_run(rng, seen=2)
    error = [rng.normal(size=(3, 1)) for _ in run["p"].values]
    nees = [(one.T @ np.linalg.solve(cov, one)).item() for one, cov in zip(error, run["p"].values, strict=True)]
    nis = [(one.T @ np.linalg.solve(cov, one)).item() for one, cov in zip(run[r"\nu"].values, run["F"].values, strict=True)]
    ours = {"P": Indexed(lambda k, _: run["p"].values[k]), r"\tilde x": Indexed(lambda k, _: error[k])}
    return ours | {r"\epsilon": Indexed(nees), r"\epsilon^\nu": Indexed(nis), r"\nu": run[r"\nu"], "S": run["F"], "k": run["k"]}


def constant_gain(rng):
    """A random walk under a gain: its errors step by step; the filter of that gain and of the right size by its recursion."""
    K, Q, R = rng.uniform(0.2, 0.8), *rng.uniform(0.5, 2, 2)
    P = 0.0
    for _ in range(2000):
        Psi = P + Q
        P = (1 - K) ** 2 * Psi + K**2 * R
    F, p_f = Psi + R, 1.0
    for _ in range(2000):  # the model R_f = (1 - K) F, Q_f = K^2 F has the gain K and innovations of the variance F
        p_f = 1 / (1 / (p_f + K**2 * F) + 1 / ((1 - K) * F))
    covariance = Psi - K * F  # of neighbouring innovations: of e and nu, less K times the variance of nu
    return {"K": K, "P": P, "F": F, "p_f": p_f, "c": covariance, r"\mathrm{NEES}": P / p_f}


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
