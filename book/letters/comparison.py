"""The letters of comparison.md: a state, its posterior mean and another estimate, with finitely
many measurements."""

import numpy as np
from gate.values import Indexed, Operator

from kfcourse.filters import aof
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import linearised


def exact(rng):
    """The posterior mean is the mean of the states that share a measurement; any other function of
    it is an estimate."""
    mass, x = rng.dirichlet(np.ones(12)), rng.normal(size=12)
    seen = np.repeat(np.arange(3), 4)
    best = np.array([np.average(x[seen == one], weights=mass[seen == one]) for one in seen])
    other = rng.normal(size=3)[seen]
    return {
        "x": Indexed([x]),
        "z": Indexed([other]),
        r"z_k^{\text{exact}}": best,
        "D": Indexed([mass @ (x - other) ** 2]),
        "k": range(1),
        r"\mathsf M": Operator(lambda values: float(mass @ values)),
    }


def against_the_bound(rng):
    """A filter off the exact one by what its measurement says; the exact one's error has two values
    for each."""
    mass = np.repeat(rng.dirichlet(np.ones(3)), 2) / 2
    p, delta = np.repeat(rng.uniform(0.5, 2, size=3), 2), np.repeat(rng.normal(size=3), 2)
    epsilon = np.sqrt(p) * np.tile([1, -1], 3)

    def mean(values):
        return float(mass @ values)

    means = {
        r"\mathsf M": Operator(mean),
        r"\mathsf D": Operator(lambda values: mean((values - mean(values)) ** 2)),
    }
    return means | {"p": p, r"\delta": delta, r"\epsilon": epsilon, "e": epsilon + delta}


other_law = r"""
s = 2
again:                  # where the mean square has no slope by the deviation of the law to draw from
s = \sqrt{\int_0^\infty x^{10}e^{-x^2(1-1/(2s^2))}dx/\int_0^\infty x^8e^{-x^2(1-1/(2s^2))}dx}
then:
"\int\varphi^2x^8/\psi\,dx" = 2s\int_0^\infty x^8e^{-x^2(1-1/(2s^2))}dx/\sqrt{2\pi}
keep: s, \int\varphi^2x^8/\psi\,dx
"""


def linearised_start(rng):
    """The linearised AOF of the lab's model at its first measurement."""
    g, e = rng.uniform(0.5, 2, size=2)
    one = aof(linearised(Model.define("0.9*x + e*x*v", "g*x + 0.3*x**2*w", {"g": g, "e": e})))
    y = rng.normal()
    state = one.step(one.init(1), np.array([[y]]))
    z, Psi = state.posterior.mean.item(), state.predicted.cov.item()
    return {"g": g, "e": e, "y": Indexed([y]), "z": Indexed([z]), r"\Psi": Indexed([1.0, Psi])}


LETTERS = (exact, against_the_bound, other_law, linearised_start)
