"""The letters of when-linearisation-fails.md: a signal that is a parabola, its moments by
quadrature."""

from gate.page import CONDITION, NOTATION
from gate.worlds import world

course = r"""
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
keep: S', S'', S, h, F, G, \Psi, D_n, s, c, \nu, \kappa
"""


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
    own = world(course)(rng)
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


perfect = r"""
\nu = 1.3
\lambda: num
\Psi: pos
S': in 1 2
t: in .5 1
S'' = \nu S'/\sqrt\Psi
x: nodes \lambda \Psi
u(x) = S'(x-\lambda)+S''(x-\lambda)^2/2
h = \mathsf Mu(x)
F = \mathsf Du(x)
G = \mathsf M(x-\lambda)u(x)/\Psi
s = (u(\lambda+t\sqrt\Psi)-h)/(S'\sqrt\Psi)
keep: \Psi, S', S'', \nu, F, G, t, s
"""


nearly_straight = perfect.replace("1.3", "0.1")


LETTERS = (course, display, western, again, perfect, nearly_straight)
SAID = {
    CONDITION: [r"\nu\ll1", r"\frac34\kappa^2\ll1", r"S'\approx0"],
    NOTATION: [r"\mathsf{M}[e^2]/p", r"(\mathsf{M}{e})^2/p", r"\mathsf{M}[e^2]/\Psi"],
}
