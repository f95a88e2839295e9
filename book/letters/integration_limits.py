"""The letters of integration-limits.md: the package's covariance analysis, and its filter along a constant bias."""

import numpy as np
from gate.page import NOTATION
from gate.values import Indexed
from gate.worlds import K_RANGE

from kfcourse.laws import Gaussian
from kfcourse.linear import LinearSystem, covariances, run


def analysis(rng):
    """True variances of a filter that believes in another drift; the mean of its error under a bias alone."""
    xi, n, beta, p0 = *rng.uniform(0.3, 1, size=3), 1.5
    believed = LinearSystem([[1.0]], [[-1.0]], [[(2 * xi) ** 2]], [[n**2]])
    true = LinearSystem([[1.0]], [[-1.0]], [[xi**2]], [[n**2]])
    gains = covariances(believed, [[p0]], 5).gains
    variances = covariances(true, [[p0]], 5, gains).posterior[:, 0, 0]
    biased = run(believed, Gaussian(np.zeros(1), np.array([[p0]])), np.full((5, 1, 1), beta))
    return {
        r"\bar p": Indexed(variances), "K": Indexed(gains[:, 0, 0]), "m": Indexed(-biased.posterior.mean[:, 0, 0]), "k": K_RANGE,
        r"\sigma_\xi": xi, r"\sigma_n": n, r"\beta": beta,
    }  # fmt: skip


def slow_drift(rng):
    """True and best variance of a filter that believes in c times a drift of 1e-9."""
    xi, n, c = 1e-9, rng.uniform(1, 2), rng.uniform(2, 3)
    size = c * xi / n
    K = -(size * np.sqrt(size**2 + 4) - size**2) / 2  # Psi = K^2 n^2 / (1 + K) in the steady state
    true = (K**2 * n**2 + (1 + K) ** 2 * xi**2) / (-K * (2 + K))
    return {r"\lim_{\sigma_\xi\to0}": 1.0, r"\bar p": true, "p": np.roots([1, xi**2, -((xi * n) ** 2)]).max(), "c": c}


LETTERS = (analysis, slow_drift)
SAID = {
    "a setting": ["K_k=0"],
    NOTATION: [r"\text{mean innovation}"],
}
EQUALS = {r"{\lim_{\sigma_\xi\to0}\bar p/p}": r"\frac12(c+1/c)"}
