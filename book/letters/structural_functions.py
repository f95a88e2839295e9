r"""The letters of structural-functions.md: means by quadrature over state and noise, derivatives by
complex steps."""

from gate.page import DEFINITION, NOTATION

MODEL = r"""
u, V: nodes 0 1
W = V
a(x, v) = 0.9x+0.2x^2+0.5xv+0.1v
b(x, w) = 1.2x+0.4x^2w+0.3w
"""

by_tangents = (
    MODEL
    + r"""
z: in .2 .9
p: in .2 .9
m_v = 0
m_w = 0
D_v = 1
D_w = 1
d = p
m = z
a_x(x) = a(x, 0)
a_v(v) = a(z, v)
b_x(x) = b(x, 0)
b_w(w) = b(z, w)
"\frac{\partial a}{\partial x}" = \operatorname{slope}(a_x, z)
"\frac{\partial a}{\partial v}" = \operatorname{slope}(a_v, 0)
"\frac{\partial b}{\partial x}" = \operatorname{slope}(b_x, z)
"\frac{\partial b}{\partial w}" = \operatorname{slope}(b_w, 0)
\tau = 0.9z+0.2z^2
\Theta = \mathsf D((0.9+0.4z)\sqrt pu+(0.5z+0.1)V)
h = 1.2z
G = 1.2
F = \mathsf D(1.2\sqrt pu+(0.4z^2+0.3)V)
forget: u, V, W, a_x, a_v, b_x, b_w, \mathsf M, \mathsf D
"""
)

of_a_sine = r"""
m, d: in .2 .9
x: nodes m d
h = \mathsf M\sin x
keep: m, d, h
"""

over_noise = (
    MODEL
    + r"""
x: num
\alpha(x) = 0.9x+0.2x^2
\gamma(x) = (0.9x+0.2x^2)^2+(0.5x+0.1)^2
\beta(x) = 1.2x
\eta(x) = 1.44x^2+(0.4x^2+0.3)^2
keep: x, V, W, a, b, \mathsf M, \alpha, \beta, \gamma, \eta
"""
)

in_short = (
    over_noise
    + r"""
\alpha = \alpha(x)
\beta = \beta(x)
\gamma = \gamma(x)
\eta = \eta(x)
a = a(x, V)
b = b(x, V)
keep: a, b, \mathsf M, \alpha, \beta, \gamma, \eta
"""
)

over_state = (
    MODEL
    + r"""
m, d: in .2 .9
x = m+\sqrt du
\alpha = 0.9x+0.2x^2
\gamma = (0.9x+0.2x^2)^2+(0.5x+0.1)^2
\beta = 1.2x
\eta = 1.44x^2+(0.4x^2+0.3)^2
\tau = \mathsf Ma(x,V)
\Theta = \mathsf Da(x,V)
h = \mathsf Mb(x,V)
F = \mathsf Db(x,V)
C = \mathsf M(x-m)b(x,V)
"\mathrm{Cov}(x,y)" = C
r(s) = \mathsf Mb(s+\sqrt du,V)
G = \operatorname{slope}(r, m)
"\frac{\partial h}{\partial m}" = G
"\partial h/\partial m" = G
forget: u, V, W, a, b, x, r, m
"""
)

moments = r"""
m, d: in .2 .9
x: nodes m d
n: range 8
q_n = \mathsf Mx^n
n: range 1 6
keep: q, n, m, d
"""


variant = r"""
e, f, g, p: in .3 .6
m: num
d = p
u, v: nodes 0 1
x = m+\sqrt pu
\Theta_\text{Gaussian} = \mathsf D(0.9x+exv)
F_\text{Gaussian} = \mathsf D(gx+fx^2v)
\Theta_\text{linearised} = \mathsf D(0.9x+emv)
F_\text{linearised} = \mathsf D(gx+fm^2v)
forget: u, v, x, g, \mathsf M, \mathsf D
"""


LETTERS = (by_tangents, of_a_sine, over_noise, in_short, over_state, moments, variant)
DECLARED = {
    DEFINITION: [
        "x_{k+1}=cx_k+ex_kv_k",
        "y_k=gx_k+fx_k^2w_k",
        r"w_k\sim\mathcal N(0,1)",
        "x_{k+1}=a(x_k,v_k)",
        "y_k=b(x_k,w_k)",
        r"x\sim\mathcal N(z,p)",
        r"x\sim\mathcal N(m,d)",
    ],
    NOTATION: [r"\mathsf M(x_{k+1}-\tau)^3"],
}
EQUALS = {
    "3f^2d(2m^2+d)": r"F_\text{Gaussian}-F_\text{linearised}",
    r"\Theta_\text{Gaussian}-\Theta_\text{linearised}": "e^2p",
    r"F_\text{Gaussian}-F_\text{linearised}": "3df^2(2m^2+d)",
}
