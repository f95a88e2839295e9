r"""The letters of stratonovich.md: a linear model whose densities are all known, and a chain."""

from gate.page import DEFINITION, NOTATION
from gate.shared import CHAIN

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


joint = r"""
a = 0.8
Q = 0.5
H = 1.3
R = 0.4
I: eye 3
x, y: list 3 num
A = \begin{pmatrix}1&0&0\\a&1&0\\a^2&a&1\end{pmatrix}
P = A\begin{pmatrix}1&0&0\\0&Q&0\\0&0&Q\end{pmatrix}A^T
V = \begin{pmatrix}P&HP\\HP&H^2P+RI\end{pmatrix}         # of all six
u = \begin{pmatrix}x_0\\x_1\\x_2\\y_0\\y_1\\y_2\end{pmatrix}
i: range 1 3
k = 2
"p(x_{0:k},y_{0:k})" = \mathcal N(u;0u,V)
"p(x_0)" = \mathcal N(x_0;0,1)
"p(y_0\mid x_0)" = \mathcal N(y_0;Hx_0,R)
"p(x_i\mid x_{i-1})" of i = \mathcal N(x_i;ax_{i-1},Q)
"p(y_i\mid x_i)" of i = \mathcal N(y_i;Hx_i,R)
forget: a, Q, H, R, I, x, y, A, P, V, u
"""


chain = r"""
x: list 3 num
i: range 3
j: range 3
P: share 3 3
m = \begin{pmatrix}0.2&0.3&0.5\end{pmatrix}
l(y, x) = \mathcal N(y;x,0.7)
"""
chain += (
    CHAIN
    + r"""
"p(y_k\mid j)" of k, j = l(y_k,x_j)
"p(y_k\mid x_j)" of k, j = l(y_k,x_j)
forget: l
"""
)


splitting = r"""
u, v: nodes 0 1              # of the measurement, and of the error after it
r = u+0.3u^2
q = 1+u^2/4
x = r+\sqrt qv
k: range 1
"p_k" of k = q
"z_k" of k = r
"\Psi_k" of k = \mathsf Dx
z = r
forget: u, v, r, q, x
"""


shadow = r"""
q: in .2 .8
\Psi = q(1-q)^2+(1-q)q^2
"""


product = r"""
y, H, x, \lambda: num
R, \Psi: in .5 2
F = H^2\Psi+R
p = 1/(1/\Psi+H^2/R)
K = pH/R
\nu = y-H\lambda
e = x-\lambda
"""
marginal = r"""
x_k, z_{k-1}, A: num
p_{k-1}, Q: in .5 2
"""


LETTERS = (densities, joint, chain, product, marginal, splitting, shadow)
DECLARED = {
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
