"""The letters of wiener.md: spectra as sums over correlations, a limit by python-control, least
squares for the amplitude."""

import numpy as np
from gate.page import DEFINITION, NOTATION
from gate.worlds import world
from scipy.linalg import solve_continuous_are

signal = r"""
a: in .5 .8
Q, R: in 1 2
\zeta = 1.1               # where the sum of the correlations converges, too
"S_x(\zeta)" = Q/(1-a^2)(1+\sum_{i=1}^{400}a^i(\zeta^i+\zeta^{-i}))
"S_y(\zeta)" = S_x(\zeta)+R
\Psi = Q
again:
\Psi = Q+a^2/(1/\Psi+1/R)
then:
K = \Psi/(\Psi+R)
\gamma = a(1-K)
z, y_k: num
z\leftarrow = az+K(y_k-az)
keep: a, Q, R, \zeta, S_x(\zeta), S_y(\zeta), K, \gamma, z, y_k, z\leftarrow
"""


def waiting(rng, m=3):
    """The best linear estimate of a state from a long record that ends m steps later, and from one
    that ends with it."""
    found = world(signal)(rng)
    a, Q, R, K = (found[name] for name in "aQRK")

    def left(last):
        at = np.arange(-60, last + 1)
        of_x = Q / (1 - a**2) * a ** np.abs(at)
        of_y = Q / (1 - a**2) * a ** np.abs(np.subtract.outer(at, at)) + R * np.eye(len(at))
        return Q / (1 - a**2) - of_x @ np.linalg.solve(of_y, of_x)

    rho = R / (1 - K)
    return {
        "p_m": left(m),
        "p_0": left(0),
        "b": K * rho,
        r"\rho": rho,
        r"\gamma": found[r"\gamma"],
        "m": m,
    }


amplitude = r"""
s, y: nums 4
R = 0.7
d = 1.9
b = 0.6
C = \sum_{i=0}^3s_iy_i
E = \sum_{i=0}^3s_i^2
p = 1/(1/d+E/R)
z = pC/R
\mathcal L(b) = \prod_{i=0}^3\mathcal N(y_i;bs_i,R)
keep: C, E, R, d, z, p, b, \mathcal L
"""


correlator = r"""
n = 3
s: nums 4
y: nums 9
i: range 4
k: range 3 9
C_k = \sum_is_iy_{k-3+i}
\hat b_k = C_k/\sum_is_i^2
"""


def bucy(rng):
    """The stationary continuous filter of an axis, its gain by SciPy, as a function of the
    frequency."""
    Omega, nu, p = rng.uniform(1, 2), rng.uniform(1, 2), rng.uniform(1, 2)
    A, H = np.array([[0.0, 1], [0, 0]]), np.array([[1.0, 0]])
    K = solve_continuous_are(A.T, H.T, np.diag([0, nu * Omega**4]), np.array([[nu]])) @ H.T / nu
    C = [np.linalg.det(sign * p * np.eye(2) - A + K @ H) for sign in (1, -1)]
    return {
        "p": p,
        "A": A,
        "H": H,
        "K": K,
        "I": np.eye(2),
        r"\Omega": Omega,
        r"\nu": nu,
        "C(p)": C[0],
        "C(-p)": C[1],
        "W(p)": 1 - p**2 / C[0],
    }


shrinking = r"""
T = 0.0000000001
\Omega: in 1 2
n = (\Omega T)^2
m = (\sqrt{n^2+8n}-n)/4      # 1 - sqrt(1 - alpha), without its cancellation
\alpha = m(2-m)
\beta = 2m^2
"\lim_{T\to0}" = 1
keep: \lim_{T\to0}, T, \Omega, \alpha, \beta
"""


weights = r"""
g, s: nums 4
k: range 4
i: range 4
j: range 4
"""


def found(rng):
    """The greatest ratio for one pulse: the mean of the correlator over its deviation, squared."""
    own = world(amplitude)(rng)
    return {name: own[name] for name in ("R", "E", "b")} | {
        "d": own["b"] * own["E"] / np.sqrt(own["R"] * own["E"])
    }


LETTERS = (signal, waiting, amplitude, correlator, weights, bucy, shrinking, found)
SAID = {
    DEFINITION: [r"\zeta=e^{i\theta}", "x_{k+1}=ax_k+v_k"],
    "quoted from Van Trees": [
        r"W(\zeta)=\frac{1-a\zeta^{-1}}{\rho\,(1-\gamma\zeta^{-1})}\left[\frac{Q}{(1-a\zeta^{-1})(1-\gamma\zeta)}\right]_+"
    ],
    "verified below, for four samples": [
        r"\frac{b^2\left(\sum g_ks_k\right)^2}{R\sum g_k^2}\;\le\;\frac{b^2}{R}\sum s_k^2"
    ],
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
