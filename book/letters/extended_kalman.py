"""The letters of extended-kalman.md: a run of the package's extended filter, and the same filter in Western letters."""

import numpy as np
from gate.page import CONDITION, DEFINITION, NOTATION
from gate.values import Indexed, Of
from gate.worlds import BENT_LATER, covariance, extended_run, given
from scipy.stats import multivariate_normal


def course(rng):
    found = extended_run(rng, BENT_LATER)
    x, lam, Psi = rng.normal(size=(3, 1)), found[r"\lambda"].plain, found[r"\Psi"].plain
    y, S, D_n = found["y"].plain, found["S"].plain, found["D_n"]

    def log_density(off, cov):
        """Of a normal law, without its constant."""
        law = multivariate_normal(cov=cov)
        return law.logpdf(off.ravel()) - law.logpdf(np.zeros(len(off)))

    def J(x):
        return log_density(x - lam, Psi) + log_density(y - S(x), D_n)

    return found | {"x": x, "J": J, "F": found["H"].plain @ Psi @ found["H"].plain.T + D_n}


def western(rng):
    own = extended_run(rng)
    x, P = given(own[r"\lambda"], own["z"]), given(own[r"\Psi"], own["p"])
    g, D_xi, H = own["g"].values, own[r"D_\xi"], own["H"].values
    S = [slope_ @ cov @ slope_.T + own["D_n"] for slope_, cov in zip(H, own[r"\Psi"].values, strict=True)]
    return {
        r"\hat x": x,
        "P": P,
        "K": own["K"],
        "H": own["H"],
        "F": own[r"\Phi"],
        "I": own["I"],
        "R": own["D_n"],
        "k": own["k"],
        "Q": Of(lambda k: g[k] @ D_xi @ g[k].T, "k"),
        "S": Indexed(S),
        "v": own[r"\nu"],
        "z": own["y"],
        "f": own["f"].plain,
        "h": own["S"].plain,
    }


def beams(rng):
    """Two radars that see a body under the angles theta, each with its own variance."""
    angles, D = rng.uniform(0, np.pi, size=3), rng.uniform(1, 2, size=3)
    H = [np.array([[np.cos(one), np.sin(one)]]) for one in angles]
    return {r"\theta": Indexed(angles), "H": Indexed(H), "D": Indexed(D), "i": range(1, 3)}


def perfect(rng):
    """Without noise of the meter; the best linear estimate by a solver, not by an inverse."""
    H, Psi = rng.normal(size=(2, 3)), covariance(rng, 3)
    F = H @ Psi @ H.T
    return {"H": H, r"\Psi": Psi, "F": F, "p": Psi - Psi @ H.T @ np.linalg.solve(F, H @ Psi)}


def no_prior(rng):
    """Weighted least squares, and what a meter says that has no part in it."""
    H, D, nu, lam = rng.normal(size=(4, 3)), covariance(rng, 4), rng.normal(size=(4, 1)), rng.normal(size=(3, 1))
    white = np.linalg.inv(np.linalg.cholesky(D))
    z = lam + np.linalg.lstsq(white @ H, white @ nu, rcond=None)[0]
    a = rng.normal(size=(4, 1))
    return {"H": H, "D_n": D, r"\nu": nu, r"\lambda": lam, "z": z, r"\Psi": covariance(rng, 3), "a": a, "F": H @ H.T + D}


def tangents(rng):
    """One component: a sine for f and S, near the place of its tangent."""
    at, off, p = rng.uniform(0.2, 0.4), rng.uniform(0.2, 0.3), rng.uniform(0.1, 0.2)
    kept = {r"\Phi": np.cos(at), "e": off, "g": lambda z: p, r"\xi": 1.0, "f": np.sin, "x_{k+1}": np.sin(at + off) + p}
    return kept | {"S": np.sin, "H": np.cos(at), r"\lambda": at, "z": at, "x": at + off}


def across(rng):
    """A body beside the line of sight; the deviation at which the bend is as large as the error of the range."""
    r, t, sigma_t = rng.uniform(4, 5), rng.uniform(3, 4), rng.uniform(1, 2)
    return {"r": r, "t": t, r"\sigma_t": sigma_t, r"\sigma_r": sigma_t**2 / (2 * r)}


LETTERS = (course, western, beams, perfect, no_prior, tangents, across)
SAID = {
    DEFINITION: [r"x_{k+1}=f_k(x_k)+g_k(x_k)\,\xi_k", "y_k=S_k(x_k)+n_k", "x=z+e"],
    NOTATION: [
        r"\Phi",
        "H",
        "{p^{-1}}",
        r"{\frac{\partial J}{\partial x}}",
        r"{-\frac{\partial^2J}{\partial x^2}}",
        r"{\textstyle\sum_i\frac{\partial^2S_i}{\partial x^2}\bigl(D_n^{-1}\nu\bigr)_i}",
        "g_{k-1}=g_{k-1}(z_{k-1})",
    ],
    CONDITION: [r"\Psi^{-1}=0", "D_n^{-1}=0"],
}
EQUALS = {
    r"\bigl(\Psi^{-1}+H^TD_n^{-1}H\bigr)\bigl(\Psi-\Psi H^TF^{-1}H\Psi\bigr)": "I",
    r"\bigl(\Psi-\Psi H^TF^{-1}H\Psi\bigr)H^TD_n^{-1}": r"\Psi H^TF^{-1}",
    "p_k": r"\Psi_k-K_kH_k\Psi_k",
    "K_k": "p_kH_k^TD_n^{-1}",
    r"\det\textstyle\sum_iH_i^TH_i/D_i": r"\frac{\sin^2(\theta_1-\theta_2)}{D_1D_2}",
}
