"""The letters of comparison.md: a state, its posterior mean and another estimate, with finitely
many measurements; point masses as a plain program, for a noise that enters linearly."""

import numpy as np
from gate.page import CONDITION, DEFINITION, NOTATION
from gate.values import Indexed, Operator
from gate.worlds import shared_readings

from kfcourse.filters import aof
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import linearised


def exact(rng):
    """The posterior mean is the mean of the states that share a measurement; any other function of
    it is an estimate."""
    mass, x, best, other = shared_readings(rng)
    return {
        "x": Indexed([x]),
        "z": Indexed([other]),
        r"z_k^{\text{exact}}": best,
        "D": Indexed([mass @ (x - other) ** 2]),
        "k": range(1),
        r"\mathsf M": Operator(lambda values: float(mass @ values)),
    }


def against_the_bound(rng):
    """A filter off the exact one by what its measurement says; the exact one's error has two values
    for each."""
    mass = np.repeat(rng.dirichlet(np.ones(3)), 2) / 2
    p, delta = np.repeat(rng.uniform(0.5, 2, size=3), 2), np.repeat(rng.normal(size=3), 2)
    epsilon = np.sqrt(p) * np.tile([1, -1], 3)

    def mean(values):
        return float(mass @ values)

    means = {
        r"\mathsf M": Operator(mean),
        r"\mathsf D": Operator(lambda values: mean((values - mean(values)) ** 2)),
    }
    return means | {"p": p, r"\delta": delta, r"\epsilon": epsilon, "e": epsilon + delta}


def linearised_start(rng):
    """The linearised AOF of the lab's model at its first measurement."""
    g, e = rng.uniform(0.5, 2, size=2)
    ekf = aof(linearised(Model.define("0.9*x + e*x*v", "g*x + 0.3*x**2*w", {"g": g, "e": e})))
    y = rng.normal()
    state = ekf.step(ekf.init(1), np.array([[y]]))
    z, Psi = state.posterior.mean.item(), state.predicted.cov.item()
    return {"g": g, "e": e, "y": Indexed([y]), "z": Indexed([z]), r"\Psi": Indexed([1.0, Psi])}


masses = r"""
c = 0.9
e = 0.5
D_v = 0.8
m_v = 0
s = 0.7
x_*, y: num
X: nums 4
M: share 4
i: range 5
j: range 4
v = 0
a(x, v) = cx+exv
a_v(x) = ex
\pi(x) = \sum_jM_j\mathcal N(x;cX_j,(eX_j)^2D_v)
l(x) = \mathcal N(y;x,0.1+0.2x^2)
"t_i" of i = -1+i/2
"x_i" of i = x_*+s\sinh(-1+i/2)
W_i = \pi(x_i)l(x_i)s\cosh(-1+i/2)
w = \sum_iW_i
"\mu_i" of i = W_i/w
"x_j" of j = X_j
"\mu_j" of j = M_j
"z_k" = \sum_i\mu_ix_i
"p_k" = \sum_i\mu_ix_i^2-z_k^2
"p(y_k\mid x_i)" of i = l(x_i)
k: range 5
"x" of k = x_*+s\sinh(-1+k/2)
"p(y_k\mid x)" of k = l(x)
"p(x\mid y_{0:k})" of k = \pi(x)l(x)
forget: c, e, v, y, X, M, l, W, w
"""


def bent(rng):
    """The mean of a state whose noise grows as its square, by the trapezium rule at two small f;
    their errors fall as f^2."""
    y = rng.uniform(1, 3)
    u = np.linspace(-12, 12, 4001)  # x - y, in standard deviations of the noise at y

    def moved(f):
        x = y + f * y**2 * u
        weight = np.exp(-(x**2 - y**2) / 2 - u**2 / 2 * (y / x) ** 4) / x**2
        return y**2 * (u @ weight) / weight.sum() / f

    return {"y_0": y, r"\lim_{f\to0}\frac{z_0-y_0}{f^2}": (4 * moved(5e-4) - moved(1e-3)) / 3}


LETTERS = (exact, against_the_bound, linearised_start, masses, bent)
SAID = {
    DEFINITION: [
        r"a_v=\frac{\partial a}{\partial v}",
        "x_{k+1}=cx_k+ex_kv_k",
        "y_k=gx_k+fx_k^2w_k",
        r"w_k\sim\mathcal N(0,1)",
    ],
    NOTATION: [r"\frac{dx}{dt}"],
    CONDITION: ["|y_0|=2"],
}
