"""The letters of better-than-a-tangent.md: moments of signals over a normal law, by quadrature and
by the package."""

from gate.page import DEFINITION, NOTATION

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


def corrected(h, G, F, lam, Psi, y):
    """What any correction does with h, G and F."""
    K = Psi * G / F
    return {
        "h": h,
        "G": G,
        "F": F,
        "K": K,
        "z": lam + (y - h) * K,
        "p": Psi - K**2 * F,
        r"\lambda": lam,
        r"\Psi": Psi,
        "y": y,
    }


second_order = r"""
\lambda, \Psi, D_n: in .2 .9
S', S'', y: num
S = 0.3
x: nodes \lambda \Psi
s(x) = S+S'(x-\lambda)+S''(x-\lambda)^2/2
h = \mathsf Ms(x)
G = \mathsf M(x-\lambda)s(x)/\Psi
F = \mathsf M(s(x)-h)^2+D_n
K = \Psi G/F
z = \lambda+K(y-h)
p = \Psi-K^2F
keep: h, G, F, K, z, p, \lambda, \Psi, y, S, S', S'', D_n
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


LETTERS = (line, second_order, statistical)
SAID = {
    DEFINITION: [r"x\sim\mathcal N(\lambda,\Psi)"],
    NOTATION: [r"g^2D_\xi", r"(\Theta-G^2p)_{1}", r"(\Theta-G^2p)_{2}", r"\mathsf{M}[e^2]"],
}
