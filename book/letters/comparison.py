"""The letters of comparison.md: a state, its posterior mean and another estimate, with finitely many measurements."""

import numpy as np

from kfcourse.pages.reader import Indexed, Operator


def exact(rng):
    """The posterior mean is the mean of the states that share a measurement; any other function of it is an estimate."""
    mass, x = rng.dirichlet(np.ones(12)), rng.normal(size=12)
    seen = np.repeat(np.arange(3), 4)
    best = np.array([np.average(x[seen == one], weights=mass[seen == one]) for one in seen])
    other = rng.normal(size=3)[seen]
    return {
        "x": Indexed([x]),
        "z": Indexed([other]),
        r"z_k^{\text{exact}}": best,
        "k": range(1),
        r"\mathsf M": Operator(lambda values: float(mass @ values)),
    }


LETTERS = (exact,)
SAID = {}
LITERALS = ("20",)
