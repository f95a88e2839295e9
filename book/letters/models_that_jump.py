"""The letters of models-that-jump.md: three modes with a joint table of probabilities, mixtures by
their second moments."""

import numpy as np
from gate.page import NOTATION
from gate.values import Operator
from scipy.stats import multivariate_normal

M, N = 3, 2


correcting = r"""
i: range 3
j: range 3
z, h: list 3 any 2
F: list 3 cov 2
y: any 2
"y_k" = y
c: share 3
"z^j" of j = z_j
"h^j" of j = h_j
"F^j" of j = F_j
L_j = \mathcal N(y;h_j,F_j)
w = \sum_jc_jL_j
\mu_j = c_jL_j/w
z = \sum_j\mu_jz_j
forget: w
"""


predicting = r"""
i: range 3
j: range 3
\pi: share 3 3
\mu: share 3
T: list 9 any 2
P: list 9 cov 2
"\tau^{ij}" of i, j = T_{3i+j}
"\Theta^{ij}" of i, j = P_{3i+j}
c_j = \sum_i\mu_i\pi_{ij}
w_{ij} = \mu_i\pi_{ij}/c_j
m_j = \sum_iw_{ij}T_{3i+j}
V_j = \sum_iw_{ij}(P_{3i+j}+T_{3i+j}T_{3i+j}^T)-m_jm_j^T
"\lambda^j" of j = m_j
"\Psi^j" of j = V_j
forget: T, P, m, V
"""


remembering = r"""
i: range 3
j: range 3
m: list 3 any 3
D: list 3 cov 3
q: share 3
\zeta: any 2
E = \begin{pmatrix}1&0&0\end{pmatrix}
B = \begin{pmatrix}0&1&0\\0&0&1\end{pmatrix}
"\Gamma^i" of i = ED_iB^T(BD_iB^T)^{-1}
"u^i" of i = Em_i+ED_iB^T(BD_iB^T)^{-1}(\zeta-Bm_i)
"\chi^i" of i = Em_i-ED_iB^T(BD_iB^T)^{-1}Bm_i
L_i = \mathcal N(\zeta;Bm_i,BD_iB^T)
w = \sum_iq_iL_i
\xi_i = q_iL_i/w
forget: m, D, E, B, w
"""


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


failed = r"""
\nu: num
a, b: pos
j: range 2
F_j = a+(b-a)j
\ell = \ln\mathcal N(\nu;0,F_1)-\ln\mathcal N(\nu;0,F_0)
\varrho = b/a
keep: F, \nu, \ell, \varrho
"""


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
