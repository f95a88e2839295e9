r"""The letters of consistency.md: squares of errors and innovations, in both notations; means over
points that have the covariances of the normal laws."""

from gate.page import CONDITION, DEFINITION, NOTATION

course = r"""
k: range 4
F: list 4 in .5 2
\nu: list 4 num
s_k = \nu_k/\sqrt{F_k}
"""


western = r"""
k: range 4
p: list 4 cov 3
e: list 4 any 3
S: list 4 cov 2
\nu: list 4 any 2
\epsilon_k = \operatorname{tr}(p_k^{-1}e_ke_k^T)
\epsilon^\nu_k = \operatorname{tr}(S_k^{-1}\nu_k\nu_k^T)
"P_{k\mid k}" of k = p_k
"\tilde x_{k\mid k}" of k = e_k
"""


constant_gain = r"""
K: in .2 .8
Q, R: in .5 2
P = Q
p_f = 1
again:
P = (1-K)^2(P+Q)+K^2R
F = P+Q+R
p_f = 1/(1/(p_f+K^2F)+1/((1-K)F))   # R_f = (1 - K) F, Q_f = K^2 F has the gain K and innovations of the variance F
then:
c = P+Q-KF
\mathrm{NEES} = P/p_f
keep: K, P, F, p_f, c, \mathrm{NEES}
"""


of_points = r"""
p, P: cov 2
R = (2P)^{1/2}                   # the points are its columns, with both signs
"\mathsf M(e^Tp^{-1}e)" = \sum_{i=1}^2(R)_i^Tp^{-1}(R)_i/2
"\mathsf M\operatorname{tr}(p^{-1}ee^T)" = \sum_{i=1}^2\operatorname{tr}(p^{-1}(R)_i(R)_i^T)/2
H: any 1 2
K: any 2 1
\Phi: any 2 2
L: cov 2
r: cov 1
T = \begin{pmatrix}3L&0\\0&3r\end{pmatrix}^{1/2}
E = \begin{pmatrix}1&0&0\\0&1&0\end{pmatrix}
N = \begin{pmatrix}H&1\end{pmatrix}
F = \sum_{i=1}^3(N(T)_i)^2/3
K_* = \sum_{i=1}^3E(T)_i(T)_i^TN^T/(3F)
"\mathsf M(\nu_{k+1}\nu_k)" = \sum_{i=1}^3H\Phi(E(T)_i-KN(T)_i)N(T)_i/3
forget: R, L, r, T, E, N
"""


LETTERS = (course, western, constant_gain, of_points)
DECLARED = {
    NOTATION: [
        r"\chi^2_{N\dim x}/N",
        "Q/R",
        r"\mathsf P(e^Tp^{-1}e<\rho^2)",
        r"\operatorname{tr}(p^{-1}P)",
    ],
    DEFINITION: [
        r"x_{k+1}=0.95\,x_k+0.3\,v_k",
        "y_k=x_k+w_k",
        r"x_0\sim\mathcal N\Bigl(0,\frac{0.3^2}{1-0.95^2}\Bigr)",
    ],
    CONDITION: [r"H\Phi K>0"],
}
