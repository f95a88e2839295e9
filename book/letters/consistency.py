"""The letters of consistency.md: a run of the package's Kalman filter, in both notations."""

import numpy as np

from kfcourse.pages.letters import kalman_run
from kfcourse.pages.reader import Indexed
from kfcourse.pages.relations import CONDITION, NOTATION


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


LETTERS = (course, western)
SAID = {
    r"\chi^2_{N\dim x}/N": NOTATION,
    "Q/R": NOTATION,
    r"H\Phi K>0": CONDITION,
    r"\mathsf P(e^Tp^{-1}e<\rho^2)": NOTATION,
    r"\mathsf M(e^Tp^{-1}e)\big|_{P=p}": NOTATION,
    r"\mathsf M(\nu_{k+1}\nu_k)": NOTATION,
}
SAID |= dict.fromkeys(
    (
        r"\mathsf{M}(e^Tp^{-1}e)",
        r"\operatorname{tr}(p^{-1}P)",
    ),
    NOTATION,
)
