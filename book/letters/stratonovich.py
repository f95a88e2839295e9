"""The letters of stratonovich.md: a linear model whose densities are all known, and a chain as a
plain program."""

import numpy as np
from gate.page import DEFINITION, NOTATION
from gate.values import Indexed, Of, Operator, bell
from gate.worlds import chain_run

densities = r"""
a = 0.8
Q = 0.5
H = 1.3
R = 0.4
p = 0.6
z, y, x_k, x_{k-1}, x_0: num
m = az
\Psi = a^2p+Q
F = H^2\Psi+R
K = \Psi H/F
G = H^2p+R
"C_k" = 1/\mathcal N(y;Hm,F)
"C_0" = 1/\mathcal N(y;Hz,G)
"p(x_k\mid x_{k-1})" of x_k, x_{k-1} = \mathcal N(x_k;ax_{k-1},Q)
"p(x_k\mid x_{k-1},y_{0:k-1})" of x_k, x_{k-1} = \mathcal N(x_k;ax_{k-1},Q)
"p(x_{k-1}\mid y_{0:k-1})" of x_{k-1} = \mathcal N(x_{k-1};z,p)
"p(x_k\mid y_{0:k-1})" of x_k = \mathcal N(x_k;m,\Psi)
"p(y_k\mid x_k)" of x_k = \mathcal N(y;Hx_k,R)
"p(y_k\mid x_k,y_{0:k-1})" of x_k = \mathcal N(y;Hx_k,R)
"p(x_k\mid y_{0:k})" of x_k = \mathcal N(x_k;m+K(y-Hm),\Psi-KH\Psi)
"p(y_k\mid y_{0:k-1})" = \mathcal N(y;Hm,F)
"p(x_0)" of x_0 = \mathcal N(x_0;z,p)
"p(y_0\mid x_0)" of x_0 = \mathcal N(y;Hx_0,R)
"p(x_0\mid y_0)" of x_0 = \mathcal N(x_0;z+pH(y-Hz)/G,pR/G)
forget: a, Q, H, R, p, z, y, m, \Psi, F, K, G
"""


def joint(rng):
    """The density of three states and measurements, from the covariance of all six."""
    a, Q, H, R = 0.8, 0.5, 1.3, 0.4
    xi = np.diag([1.0, Q, Q, R, R, R])
    states = np.array([[1, 0, 0], [a, 1, 0], [a**2, a, 1]])
    made = np.block([[states, np.zeros((3, 3))], [H * states, np.eye(3)]])
    x, y = rng.normal(size=(2, 3))
    whole = bell(np.concatenate([x, y])[:, None], np.zeros((6, 1)), made @ xi @ made.T)
    return {
        "k": 2,
        "p(x_{0:k},y_{0:k})": whole,
        "p(x_0)": bell(x[0], 0, 1.0),
        r"p(y_0\mid x_0)": bell(y[0], H * x[0], R),
        r"p(x_i\mid x_{i-1})": Of(lambda i: bell(x[i], a * x[i - 1], Q), "i"),
        r"p(y_i\mid x_i)": Of(lambda i: bell(y[i], H * x[i], R), "i"),
    }


def chain(rng):
    nodes = np.array([0.0, 1.0, 3.0])
    P = rng.dirichlet(np.ones(3), size=3)

    def seen(y, x):
        return bell(y, x, 0.7)

    run = chain_run(rng, nodes, P, rng.dirichlet(np.ones(3)), seen)
    y, at = run["y"].values, run["x"].values
    return run | {
        r"p(y_k\mid j)": Of(lambda k, j: seen(y[k], at[j]), "k", "j"),
        r"p(y_k\mid x_j)": Of(lambda k, j: seen(y[k], at[j]), "k", "j"),
    }


def splitting(rng):
    """What a meter with three readings tells of a state with four values."""
    joint, x = rng.dirichlet(np.ones(12)).reshape(3, 4), rng.normal(size=4)
    given = joint / joint.sum(axis=1, keepdims=True)
    z, square = given @ x, given @ x**2
    mass, lam = joint.sum(axis=1), joint.sum(axis=0) @ x

    def mean(values):
        return float(mass @ values)

    before = joint.sum(axis=0) @ (x - lam) ** 2
    means = {
        r"\mathsf M": Operator(mean),
        r"\mathsf D": Operator(lambda values: mean((values - mean(values)) ** 2)),
    }
    return means | {
        "p": Indexed([square - z**2]),
        "z": Indexed([z], z),
        r"\Psi": Indexed([before]),
        "k": range(1),
    }


shadow = r"""
q: in .2 .8
\Psi = q(1-q)^2+(1-q)q^2
"""


product = r"""
y, H, x, \lambda: num
R, \Psi: pos
F = H^2\Psi+R
p = 1/(1/\Psi+H^2/R)
K = pH/R
\nu = y-H\lambda
e = x-\lambda
"""
marginal = r"""
x_k, z_{k-1}, A: num
p_{k-1}, Q: pos
"""


LETTERS = (densities, joint, chain, product, marginal, splitting, shadow)
SAID = {
    DEFINITION: [
        r"x_{k+1}=f_k(x_k)+g_k(x_k)\,\xi_k",
        "y_k=S_k(x_k)+n_k",
        r"x_0\sim\mathcal N(m_0,D_0)",
        r"x_{k+1}=x_k+0.3\Bigl(1+\frac1{1+x_k^2}\Bigr)+0.2\,v_k",
        r"y_k=\sqrt{x_k^2+1}+0.2\,w_k",
        r"x_0\sim\mathcal N(-1,2)",
        r"P_{ij}=p(x_k=x_j\mid x_{k-1}=x_i)",
    ],
    NOTATION: [
        r"Z_k=p(y_k\mid y_{1:k-1})",
        r"\prod_kC_k^{-1}",
        r"\mathsf{M}[x^2|y]",
        r"\mathsf{M}[(x-z)^2|y]",
    ],
}
