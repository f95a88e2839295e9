"""The letters of particles.md: the share of particles that counts after one measurement; names are checked beside them."""

import numpy as np
from gate.page import NOTATION


def weighted(rng):
    """Means of the weight and of its square over the prior, on a fine grid."""
    r, y = rng.uniform(0.2, 1), rng.normal()
    x = np.linspace(-12, 12, 20_001)
    prior, weight = np.exp(-(x**2) / 2), np.exp(-((y - x) ** 2) / (2 * r))
    share = (prior @ weight) ** 2 / (prior @ weight**2) / prior.sum()
    return {r"\lim_{N\to\infty}\frac{N_e}N": share, "r": r, "y": y}


LETTERS = (weighted,)
SAID = {
    NOTATION: [r"\mathsf M_q\left[x^2\,\tfrac{p}{q}\right]", r"\frac{N_e}{N}\to\frac{(\mathsf M w)^2}{\mathsf M w^2}"],
}
