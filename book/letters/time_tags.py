r"""The letters of time-tags.md: a foreign clock, and the prediction over an interval in one step and
in many short ones."""

from gate.page import DEFINITION, NOTATION
from gate.shared import LINEAR

clock = r"""
r: in .9 1.1
c_0, t: num
c = c_0+rt
"""

prediction = (
    LINEAR
    + r"""
z: any 2
p: cov 2
q: num
\Delta = 0.4
d = \Delta/8
k: range 9
x_0 = z
P_0 = p
x_{k+1} = \Phi(d)x_k+b(d)q
P_{k+1} = \Phi(d)P_k\Phi(d)^T+Q(d)
\lambda = x_8
\Psi = P_8
A(t) = \Phi(t)
B(t) = b(t)
u = q
keep: A, B, Q, \Delta, z, p, u, \lambda, \Psi
"""
)

late = r"""
s, V, a, j, \tau, b: num
p(t) = s+Vt+at^2/2+jt^3/6
\hat s = p(-\tau)
\hat V = V-a\tau+j\tau^2/2
\hat b = a+b-(a-j\tau)
V_0 = V
a_0 = a
keep: s, V, b, V_0, a_0, j, \tau, \hat s, \hat V, \hat b
"""


one_step_late = r"""
p, Q, R, K: in .5 2
K_* = p/(p+R)
"""


late_gain = r"""
p, Q, R: in .5 2
K = 1-R/(p+Q+R)
"""


LETTERS = (clock, prediction, late, one_step_late, late_gain)
DECLARED = {
    NOTATION: [r"\text{loss}", r"\text{has}-\text{claims}"],
    DEFINITION: [
        r"\hat s(t)=s(t-\tau)",
        r"\hat V(t)=\dot s(t-\tau)",
        r"\hat b(t)=u(t)-\ddot s(t-\tau)",
        "c(t)=rt+c_0",
        r"\dot x=Ax+Bu+\xi",
        "y_{i,k}=H_ix(t_{i,k})+n_{i,k}",
    ],
}
EQUALS = {
    r"{\hat{s}-s}": r"-V_0\tau+a_0\tau^2/2-j\tau^3/6",
    r"{\hat{V}-V}": r"-a_0\tau+j\tau^2/2",
    r"{\hat{b}-b}": r"j\tau",
}
