"""The letters of track-2d.md: a run of the package's filter with a known input; a lost sample; a
mean given measurements."""

import numpy as np
from gate.page import DEFINITION, NOTATION
from gate.values import Indexed, Operator
from gate.worlds import K_RANGE, column, covariance, shared_readings

from kfcourse.laws import Gaussian
from kfcourse.linear import run
from kfcourse.scenarios import pointer

DELTA, SIGMA, INTENSITY = 0.3, 1.3, 2.0


def _run(rng, lost=None):
    system = pointer.uniform_acceleration(DELTA, np.sqrt(INTENSITY / DELTA), SIGMA)
    y, u = rng.normal(size=(5, 1, 2)), rng.normal(size=(5, 1, 2))
    if lost is not None:
        y[lost] = np.nan
    laws = run(system, Gaussian(rng.normal(size=4), covariance(rng, 4)), y, u)
    (z, p), (lam, Psi) = (
        ([column(part[0]) for part in law.mean], [part[0] for part in law.cov])
        for law in (laws.posterior, laws.predicted)
    )
    return system, y, u, z, p, lam, Psi


def filtered(rng):
    system, y, u, z, p, lam, Psi = _run(rng)
    K = [part @ system.H.T @ np.linalg.inv(system.R) for part in p]
    F = [np.linalg.solve(np.eye(2) - system.H @ gain, system.R) for gain in K]
    nu = [
        np.linalg.lstsq(gain, after - before, rcond=None)[0]
        for gain, after, before in zip(K, z, lam, strict=True)
    ]
    rows = {"y": [column(part) for part in y], "u": [column(part) for part in u], "z": z, "p": p}
    rows |= {r"\lambda": lam, r"\Psi": Psi, "K": K, "F": F, r"\nu": nu}
    fixed = {name: getattr(system, name) for name in "ABHQR"}
    fixed |= {"I": np.eye(4), "S": INTENSITY, r"\Delta": DELTA, "k": K_RANGE}
    return fixed | {name: Indexed(values, values[2]) for name, values in rows.items()}


def sample_lost(rng):
    *_, z, p, lam, Psi = _run(rng, lost=2)
    return {"z": z[2], "p": p[2], r"\lambda": lam[2], r"\Psi": Psi[2]}


axes = r"""
\sigma = 1.3
I: eye 2
R = \sigma^2I
"""


def no_news(rng):
    """The mean of the states that share a measurement, and any other function of it."""
    mass, x, best, other = shared_readings(rng)
    mean = Operator(lambda values: float(mass @ values))
    return {"x": x, r"\lambda": best, r"\lambda'": other, r"\mathsf M": mean}


LETTERS = (filtered, sample_lost, axes, no_news)
SAID = {
    DEFINITION: [
        r"x_{k+1}=Ax_k+B\,(u_k+\xi_k)",
        "y_k=Hx_k+w_k",
        r"\xi_k\sim\mathcal N(0,\sigma_a^2I)",
        r"w_k\sim\mathcal N(0,R)",
        "y_i=|r-b_i|+w_i",
    ],
    NOTATION: [r"Q_{\rm const}", r"Q_{\rm white}", r"\sum_{i=0}^{j-1}(i+\tfrac{1}{2})^2"],
}
