"""The letters of cycle-slips.md: the mean time to a slip by Pontryagin's equation, the loop by
iteration."""

import numpy as np
from gate.page import CONDITION, DEFINITION, NOTATION
from gate.values import Of
from scipy.integrate import quad, solve_ivp
from scipy.special import iv


def mean_time(V, q):
    """1/q int_0^{2 pi} e^V(x) int_0^x e^-V(s) ds dx: Pontryagin's solution with tau = 0 at +-2
    pi."""

    def inner(x):
        return quad(lambda s: np.exp(-V(s)), 0, x, epsabs=0, epsrel=1e-12, limit=200)[0]

    halves = (0, np.pi), (np.pi, 2 * np.pi)
    return (
        sum(
            quad(lambda x: np.exp(V(x)) * inner(x), *half, epsabs=0, epsrel=1e-11, limit=400)[0]
            for half in halves
        )
        / q
    )


def slips(rng):
    variance, q = rng.uniform(0.06, 0.12), rng.uniform(0.01, 0.1)

    def V(x):
        return (1 - np.cos(x)) / variance

    known = {r"\tau": mean_time(V, q), "q": q, r"\sigma_\varphi": np.sqrt(variance)}
    return known | {"V": Of(V, r"\Delta"), "I_0": lambda x: iv(0, x)}


loop = r"""
A, D_n: pos
q: in .01 .1
r = 2\pi D_n/\int_0^{2\pi}(A\sin t)^2dt
\Psi = 1
again:
p = 1/(1/\Psi+1/r)
\Psi = p+q
then:
\sigma_\varphi = \sqrt{(p+\Psi)/2}
U'(x) = \cos(x)/r
keep: q, r, p, \Psi, \sigma_\varphi, U'
"""


def saw(rng):
    """The potential of a saw, with its edge at half a cycle."""
    variance, q = rng.uniform(0.05, 0.1), rng.uniform(0.01, 0.1)

    def V(x):
        return ((x + np.pi) % (2 * np.pi) - np.pi) ** 2 / (2 * variance)

    return {r"\tau": mean_time(V, q), "q": q, r"\sigma_\varphi": np.sqrt(variance)}


def pushed(rng):
    """The probability to slip forwards, by its differential equation, q Pi'' + (b - q V') Pi' =
    0."""
    q, b, height = rng.uniform(0.5, 1), rng.uniform(0.1, 0.3), rng.uniform(0.5, 1)

    def W(x):
        return height * (1 - np.cos(x)) + 0.1 * (1 - np.cos(2 * x)) - b * x / q

    def rates(x, state):
        return [state[1], (height * np.sin(x) + 0.2 * np.sin(2 * x) - b / q) * state[1]]

    begin, end = -2 * np.pi, 2 * np.pi
    way = solve_ivp(
        rates, (begin, end), [0, 1], method="DOP853", t_eval=[0, end], rtol=1e-12, atol=1e-14
    )
    return {r"\Pi": way.y[0, 0] / way.y[0, 1], "W": Of(W, r"\Delta")}


carrier = r"""
q, r: pos
p = 1
again:
p = (p+qr/p)/2
then:
V(x) = (1-\cos(x))/p
\sigma_\varphi = \sqrt p
"""


LETTERS = (slips, loop, saw, pushed, carrier)
SAID = {
    DEFINITION: [r"\Delta_{k+1}=\Delta_k-p\,U(\Delta_k)-p\,\tilde n_k+s_\varphi v_k"],
    NOTATION: ["2D_n/A^2", r"1/\sigma_\varphi^2"],
    CONDITION: [r"\tau(2\pi)=0"],
}
