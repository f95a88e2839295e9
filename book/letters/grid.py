"""The letters of grid.md: a filter on a grid as a plain program, and the sum of bells on nodes of
any distance."""

import numpy as np
from gate.page import CONDITION
from gate.values import Of, bell
from gate.worlds import chain_run

NODES = 7


def bells(rng):
    """The left side of Poisson's formula is a sum over all nodes, the right a series: both are
    computed."""
    h = rng.uniform(1, 2)
    sigma = h * rng.uniform(0.3, 0.5)

    def normal(x, *law):
        return bell(x, *(law or (0, sigma**2)))

    return {
        "h": h,
        "s": rng.uniform(0, h),
        r"\sigma": sigma,
        "j": range(-60, 61),
        "m": range(1, 3),
        r"\mathcal N": normal,
    }


def course(rng):
    x, h = np.linspace(-3, 3, NODES), 1.0
    f, g, D_xi, D_n = (
        (lambda at: 0.8 * at + 0.1),
        (lambda at: 0.7 + 0.1 * at),
        rng.uniform(0.8, 1.2),
        rng.uniform(0.3, 0.6),
    )
    P = np.array([[h * bell(to, f(at), g(at) ** 2 * D_xi) for to in x] for at in x])
    run = chain_run(rng, x, P, h * bell(x, 0.2, 1.0), lambda y, at: bell(y, np.sin(at), D_n))
    density = Of(lambda j: bell(x[j], 0.2, 1.0), "j")
    return run | {
        "f": f,
        "g": g,
        "S": np.sin,
        "h": h,
        r"D_\xi": D_xi,
        "D_n": D_n,
        "p(x_j)": density,
    }


widths = r"""
S', f', g, D_n, D_\xi: pos
L(x) = \ln(\mathcal N(0.3;S'x,D_n)\mathcal N(x;0.1,g^2D_\xi)\mathcal N(0.7;f'x,g^2D_\xi))
\sigma = (2L(0)-L(1)-L(-1))^{-1/2}
keep: \sigma, S', f', g, D_n, D_\xi
"""


LETTERS = (bells, course, widths)
SAID = {
    CONDITION: [r"h\le\sigma", r"2e^{-2\pi^2\sigma^2/h^2}=10^{-6}"],
}
EQUALS = {
    r"\frac2h\int_0^hh\sum_j\mathcal N(s+jh)\cos\frac{2\pi ms}h\,ds": r"2e^{-2\pi^2m^2\sigma^2/h^2}"
}
