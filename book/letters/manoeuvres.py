"""The letters of manoeuvres.md: three modes with a joint table of probabilities; a place as a radar measures it."""

import numpy as np
from gate.page import CONDITION, DEFINITION, NOTATION
from gate.values import Indexed, Of
from gate.worlds import column, covariance
from scipy.stats import multivariate_normal

from kfcourse.scenarios.radar import spherical

M, N = 3, 2


def modes(rng):
    """One cycle of three modes: L by SciPy, moments of the mixture as M(x x^T) - m m^T."""
    z, p = rng.normal(size=(M, N)), np.array([covariance(rng, N) for _ in range(M)])
    h, F, y = rng.normal(size=(M, N)), np.array([covariance(rng, N) for _ in range(M)]), rng.normal(size=N)
    L = np.array([multivariate_normal(one, cov).pdf(y) for one, cov in zip(h, F, strict=True)])
    c = rng.dirichlet(np.ones(M))
    joint = c * L
    mu = joint / np.add.reduce(joint)
    mean = np.average(z, axis=0, weights=mu)
    square = np.average(p + np.einsum("ia,ib->iab", z, z), axis=0, weights=mu)
    return {
        "i": range(M), "j": range(M), "L": Indexed(L), "c": Indexed(c), r"\mu": Indexed(mu), "y_k": column(y),
        "h^j": Of(lambda j: column(h[j]), "j"), "F^j": Of(lambda j: F[j], "j"),
        "z^j": Of(lambda j: column(z[j]), "j"), "p^j": Of(lambda j: p[j], "j"),
        "z": column(mean), "p": square - np.outer(mean, mean),
    }  # fmt: skip


def mixing(rng):
    """The joint table of the modes of two steps."""
    pi, mu = rng.dirichlet(np.ones(M), size=M), rng.dirichlet(np.ones(M))
    table = np.diag(mu) @ pi
    c = np.ones(M) @ table
    backwards = table @ np.diag(1 / c)
    return {
        "i": range(M), "j": range(M), r"\pi": Indexed(pi.tolist()), r"\mu_{i\mid j}": Of(lambda i, j: backwards[i, j], "i", "j"),
        r"\mu": Indexed(mu), "c": Indexed(c),
    }  # fmt: skip


def place(rng):
    x = rng.normal(size=3)
    r, phi, epsilon = spherical(x)
    return dict(zip((r"r_x", r"r_y", r"r_z", "r", r"\varphi", r"\epsilon"), (*x, r, phi, epsilon), strict=True))


def two_modes(rng):
    """The joint table of two modes, counted from one."""
    pi, mu = rng.dirichlet(np.ones(2), size=2), rng.dirichlet(np.ones(2))
    table = np.diag(mu) @ pi
    c = np.ones(2) @ table
    one = {f"{name}_{i}": values[i - 1] for name, values in ((r"\mu", mu), ("c", c)) for i in (1, 2)}
    backwards = {rf"\mu_{{1\mid{j}}}": table[0, j - 1] / c[j - 1] for j in (1, 2)}
    return one | backwards | {rf"\pi_{{{i}{i}}}": pi[i - 1, i - 1] for i in (1, 2)}


def turned(rng, middle=False):
    """A velocity turned by an acceleration across it: that of the step's beginning, or of its middle."""
    v, J = column(rng.normal(size=2)), np.array([[0.0, -1], [1, 0]])
    omega, T = rng.uniform(0.5, 1), rng.uniform(0.2, 0.3)
    half = np.eye(2) - omega * T / 2 * J
    after = np.linalg.solve(half, half.T @ v) if middle else v + omega * T * J @ v
    sizes = {"|v|": np.hypot(*v.ravel()), "|v'|": np.hypot(*after.ravel())}
    product = {r"(v'-v)\cdot(v'+v)": ((after - v).T @ (after + v)).item()}
    return sizes | product | {"v": v, "v'": after, "J": J, r"\omega": omega, "T": T}


def turned_in_the_middle(rng):
    return turned(rng, middle=True)


LETTERS = (modes, mixing, two_modes, place, turned, turned_in_the_middle)
SAID = {
    "a setting": ["L_j=1"],
    NOTATION: [r"\mu_{i|j}(k-1|k-1)", "r_x", "r_y", "r_z", r"\mu_{1\mid1}-\mu_{1\mid2}"],
    "a series": [r"\frac{\sin\eta}{\eta}-\frac{\eta^4}{120}+\dots"],
    CONDITION: [r"\pi_{11}+\pi_{22}=1"],
    DEFINITION: [r"\Theta=JpJ^T+Q"],
}
EQUALS = {
    r"\pi_{ij}\mu_i/c_j": r"\mu_{i\mid j}",
    r"r\cos(\epsilon)\cos(\varphi)": "r_x",
    r"r\cos(\epsilon)\sin(\varphi)": "r_y",
    r"r\sin(\epsilon)": "r_z",
}
