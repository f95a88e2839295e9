"""The letters of time-tags.md: a foreign clock, and the package's prediction over an interval."""

import numpy as np
from gate.page import DEFINITION
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
        "A": lambda d: motion.over(d).A, "B": lambda d: motion.over(d).B, "Q": lambda d: motion.over(d).Q, r"\Delta": delta,
        "z": z, "p": p, "u": u, r"\lambda": lam, r"\Psi": Psi,
    }  # fmt: skip


def late(rng):
    """At the time 0: what a motion with a constant jerk was a moment tau before, beside what it is."""
    s, V, a, j, tau, b = rng.normal(size=6)
    was = np.polynomial.Polynomial([s, V, a / 2, j / 6])
    return {
        "s": s, "V": V, "b": b, "V_0": V, "a_0": a, "j": j, r"\tau": tau, r"\hat s": was(-tau), r"\hat V": was.deriv()(-tau),
        r"\hat b": a + b - was.deriv(2)(-tau),
    }  # fmt: skip


def one_step_late(rng):
    """A measurement of the last state: its best gain by least squares over the three errors."""
    p, Q, R, K = rng.uniform(0.5, 2, 4)
    unit = np.sqrt(np.array([[p, 0], [Q, 0], [0, R]]))  # of x_{k-1} - z, v, w: what the state holds, what is noise alone
    state, seen = unit[:, 0], np.array([unit[0, 0], 0, unit[2, 1]])
    return {"p": p, "Q": Q, "R": R, "K": K, "K_*": np.linalg.lstsq(seen[:, None], state, rcond=None)[0].item()}


def late_gain(rng):
    """The gain of one who takes the measurement for one of this moment."""
    p, Q, R = rng.uniform(0.5, 2, size=3)
    return {"p": p, "Q": Q, "R": R, "K": 1 - R * np.linalg.inv([[p + Q + R]]).item()}


LETTERS = (clock, prediction, late, one_step_late, late_gain)
SAID = {
    DEFINITION: [r"\hat s(t)=s(t-\tau)", r"\hat V(t)=\dot s(t-\tau)", r"\hat b(t)=u(t)-\ddot s(t-\tau)", "c(t)=rt+c_0"],
}
EQUALS = {r"{\hat{s}-s}": r"-V_0\tau+a_0\tau^2/2-j\tau^3/6", r"{\hat{V}-V}": r"-a_0\tau+j\tau^2/2", r"{\hat{b}-b}": r"j\tau"}
