r"""The letters of grid.md: a filter on a grid, and the sum of bells on nodes of any distance."""

from gate.page import CONDITION, DEFINITION, NOTATION, STATED
from gate.shared import CHAIN

bells = r"""
h: in 1 2
r: in .3 .5
\sigma = hr
s: in 0 1
j: range -60 61
m: range 1 3
a = 0
v = \sigma^2
\mathcal N(x, a, v) = \exp(-(x-a)^2/(2v))/\sqrt{2\pi v}
forget: r, a, v
"""


course = r"""
h = 1
D_\xi: in .8 1.2
D_n: in .3 .6
i: range 3
j: range 3
"x_j" of j = 1.5(j-1)
"x_i" of i = 1.5(i-1)
x_0 = -1.5
x_1 = 0
x_2 = 1.5
f(x) = 0.8x+0.1
g(x) = 0.7+0.1x
S(x) = \sin x
P_{ij} = h\exp(-(1.5(j-1)-f(x_i))^2/(2g^2(x_i)D_\xi))/\sqrt{2\pi g^2(x_i)D_\xi}
l(y, x) = \exp(-(y-S(x))^2/(2D_n))/\sqrt{2\pi D_n}
"p(x_j)" of j = \mathcal N(x_j;0.2,1)
m = h\begin{pmatrix}\mathcal N(x_0;0.2,1)&\mathcal N(x_1;0.2,1)&\mathcal N(x_2;0.2,1)\end{pmatrix}
"""
course += (
    CHAIN
    + r"""
forget: l
"""
)


widths = r"""
S', f', g, D_n, D_\xi: in .5 2
L(x) = \ln(\mathcal N(0.3;S'x,D_n)\mathcal N(x;0.1,g^2D_\xi)\mathcal N(0.7;f'x,g^2D_\xi))
\sigma = (2L(0)-L(1)-L(-1))^{-1/2}
keep: \sigma, S', f', g, D_n, D_\xi
"""


swarm = r"""
i: range 4
k: range 2
x: list 4 num
w: share 4
"z_k" of k = \sum_iw_ix_i
"p_k" of k = \sum_iw_ix_i^2-(\sum_iw_ix_i)^2
"""


LETTERS = (bells, course, widths, swarm)
DECLARED = {
    DEFINITION: [
        r"x_{k+1}=x_k+u\Bigl(1+\frac1{1+x_k^2}\Bigr)+\xi_k",
        r"y_k=\sqrt{x_k^2+\rho^2}+n_k",
    ],
    STATED: [
        r"\mathsf M_q\Bigl[F\,\frac pq\Bigr]=\int F(x)\,\frac{p(x)}{q(x)}\,q(x)\,dx=\int F(x)\,p(x)\,dx"
    ],
    NOTATION: [r"\frac{N_e}{N}\to\frac{(\mathsf M w)^2}{\mathsf M w^2}"],
    CONDITION: [r"h\le\sigma", r"2e^{-2\pi^2\sigma^2/h^2}=10^{-6}"],
}
EQUALS = {
    r"\frac2h\int_0^hh\sum_j\mathcal N(s+jh)\cos\frac{2\pi ms}h\,ds": r"2e^{-2\pi^2m^2\sigma^2/h^2}"
}
