"""The letters of models-that-jump.md: three modes with a joint table of probabilities, mixtures by their second moments."""

import numpy as np
from gate.page import NOTATION
from gate.values import Indexed, Of, Operator
from gate.worlds import column, covariance
from scipy.stats import multivariate_normal

M, N = 3, 2


def correcting(rng):
    """Probabilities by the joint density of mode and measurement, L by SciPy."""
    h, F, y = rng.normal(size=(M, N)), np.array([covariance(rng, N) for _ in range(M)]), rng.normal(size=N)
    z = rng.normal(size=(M, N))
    L = np.array([multivariate_normal(one, cov).pdf(y) for one, cov in zip(h, F, strict=True)])
    c = rng.dirichlet(np.ones(M))
    joint = np.diag(c) @ L
    mu = joint / np.add.reduce(joint)
    return {
        "i": range(M), "j": range(M), "L": Indexed(L), "c": Indexed(c), r"\mu": Indexed(mu), "y_k": column(y), "y": column(y),
        "h": Indexed([column(one) for one in h]), "F": Indexed(F),
        "h^j": Of(lambda j: column(h[j]), "j"), "F^j": Of(lambda j: F[j], "j"),
        "z^j": Of(lambda j: column(z[j]), "j"), "z": column(np.average(z, axis=0, weights=mu)),
    }  # fmt: skip


def predicting(rng):
    """The joint table of the modes of two steps; each mode's prediction as M(x x^T) - m m^T."""
    pi, mu = rng.dirichlet(np.ones(M), size=M), rng.dirichlet(np.ones(M))
    tau, Theta = rng.normal(size=(M, M, N)), np.array([[covariance(rng, N) for _ in range(M)] for _ in range(M)])
    table = np.diag(mu) @ pi
    c = np.ones(M) @ table
    w = table @ np.diag(1 / c)
    mean = np.einsum("ij,ija->ja", w, tau)
    square = np.einsum("ij,ijab->jab", w, Theta + np.einsum("ija,ijb->ijab", tau, tau))
    return {
        "i": range(M), "j": range(M), r"\pi": Indexed(pi.tolist()), r"\mu": Indexed(mu), "c": Indexed(c),
        "w": Indexed(w.tolist()),
        r"\tau^{ij}": Of(lambda i, j: column(tau[i, j]), "i", "j"), r"\Theta^{ij}": Of(lambda i, j: Theta[i, j], "i", "j"),
        r"\lambda^j": Of(lambda j: column(mean[j]), "j"),
        r"\Psi^j": Of(lambda j: square[j] - np.outer(mean[j], mean[j]), "j"),
    }  # fmt: skip


def remembering(rng):
    """Joint normal laws of x and zeta in each mode: M[x | zeta] by their precision, and the table of mode and zeta."""
    mean, cov = rng.normal(size=(M, N + 1)), np.array([covariance(rng, N + 1) for _ in range(M)])  # x, and zeta of N
    q, zeta = rng.dirichlet(np.ones(M)), rng.normal(size=N)
    precision = np.linalg.inv(cov)
    u = mean[:, 0] - np.einsum("ia,ia->i", precision[:, 0, 1:], zeta - mean[:, 1:]) / precision[:, 0, 0]
    Gamma = [one[:1, 1:] @ np.linalg.inv(one[1:, 1:]) for one in cov]
    L = np.array([multivariate_normal(m[1:], d[1:, 1:]).pdf(zeta) for m, d in zip(mean, cov, strict=True)])
    joint = np.diag(q) @ L
    return {
        "i": range(M), "j": range(M), "q": Indexed(q), "L": Indexed(L), r"\xi": Indexed(joint / np.add.reduce(joint)),
        r"\zeta": column(zeta),
        "u^i": Of(lambda i: u[i], "i"), r"\Gamma^i": Of(lambda i: Gamma[i], "i"),
        r"\chi^i": Of(lambda i: mean[i, :1] - Gamma[i] @ mean[i, 1:], "i"),
    }  # fmt: skip


def nearest(rng):
    """The mean square about m of a law with the mean mu and the variance s."""
    mass, x, m = rng.dirichlet(np.ones(4)), rng.normal(size=4), rng.normal()
    mu, d = mass @ x, rng.uniform(0.5, 2)
    entropy = {"d": d, r"\mathsf M_f\ln\mathcal N": mass @ multivariate_normal(m, d).logpdf(x)}
    return entropy | {
        r"\mathsf M_f": Operator(lambda values: float(mass @ values)),
        "x": x,
        "m": m,
        r"\mu": mu,
        "s": mass @ (x - mu) ** 2,
    }


def failed(rng):
    """What one innovation adds to the odds of a failed sensor."""
    F, nu = rng.uniform(0.5, 2, size=2), rng.normal()
    sound, failed = (multivariate_normal(0, one).logpdf(nu) for one in F)
    return {"F": Indexed(F), r"\nu": nu, r"\ell": failed - sound, r"\varrho": F[1] / F[0]}


LETTERS = (correcting, predicting, remembering, nearest, failed)
SAID = {
    NOTATION: [
        "x_{k+1}=a^{i_{k+1}}(x_k,v_k)",
        "y_k=b^{i_k}(x_k,w_k)",
        r"\lambda^{\text{before}}",
        r"\lambda^{\text{after}}",
        r"\Psi^{\text{before}}",
        r"\Psi^{\text{after}}",
    ],
}
