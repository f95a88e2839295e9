"""The letters of radar-extended.md: the package's filter with an acceleration made of measurements,
and transfers by matrices."""

import numpy as np
from gate.page import CONDITION, NOTATION
from gate.values import Indexed
from gate.worlds import column, covariance, world

from kfcourse.laws import Gaussian
from kfcourse.linear import LinearSystem, run
from kfcourse.scenarios.pointer import acceleration_from

SIGMA = 3.0


axis = r"""
T: in .5 1
I: eye 2
\alpha = 0.4
\sigma = 3
\beta = 2(2-\alpha)-4\sqrt{1-\alpha}
\sigma_a = \beta/\sqrt{1-\alpha}\sigma/T^2
A = \begin{pmatrix}1&T\\0&1\end{pmatrix}
H = \begin{pmatrix}1&0\end{pmatrix}
B = \begin{pmatrix}\int_0^Tt\,dt\\T\end{pmatrix}
K = \begin{pmatrix}\alpha\\\beta/T\end{pmatrix}
"""


def acceleration_to_state(T):
    """What an acceleration of one, constant over T, does to position and velocity: a fine sum."""
    steps = 2**12
    v = T / steps * (np.arange(steps) + 0.5)
    return column([np.sum(v) * T / steps, T])


def filtered(rng, k=3):
    """A run with the control, and the step k of it in plain letters."""
    found = world(axis)(rng)
    y = rng.normal(size=(6, 1, 2))
    u = np.nan_to_num(acceleration_from(y, found["T"]))[..., :1]
    A, H, B = found["A"], found["H"], found["B"]
    Q = found[r"\sigma_a"] ** 2 * B @ B.T
    system = LinearSystem(A, H, (Q + Q.T) / 2, np.array([[SIGMA**2]]), B)
    law = run(system, Gaussian(rng.normal(size=2), covariance(rng, 2)), y[..., :1], u)
    (z, p), (lam, Psi) = (
        ([column(one) for one in laws.mean[:, 0]], [one[0] for one in laws.cov])
        for laws in (law.posterior, law.predicted)
    )
    K = p[k] @ H.T / SIGMA**2
    return found | {
        r"\lambda": Indexed(lam, lam[k]),
        "z": Indexed(z, z[k]),
        "u": Indexed(u[:, 0, 0]),
        "y": Indexed(y[:, 0, 0]),
        "k": range(2, 5),
        "p": p[k],
        r"\Psi": Psi[k],
        "K": K,
        "F": SIGMA**2 / (1 - (H @ K).item()),
        r"\Psi_{11}": Psi[k][0, 0],
        r"\lambda\leftarrow": lam[k + 1],
        r"\Psi\leftarrow": Psi[k + 1],
    }


def in_one_step(rng, k=3):
    """The same, with the index k fixed."""
    found = filtered(rng, k)
    y, u = found["y"], found["u"]
    fixed = {"y_k": y[k,], "y_{k-1}": y[k - 1,], "y_{k-2}": y[k - 2,], "u_k": u[k,]}
    return (
        {
            name: value
            for name, value in found.items()
            if name not in ("y", "u", "k", r"\lambda", "z")
        }
        | fixed
        | {r"\lambda": found[r"\lambda"].plain, "z": found["z"].plain}
    )


expanded = (
    axis
    + r"""
\bar x, a, b: any 2
y: nums 6 plain
k: range 5
z_0 = a
\lambda_0 = b
\lambda_{k+1} = Az_k
z_{k+1} = (I-KH)\lambda_{k+1}+Ky_{k+1}
h(x) = Hx
k: range 1 4
forget: a, b
"""
)


def transfers(rng):
    """What leads from y to the error, by matrices; the literal update by a long run."""
    found = world(axis)(rng)
    A, B, H, K, T = (found[name] for name in "ABHKT")
    rest = np.eye(2) - K @ H

    def error(control):
        def E(zeta):
            taken = K + rest @ B * (1 - 1 / zeta) ** 2 / T**2 / zeta * control
            return 1 - np.linalg.solve(np.eye(2) - rest @ A / zeta, taken)[0, 0]

        return E

    literal, state, behind = np.eye(2) - K @ H @ (2 * A - np.eye(2)), np.zeros((2, 1)), []
    for k in range(400):
        state = literal @ state + K * k
        behind.append(k - state[0, 0])
    return found | {
        "E": error(0),
        "E_u": error(1),
        r"\zeta": 1.7,
        r"E_{\rm literal}": lambda one: behind[-1] - behind[-2],
    }


def far_apart(rng, j=3):
    """The same with second differences over j steps, by what the filter makes of a single
    measurement."""
    found, zeta = world(axis)(rng), 1.7
    A, B, H, K, T = (found[name] for name in "ABHKT")
    errors = []
    for control in (0, 1):
        y, state, response = np.zeros(200), np.zeros((2, 1)), []
        y[2 * j] = 1
        for k in range(2 * j, 200):
            u = (y[k - 1] - 2 * y[k - 1 - j] + y[k - 1 - 2 * j]) / (j * T) ** 2 if k > 2 * j else 0
            ahead = A @ state + B * u * control
            state = ahead + K * (y[k] - H @ ahead)
            response.append((H @ state).item())
        errors.append(1 - np.array(response) @ zeta ** -np.arange(200.0 - 2 * j))
    mean = (1 - zeta**-j) / (1 - 1 / zeta) / j
    return {"E": errors[0], "E_j": errors[1], "M_j": mean, "j": j, r"\zeta": zeta}


LETTERS = (axis, filtered, in_one_step, expanded, transfers, far_apart)
SAID = {
    "quoted from the radar paper": [
        r"z_k=z_{k-1}+K\bigl[y_k-h(\lambda_k)-H(\hat x_{k-1}-z_{k-1})\bigr]"
    ],
    "a setting": ["u_k=0"],
    NOTATION: [r"E(\zeta)"],
    CONDITION: [r"|\zeta|=1"],
}
EQUALS = {
    r"y-h(z_{k-1})-H(\lambda_k-z_{k-1})": r"y-H\lambda_k",
    r"y-H\lambda_k": r"y-h(z_{k-1})-H(\lambda_k-z_{k-1})",
    r"E_{\rm literal}(1)": r"\frac{2\beta}{\alpha+2\beta}",
    r"\frac{E_u(\zeta)}{E(\zeta)}": r"\frac{(\zeta-1)(2\zeta+1)}{2\zeta^2}",
}
