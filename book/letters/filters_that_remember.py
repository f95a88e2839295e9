r"""The letters of filters-that-remember.md: a filter that remembers two measurements, fitted on a
sample by second moments, and the recursion over the length of its window."""

from gate.page import DEFINITION, NOTATION
from gate.shared import CORRECTION

windowed = (
    r"""
x_1, y_1: sample 80          # the means below are those of a sample
v, w: list 6 sample 80
C(x, y) = \mathsf M(x-\mathsf Mx)(y-\mathsf My)
k: range 6
x_0 = x_1
y_k = x_k+0.1x_k^2+0.4w_k
x_{k+1} = 0.9x_k+0.2\sin(x_k)+0.3v_k
d_k = y_k-\mathsf My_k
k: range 1 5
o = \begin{pmatrix}1+0x_1\end{pmatrix}
a = \begin{pmatrix}1\\0\end{pmatrix}
b = \begin{pmatrix}0\\1\end{pmatrix}
\lambda_1 = 0x_1
\Psi_1 = 1+0x_1
"""
    + CORRECTION
    + r"""
z_k = \lambda_k+\mathsf M(x_k-\lambda_k)+H_k(\sigma_k-\mathsf M\sigma_k)
\zeta_k = \begin{pmatrix}y_k\\y_{k-1}\end{pmatrix}
D_k = \begin{pmatrix}d_k\\d_{k-1}\end{pmatrix}
\Gamma_k = \begin{pmatrix}x_k\end{pmatrix}D_k^T(D_kD_k^T)^{-1}
\chi_k = (\mathsf Mx_k-\Gamma_k\begin{pmatrix}\mathsf My_k\\\mathsf My_{k-1}\end{pmatrix})o
u_k = (\mathsf Mx_k)o+\Gamma_kD_k
q_k = \mathsf Mx_k+(\Gamma_ka)d_k+(\Gamma_kb)d_{k-1}        # u once more, no matrix
T_k = C(x_k-q_k,x_k-q_k)
s_k = 0.9q_k+0.2\sin(q_k)\exp(-T_k/2)
L_{k+1} = C(x_{k+1},s_k)/C(s_k,s_k)
n_{k+1} = \mathsf M(x_{k+1}-L_{k+1}s_k)
\lambda_{k+1} = \mathsf Mx_{k+1}+L_{k+1}(s_k-\mathsf Ms_k)
\Psi_{k+1} = (0.9+0.2\cos(q_k))^2T_k+0.09
"\tau(u_k,T_k)" of k = s_k
keep: \lambda, \Psi, \sigma, H, e, z, y, h, G, F, L, n, u, \zeta, \Gamma, \chi, k, \tau(u_k,T_k)
"""
)

lengthened = r"""
c: in .8 .9
q, R: in .5 1.5
k: range 6
p_0 = q/(1-c^2)
p_{k+1} = 1/(1/(c^2p_k+q)+1/R)
p_* = 1
again:
p_* = 1/(1/(c^2p_*+q)+1/R)
then:
p_- = -qR/(c^2p_*)           # the product of the roots
\varrho = (cR/(c^2p_*+q+R))^2
D(x) = c^2x+q+R
\ell: range 1 5
keep: p, p_*, p_-, \varrho, D, \ell
"""

slow = r"""
c = 1-0.000001               # a state that hardly forgets
q: in .0001 .0002
R: in 1 2
b = q+R(1-c^2)
p_* = (\sqrt{b^2+4c^2qR}-b)/(2c^2)
k: range 1 203
p_1 = R/(1+R(1-c^2)/q)
p_{k+1} = 1/(1/(c^2p_k+q)+1/R)
\varrho = (cR/(c^2p_*+q+R))^2
\ell: range 200 202
keep: p, p_*, \varrho, \ell
"""

LETTERS = (windowed, lengthened, slow)
DECLARED = {
    DEFINITION: ["H=1", "e=0", "L=1", "n=0"],
    NOTATION: [
        r"p_k\text{ of the filter begun anew}",
        r"\frac{\partial p_{k+1}}{\partial p_k}",
        r"\Psi_{k+1}",
        r"\mathsf M\,\Theta(u_k,T_k)",
    ],
}
