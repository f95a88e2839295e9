"""The letters of what-the-data-say.md: a level that wanders, its record's density at once, and one round of EM by a dense law."""

import numpy as np
from gate.page import NOTATION, STATED
from gate.values import Indexed, bell
from gate.worlds import normal_nodes
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
    at, lags = rng.uniform(1, 2), np.array([-1, 0, 1])  # of the differences, whose covariances are -r, q + 2r, -r
    S = {"S": lambda omega: np.sum([-r, q + 2 * r, -r] * np.cos(lags * omega)), r"\omega": at}
    of_S = {rf"\partial\ln S/\partial {one}": slope / S["S"](at) for one, slope in (("q", 1), ("r", 2 - 2 * np.cos(at)))}
    of_S[r"\bar s_r"] = slopes[1].mean()
    return S | of_S | {"I_{qq}": qq, "I_{qr}": qr, "I_{rr}": rr, "N": count, "q": q, "r": r, "a": q**2 + 4 * q * r}


def rounds(rng, r_of_m=0.5):
    """Rounds of EM for independent states, each the mean of their squares over a record whose mean square is m."""
    y = rng.normal(size=5)
    m = float(np.mean(y**2))
    r = r_of_m * m

    def after(q):
        gain = q / (q + r)
        return float(np.mean((gain * y) ** 2 + (1 - gain) * q))

    q = [m]
    for _ in range(20_001):
        q.append(after(q[-1]))
    return {"m": m, "r": r, "K": q[-1] / (q[-1] + r), "q": Indexed(q, q[-1]), "q'": after(q[-1]), "j": range(20_000, 20_001)}


def quiet_rounds(rng):
    return rounds(rng, 2)


def edge_rounds(rng):
    return rounds(rng, 1)


def seen_states(rng):
    """The information about q by the mean square of the score, of N states and of N measurements."""
    q, r, count = *rng.uniform(0.5, 2, size=2), 9

    def information(variance):
        x, mean = normal_nodes(0, variance)
        score = np.log(bell(x, 0, variance + 1e-20j)).imag / 1e-20
        return count * mean(score**2)

    return {"q": q, "r": r, "N": count, r"I_\text{states}": information(q), r"I_\text{record}": information(q + r)}


LETTERS = (wandering, whittle, rounds, quiet_rounds, edge_rounds, seen_states)
SAID = {
    STATED: [r"p(y_0,\dots,y_N)=\prod_kp(y_k\mid y_0,\dots,y_{k-1})"],
    NOTATION: [r"\ln p(y_0)+\ln p(y_1\mid y_0)", r"\ln p(y_0,y_1)", r"\mathsf M r_k^2"],
}
EQUALS = {"N/(2q^2)": r"I_\text{states}", r"N/\bigl(2(q+r)^2\bigr)": r"I_\text{record}", r"(1-q/\sqrt a)/r": r"\bar s_r"}
