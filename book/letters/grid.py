"""The letters of grid.md: a filter on a grid as a plain program, and the sum of bells on nodes of
any distance."""

import numpy as np
from gate.page import CONDITION, DEFINITION, NOTATION, STATED
from gate.values import Indexed, Of, bell
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


def swarm(rng):
    """Weighted particles; their moments by NumPy."""
    x, w = rng.normal(size=4), rng.dirichlet(np.ones(4))
    return {
        "x": Indexed(x),
        "w": Indexed(w),
        "i": range(4),
        "k": range(2),
        "z": Indexed([np.average(x, weights=w)] * 2),
        "p": Indexed([np.cov(x, aweights=w, ddof=0)] * 2),
    }


LETTERS = (bells, course, widths, swarm)
SAID = {
    DEFINITION: [
        r"x_{k+1}=x_k+u\Bigl(1+\frac1{1+x_k^2}\Bigr)+\xi_k",
        r"y_k=\sqrt{x_k^2+\rho^2}+n_k",
    ],
    STATED: [
        r"\mathsf M_q\Bigl[F\,\frac pq\Bigr]=\int F(x)\,\frac{p(x)}{q(x)}\,q(x)\,dx=\int F(x)\,p(x)\,dx"
    ],
    NOTATION: [r"\frac{N_e}{N}\to\frac{(\mathsf M w)^2}{\mathsf M w^2}"],
    CONDITION: [r"h\le\sigma", r"2e^{-2\pi^2\sigma^2/h^2}=10^{-6}"],
}
EQUALS = {
    r"\frac2h\int_0^hh\sum_j\mathcal N(s+jh)\cos\frac{2\pi ms}h\,ds": r"2e^{-2\pi^2m^2\sigma^2/h^2}"
}
