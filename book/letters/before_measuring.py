"""The letters of before-measuring.md: a run of the Kalman filter; the same step with all noises
scaled; a small index."""

from gate.page import NOTATION
from gate.shared import KALMAN

scaled = r"""
A: any 3 3
H: any 1 3
\Psi, Q: cov 3
R: cov 1
c: in .5 2
\Psi' = A(\Psi^{-1}+H^TR^{-1}H)^{-1}A^T+Q
\Psi'_c = A((c\Psi)^{-1}+H^T(cR)^{-1}H)^{-1}A^T+cQ
keep: c, \Psi', \Psi'_c
"""


small_index = r"""
\Lambda: in 1e-18 2e-18
r = \sqrt{\Lambda(\Lambda+8)}/4-\Lambda/4     # 1 - rho: alpha without a difference of nearly equal numbers
\alpha = r(2-r)
"\lim_{\Lambda\to0}" = 1
keep: \lim_{\Lambda\to0}, \Lambda, \alpha
"""


steady = r"""
\Delta, \sigma, \sigma_a: in .5 2
A = \begin{pmatrix}1&\Delta\\0&1\end{pmatrix}
H = \begin{pmatrix}1&0\end{pmatrix}
E = \begin{pmatrix}0&1\end{pmatrix}
B = \sigma_a\begin{pmatrix}\Delta^2/2\\\Delta\end{pmatrix}
P = AA^T
again:
p = P-PH^T(HPH^T+\sigma^2)^{-1}HP
P = ApA^T+BB^T
then:
p_{11} = HpH^T
p_{12} = HpE^T
p_{22} = EpE^T
\psi_{12} = HPE^T
\sigma_r = \sqrt{p_{11}}
\alpha = HPH^T(HPH^T+\sigma^2)^{-1}
\beta = \Delta EPH^T(HPH^T+\sigma^2)^{-1}
"\alpha(\Lambda)" = \alpha
\Lambda = \sigma_a\Delta^2/\sigma
keep: p_{11}, p_{12}, p_{22}, \psi_{12}, \sigma_r, \alpha(\Lambda), \Lambda, \sigma, \sigma_a, \Delta, \alpha, \beta
"""


small_gains = r"""
\alpha: in .05 .1
\beta = 2(1-\sqrt{1-\alpha})^2
"""


run = (
    KALMAN
    + r"""
\lambda = \lambda_2
\Psi = \Psi_2
y = y_2
K = K_2
z = z_2
p = p_2
\nu = \nu_2
F = F_2
k: range 1 4
"""
)


LETTERS = (run, scaled, small_index, steady, small_gains)
DECLARED = {
    "a setting": ["Q=0"],
    NOTATION: [r"\Psi'_c", r"\psi'_{22}", r"\sigma_r", "p_{22}", r"p_{22}\big|_{\Lambda\to0}"],
}
EQUALS = {r"c\,\Psi'": r"\Psi'_c", r"\lim_{\Lambda\to0}\alpha\,/\sqrt{2\Lambda}": "1"}
