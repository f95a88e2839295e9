r"""The letters of live-lab.md: the gain of the best line through a law, by quadrature, and the largest
of all variances."""

from gate.page import DEFINITION, NOTATION

best_line = r"""
f: in .1 .5
\lambda: in 1 3
P: in .1 5
u, v: nodes 0 1
y(s) = \lambda+u\sqrt s+f(\lambda+u\sqrt s)^2v
K(s) = \mathsf Mu\sqrt sy(s)/\mathsf Dy(s)
d(s) = \operatorname{slope}(K, s)
h = 0.0001
k: range 20
s_0 = \lambda^2/2
s_{k+1} = s_k-2hd(s_k)/(d(s_k+h)-d(s_k-h))        # Newton's method
n = 20
"\max_{\Psi}K" = K(s_n)
K = K(P)
keep: K, \max_{\Psi}K, f, \lambda
"""


LETTERS = (best_line,)
DECLARED = {
    DEFINITION: ["x_{k+1}=cx_k+ex_kv_k", "y_k=gx_k+fx_k^2w_k"],
    NOTATION: [r"\lambda", r"\Psi", "1/K", r"1/K\,\big|_{\Psi=\lambda^2/\sqrt3}"],
}
