"""The letters of four-sensors.md: the steady covariance of a distance and a speed, by a solver of
the Riccati equation."""

import numpy as np
import scipy


def steady(rng):
    q, N, M = rng.uniform(0.5, 2, 3)
    P = scipy.linalg.solve_continuous_are(
        np.array([[0, 0], [1, 0]]), np.eye(2), np.diag([0, q]), np.diag([N, M])
    )
    variances = {"p_{ss}": P[0, 0], "p_{sV}": P[0, 1], "p_{VV}": P[1, 1]}
    return {"q": q, "N": N, "M": M, r"\rho": np.sqrt(q * N) / M} | variances


LETTERS = (steady,)
