"""The letters of continuous.md: the package's equations, steps and steady state, with noises that
are mixed."""

import numpy as np
import sympy as sp
from gate.page import CONDITION, DEFINITION, NOTATION
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
        r"S_\xi": letters[r"S_\xi"],
    }
    after = {r"\lambda": column(law.mean), r"\Psi": Psi, "f": f(letters["z"]), "T": T, "B": B}
    return names | after | {r"D_\xi": steps.state_noise.cov, "D_n": D_n}


def derivatives(rng):
    """The package's rates with second derivatives; the gradient and the Hessian of F by complex
    steps and differences."""
    own = model(rng)
    letters, f, S = rates(own, second_derivatives=True)
    y, N = letters["y"], letters["N"]

    def rate(x):
        return np.linalg.solve(N, 2 * S(x)).T @ y - S(x).T @ np.linalg.solve(N, S(x))

    def gradient(x):
        return slope(S, x).T @ np.linalg.solve(N, 2 * (y - S(x)))

    z, step = letters["z"], 1e-4
    sides = [
        [
            gradient(z + sign * step * size * e[:, None])
            for sign, size in ((1, 1), (-1, 1), (1, 2), (-1, 2))
        ]
        for e in np.eye(2)
    ]
    U = np.hstack([(8 * (a - b) - (c - d)) / (12 * step) for a, b, c, d in sides])  # fourth order
    row = slope(rate, z)
    found = {
        "u": gradient(z),
        "U": U,
        r"\frac{\partial F}{\partial x}": row,
        r"\partial F/\partial x": row,
        r"\partial u/\partial x": U,
    }
    hessian = {
        r"\frac{\partial}{\partial x}\Bigl(\frac{\partial F}{\partial x}\Bigr)^T": U,
        r"\partial f/\partial x": letters["A"],
    }
    return letters | found | hessian | {"f": f(z)}


def likelihood(rng):
    own = model(rng)
    letters, _, S = rates(own)
    x, y, N = rng.normal(size=(2, 1)), letters["y"], letters["N"]
    of_phase = {"S": lambda phi, t: S(C.T @ phi), "y": lambda t: y, "c": C}

    def F(x, t):
        """What is left of -(y - S)^T N^-1 (y - S) without its part in y alone."""
        return y.T @ np.linalg.solve(N, y) - (y - S(x)).T @ np.linalg.solve(N, y - S(x))

    return {"x": x, "t": 0.0, "N": N, "F": F} | of_phase


sizes = r"""
D, N, S'', s: pos
S' = -s
\varepsilon = \sqrt{(2DS''/N)^2N/2/(2DS'^2/N)}
keep: D, S', S'', N, \varepsilon
"""


def short_gain(rng):
    """The gain of the package's discrete filter, by a solver, and what the second derivative of F
    leaves of a covariance, by differences of the exponent."""
    own, T = model(rng), 0.07
    letters, _, _ = rates(own)
    steps = to_discrete(own, T)
    law = linearised(steps).predict(letters["z"].T, letters["D"][None])
    Psi, U, H, D_n = law.cov.reshape(2, 2), covariance(rng, 2), letters["H"], steps.meter_noise.cov
    K = np.linalg.solve(H @ Psi @ H.T + D_n, H @ Psi).T

    def exponent(e):
        return T * e @ U @ e / 2 - e @ np.linalg.solve(Psi, e) / 2

    # exact for a square
    bend = [[exponent(a + b) - exponent(a) - exponent(b) for b in np.eye(2)] for a in np.eye(2)]
    known = {name: letters[name] for name in ("H", "N", "I")}
    return known | {r"\Psi": Psi, "K": K, "T": T, "U": U, "D_+": -np.linalg.inv(bend)}


def linear_signal(rng):
    """The second derivative of the log-likelihood's rate where the signal is linear, by the slopes
    of its gradient."""
    own = model(rng, ["x1 + 0.2*x2", "x2 - 0.3*x1"])
    letters, _, S = rates(own)
    y, N = letters["y"], letters["N"]
    U = slope(lambda x: slope(S, letters["z"]).T @ np.linalg.solve(N, 2 * (y - S(x))), letters["z"])
    return {"U": U, "H": letters["H"], "N": N}


def ahead_of_data(rng):
    """The covariance with the data and without them, both at one moment."""
    letters, _, _ = rates(model(rng), second_derivatives=True)
    letters |= derivatives(rng)
    A, D, g = letters["A"], letters["D"], letters["g"]
    above = D + covariance(rng, 2)
    dot = A @ above + above @ A.T + g @ letters[r"S_\xi"] @ g.T / 2
    return letters | {
        r"\bar D": above,
        r"\dot{\bar D}": dot,
        "E": above - D,
        r"\dot E": dot - letters[r"\dot D"],
    }


even_signal = r"""
y: in -1 1
N: in 1 2
x: num
w: nodes 0 0.5
"\mathsf My" = \mathsf M\cos w
g(u) = -2(y-\cos(u))\sin(u)/N
h = 0.001
U = (8(g(h)-g(-h))-(g(2h)-g(-2h)))/(12h)
S = \cos x
keep: y, N, U, S, x, \mathsf My
"""


def scalar(rng):
    """D(t) of the scalar equation, as the quotient of two solutions of a linear one."""
    a, q, r, D_0, t = *rng.uniform(0.5, 1, size=3), rng.uniform(2, 3), rng.uniform(0.1, 0.2)
    rates = np.array([[-a, q], [r, a]])

    def D(t):
        above, below = expm(rates * t) @ [D_0, 1]
        return above / below

    end, now, dot = D(60), D(t), D(t + 1e-20j).imag / 1e-20
    delta = now - end
    known = {"a": a, "q": q, "r": r, "D_0": D_0, "t": t, r"\rho": np.sqrt(a**2 + q * r)}
    moved = {"D": now, r"\dot D": dot, r"\dot\delta": dot, "w": 1 / delta}
    return (
        known
        | moved
        | {
            r"D_\infty": end,
            r"\delta": delta,
            r"\delta_0": D_0 - end,
            r"\dot w": -dot / delta**2,
        }
    )


def forgotten(rng):
    known = scalar(rng)
    delta = known[r"\delta"]
    return known | {r"\delta": lambda t: delta}


def rate_of_likelihood(rng):
    known = likelihood(rng)
    x, t = known["x"], known["t"]
    now = {"S": known["S"](known["c"] @ x, t), "y": known["y"](t), "F": known["F"](x, t)}
    return now | {"N": known["N"], "T": 0.07}


def ranks(rng):
    """A system that is seen and moved."""
    A, mu = covariance(rng, 3), rng.uniform(1, 2)
    known = {"A": A - 2 * np.eye(3), r"\mu": mu, "I": np.eye(3), "n": 3}
    parts = {"H": rng.normal(size=(2, 3)), "G": rng.normal(size=(3, 2))}
    return known | parts | {r"\operatorname{rank}": np.linalg.matrix_rank}


LETTERS = (
    display,
    rate_of_likelihood,
    ranks,
    in_short,
    box,
    western,
    discretised,
    stationary,
    short_step,
    short_gain,
    scalar,
    forgotten,
    derivatives,
    likelihood,
    sizes,
    linear_signal,
    ahead_of_data,
    even_signal,
)
SAID = {
    DEFINITION: [
        r"\mathsf D\Bigl[\textstyle\frac1T\int_0^Tn\,dt\Bigr]"
        r"=\frac1{T^2}\int_0^T\!\!\int_0^T\frac N2\delta(t-t')\,dt'dt",
        r"q=s^2S_\xi/2",
        "r=2h^2/N",
        r"\frac{dx}{dt}=f(x,t)+g(x,t)\,\xi(t)",
        "y(t)=S(cx,t)+n(t)",
        r"x(0)\sim\mathcal N(m,d)",
        r"\dot x=-\tfrac12x+\xi",
        "y=x+n",
        r"\dot x=-x+\xi",
        r"y=x+\tfrac12\kappa x^2+n",
        r"\text{intensity}=\text{two-sided density}=\tfrac12\,\text{one-sided density}=\tfrac N2 .",
    ],
    NOTATION: [
        r"\mathsf M[\text{middle}]-\mathsf M[\text{beginning}]",
        r"{\textstyle\frac12}",
        r"{\textstyle\sum_i\bigl[2N^{-1}(y-S)\bigr]_i\frac{\partial^2S_i}{\partial x^2}}",
        "{(y-S)}",
    ],
    CONDITION: [r"|\mu|\ge1"],
}
