"""The letters of what-the-data-say.md: a level that wanders, its record's density at once, and one round of EM by a dense law."""

import numpy as np
from scipy.stats import multivariate_normal

from kfcourse.filters import kalman_filter
from kfcourse.linear.consistency import innovations
from kfcourse.montecarlo.experiment import predictions, run
from kfcourse.pages.reader import Indexed
from kfcourse.pages.relations import NOTATION, STATED
from kfcourse.records import smooth
from kfcourse.symbolic.model import Model

N = 4


def wandering(rng):
    """The record's law is one normal law; the innovations are the package's."""
    q, r, d = rng.uniform(0.5, 2, 3)
    model = Model.define(
        "x + v", "x + w", prior={"mean": 0, "variance": d}, state_noise={"variance": q}, meter_noise={"variance": r}
    )
    one, y = kalman_filter(model), rng.normal(size=N + 1)
    at = np.arange(N + 1)
    states = d + q * np.minimum(at[:, None], at)
    law = states + r * np.eye(N + 1)
    nu, F = innovations(one.structure.measure, predictions(one, y), y[:, None, None])
    log_density = multivariate_normal(np.zeros(N + 1), law).logpdf(y)
    gain = states @ np.linalg.inv(law)
    z, p = gain @ y, states - gain @ states
    back, own = smooth(one, y), run(one, y).cov.ravel()
    expected = np.mean(np.diff(z) ** 2 + np.diag(p)[1:] + np.diag(p)[:-1] - 2 * np.diag(p, 1))
    letters = {r"\ln L": log_density, r"\nu": Indexed(nu.ravel()), "F": Indexed(F.ravel()), "q": expected, "N": N}
    return letters | {
        r"\bar z": Indexed(back.mean.ravel()),
        r"\bar p": Indexed(back.cov.ravel()),
        "S": Indexed(own / (own + q)),
        "k": range(N + 1),
    }


def whittle(rng):
    """The information of N differences about their spectrum, by its definition."""
    q, r, count = *rng.uniform(0.5, 2, 2), 7
    wave = 2 * (1 - np.cos(2 * np.pi * np.arange(4096) / 4096))
    slopes = np.array([np.ones_like(wave), wave]) / (q + r * wave)  # of ln S, by q and r
    (qq, qr), (_, rr) = count / 2 * slopes @ slopes.T / len(wave)
    return {"I_{qq}": qq, "I_{qr}": qr, "I_{rr}": rr, "N": count, "q": q, "r": r, "a": q**2 + 4 * q * r}


LETTERS = (wandering, whittle)
SAID = {
    r"p(y_0,\dots,y_N)=\prod_kp(y_k\mid y_0,\dots,y_{k-1})": STATED,
    r"\ln p(y_0)+\ln p(y_1\mid y_0)": NOTATION,
    r"\ln p(y_0,y_1)": NOTATION,
    r"\mathsf M r_k^2": NOTATION,
}
