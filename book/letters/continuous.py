"""The letters of continuous.md: the package's equations, steps and steady state, with noises that
are mixed."""

import numpy as np
import sympy as sp
from gate.page import DEFINITION, NOTATION
from gate.values import Indexed
from gate.worlds import column, covariance, slope
from scipy.linalg import expm

from kfcourse.continuous import ContinuousModel, extended_kalman_bucy, steady_state, to_discrete
from kfcourse.continuous.equations import filter_equations
from kfcourse.symbolic.structure import linearised

SIGNAL = ["x1 + 0.2*x2**2", "x2 - 0.3*x1*x2"]
C = np.array([[0.0, 1.0], [1.0, 0.0]])  # picks the components in the other order


def model(rng, signal=SIGNAL):
    return ContinuousModel.define(
        ["0.3*x2 - 0.5*x1 + 0.1*x1*x2", "-0.7*x2 + 0.2*x1**2"],
        [["0.6 + 0.1*x1", "0.2"], ["0.1*x2", "0.5"]],
        signal,
        spectral_density=covariance(rng, 2),
        noise_density=covariance(rng, 2),
        prior={"mean": [0.4, -0.2], "variance": [0.5, 0.3]},
    )


def function(own, matrix):
    computed = sp.lambdify(list(own.x), matrix)
    return lambda x, t=0: np.array(computed(*np.ravel(x))).reshape(matrix.shape)


def rates(own, second_derivatives=False):
    """dz/dt and dD/dt of the package at a random state, and the letters they are made of."""
    equations, rng = filter_equations(own, second_derivatives), np.random.default_rng(1)
    z, D, y = column(rng.normal(size=2)), covariance(rng, 2), column(rng.normal(size=2))
    upper = [D[0, 0], D[0, 1], D[1, 1]]
    values = sp.lambdify([*equations.state, *equations.y], equations.rates)(
        *z.ravel(), *upper, *y.ravel()
    )
    dz, dD = values[:2], np.array([[values[2, 0], values[3, 0]], [values[3, 0], values[4, 0]]])
    f, S, g = (function(own, one) for one in (own.drift, own.signal, own.diffusion))
    A, H = slope(f, z), slope(S, z)
    letters = {
        "z": z,
        "D": D,
        "y": y,
        "A": A,
        "H": H,
        "g": g(z),
        "N": own.noise_density,
        r"S_\xi": own.spectral_density,
    }
    return letters | {r"\dot z": dz, r"\dot D": dD, "I": np.eye(2)}, f, S


def display(rng):
    letters, f, S = rates(model(rng))
    return letters | {"c": C, "t": 0.0, "f": f, "S": lambda phi, t: S(C.T @ phi)}


def box(rng):
    """One step of the package's filter, and its rates."""
    own, T = model(rng), 0.07
    _, f, S = rates(own)
    one = extended_kalman_bucy(own, T)
    state = one.init(1)
    z, D, y = (
        column(state.predicted.mean),
        state.predicted.cov[0] if state.predicted.cov.ndim == 3 else state.predicted.cov,
        column([0.3, -0.5]),
    )
    after = one.step(state, y.T).predicted
    A, H, g, N = slope(f, z), slope(S, z), function(own, own.diffusion)(z), own.noise_density
    B = D - D @ H.T @ np.linalg.solve(H @ D @ H.T + N / (2 * T), H @ D)
    new = {
        r"z\leftarrow": column(after.mean),
        r"D\leftarrow": np.reshape(after.cov, (2, 2)),
        "B": B,
        "T": T,
        "y_k": y,
    }
    return {
        "z": z,
        "D": D,
        "A": A,
        "H": H,
        "g": g,
        "N": N,
        r"S_\xi": own.spectral_density,
        "I": np.eye(2),
        "f": f(z),
        "S": S(z),
    } | new


def in_short(rng):
    letters, f, S = rates(model(rng))
    K = np.linalg.solve(letters["N"] / 2, letters["H"] @ letters["D"]).T
    slopes = {
        r"\partial f/\partial x": letters["A"],
        r"\partial S/\partial x": letters["H"],
        "d": letters["D"],
        "m": letters["z"],
    }
    return (
        letters
        | slopes
        | {
            "f": f(letters["z"]),
            "S": S(letters["z"]),
            "K": K,
            "z(0)": letters["z"],
            "D(0)": letters["D"],
        }
    )


def western(rng):
    own = in_short(rng)
    z, f, S = (
        own["z"],
        *(function(one, matrix) for one in [model(rng)] for matrix in (one.drift, one.signal)),
    )
    names = {
        r"\hat x": z,
        r"\dot{\hat x}": own[r"\dot z"],
        "P": own["D"],
        r"\dot P": own[r"\dot D"],
        "F": own["A"],
        "G": own["g"],
        "h": S,
        "f": f,
    }
    halves = {"Q": own[r"S_\xi"] / 2, "R": own["N"] / 2}
    return names | halves | {name: own[name] for name in ("H", "K", "y", r"S_\xi", "N")}


def discretised(rng):
    own, T = model(rng), 0.07
    steps = to_discrete(own, T)
    x, xi, n = (rng.normal(size=2) for _ in range(3))
    here = dict(zip((*steps.x, *steps.v, *steps.w), (*x, *xi, *n), strict=True))
    x_next, y = (
        column([float(one.subs(here)) for one in side])
        for side in (steps.state_equation, steps.meter_equation)
    )
    f, S, g = (function(own, one) for one in (own.drift, own.signal, own.diffusion))
    noises = {
        r"D_\xi": steps.state_noise.cov,
        "D_n": steps.meter_noise.cov,
        r"S_\xi": own.spectral_density,
        "N": own.noise_density,
    }
    rows = {
        "x": Indexed([column(x), x_next]),
        "y": Indexed([y]),
        r"\xi": Indexed([column(xi)]),
        "n": Indexed([column(n)]),
    }
    return noises | rows | {"k": range(1), "T": T, "f": f, "S": S, "g": g}


def stationary(rng):
    own = ContinuousModel.define(
        ["x2 - 0.5*x1", "-0.7*x2 + 0.2*x1"],
        [["0.6", "0.2"], ["0.1", "0.5"]],
        ["x1 + 0.2*x2", "x2"],
        spectral_density=covariance(rng, 2),
        noise_density=covariance(rng, 2),
    )
    names = {"A": own.drift.jacobian(own.x), "G": own.diffusion, "H": own.signal.jacobian(own.x)}
    matrices = {name: np.array(matrix, dtype=float) for name, matrix in names.items()}
    return matrices | {
        "D": steady_state(own).cov,
        "N": own.noise_density,
        r"S_\xi": own.spectral_density,
    }


walk = r"""
q, r: pos
D = \sqrt{qr}/r
D_{4N} = \sqrt{4q/r}
T = q
N = r
"""


def short_step(rng):
    """The prediction of the package's discrete filter, and its next covariance by a solver."""
    own, T = model(rng), 0.07
    letters, f, _ = rates(own)
    steps = to_discrete(own, T)
    law = linearised(steps).predict(letters["z"].T, letters["D"][None])
    Psi, D_n = np.reshape(law.cov, (2, 2)), steps.meter_noise.cov
    B = np.eye(2) + Psi @ letters["H"].T @ np.linalg.solve(D_n, letters["H"])
    names = {
        "z": letters["z"],
        "D": letters["D"],
        "A": letters["A"],
        "H": letters["H"],
        "g": letters["g"],
        "I": np.eye(2),
    }
    after = {r"\lambda": column(law.mean), r"\Psi": Psi, "f": f(letters["z"]), "T": T, "B": B}
    return names | after | {r"D_\xi": steps.state_noise.cov, "D_n": D_n}


def riccati(a, q, r, start):
    """D(t) of the scalar equation, as the quotient of two solutions of a linear one; `start` is a
    quotient too."""
    rates = np.array([[-a, q], [r, a]])

    def D(t):
        above, below = expm(rates * t) @ start
        return above / below

    return {"a": a, "q": q, "r": r}, D


forgetting = r"""
a, q, r: pos
\rho = \sqrt{a^2+qr}
d: pos
D_0 = d+200
t: in .2 .5
f(t) = (\cosh(\rho t)D_0+\sinh(\rho t)(q-aD_0)/\rho)/(\cosh(\rho t)+\sinh(\rho t)(rD_0+a)/\rho)
h = 0.0005
D = f(t)
\dot D = (8(f(t+h)-f(t-h))-(f(t+2h)-f(t-2h)))/(12h)
D_\infty = f(40)
T = 1.01D_0/(2aD_0+rD_0^2-q)
\delta_0 = D_0-D_\infty
\delta(t) = f(t)-D_\infty
keep: a, q, r, D, \dot D, D_\infty, \rho, t, T, \delta, \delta_0, D_0
"""


forgotten = r"""
a, q, r: pos
\rho = \sqrt{a^2+qr}
d: pos
D_0 = d+200
t: in .2 .5
f(t) = (\cosh(\rho t)D_0+\sinh(\rho t)(q-aD_0)/\rho)/(\cosh(\rho t)+\sinh(\rho t)(rD_0+a)/\rho)
h = 0.0005
D = f(t)
\dot D = (8(f(t+h)-f(t-h))-(f(t+2h)-f(t-2h)))/(12h)
D_\infty = f(40)
T = 1.01D_0/(2aD_0+rD_0^2-q)
\delta_0 = D_0-D_\infty
\delta = D-D_\infty
\dot\delta = \dot D
w = 1/\delta
\dot w = -\dot D/\delta^2
keep: a, q, r, D, \dot D, D_\infty, \rho, t, T, \delta, \delta_0, D_0, \dot\delta, w, \dot w
"""


unknown_start = r"""
q, r: pos
n = \sqrt{qr}
f(t) = \sqrt{q/r}\cosh(nt)/\sinh(nt)
t = \ln(201)/(2n)
h = 0.0005
D = f(t)
\dot D = (8(f(t+h)-f(t-h))-(f(t+2h)-f(t-2h)))/(12h)
\theta = nt
u(x) = \cosh(x)/\sinh(x)
keep: q, r, D, \dot D, t, \theta, u
"""


unknown_start_now = r"""
q, r: pos
n = \sqrt{qr}
f(t) = \sqrt{q/r}\cosh(nt)/\sinh(nt)
t = \ln(201)/(2n)
h = 0.0005
D = f(t)
\dot D = (8(f(t+h)-f(t-h))-(f(t+2h)-f(t-2h)))/(12h)
\theta = nt
u = D\sqrt{r/q}
u' = \dot D\sqrt{r/q}/n
keep: q, r, D, \dot D, t, \theta, u, u'
"""


from_infinity = r"""
a, q, r: pos
t: in .2 .5
\rho = \sqrt{a^2+qr}
f(t) = (\cosh(\rho t)-a\sinh(\rho t)/\rho)/(r\sinh(\rho t)/\rho)
\delta_\infty = f(t)-f(40)
keep: a, q, r, t, \rho, \delta_\infty
"""


LETTERS = (
    display,
    in_short,
    box,
    western,
    discretised,
    stationary,
    walk,
    short_step,
    forgetting,
    forgotten,
    unknown_start,
    unknown_start_now,
    from_infinity,
)
SAID = {
    DEFINITION: [
        r"\frac{dx}{dt}=f(x,t)+g(x,t)\,\xi(t)",
        "y(t)=S(cx,t)+n(t)",
        r"x(0)\sim\mathcal N(m,d)",
        r"\text{intensity}=\text{two-sided density}=\tfrac12\,\text{one-sided density}=\tfrac N2 .",
        r"q=s^2S_\xi/2",
        "r=2h^2/N",
    ],
    NOTATION: [
        r"\mathsf D\Bigl[\textstyle\frac1T\int_0^Tn\,dt\Bigr]",
        r"\mathsf M[\text{middle}]-\mathsf M[\text{beginning}]",
        r"{\textstyle\frac12}",
    ],
}
EQUALS = {
    r"N\cdot\frac1{2T}": r"\frac N{2T}",
    r"D\big|_{a=0}": r"\sqrt{q/r}",
    "D_{4N}": "2D",
    r"2\rho/\bigl(r(e^{2\rho t}-1)\bigr)": r"\delta_\infty",
}
