"""The letters of checking-exact.md: point masses as a plain program, for a noise that enters linearly."""

import numpy as np
from gate.page import CONDITION, DEFINITION, NOTATION
from gate.values import Of, bell


def masses(rng):
    """One step of variant 53; new nodes x_i with masses mu_i from old ones, x_j and mu_j."""
    old, mass, c, e = rng.normal(size=4), rng.dirichlet(np.ones(4)), 0.9, 0.5
    t, middle, scale, y = np.linspace(-1, 1, 5), rng.normal(), 0.7, rng.normal()
    new = middle + scale * (np.exp(t) - np.exp(-t)) / 2

    def ahead(at):
        return sum(one * bell(at, c * node, (e * node) ** 2 * 0.8) for one, node in zip(mass, old, strict=True))

    def likelihood(at):
        return bell(y, at, 0.1 + 0.2 * at**2)

    joint = np.array([ahead(at) * likelihood(at) for at in new])
    after = joint * scale * (np.exp(t) + np.exp(-t)) / 2
    after = after / after.sum()
    nodes = {
        "x_i": Of(lambda i: new[i], "i"),
        r"\mu_i": Of(lambda i: after[i], "i"),
        "t_i": Of(lambda i: t[i], "i"),
        "x_j": Of(lambda j: old[j], "j"),
        r"\mu_j": Of(lambda j: mass[j], "j"),
        "x": Of(lambda k: new[k], "k"),
        r"p(x\mid y_{0:k})": Of(lambda k: joint[k], "k"),
        r"p(y_k\mid x)": Of(lambda k: likelihood(new[k]), "k"),
        r"p(y_k\mid x_i)": Of(lambda i: likelihood(new[i]), "i"),
    }
    model = {"a": lambda x, v=0: c * x + e * x * v, "a_v": lambda x: e * x, "D_v": 0.8, "m_v": 0.0, r"\pi": ahead}
    found = {"z_k": after @ new, "p_k": after @ new**2 - (after @ new) ** 2}
    return nodes | model | found | {"x_*": middle, "s": scale, "i": range(5), "j": range(4), "k": range(5)}


def bent(rng):
    """The mean of a state whose noise grows as its square, by the trapezium rule at two small f; their errors fall as f^2."""
    y = rng.uniform(1, 3)
    u = np.linspace(-12, 12, 4001)  # x - y, in standard deviations of the noise at y

    def moved(f):
        x = y + f * y**2 * u
        weight = np.exp(-(x**2 - y**2) / 2 - u**2 / 2 * (y / x) ** 4) / x**2
        return y**2 * (u @ weight) / weight.sum() / f

    return {"y_0": y, r"\lim_{f\to0}\frac{z_0-y_0}{f^2}": (4 * moved(5e-4) - moved(1e-3)) / 3}


def crossing(rng):
    """Where the average line meets the curve, off zero: the greatest root of y^4 - 4 y^2 - 3."""
    return {"|y_0|": np.roots([1, 0, -4, 0, -3]).real.max()}


LETTERS = (masses, bent, crossing)
SAID = {
    DEFINITION: [r"a_v=\frac{\partial a}{\partial v}"],
    NOTATION: [r"\frac{dx}{dt}", "I_y(x)"],
    CONDITION: ["|y_0|=2"],
}
