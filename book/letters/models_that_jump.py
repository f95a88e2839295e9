"""The letters of models-that-jump.md: three modes with a joint table of probabilities, mixtures by
their second moments."""

from gate.page import NOTATION

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


failed = r"""
\nu: num
a, b: in .5 2
j: range 2
F_j = a+(b-a)j
\ell = \ln\mathcal N(\nu;0,F_1)-\ln\mathcal N(\nu;0,F_0)
\varrho = b/a
keep: F, \nu, \ell, \varrho
"""


joined = r"""
x, y, g, \lambda: num
\Psi, R: in .5 2
"2/p" = 2/\Psi+2g^2/R
"""


turned = r"""
V, v_x, v_y: num
\omega, T: in .5 2
\eta = \omega T/2
"""


LETTERS = (correcting, predicting, failed, joined, turned)
DECLARED = {
    NOTATION: [
        r"\mathsf M\ell\big|_{\text{failed}}",
        r"\mathsf M\ell\big|_{\text{sound}}",
        "x_{k+1}=a^{i_{k+1}}(x_k,v_k)",
        "y_k=b^{i_k}(x_k,w_k)",
        r"\lambda^{\text{before}}",
        r"\lambda^{\text{after}}",
        r"\Psi^{\text{before}}",
        r"\Psi^{\text{after}}",
    ],
}
