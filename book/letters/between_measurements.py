r"""The letters of between-measurements.md: a linear object, its moments by the matrix exponential and
their rates."""

from gate.page import DEFINITION, NOTATION
from gate.shared import LINEAR

course = (
    LINEAR
    + r"""
p: cov 2
s: any 2
m(t) = \Phi(t)s+b(t)
z = m(0.5)
\dot z = \operatorname{slope}(m, 0.5)
\dot\Phi = \operatorname{slope}(\Phi, 0.5)
\dot Q = \operatorname{slope}(Q, 0.5)
\Psi = \Phi(0.5)p\Phi(0.5)^T+Q(0.5)
\Phi = \Phi(0.5)
Q = Q(0.5)
"\mathsf MBB^T" = BB^T
"\mathsf Ma" = Az+c
keep: A, p, \Phi, Q, \Psi, \dot z, \dot\Phi, \dot Q, \mathsf MBB^T, \mathsf Ma
"""
)


correction = r"""
\Psi, R: cov 2
G: any 2 2
\lambda, y, h: any 2 1
p = (\Psi^{-1}+G^TR^{-1}G)^{-1}
K = pG^TR^{-1}
z = \lambda+K(y-h)
"""


LETTERS = (course, correction)
DECLARED = {
    DEFINITION: [r"dx=a(x,t)\,dt+B(x,t)\,dw", "y_k=b(x(t_k),w_k)"],
    NOTATION: [
        r"\Phi p\Phi^T+Q",
        r"\mathsf{M}B^2",
        r"\mathsf{M}BB^T",
        r"\partial p/\partial t",
        r"-\partial(\tanh(x')\,p)/\partial x'+\tfrac12\,\partial^2p/\partial x'^2",
    ],
}
