r"""The letters of linearisation.md: runs of the extended filter in information form, scalar and with
vectors, and the same in Western letters."""

from gate.page import CONDITION, DEFINITION, NOTATION
from gate.shared import EXTENDED

scalar = r"""
k: range 5
x, y: list 6 num
D_n: in .5 2
f(x) = 0.8x+0.3\sin x
e(x) = x+0.2x^2
\lambda_0 = 0.5
\Psi_0 = 0.4
h_k = \operatorname{slope}(e, \lambda_k)
p_k = 1/(1/\Psi_k+h_k^2/D_n)
K_k = \Psi_kh_k/(h_k^2\Psi_k+D_n)
\nu_k = y_k-e(\lambda_k)
z_k = \lambda_k+K_k\nu_k
d_k = -\nu_k^2/(2(h_k^2\Psi_k+D_n))
s_k = e(\lambda_k)
\lambda_{k+1} = f(z_k)
\Psi_{k+1} = (0.8+0.3\cos z_k)^2p_k+(0.4+0.1z_k)^2
k: range 1 4
"S'" of k = h_k
"S" of k = s_k
"f_k(z_k)" of k = f(z_k)
"f_{k-1}(z_{k-1})" of k = f(z_{k-1})
forget: f, e, h, s
"""

vector = (
    EXTENDED
    + r"""
k: range 1 4
"f_k(z_k)" of k = f(z_k)
"f_{k-1}(z_{k-1})" of k = f(z_{k-1})
"g_k" of k = g
"g_{k-1}" of k = g
"S_k(\lambda_k)" of k = S(\lambda_k)
x: any 3
\lambda = \lambda_2
\Psi = \Psi_2
H = H_2
y = y_2
z = z_2
p = p_2
F = H\Psi H^T+D_n
J(x) = \ln(\mathcal N(x;\lambda,\Psi)\mathcal N(y;S(x),D_n)/(\mathcal N(x;x,\Psi)\mathcal N(y;y,D_n)))
forget: M, E, a, l, b, g, P
"""
)

western = (
    EXTENDED
    + r"""
k: range 1 4
"P_{k\mid k}" of k = p_k
"P_{k\mid k-1}" of k = \Psi_k
"P_{k+1\mid k}" of k = \Psi_{k+1}
"\hat x_{k\mid k}" of k = z_k
"\hat x_{k\mid k-1}" of k = \lambda_k
"\hat x_{k+1\mid k}" of k = \lambda_{k+1}
"z_k" of k = y_k
"v_k" of k = \nu_k
"F_k" of k = \Phi_k
"S_k" of k = H_k\Psi_kH_k^T+D_n
h(x) = S(x)
R = D_n
Q = gD_\xi g^T
forget: M, E, a, l, b, g, S, P, z, y, \lambda, \Psi, p, \nu, \Phi, D_n, D_\xi
"""
)


even = r"""
c, g, D_\xi, D_0: in .5 2
k: range 5
\Psi_k = c^{2k}D_0+\sum_{i=0}^kc^{2i}g^2D_\xi-c^{2k}g^2D_\xi
S(x) = \cos x
x: num
k: range 3
"""


averaged = r"""
p: in .00001 .00002
u: nodes 0 p
"""


pendulum = r"""
x: num
T = 0.2
f = x-T\sin x
g = \cos x
S = \sin x
"""


meters = r"""
p = 0.25
S'(x) = 2x
"""


LETTERS = (
    scalar,
    vector,
    western,
    even,
    averaged,
    pendulum,
    meters,
)
DECLARED = {
    DEFINITION: [
        r"x_{k+1}=f_k(x_k)+g_k(x_k)\,\xi_k",
        "y_k=S_k(x_k)+n_k",
        r"x_{k+1}=x_k-T\sin x_k+\cos x_k\,\xi_k",
        r"y_k=\sin x_k+n_k",
        r"x_0\sim\mathcal N(1,0.1)",
        r"p(x_{k-1}\mid y_{0:k-1})=\mathcal N(x_{k-1};z_{k-1},p_{k-1})",
        r"p(x_k\mid x_{k-1})=\mathcal N\bigl(x_k;f(x_{k-1}),g^2(x_{k-1})D_\xi\bigr)",
        r"p(y_k\mid x_k)=\mathcal N\bigl(y_k;S(x_k),D_n\bigr)",
        r"f(x_{k-1})\approx f+f'\cdot(x_{k-1}-z_{k-1})",
        r"g^2(x_{k-1})\approx g^2",
        r"S(x_k)\approx S+S'\cdot(x_k-\lambda_k)",
        "g=ex",
        "x=z+e",
        "S=x^2",
        "S(x)=x^2",
    ],
    NOTATION: [r"\mathsf{M}\,g^2(z+u)-g^2(z)-O(p^2)"],
    CONDITION: [r"\Psi^{-1}=0", "D_n=0"],
}
