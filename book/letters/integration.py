"""The letters of integration.md: runs of the package's filter of an axis, its Western form with matrices, the accelerometer."""

import numpy as np
from control import dare
from gate.page import CONDITION, DEFINITION, NOTATION
from gate.values import Indexed, Of
from gate.worlds import K_RANGE, column, covariance
from scipy.integrate import quad

from kfcourse.filters.kalman import correct, predict
from kfcourse.laws import Gaussian
from kfcourse.linear import LinearSystem, run
from kfcourse.scenarios.navigation import Dynamics

SENSOR, RADIO = r"y_{\mathrm{NR},k}", r"y_{\mathrm R,k}"


def sensors(rng):
    """What the two sensors read, and the error that the slow one has."""
    lam, eps, n = rng.normal(size=(3, 5))
    S = [np.sin, np.cos, np.exp, np.tanh, np.cosh]
    slow, radio = lam + eps, [one(value) + noise for one, value, noise in zip(S, lam, n, strict=True)]
    y, at = rng.normal(size=2)
    step = 1e-20
    return {
        r"\lambda": Indexed(lam, at), r"\varepsilon": Indexed(eps), "n": Indexed(n), "S": Indexed(S), "k": K_RANGE,
        SENSOR: Of(lambda k: slow[k], "k"), RADIO: Of(lambda k: radio[k], "k"), "S'": np.cos,
        r"\frac{d}{d\varepsilon}S(y_{\mathrm{NR}}-\varepsilon)": np.sin(y - (y - at + 1j * step)).imag / step,
    }  # fmt: skip


def axis(rng):
    """The package's filter of the inertial system's error, on one axis."""
    xi, n, p0, V = 0.3, 0.7, 1.4, rng.normal(size=5)
    drift = rng.normal(size=5)
    ins, receiver = V + drift, V + rng.normal(size=5)
    law = run(
        LinearSystem([[1.0]], [[-1.0]], [[xi**2]], [[n**2]]),
        Gaussian(np.zeros(1), np.array([[p0]])),
        (receiver - ins)[:, None, None],
    )
    eps, p, Psi = law.posterior.mean[:, 0, 0], law.posterior.cov[:, 0, 0, 0], law.predicted.cov[:, 0, 0, 0]
    innovation = receiver - ins + law.predicted.mean[:, 0, 0]
    changes = {"V": Indexed(V), "n": Indexed(receiver - V), r"\varepsilon": Indexed(drift)}
    return changes | {
        r"\Psi": Indexed(Psi), "p": Indexed(p), "K": Indexed(-p / n**2), r"\hat\varepsilon": Indexed(eps),
        r"\nu": Indexed(innovation),
        r"\hat V": Indexed(ins - eps), r"\sigma_\xi": xi, r"\sigma_n": n, "k": K_RANGE,
        r"y_{\mathrm{SR},k}": Of(lambda k: receiver[k], "k"), r"y_{\mathrm{INS},k}": Of(lambda k: ins[k], "k"),
    }  # fmt: skip


def errors(rng):
    """One moment: the readings by what they are made of."""
    V, n, e, guess = rng.normal(size=4)
    return {
        "V": V, "n": n, r"\varepsilon": e, r"\hat\varepsilon": guess, r"\hat V": V + e - guess, r"y_{\mathrm{SR}}": V + n,
        r"y_{\mathrm{INS}}": V + e,
    }  # fmt: skip


def western(rng, after=True):
    """Three axes together, as Western books write it."""
    system = LinearSystem(np.eye(3), -np.eye(3), covariance(rng, 3), covariance(rng, 3))
    P, before = covariance(rng, 3), rng.normal(size=3)
    ahead = predict(system, Gaussian(before, P))
    gnss, ins = rng.normal(size=(2, 3))
    found = correct(system, ahead, gnss - ins)
    K = -found.cov @ np.linalg.inv(system.R)
    return {
        "P^-": ahead.cov, "P": found.cov if after else P, "Q": system.Q, "R": system.R, "H": system.H, "I": np.eye(3), "K": K,
        r"\delta z": column(gnss - ins), r"\delta\hat x^-": column(ahead.mean), r"\delta\hat x": column(found.mean),
        r"(\cdot)": column(gnss - ins + ahead.mean), r"z_\text{GNSS}": column(gnss), r"z_\text{INS}": column(ins),
        r"\hat v": column(ins - found.mean), r"v_\text{INS}": column(ins), r"\delta\hat v": column(found.mean),
    }  # fmt: skip


def western_before(rng):
    return western(rng, after=False)


def accelerometer(rng):
    T = rng.uniform(0.5, 1)
    moved = Dynamics(A=[[0, 1, 0], [0, 0, -1], [0, 0, 0]], B=[[0], [1], [0]], Qc=np.zeros((3, 3))).over(T)
    return {"A": moved.A, "H": np.array([[1.0, 0, 0]]), "T_a": T}


def failure(rng):
    t, q = rng.uniform(1, 2, size=2)
    spread = quad(lambda s: ((t - s) ** 2 / 2) ** 2 * q, 0, t)[0]
    return {"t": t, "q_b": q, r"\textstyle\int_0^t\bigl(\frac12(t-s)^2\bigr)^2q_b\,ds": spread}


def slow_drift(rng):
    """The variance of the steady state, from its quadratic equation, at a drift of 1e-10."""
    xi, n = rng.uniform(1, 2) * 1e-10, rng.uniform(1, 2)
    return {r"\lim_{\sigma_\xi\to0}": 1.0, r"\sigma_\xi": xi, r"\sigma_n": n, "p": np.roots([1, xi**2, -((xi * n) ** 2)]).max()}


def complementary(rng, kappa=0.4, xi=0.7, n=1.3):
    """The steady variance of a low-pass filter for the receiver and its complement for the INS: noises added up one by one."""
    weights = (1 - kappa) ** np.arange(600)  # of the receiver's noises in the error, and of the changes of the INS's error
    spread = ((kappa * weights) ** 2).sum() * n**2 + (weights[1:] ** 2).sum() * xi**2
    return {r"\kappa": kappa, r"\sigma_\xi": xi, r"\sigma_n": n, r"\mathsf De": spread}


def best_border(rng):
    """The low-pass filter with the gain of the steady Kalman filter, for a drift that is slow."""
    n = rng.uniform(1, 2)
    xi = n * rng.uniform(0.05, 0.1)
    p = np.roots([1, xi**2, -((xi * n) ** 2)]).max()
    return complementary(rng, p / n**2, xi, n)


def low_pass(rng):
    """Step by step: the receiver's velocity less the INS's, smoothed, is added to the INS's."""
    kappa, V, drift, n = rng.uniform(0.3, 0.6), *rng.normal(size=(3, 5))
    epsilon, smooth = np.cumsum(drift), np.zeros(5)
    for k in range(1, 5):
        smooth[k] = (1 - kappa) * smooth[k - 1] + kappa * ((V + n) - (V + epsilon))[k]
    made = {"V": Indexed(V), "n": Indexed(n), r"\varepsilon": Indexed(epsilon), r"\xi": Indexed(drift[1:])}
    return made | {r"\kappa": kappa, "e": Indexed(V + epsilon + smooth - V), "k": range(1, 4)}


def two_filters(rng):
    """At one frequency filters are factors."""
    V, n, e, F, G = rng.normal(size=5)
    made = {r"\mathcal F": F, r"\mathcal G": G, r"\hat V": F * (V + e) + G * (V + n), "V": V, "n": n, r"\varepsilon": e}
    return made | {r"y_{\mathrm{INS}}": V + e, r"y_{\mathrm{SR}}": V + n}


def rare(rng):
    """The steady variances of a receiver that averages over m steps."""
    m, xi, n = 3, *rng.uniform(0.5, 2, size=2)
    q, R = m * xi**2, n**2 / m
    Psi = dare(np.eye(1), np.eye(1), [[q]], [[R]])[0].item()
    return {"m": m, r"\sigma_\xi": xi, r"\sigma_n": n, "q": q, "R": R, r"\Psi": Psi, "p": Psi - q}


def lecture(rng):
    """The general gain, and the lecture's."""
    own = western(rng)
    law = {"G": own["H"], r"\Psi": own["P^-"], "p": own["P"], "F": own["P^-"] + own["R"], "K": own["P^-"] @ own["H"].T}
    K = np.linalg.solve(law["F"], law["K"].T).T
    return law | {"K": K, r"\tilde D": own["P^-"], "D": own["P"], "D_n": own["R"], "I": np.eye(3)}


LETTERS = (
    complementary,
    slow_drift,
    sensors,
    axis,
    errors,
    western,
    western_before,
    accelerometer,
    failure,
    best_border,
    low_pass,
    two_filters,
    rare,
    lecture,
)
SAID = {
    DEFINITION: [
        r"x_k=f(x_{k-1},\,y_{\mathrm{NR},k-1}-\varepsilon_{k-1})+g\,\xi_{k-1}",
        r"\varepsilon_k=\varepsilon_{k-1}+\zeta_{k-1}",
    ],
    NOTATION: ["p", r"S(\lambda)-S(\lambda+\delta)"],
    CONDITION: [r"m=2\sigma_n/\sigma_\xi", r"\mathcal F+\mathcal G=1", r"\mathcal F=1-\mathcal G"],
}
EQUALS = {
    r"\sqrt{\sigma_n/\sigma_\xi}": r"\sigma_n/\sqrt p",
    r"{\lim_{\sigma_\xi\to0}p/\sigma_\xi}": r"\sigma_n",
    r"\frac{d}{d\varepsilon}S(y_{\mathrm{NR}}-\varepsilon)": r"-S'(\lambda)",
    r"y_{\mathrm{SR}}-(y_{\mathrm{INS}}-\hat\varepsilon)": r"n-\varepsilon+\hat\varepsilon",
    r"\hat V-V": r"\varepsilon-\hat\varepsilon",
    r"\delta z-H\,\delta\hat x^-": r"(\cdot)",
    r"\det\begin{pmatrix}H\\HA\\HA^2\end{pmatrix}": "-T_a^3",
    r"\textstyle\int_0^t\bigl(\frac12(t-s)^2\bigr)^2q_b\,ds": "q_bt^5/20",
}
