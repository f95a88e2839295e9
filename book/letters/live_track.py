"""The letters of live-track.md: the package's filter, settled on a constant acceleration."""

import numpy as np
from gate.page import NOTATION

from kfcourse.laws import Gaussian
from kfcourse.linear import run, steady_state
from kfcourse.scenarios import pointer


def settled(rng):
    a, sigma_a, sigma, Delta = rng.uniform(1, 3), *rng.uniform(0.5, 2, 3)
    system = pointer.uniform_acceleration(Delta, sigma_a, sigma)
    t = Delta * np.arange(400)
    y = np.stack([a * t**2 / 2, 0 * t], axis=-1)[:, None]
    ahead = run(system, Gaussian(np.zeros(4), np.eye(4)), y).predicted
    gain = steady_state(system).gain
    F = (system.H @ ahead.cov[-1, 0] @ system.H.T + system.R)[0, 0]
    nu = y[-1, 0, 0] - ahead.mean[-1, 0, 0]
    names = {"a": a, r"\sigma_a": sigma_a, r"\sigma": sigma, r"\Delta": Delta}
    return names | {r"\nu": nu, "F": F, r"\alpha": gain[0, 0], r"\beta": Delta * gain[2, 0]}


LETTERS = (settled,)
SAID = {
    NOTATION: [
        r"\int_0^\infty e^{-st}\,w\,dt",
        r"\int_0^\infty w\,dt",
        r"\int_0^\infty t\,w\,dt",
        r"\dot w\left(\tfrac{3\pi}{4a}\right)",
        r"w\left(\tfrac{3\pi}{4a}\right)/w(0)",
    ],
}
