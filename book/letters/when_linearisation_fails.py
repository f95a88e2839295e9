"""The letters of when-linearisation-fails.md: a signal that is a parabola, its moments by
quadrature."""

from gate.page import CONDITION, DEFINITION, NOTATION
from gate.worlds import world

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


def western(rng):
    own = world(display)(rng)
    names = {r"\Psi": "P^-", "D_n": "R", "S'": "h'", "S''": "h''"}
    return {names.get(name, name): value for name, value in own.items()}


def again(rng):
    """A constant measured n times, the first time with a larger error than is claimed: the filter's
    own recursion."""
    kappa, p, n = rng.uniform(1, 3), rng.uniform(0.5, 2), int(rng.integers(4, 9))
    claimed, square = p, (1 + 3 * kappa**2 / 4) * p
    for _ in range(n - 1):
        K = claimed / (claimed + p)
        claimed, square = (1 - K) * claimed, (1 - K) ** 2 * square + K**2 * p
    return {r"\kappa": kappa, "n": n, r"\frac{\mathsf Me_n^2}{p_n}": square / claimed}


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
SAID = {
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
