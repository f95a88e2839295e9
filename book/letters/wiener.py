"""The letters of wiener.md: spectra as sums over correlations, a limit by python-control, least squares for the amplitude."""

import numpy as np
from control import dare
from gate.page import DEFINITION, NOTATION
from gate.values import Indexed
from scipy.linalg import solve_continuous_are
from scipy.stats import norm

from kfcourse.filters.kalman import correct
from kfcourse.laws import Gaussian
from kfcourse.linear.system import LinearSystem


def signal(rng):
    """x' = a x + v in white noise; its spectrum at a real zeta, where the sum of the correlations converges, too."""
    a, Q, R, zeta = rng.uniform(0.5, 0.8), rng.uniform(1, 2), rng.uniform(1, 2), 1.1
    spectrum = sum(Q * a ** abs(k) / (1 - a**2) * zeta ** (-k) for k in range(-300, 301))
    Psi = dare(*(np.array([[one]]) for one in (a, 1, Q, R)))[0].item()
    K = Psi / (Psi + R)
    z, y = rng.normal(size=2)
    after = a * z + K * (y - a * z)
    return {
        "a": a, "Q": Q, "R": R, r"\zeta": zeta, r"S_x(\zeta)": spectrum, r"S_y(\zeta)": spectrum + R, "K": K,
        r"\gamma": a * (1 - K),
        "z": z, "y_k": y, r"z\leftarrow": after,
    }  # fmt: skip


def waiting(rng, m=3):
    """The best linear estimate of a state from a long record that ends m steps later, and from one that ends with it."""
    found = signal(rng)
    a, Q, R, K = (found[name] for name in "aQRK")

    def left(last):
        at = np.arange(-60, last + 1)
        of_x = Q / (1 - a**2) * a ** np.abs(at)
        of_y = Q / (1 - a**2) * a ** np.abs(np.subtract.outer(at, at)) + R * np.eye(len(at))
        return Q / (1 - a**2) - of_x @ np.linalg.solve(of_y, of_x)

    rho = R / (1 - K)
    return {"p_m": left(m), "p_0": left(0), "b": K * rho, r"\rho": rho, r"\gamma": found[r"\gamma"], "m": m}


def amplitude(rng):
    """A pulse of which the package's Kalman filter finds the amplitude, sample by sample."""
    s, y, R, d, b = rng.normal(size=4), rng.normal(size=4), 0.7, 1.9, 0.6
    law = Gaussian(np.zeros(1), np.array([[d]]))
    for one, measured in zip(s, y, strict=True):
        law = correct(LinearSystem([[1.0]], [[one]], [[0.0]], [[R]]), law, np.array([measured]))
    return {
        "C": np.dot(s, y), "E": np.dot(s, s), "R": R, "d": d, "z": law.mean.item(), "p": law.cov.item(), "b": b,
        r"\mathcal L": lambda b: np.prod(norm.pdf(y, b * s, np.sqrt(R))),
    }  # fmt: skip


def correlator(rng):
    """The matched filter along a record, and the amplitude by least squares at each moment."""
    n, s, y = 3, rng.normal(size=4), rng.normal(size=9)
    C = [np.convolve(y, s[::-1])[k] for k in range(9)]
    b = [np.nan] * n + [np.linalg.lstsq(s[:, None], y[k - n : k + 1], rcond=None)[0].item() for k in range(n, 9)]
    return {"n": n, "s": Indexed(s), "y": Indexed(y), "C": Indexed(C), "i": range(n + 1), "k": range(n, 9), r"\hat b": Indexed(b)}


def bucy(rng):
    """The stationary continuous filter of an axis, its gain by SciPy, as a function of the frequency."""
    Omega, nu, p = rng.uniform(1, 2), rng.uniform(1, 2), rng.uniform(1, 2)
    A, H = np.array([[0.0, 1], [0, 0]]), np.array([[1.0, 0]])
    K = solve_continuous_are(A.T, H.T, np.diag([0, nu * Omega**4]), np.array([[nu]])) @ H.T / nu
    C = [np.linalg.det(sign * p * np.eye(2) - A + K @ H) for sign in (1, -1)]
    return {
        "p": p, "A": A, "H": H, "K": K, "I": np.eye(2), r"\Omega": Omega, r"\nu": nu, "C(p)": C[0], "C(-p)": C[1],
        "W(p)": 1 - p**2 / C[0],
    }  # fmt: skip


def shrinking(rng):
    """The gains of the alpha-beta filter at an interval of 1e-10, where they are those of the limit."""
    T, Omega = 1e-10, rng.uniform(1, 2)
    index = (Omega * T) ** 2
    missing = (np.sqrt(index**2 + 8 * index) - index) / 4  # 1 - sqrt(1 - alpha), without its cancellation
    return {r"\lim_{T\to0}": 1.0, "T": T, r"\Omega": Omega, r"\alpha": missing * (2 - missing), r"\beta": 2 * missing**2}


def weights(rng):
    g, s = rng.normal(size=(2, 4))
    return {"g": Indexed(g), "s": Indexed(s), "k": range(4), "i": range(4), "j": range(4)}


def found(rng):
    """The greatest ratio for one pulse: the mean of the correlator over its deviation, squared."""
    own = amplitude(rng)
    return {name: own[name] for name in ("R", "E", "b")} | {"d": own["b"] * own["E"] / np.sqrt(own["R"] * own["E"])}


LETTERS = (signal, waiting, amplitude, correlator, weights, bucy, shrinking, found)
SAID = {
    DEFINITION: [r"\zeta=e^{i\theta}", "x_{k+1}=ax_k+v_k"],
    "quoted from Van Trees": [
        r"W(\zeta)=\frac{1-a\zeta^{-1}}{\rho\,(1-\gamma\zeta^{-1})}\left[\frac{Q}{(1-a\zeta^{-1})(1-\gamma\zeta)}\right]_+"
    ],
    "verified below, for four samples": [r"\frac{b^2\left(\sum g_ks_k\right)^2}{R\sum g_k^2}\;\le\;\frac{b^2}{R}\sum s_k^2"],
    "a condition": [r"|\gamma|<1"],
    NOTATION: [r"\bigl[\,\cdot\,\bigr]", r"W(\zeta)", "W(p)", "C(p)", "C(-p)", "|D|^2", "|C|^2"],
    "a setting": ["d^2=13"],
}
EQUALS = {
    "H(pI-A+KH)^{-1}K": "W(p)",
    r"\lim_{T\to0}\frac{\alpha}{T}": r"\sqrt2\Omega",
    r"\lim_{T\to0}\frac{\beta}{T^2}": r"\Omega^2",
    r"C_k/\sum s_i^2": r"\hat b_k",
    r"\textstyle\sum g_k^2\sum s_k^2-(\sum g_ks_k)^2": r"\frac12\sum_i\sum_j(g_is_j-g_js_i)^2",
    r"\ln\frac{\mathcal L(b)}{\mathcal L(0)}": "(bC-b^2E/2)/R",
}
