r"""The letters of looking-back.md: a run of the linear filter, what the later measurements say, and
the smoother made of both; and back step by step."""

from gate.page import NOTATION
from gate.shared import KALMAN

LATER = (
    KALMAN
    + r"""
N_0 = 0I                  # of x_4, x_3, ...: counted from the end
h_0 = 0z_0
W_k = N_k+H^TR^{-1}H
w_k = h_k+H^TR^{-1}y_{4-k}
N_{k+1} = A^T(W_k-W_k(W_k+Q^{-1})^{-1}W_k)A
h_{k+1} = A^T(w_k-W_k(W_k+Q^{-1})^{-1}w_k)
k: range 5
"""
)

course = (
    LATER
    + r"""
\bar p_k = (p_k^{-1}+N_{4-k})^{-1}
\bar z_k = \bar p_k(p_k^{-1}z_k+h_{4-k})
S_k = (\Psi_{k+1}^{-1}Ap_k)^T
k: range 1 4
"A_k" of k = A
"Q_k" of k = Q
"\mathrm{Cov}(x_k,x_{k+1})" of k = (Ap_k)^T
keep: A, A_k, Q_k, I, k, p, z, \lambda, \Psi, S, \bar p, \bar z, \mathrm{Cov}(x_k,x_{k+1})
"""
)

meeting = (
    LATER
    + r"""
J_k = N_{4-k}
\eta_k = h_{4-k}
\tilde J_k = W_{4-k}
\tilde\eta_k = w_{4-k}
k: range 4
b_0 = z_4
v_0 = p_4
G_k = p_{3-k}A^T\Psi_{4-k}^{-1}
b_{k+1} = z_{3-k}+G_k(b_k-\lambda_{4-k})
v_{k+1} = p_{3-k}+G_k(v_k-\Psi_{4-k})G_k^T
k: range 5
\bar z_k = b_{4-k}
\bar p_k = v_{4-k}
k: range 1 4
keep: A, H, Q, R, I, k, y, z, p, \bar z, \bar p, J, \eta, \tilde J, \tilde\eta
"""
)


walk = r"""
Q, R: in .5 2
\Psi = Q
again:
\Psi = Q+1/(1/\Psi+1/R)
then:
p = \Psi-Q
S = p/\Psi
\bar p = p
again:
\bar p = p+S^2(\bar p-\Psi)
then:
"""


slow_walk = r"""
Q: in .0005 .002
R: in 1 2
\Psi = Q
again:
\Psi = Q+1/(1/\Psi+1/R)
then:
p = \Psi-Q
"""


one_component = r"""
A, Q, s: in .5 2
k: range 1
p_k = s
\Psi_k = s
\Psi_{k+1} = (A\sqrt s)^2+Q
keep: A, Q, p, \Psi, k
"""


LETTERS = (course, meeting, walk, slow_walk, one_component)
DECLARED = {
    NOTATION: [
        r"\bar z=z",
        r"\bar p=p",
        r"\frac{\partial\mathcal N(x;z,p)}{\partial z}",
        r"\mathcal N(x;z,p)",
        r"\Delta t",
        "J_k",
        r"\tilde J_{k+1}",
        r"\tilde\eta_{k+1}",
        r"\eta_k",
    ],
}
