r"""The letters of sigma-points.md: a correction that is iterated, in information form, and one by
points."""

from gate.page import DEFINITION

GIVEN = r"""
E: any 2 3
b, y: any 2
\lambda: any 3
P: cov 3
Q: cov 2
\Psi = P/9
D_n = Q/9
I: eye 3
S(x) = b+Ex+bx^Tx/9
"""

iterated = (
    GIVEN
    + r"""
k: range 3
x_0 = \lambda
G_k = \operatorname{slope}(S, x_k)
p_k = (\Psi^{-1}+G_k^TD_n^{-1}G_k)^{-1}
x_{k+1} = p_k(\Psi^{-1}\lambda+G_k^TD_n^{-1}(y-S(x_k)+G_kx_k))
i: range 3
"H" of i = G_i
"K" of i = p_iG_i^TD_n^{-1}
"\partial S(x_i)/\partial x" of i = G_i
forget: E, b, P, Q, G, p, I, k
"""
)

settled = (
    GIVEN
    + r"""
z = \lambda
again:
H = \operatorname{slope}(S, z)
p = (\Psi^{-1}+H^TD_n^{-1}H)^{-1}
z = p(\Psi^{-1}\lambda+H^TD_n^{-1}(y-S(z)+Hz))
then:
K = pH^TD_n^{-1}
"x_i" = z
keep: z, x_i, \Psi, p, I, K, H
"""
)

points = (
    GIVEN
    + r"""
n = 3
\kappa = 0.7
j: range -3 4
R = ((n+\kappa)\Psi)^{1/2}
\chi_j = \lambda+\operatorname{sign}(j)(R)_{|j|}
w_j = (1/2+(\kappa-1/2)(1-|\operatorname{sign}j|))/(n+\kappa)
h = \sum_jw_jS(\chi_j)
F = \sum_jw_jS(\chi_j)S(\chi_j)^T-hh^T+D_n
C = \sum_jw_j\chi_jS(\chi_j)^T-\lambda h^T
K = (F^{-1}C^T)^T
G = (\Psi^{-1}C)^T
z = \lambda+CF^{-1}(y-h)
p = \Psi-CF^{-1}C^T
i: range 1 4
forget: E, b, P, Q, R, I
"""
)


posterior = r"""
A: any 2 3
b, y: any 2
x, \lambda: any 3
\Psi: cov 3
D_n: cov 2
S(x) = Ax+bx^Tx
J(x) = \ln(\mathcal N(x;\lambda,\Psi)\mathcal N(y;S(x),D_n)/(\mathcal N(x;x,\Psi)\mathcal N(y;y,D_n)))
"""


one_component = r"""
\lambda: num
\sigma: in .5 1.5
v = \sigma^2
x: nodes \lambda v 3          # its three points, with kappa = 2
keep: x, \lambda, \sigma, \mathsf M
"""


fourth_moment = r"""
n = 3
\kappa = 2\cdot3/2-n      # (n + kappa)^2 2 w - 1 = 2, with the weight w = 1 / (2 (n + kappa))
"|x|" = \sqrt{n+\kappa}
"""


LETTERS = (iterated, settled, points, posterior, one_component, fourth_moment)
DECLARED = {
    DEFINITION: [
        r"S(x)=\begin{pmatrix}\sqrt{s^2+a^2}\\\operatorname{atan2}(a,s)\end{pmatrix}",
        "y_k=S(x_k)+n_k",
    ],
}
EQUALS = {
    "x_{i+1}": r"\lambda+K\bigl(y-S(x_i)-H(\lambda-x_i)\bigr)",
    r"\mathsf M\,x": r"\lambda",
    r"\mathsf M(x-\lambda)^2": r"\sigma^2",
    r"\mathsf M(x-\lambda)^4\big|_{\kappa=2}": r"3\sigma^4",
}
