"""The letters of radar-tracking.md: a limit by iteration, least squares, the package's
alpha-beta filter and its filter with an acceleration made of measurements."""

import numpy as np
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
A = \begin{pmatrix}1&T\\0&1\end{pmatrix}
B = \begin{pmatrix}T^2/2\\T\end{pmatrix}
H = \begin{pmatrix}1&0\end{pmatrix}
k: range 5
v, w: nums 6
b: any 2
x_0 = b
x_{k+1} = Ax_k+Bv_k
y_k = Hx_k+w_k
k: range 4
keep: T, A, B, H, x, v, w, y, k
"""


limit = r"""
T: in .5 1
\sigma = 3
\sigma_a: in 1 3
\zeta = 1.7
a_0 = 1.7
y: num
I: eye 2
A = \begin{pmatrix}1&T\\0&1\end{pmatrix}
B = \begin{pmatrix}T^2/2\\T\end{pmatrix}
H = \begin{pmatrix}1&0\end{pmatrix}
q = \sigma_a^2
\Psi = I
again:
p = (\Psi^{-1}+H^TH/\sigma^2)^{-1}
\Psi = ApA^T+BqB^T
then:
K = pH^T/\sigma^2
F = H\Psi H^T+\sigma^2
\alpha = HK
\beta = T\begin{pmatrix}0&1\end{pmatrix}K
\rho = \sqrt{1-\alpha}
\Lambda = \sigma_aT^2/\sigma
C = (I-KH)A
\chi(x) = \det(xI-C)
s = 2\sqrt{(2-\alpha)^2-\alpha^2}
"\chi(-1)\big|_{\beta=\beta_-}" = \chi(-1)+\beta-(2(2-\alpha)-s)      # linear in beta
"\chi(-1)\big|_{\beta=\beta_+}" = \chi(-1)+\beta-(2(2-\alpha)+s)
\hat x = (I-C/\zeta)^{-1}Ky
\hat r = H\hat x
E(x) = 1-H(I-C/x)^{-1}K
E_u(x) = 1-H(I-C/x)^{-1}(K+(I-KH)B(1-1/x)^2/(T^2x))
e = a_0B
again:
e = Ce+(I-KH)Ba_0
then:
\nu = H(Ae+Ba_0)
\ell = He
forget: e, s, C, I
entries: \Psi, p
"""


def growing(rng):
    """The weight of the newest point in the line through k points, at its end and in its slope."""
    end, slope = ([0.0] * 7 for _ in range(2))
    for k in range(2, 7):
        weights = np.linalg.pinv(np.column_stack([np.ones(k), np.arange(1 - k, 1)]))
        end[k], slope[k] = weights[:, -1]
    return {r"\alpha": Indexed(end), r"\beta": Indexed(slope), "k": range(2, 7)}


def _followed(rng):
    known = axis(rng)
    of_axis = kinematic(known["T"], noise_sd=known[r"\sigma_a"], measurement_sd=SIGMA)
    y = rng.normal(size=(6, 1, 3))
    return known, y[:, 0, 0], run(alpha_beta(of_axis, ALPHA, steady_beta(ALPHA)), y).mean[:, 0, ::3]


def start(rng):
    known, y, states = _followed(rng)
    return {"T": known["T"], "y": Indexed(y), "r": states[1, 0], "s": states[1, 1]}


def step(rng):
    """The fourth measurement: the memory still grows."""
    known, y, states = _followed(rng)
    gains = growing(rng)
    return {
        "T": known["T"],
        "r": states[2, 0],
        "s": states[2, 1],
        "r^-": (known["A"] @ states[2])[0],
        "y": y[3],
        r"\nu": y[3] - (known["A"] @ states[2])[0],
        r"\alpha": ALPHA,
        r"\beta": steady_beta(ALPHA),
        r"\alpha_k": gains[r"\alpha"][4,],
        r"\beta_k": gains[r"\beta"][4,],
        r"r\leftarrow": states[3, 0],
        r"s\leftarrow": states[3, 1],
    }


def controlled(rng):
    """A run with the control."""
    known = axis(rng)
    y = rng.normal(size=(6, 1, 2))
    u = np.nan_to_num(acceleration_from(y, known["T"]))[..., :1]
    Q = (known["Q"] + known["Q"].T) / 2
    system = LinearSystem(known["A"], known["H"], Q, np.array([[SIGMA**2]]), known["B"])
    law = run_linear(system, Gaussian(rng.normal(size=2), covariance(rng, 2)), y[..., :1], u)
    z, lam = ([column(mean) for mean in laws.mean[:, 0]] for laws in (law.posterior, law.predicted))
    return known | {
        r"\lambda": Indexed(lam),
        "z": Indexed(z),
        "u": Indexed(u[:, 0, 0]),
        "y": Indexed(y[:, 0, 0]),
        "k": range(2, 5),
    }


def polar(rng):
    """The meter's derivatives by differences."""
    x = rng.uniform(1, 2, 2)

    def h(x):
        return np.array([abs(complex(*x)), np.angle(complex(*x))])

    steps = 1e-6 * np.eye(2)
    H = np.column_stack([(h(x + step) - h(x - step)) / 2e-6 for step in steps])
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
    growing,
    start,
    step,
    controlled,
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
