"""The letters of radar-tracking.md: a limit by python-control, least squares, the package's
alpha-beta filter and its filter with an acceleration made of measurements."""

import numpy as np
from control import dare
from gate.page import CONDITION, DEFINITION, NOTATION
from gate.values import Indexed
from gate.worlds import column, covariance

from kfcourse import run
from kfcourse.filters.alphabeta import alpha_beta, steady_beta, tracking_index
from kfcourse.laws import Gaussian
from kfcourse.linear import LinearSystem
from kfcourse.linear import run as run_linear
from kfcourse.linear.system import linear_system
from kfcourse.scenarios.pointer import acceleration_from
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


def limit(rng):
    found = axis(rng)
    Psi = dare(found["A"].T, found["H"].T, found["Q"], np.array([[SIGMA**2]]))[0]
    F = Psi[0, 0] + SIGMA**2
    p = Psi - Psi @ found["H"].T @ found["H"] @ Psi / F
    alpha, beta = Psi[0, 0] / F, Psi[1, 0] / F * found["T"]
    closed = np.eye(2) - column([alpha, beta / found["T"]]) @ found["H"]

    def chi(value, beta=beta):
        K = column([alpha, beta / found["T"]])
        return np.linalg.det(value * np.eye(2) - (np.eye(2) - K @ found["H"]) @ found["A"])

    roots = np.roots([1 / 4, alpha - 2, alpha**2])  # of (alpha + beta / 2)^2 - 2 beta

    def E(zeta):
        return (1 - alpha) * (zeta - 1) ** 2 / np.linalg.det(zeta * np.eye(2) - closed @ found["A"])

    return found | {
        r"\Psi": Indexed(lambda i, j: Psi[i - 1, j - 1]),
        "p": Indexed(lambda i, j: p[i - 1, j - 1]),
        "F": F,
        "q": found[r"\sigma_a"] ** 2,
        r"\alpha": alpha,
        r"\beta": beta,
        r"\rho": np.sqrt(1 - alpha),
        "a_0": 1.7,
        r"\Lambda": found[r"\sigma_a"] * found["T"] ** 2 / SIGMA,
        r"\chi": chi,
        "E": E,
        r"\zeta": 1.7,
        r"\chi(-1)\big|_{\beta=\beta_-}": chi(-1, roots.min()),
        r"\chi(-1)\big|_{\beta=\beta_+}": chi(-1, roots.max()),
    }


def lagging(rng):
    """A parabola without noise, followed until nothing changes."""
    found = axis(rng)
    T, beta, a = found["T"], steady_beta(ALPHA), 1.7
    state = np.zeros(2)
    for time in T * np.arange(400):
        state = found["A"] @ state
        miss = a * time**2 / 2 - state[0]
        state += np.array([ALPHA, beta / T]) * miss
    return found | {
        r"\alpha": ALPHA,
        r"\beta": beta,
        "a_0": a,
        r"\nu": miss,
        r"\ell": a * time**2 / 2 - state[0],
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
        "p": Psi - K @ H @ Psi,
    }
    return own | answer | {r"\Psi": Psi, "K": K}


def controlled(rng):
    """A run with the control."""
    found = axis(rng)
    y = rng.normal(size=(6, 1, 2))
    u = np.nan_to_num(acceleration_from(y, found["T"]))[..., :1]
    Q = (found["Q"] + found["Q"].T) / 2
    system = LinearSystem(found["A"], found["H"], Q, np.array([[SIGMA**2]]), found["B"])
    law = run_linear(system, Gaussian(rng.normal(size=2), covariance(rng, 2)), y[..., :1], u)
    z, lam = ([column(one) for one in laws.mean[:, 0]] for laws in (law.posterior, law.predicted))
    return found | {
        r"\lambda": Indexed(lam),
        "z": Indexed(z),
        "u": Indexed(u[:, 0, 0]),
        "y": Indexed(y[:, 0, 0]),
        "k": range(2, 5),
    }


def transfers(rng):
    """What leads from y to the error, by matrices."""
    found = limit_at_once(rng)
    A, B, H, K, T = (found[name] for name in "ABHKT")
    rest = np.eye(2) - K @ H

    def error(control):
        def E(zeta):
            taken = K + rest @ B * (1 - 1 / zeta) ** 2 / T**2 / zeta * control
            return 1 - np.linalg.solve(np.eye(2) - rest @ A / zeta, taken)[0, 0]

        return E

    return {"E": error(0), "E_u": error(1), r"\zeta": 1.7}


def polar(rng):
    """The meter's derivatives by differences."""
    x = rng.uniform(1, 2, 2)

    def h(x):
        return np.array([abs(complex(*x)), np.angle(complex(*x))])

    steps = 1e-6 * np.eye(2)
    H = np.column_stack([(h(x + one) - h(x - one)) / 2e-6 for one in steps])
    return {
        "r_x": x[0],
        "r_y": x[1],
        "d": h(x)[0],
        r"\varphi": h(x)[1],
        "h": lambda _: column(h(x)),
        "x": 0,
        r"\operatorname{atan2}": lambda y, x: np.arctan2(y, x),
        "H": H,
        r"\frac{\partial h}{\partial(r_x,r_y)}": H,
    }


LETTERS = (
    model,
    limit,
    lagging,
    growing,
    start,
    step,
    limit_at_once,
    controlled,
    transfers,
    polar,
)
SAID = {
    DEFINITION: [r"v_k\sim\mathcal N(0,\sigma_a^2)", r"w_k\sim\mathcal N(0,\sigma^2)"],
    "quoted from the radar paper": [r"K=[\alpha,\beta/T]^T"],
    NOTATION: [r"E(\zeta)"],
    CONDITION: [r"|\zeta|=1"],
}
EQUALS = {
    r"\chi(\zeta)": r"\zeta^2-(2-\alpha-\beta)\zeta+1-\alpha",
    r"\chi(1)": r"\beta",
    r"\chi(-1)": r"4-2\alpha-\beta",
    r"\chi(-1)\big|_{\beta=\beta_-}": r"4\rho",
    r"\chi(-1)\big|_{\beta=\beta_+}": r"-4\rho",
    r"\frac{E_u(\zeta)}{E(\zeta)}": r"\frac{(\zeta-1)(2\zeta+1)}{2\zeta^2}",
}
