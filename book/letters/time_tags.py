"""The letters of time-tags.md: a foreign clock, and the package's prediction over an interval."""

from gate.page import DEFINITION, NOTATION
from gate.worlds import column, covariance

from kfcourse.scenarios.navigation import Clock, Dynamics


def clock(rng):
    rate, shift, read = rng.uniform(0.9, 1.1), *rng.normal(size=2)
    return {"c": read, "c_0": shift, "r": rate, "t": Clock(rate, shift).time(read)}


def prediction(rng):
    """Over the interval in one step, against many short ones."""
    motion = Dynamics(A=rng.normal(size=(3, 3)), B=rng.normal(size=(3, 1)), Qc=covariance(rng, 3))
    z, p, u, delta = column(rng.normal(size=3)), covariance(rng, 3), rng.normal(size=(1, 1)), 0.4
    lam, Psi, short = z, p, motion.over(delta / 8)
    for _ in range(8):
        lam, Psi = short.A @ lam + short.B @ u, short.A @ Psi @ short.A.T + short.Q
    return {
        "A": lambda d: motion.over(d).A,
        "B": lambda d: motion.over(d).B,
        "Q": lambda d: motion.over(d).Q,
        r"\Delta": delta,
        "z": z,
        "p": p,
        "u": u,
        r"\lambda": lam,
        r"\Psi": Psi,
    }


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
p, Q, R, K: pos
K_* = p/(p+R)
"""


late_gain = r"""
p, Q, R: pos
K = 1-R/(p+Q+R)
"""


LETTERS = (clock, prediction, late, one_step_late, late_gain)
SAID = {
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
