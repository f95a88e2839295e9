"""The letters of looking-back.md: a run of the package's linear filter, and its smoother by one regression on all of it."""

import numpy as np

from kfcourse.laws import Gaussian
from kfcourse.linear import LinearSystem, run, smooth
from kfcourse.pages.letters import K_RANGE, column, covariance
from kfcourse.pages.reader import Indexed
from kfcourse.pages.relations import NOTATION

STEPS = 6


def course(rng):
    states, seen = 3, 2
    A, H = rng.normal(size=(states, states)), rng.normal(size=(seen, states))
    system = LinearSystem(A, H, covariance(rng, states), covariance(rng, seen))
    prior = Gaussian(rng.normal(size=states), covariance(rng, states))
    found = run(system, prior, rng.normal(size=(STEPS, 1, seen)))
    back = smooth(system, found)
    p, Psi = found.posterior.cov[:, 0], found.predicted.cov[:, 0]
    gains = [np.linalg.solve(Psi[k + 1], A @ p[k]).T for k in range(STEPS - 1)]

    def columns(means):
        return Indexed([column(mean) for mean in means[:, 0]])

    return {
        "z": columns(found.posterior.mean),
        "p": Indexed(p),
        r"\lambda": columns(found.predicted.mean),
        r"\Psi": Indexed(Psi),
        r"\bar z": columns(back.mean),
        r"\bar p": Indexed(back.cov[:, 0]),
        "S": Indexed(gains),
        "A": Indexed([A] * STEPS),
        "Q": Indexed([system.Q] * STEPS),
        "I": np.eye(states),
        "k": K_RANGE,
    }


LETTERS = (course,)
SAID = {
    r"\bar z=z": NOTATION,
    r"\bar p=p": NOTATION,
    r"\frac{\partial\mathcal N(x;z,p)}{\partial z}": NOTATION,
    r"\mathcal N(x;z,p)": NOTATION,
    r"\Delta t": NOTATION,
}
