"""The letters of before-measuring.md: a run of the Kalman filter; the same step with all noises scaled; a small index."""

import numpy as np
from gate.page import NOTATION
from gate.worlds import covariance, kalman_run

from kfcourse.filters.alphabeta import steady_beta
from kfcourse.filters.kalman import correct, predict
from kfcourse.laws import Gaussian
from kfcourse.linear.system import LinearSystem


def scaled(rng):
    """One step from Psi to Psi', with Q, R and Psi as they are and c times as large."""
    A, H, c = rng.normal(size=(3, 3)), rng.normal(size=(1, 3)), 2.7
    Psi, Q, R = covariance(rng, 3), covariance(rng, 3), covariance(rng, 1)

    def step(size):
        system = LinearSystem(A, H, size * Q, size * R)
        return predict(system, correct(system, Gaussian(np.zeros(3), size * Psi), np.zeros(1))).cov

    return {"c": c, r"\Psi'": step(1), r"\Psi'_c": step(c)}


def small_index(rng):
    """alpha = 1 - rho^2 without a difference of nearly equal numbers, at an index of 1e-18."""
    index = rng.uniform(1, 2) * 1e-18
    less = np.sqrt(index * (index + 8)) / 4 - index / 4  # 1 - rho
    return {r"\lim_{\Lambda\to0}": 1.0, r"\Lambda": index, r"\alpha": less * (2 - less)}


def steady(rng):
    """One axis under the random acceleration, step by step until nothing changes."""
    Delta, sigma, sigma_a = rng.uniform(0.5, 2, 3)
    A, H = np.array([[1, Delta], [0, 1]]), np.array([[1.0, 0.0]])
    push = sigma_a * np.array([[Delta**2 / 2], [Delta]])
    Psi = np.eye(2)
    for _ in range(2000):
        K = Psi @ H.T / (Psi[0, 0] + sigma**2)
        p = Psi - K @ H @ Psi
        Psi = A @ p @ A.T + push @ push.T
    alpha, beta = K[0, 0], K[1, 0] * Delta
    same = {r"\sigma_r": np.sqrt(p[0, 0]), r"\alpha(\Lambda)": alpha, r"\Lambda": sigma_a * Delta**2 / sigma}
    of_p = {"p_{11}": p[0, 0], "p_{12}": p[0, 1], "p_{22}": p[1, 1], r"\psi_{12}": Psi[0, 1]}
    return of_p | same | {r"\sigma": sigma, r"\sigma_a": sigma_a, r"\Delta": Delta, r"\alpha": alpha, r"\beta": beta}


def small_gains(rng):
    alpha = rng.uniform(0.05, 0.1)
    return {r"\alpha": alpha, r"\beta": steady_beta(alpha)}


LETTERS = (kalman_run, scaled, small_index, steady, small_gains)
SAID = {
    "a setting": ["Q=0"],
    NOTATION: [r"\Psi'_c", r"\psi'_{22}", r"\sigma_r", "p_{22}", r"p_{22}\big|_{\Lambda\to0}"],
}
EQUALS = {r"c\,\Psi'": r"\Psi'_c", r"\lim_{\Lambda\to0}\alpha\,/\sqrt{2\Lambda}": "1"}
