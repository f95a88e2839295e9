"""The letters of what-the-data-say.md: a level that wanders, its record's density at once, and one
round of EM by a dense law."""

import numpy as np
from gate.page import NOTATION, STATED
from gate.values import Indexed
from scipy.stats import multivariate_normal

from kfcourse.filters import kalman_filter
from kfcourse.linear.consistency import innovations
from kfcourse.montecarlo.experiment import predictions, run
from kfcourse.records import smooth
from kfcourse.symbolic.model import Model

N = 4


def wandering(rng):
    """The record's law is one normal law; the innovations are the package's."""
    q, r, d = rng.uniform(0.5, 2, 3)
    model = Model.define(
        "x + v",
        "x + w",
        prior={"mean": 0, "variance": d},
        state_noise={"variance": q},
        meter_noise={"variance": r},
    )
    filter_, y = kalman_filter(model), rng.normal(size=N + 1)
    at = np.arange(N + 1)
    states = d + q * np.minimum(at[:, None], at)
    law = states + r * np.eye(N + 1)
    nu, F = innovations(filter_.structure.measure, predictions(filter_, y), y[:, None, None])
    log_density = multivariate_normal(np.zeros(N + 1), law).logpdf(y)
    gain = states @ np.linalg.inv(law)
    z, p = gain @ y, states - gain @ states
    back, own = smooth(filter_, y), run(filter_, y).cov.ravel()
    expected = np.mean(np.diff(z) ** 2 + np.diag(p)[1:] + np.diag(p)[:-1] - 2 * np.diag(p, 1))
    letters = {
        r"\ln L": log_density,
        r"\nu": Indexed(nu.ravel()),
        "F": Indexed(F.ravel()),
        "q": expected,
        "N": N,
    }
    return letters | {
        r"\bar z": Indexed(back.mean.ravel()),
        r"\bar p": Indexed(back.cov.ravel()),
        "S": Indexed(own / (own + q)),
        "k": range(N + 1),
    }


whittle = r"""
q, r: pos
N = 7
\omega: in 1 2
w(x) = 2(1-\cos(x))
S(x) = q+rw(x)          # of the differences, whose covariances are -r, q + 2r, -r
I_{qq} = N\int_0^{2\pi}1/S(x)^2dx/(4\pi)
I_{qr} = N\int_0^{2\pi}w(x)/S(x)^2dx/(4\pi)
I_{rr} = N\int_0^{2\pi}w(x)^2/S(x)^2dx/(4\pi)
\bar s_r = \int_0^{2\pi}w(x)/S(x)dx/(2\pi)
"\partial\ln S/\partial q" = 1/S(\omega)
"\partial\ln S/\partial r" = w(\omega)/S(\omega)
a = q^2+4qr
forget: w
"""


def rounds(rng, r_of_m=0.5):
    """Rounds of EM for independent states, each the mean of their squares over a record whose mean
    square is m."""
    y = rng.normal(size=5)
    m = float(np.mean(y**2))
    r = r_of_m * m

    def after(q):
        gain = q / (q + r)
        return float(np.mean((gain * y) ** 2 + (1 - gain) * q))

    q = [m]
    for _ in range(20_001):
        q.append(after(q[-1]))
    return {
        "m": m,
        "r": r,
        "K": q[-1] / (q[-1] + r),
        "q": Indexed(q, q[-1]),
        "q'": after(q[-1]),
        "j": range(20_000, 20_001),
    }


def quiet_rounds(rng):
    return rounds(rng, 2)


def edge_rounds(rng):
    return rounds(rng, 1)


seen_states = r"""
q, r: pos
N = 9
x: nodes 0 q
I_\text{states} = N\mathsf M(x^2/q^2-1/q)^2/4
s = q+r
x: nodes 0 s
I_\text{record} = N\mathsf M(x^2/s^2-1/s)^2/4
keep: q, r, N, I_\text{states}, I_\text{record}
"""


LETTERS = (wandering, whittle, rounds, quiet_rounds, edge_rounds, seen_states)
SAID = {
    STATED: [r"p(y_0,\dots,y_N)=\prod_kp(y_k\mid y_0,\dots,y_{k-1})"],
    NOTATION: [r"\ln p(y_0)+\ln p(y_1\mid y_0)", r"\ln p(y_0,y_1)", r"\mathsf M r_k^2"],
}
EQUALS = {
    "N/(2q^2)": r"I_\text{states}",
    r"N/\bigl(2(q+r)^2\bigr)": r"I_\text{record}",
    r"(1-q/\sqrt a)/r": r"\bar s_r",
}
