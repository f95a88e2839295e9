"""The letters of when-linearisation-fails.md: a signal that is a parabola, its moments by
quadrature."""

from gate.page import CONDITION, DEFINITION, NOTATION

display = r"""
\lambda: num
\Psi, S'': in .2 .5
D_n: in .3 .6
a: in 1 2
S' = -a
x: nodes \lambda \Psi
u(x) = 1+S'(x-\lambda)+S''(x-\lambda)^2/2
H = S'^2\Psi+D_n
K = \Psi S'/H
p = \Psi D_n/H
\kappa = \sqrt{4(\mathsf M(x-\lambda-K(u(x)-1))^2/p+K^2D_n/p-1)/3}
q = \mathsf Du(x)
S = 1
h = \mathsf Mu(x)
F = q+D_n
G = \mathsf M(x-\lambda)u(x)/\Psi
c = \sqrt{2(q-S'^2\Psi)/D_n}
s = \sqrt{S'^2\Psi/D_n}
\nu = c/s
t = 10
"S(x)" = S+a\sqrt\Psi t+S''\Psi t^2/2+0.001(\sqrt\Psi t)^3     # what the series leaves out
"S(\lambda)" = S
keep: S', S'', S, h, F, G, \Psi, D_n, s, c, \nu, \kappa, t, S(x), S(\lambda)
"""


western = (
    display
    + r"""
P^- = \Psi
R = D_n
h' = S'
h'' = S''
forget: \Psi, D_n, S', S''
"""
)


again = r"""
\kappa: in 1 3
p: in .5 2
n = 5                # a constant is measured so often; the first error is larger than is claimed
k: range 1 6
P_1 = p
M_1 = (1+3\kappa^2/4)p
K_k = P_k/(P_k+p)
P_{k+1} = 1/(1/P_k+1/p)
M_{k+1} = (1-K_k)^2M_k+K_k^2p
"\frac{\mathsf Me_n^2}{p_n}" = M_n/P_n
keep: \kappa, n, \frac{\mathsf Me_n^2}{p_n}
"""


line = r"""
m, \alpha, \beta: num
d: in .2 .5
x: nodes m d
s = \mathsf M\sin x
c = \mathsf M(x-m)\sin x
v = \mathsf M(\sin(x)-s)^2
J(a, b) = v+(s-a)^2-2bc+b^2d
S(x) = \sin x
keep: J, \alpha, \beta, \mathsf M, S, x, m
"""


statistical = r"""
\lambda, \Psi, D_n: in .2 .9
y: num
x: nodes \lambda \Psi
h = \mathsf M\sin x
G = \mathsf M(x-\lambda)\sin(x)/\Psi
F = \mathsf D\sin(x)+D_n
K = \Psi G/F
z = \lambda+K(y-h)
p = \Psi-K^2F
C = \mathsf M(x-\lambda)\sin x
P^- = \Psi
S(x) = \sin x
S'(x) = \cos x
"""


LETTERS = (display, western, again, line, statistical)
DECLARED = {
    DEFINITION: [
        r"x_{k+1}=x_k-T\sin x_k+\cos(x_k)\,\xi_k",
        r"y_k=\sin x_k+n_k",
        r"x_0\sim\mathcal N(1,\,0.1)",
        r"x\sim\mathcal N(\lambda,\Psi)",
    ],
    CONDITION: [r"\nu\ll1", r"\frac34\kappa^2\ll1", r"S'\approx0"],
    NOTATION: [r"\mathsf{M}[e^2]/p", r"\mathsf{M}[e^2]/\Psi", r"g^2D_\xi"],
}
EQUALS = {r"\frac{\mathsf Me_n^2}{p_n}": r"1+\frac{3\kappa^2}{4n}"}
