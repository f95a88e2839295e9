r"""The letters of comparison.md: a state, its posterior mean and another estimate; point masses for a
noise that enters linearly."""

from gate.page import CONDITION, DEFINITION, NOTATION

exact = r"""
u, v: nodes 0 1               # of the measurement, and of the error after it
e = u+0.3u^2
x = e+v\sqrt{1+u^2}
k: range 1
"x_k" of k = x
"z_k" of k = \sin(u)+0.5
"z_k^{\text{exact}}" of k = e
"D_k" of k = \mathsf M(x-\sin(u)-0.5)^2
forget: u, v, e, x
"""


against_the_bound = r"""
u, v: nodes 0 1
p = 1+u^2/4
\delta = u+0.3u^2
\epsilon = v\sqrt p
e = \epsilon+\delta
forget: u, v
"""


linearised_start = r"""
g, e: in .5 2
y_0: num
K = g/(g^2+0.09\cdot0^4)       # of the first step: the state is 0, and the meter has no noise there
z_0 = 0+K(y_0-g\cdot0)
\Psi_1 = 0.81(1-Kg)+(ez_0)^2
keep: g, e, y_0, z_0, \Psi_1
"""


masses = r"""
c = 0.9
e = 0.5
D_v = 0.8
m_v = 0
s = 0.7
x_*, y: num
X: list 4 num
M: share 4
i: range 5
j: range 4
v = 0
a(x, v) = cx+exv
a_v(x) = ex
\pi(x) = \sum_jM_j\mathcal N(x;cX_j,(eX_j)^2D_v)
l(x) = \mathcal N(y;x,0.1+0.2x^2)
"t_i" of i = -1+i/2
"x_i" of i = x_*+s\sinh(-1+i/2)
W_i = \pi(x_i)l(x_i)s\cosh(-1+i/2)
w = \sum_iW_i
"\mu_i" of i = W_i/w
"x_j" of j = X_j
"\mu_j" of j = M_j
"z_k" = \sum_i\mu_ix_i
"p_k" = \sum_i\mu_ix_i^2-z_k^2
"p(y_k\mid x_i)" of i = l(x_i)
k: range 5
"x" of k = x_*+s\sinh(-1+k/2)
"p(y_k\mid x)" of k = l(x)
"p(x\mid y_{0:k})" of k = \pi(x)l(x)
forget: c, e, v, y, X, M, l, W, w
"""


bent = r"""
y_0: in 1 3
c = y_0^2
w(x, u) = \exp(-(x^2-c)/2-u^2y_0^4/(2x^4))/x^2
V(f) = \int uw(y_0+fcu,u)du
W(f) = \int w(y_0+fcu,u)du
m(f) = cV(f)/(fW(f))            # off by the square of f
"\lim_{f\to0}\frac{z_0-y_0}{f^2}" = (4m(0.0005)-m(0.001))/3
forget: c, w, V, W, m
"""


LETTERS = (exact, against_the_bound, linearised_start, masses, bent)
DECLARED = {
    DEFINITION: [
        r"a_v=\frac{\partial a}{\partial v}",
        "x_{k+1}=cx_k+ex_kv_k",
        "y_k=gx_k+fx_k^2w_k",
        r"w_k\sim\mathcal N(0,1)",
    ],
    NOTATION: [r"\frac{dx}{dt}"],
    CONDITION: ["|y_0|=2"],
}
