"""The letters of radar-tracking.md: the flight, a limit by python-control, least squares, and the
package's alpha-beta filter."""

import numpy as np
from control import dare
from gate.page import CONDITION, DEFINITION, NOTATION
from gate.values import Indexed
from gate.worlds import column

from kfcourse import run
from kfcourse.filters.alphabeta import alpha_beta, steady_beta, tracking_index
from kfcourse.linear.system import linear_system
from kfcourse.scenarios.flight import aircraft
from kfcourse.scenarios.radar import kinematic

ALPHA, SIGMA = 0.4, 3.0


def axis(rng, alpha=ALPHA):
    """One axis of the radar's model, with the noise that brings its gain to alpha."""
    T = rng.uniform(0.5, 1)
    sigma_a = tracking_index(alpha) * SIGMA / T**2
    system = linear_system(kinematic(T, noise_sd=sigma_a, measurement_sd=SIGMA))[0]
    A, Q, H = system.A[::3, ::3], system.Q[::3, ::3], system.H[:1, ::3]
    B = Q[:, :1] / np.sqrt(Q[0, 0]) / sigma_a  # Q = sigma_a^2 B B^T
    return {"T": T, "A": A, "B": B, "H": H, "Q": Q, r"\sigma_a": sigma_a, r"\sigma": SIGMA}


model = r"""
T: in .5 1
\sigma = 3
\sigma_a: pos
A = \begin{pmatrix}1&T\\0&1\end{pmatrix}
B = \begin{pmatrix}T^2/2\\T\end{pmatrix}
H = \begin{pmatrix}1&0\end{pmatrix}
Q = \sigma_a^2BB^T
k: range 5
v, w: nums 6
b: any 2
x_0 = b
x_{k+1} = Ax_k+Bv_k
y_k = Hx_k+w_k
k: range 4
keep: T, A, B, H, Q, \sigma_a, \sigma, x, v, w, y, k
"""


def flight(rng):
    track = aircraft(0.8)
    i = int(rng.integers(len(track.time)))
    east, north = track.velocity[i, :2]
    return {
        r"\dot r_x": east,
        r"\dot r_y": north,
        "V": np.hypot(east, north),
        r"\psi": np.arctan2(north, east),
    }


def limit(rng):
    found = axis(rng)
    Psi = dare(found["A"].T, found["H"].T, found["Q"], np.array([[SIGMA**2]]))[0]
    F = Psi[0, 0] + SIGMA**2
    alpha, beta = Psi[0, 0] / F, Psi[1, 0] / F * found["T"]
    closed = np.eye(2) - column([alpha, beta / found["T"]]) @ found["H"]

    def chi(value, beta=beta):
        K = column([alpha, beta / found["T"]])
        return np.linalg.det(value * np.eye(2) - (np.eye(2) - K @ found["H"]) @ found["A"])

    roots = np.roots([1 / 4, alpha - 2, alpha**2])  # of (alpha + beta / 2)^2 - 2 beta
    near = 1 + 2.0**-30

    def E(zeta):
        return (1 - alpha) * (zeta - 1) ** 2 / np.linalg.det(zeta * np.eye(2) - closed @ found["A"])

    return found | {
        r"\Psi": Indexed(lambda i, j: Psi[i - 1, j - 1]),
        "F": F,
        r"\alpha": alpha,
        r"\beta": beta,
        "a_0": 1.7,
        r"\Lambda": found[r"\sigma_a"] * found["T"] ** 2 / SIGMA,
        r"\chi": chi,
        "E": E,
        r"\zeta": near,
        r"\lim_{\zeta\to1}": 1.0,
        r"\chi(-1)\big|_{\beta=\beta_-}": chi(-1, roots.min()),
        r"\chi(-1)\big|_{\beta=\beta_+}": chi(-1, roots.max()),
    }


def growing(rng):
    """The weight of the newest point in the line through k points, at its end and in its slope."""
    end, slope = ([0.0] * 7 for _ in range(2))
    for k in range(2, 7):
        weights = np.linalg.pinv(np.column_stack([np.ones(k), np.arange(1 - k, 1)]))
        end[k], slope[k] = weights[:, -1]
    return {r"\alpha": Indexed(end), r"\beta": Indexed(slope), "k": range(2, 7)}


def _followed(rng):
    found = axis(rng)
    one = kinematic(found["T"], noise_sd=found[r"\sigma_a"], measurement_sd=SIGMA)
    y = rng.normal(size=(6, 1, 3))
    return found, y[:, 0, 0], run(alpha_beta(one, ALPHA, steady_beta(ALPHA)), y).mean[:, 0, ::3]


def start(rng):
    found, y, states = _followed(rng)
    return {"T": found["T"], "y": Indexed(y), "r": states[1, 0], "s": states[1, 1]}


def step(rng):
    """The fourth measurement: the memory still grows."""
    found, y, states = _followed(rng)
    gains = growing(rng)
    return {
        "T": found["T"],
        "r": states[2, 0],
        "s": states[2, 1],
        "r^-": (found["A"] @ states[2])[0],
        "y": y[3],
        r"\nu": y[3] - (found["A"] @ states[2])[0],
        r"\alpha": ALPHA,
        r"\beta": steady_beta(ALPHA),
        r"\alpha_k": gains[r"\alpha"][4,],
        r"\beta_k": gains[r"\beta"][4,],
        r"r\leftarrow": states[3, 0],
        r"s\leftarrow": states[3, 1],
    }


noise_alone = r"""
\alpha, \beta: in .3 .6
\sigma: in 1 2
M = \begin{pmatrix}1-\alpha&1-\alpha\\-\beta&1-\beta\end{pmatrix}
G = \begin{pmatrix}\alpha\\\beta\end{pmatrix}
P = GG^T
again:
P = MPM^T+\sigma^2GG^T
then:
\mathsf De^r = \begin{pmatrix}1&0\end{pmatrix}P\begin{pmatrix}1\\0\end{pmatrix}
\mathsf De^s = \begin{pmatrix}0&1\end{pmatrix}P\begin{pmatrix}0\\1\end{pmatrix}
keep: \alpha, \beta, \sigma, \mathsf De^r, \mathsf De^s
"""


def small_gains(rng):
    alpha = rng.uniform(0.05, 0.1)
    return {r"\alpha": alpha, r"\beta": steady_beta(alpha)}


def limit_at_once(rng):
    """The same limit as matrices, and the filter's answer to a measurement that grows by a factor
    at each step."""
    own, zeta, y = limit(rng), 1.7, rng.normal()
    Psi = np.array([[own[r"\Psi"][i, j] for j in (1, 2)] for i in (1, 2)])
    K, A, H = column([own[r"\alpha"], own[r"\beta"] / own["T"]]), own["A"], own["H"]
    x = np.linalg.solve(np.eye(2) - (np.eye(2) - K @ H) @ A / zeta, K * y)
    answer = {
        r"\zeta": zeta,
        "y": y,
        r"\hat x": x,
        r"\hat r": x[0].item(),
        r"\rho": np.sqrt(1 - own[r"\alpha"]),
    }
    return own | answer | {r"\Psi": Psi, "K": K, "q": own[r"\sigma_a"] ** 2}


errors = r"""
\alpha, \beta: in .3 .6
a, b: num
n: nums 6
k: range 5
r_0 = 0
s_0 = 0
r_{k+1} = r_k+s_k+\alpha(a+(k+1)b+n_{k+1}-r_k-s_k)
s_{k+1} = s_k+\beta(a+(k+1)b+n_{k+1}-r_k-s_k)
e^r_k = r_k-a-kb
e^s_k = s_k-b
k: range 1 5
keep: e^r, e^s, \alpha, \beta, n, k
"""


LETTERS = (
    model,
    flight,
    limit,
    growing,
    start,
    step,
    noise_alone,
    small_gains,
    limit_at_once,
    errors,
)
SAID = {
    DEFINITION: [r"v_k\sim\mathcal N(0,\sigma_a^2)", r"w_k\sim\mathcal N(0,\sigma^2)"],
    "quoted from the radar paper": [r"K=[\alpha,\beta/T]^T"],
    NOTATION: ["0", r"\beta_-", r"\beta_+", r"E(\zeta)", r"\text{lag}", r"\text{instead of}\quad0"],
    "quoted from Benedict and Bordner": [r"\beta=\alpha^2/(2-\alpha)"],
    CONDITION: [r"\chi(-1)<0", r"\beta=4-2\alpha"],
}
EQUALS = {
    r"\chi(-1)": r"4-2\alpha-\beta",
    r"\chi(-1)\big|_{\beta=\beta_-}": r"4\sqrt{1-\alpha}",
    r"\chi(-1)\big|_{\beta=\beta_+}": r"-4\sqrt{1-\alpha}",
    r"\lim_{\zeta\to1}\frac{E(\zeta)}{(\zeta-1)^2}\,T^2": r"T^2(1-\alpha)/\beta",
}
