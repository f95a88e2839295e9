r"""The letters of track-2d.md: a run of the filter with a known input; a lost sample; a mean given
measurements."""

from gate.page import DEFINITION, NOTATION

filtered = r"""
A: any 4 4
B: any 4 2
H: any 2 4
R: cov 2
P: cov 4
l: any 4
I: eye 4
S, \Delta: in .5 2
Q = SBB^T/\Delta
y, u: list 5 any 2
k: range 5
\lambda_0 = l
\Psi_0 = P
p_k = (\Psi_k^{-1}+H^TR^{-1}H)^{-1}
K_k = p_kH^TR^{-1}
z_k = p_k(\Psi_k^{-1}\lambda_k+H^TR^{-1}y_k)
\lambda_{k+1} = Az_k+Bu_k
\Psi_{k+1} = Ap_kA^T+Q
y = y_2
\lambda = \lambda_2
\Psi = \Psi_2
p = p_2
K = K_2
z = z_2
F = H\Psi H^T+R
\nu = y-H\lambda
k: range 1 4
forget: P, l
"""


sample_lost = r"""
\Psi: cov 4
\lambda: any 4
p = (\Psi^{-1})^{-1}
z = p\Psi^{-1}\lambda
"""


axes = r"""
\sigma = 1.3
I: eye 2
R = \sigma^2I
"""


no_news = r"""
u, v: nodes 0 1               # of the measurement, and of the error after it
\lambda = u+0.3u^2
x = \lambda+v\sqrt{1+u^2}
\lambda' = \sin(u)+0.5
keep: x, \lambda, \lambda', \mathsf M
"""


LETTERS = (filtered, sample_lost, axes, no_news)
DECLARED = {
    DEFINITION: [
        r"x_{k+1}=Ax_k+B\,(u_k+\xi_k)",
        "y_k=Hx_k+w_k",
        r"\xi_k\sim\mathcal N(0,\sigma_a^2I)",
        r"w_k\sim\mathcal N(0,R)",
        "y_i=|r-b_i|+w_i",
    ],
    NOTATION: [r"Q_{\rm const}", r"Q_{\rm white}", r"\sum_{i=0}^{j-1}(i+\tfrac{1}{2})^2"],
}
