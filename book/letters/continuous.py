"""The letters of continuous.md: the package's equations, steps and steady state, with noises that
are mixed."""

import numpy as np
import sympy as sp
from gate.page import CONDITION, DEFINITION, NOTATION
from gate.values import At, Indexed
from gate.worlds import column, covariance, slope
from scipy.linalg import expm

from kfcourse.continuous import ContinuousModel, extended_kalman_bucy, steady_state, to_discrete
from kfcourse.continuous.equations import filter_equations
from kfcourse.symbolic.structure import linearised

SIGNAL = ["x1 + 0.2*x2**2", "x2 - 0.3*x1*x2"]
WEIGHTS = (1, 2 / 3), (-1, -2 / 3), (2, -1 / 12), (-2, 1 / 12)  # of a first derivative
C = np.array([[0.0, 1.0], [1.0, 0.0]])  # picks the components in the other order


def model(rng, signal=SIGNAL):
    return ContinuousModel.define(
        ["0.3*x2 - 0.5*x1 + 0.1*x1*x2", "-0.7*x2 + 0.2*x1**2"],
        [["0.6 + 0.1*x1", "0.2"], ["0.1*x2", "0.5"]],
        signal,
        spectral_density=covariance(rng, 2),
        noise_density=covariance(rng, 2),
        prior={"mean": [0.4, -0.2], "variance": covariance(rng, 2)},
    )


def function(own, matrix):
    computed = sp.lambdify(list(own.x), matrix)
    return lambda x, t=0: np.array(computed(*np.ravel(x))).reshape(matrix.shape)


def rates(own, y, second_derivatives=False):
    """The package's rates of the prior's mean and covariance, and the letters they are made of; a
    signal of two arguments is that of the phase."""
    equations = filter_equations(own, second_derivatives)
    z, D = column(own.prior.mean), own.prior.cov
    values = sp.lambdify([*equations.state, *equations.y], equations.rates)(
        *z.ravel(), *D[np.triu_indices(2)], *y.ravel()
    )
    f, S, g = (function(own, part) for part in (own.drift, own.signal, own.diffusion))
    functions = {
        "f": At(f, f(z)),
        "S": At(lambda x, t=None: S(x if t is None else C.T @ x), S(z)),
        "g": At(g, g(z)),
    }
    known = {"z": z, "D": D, "A": slope(f, z), "H": slope(S, z), "N": own.noise_density}
    known |= {r"S_\xi": own.spectral_density, "I": np.eye(2)}
    return functions | known | {r"\dot z": values[:2], r"\dot D": values[[[2, 3], [3, 4]], 0]}


def first(rng):
    """The package's discrete model at a random state, and with its measurement the filter's rates
    and step, the discrete filter's prediction, and the rate of the log-likelihood."""
    own, T = model(rng), 0.07
    steps = to_discrete(own, T)
    x, xi, n = rng.normal(size=(3, 2))
    here = dict(zip((*steps.x, *steps.v, *steps.w), (*x, *xi, *n), strict=True))
    x_next, y = (
        column([float(formula.subs(here)) for formula in side])
        for side in (steps.state_equation, steps.meter_equation)
    )
    known = rates(own, y)
    z, D, H, N, S = (known[name] for name in "zDHNS")
    bucy = extended_kalman_bucy(own, T)
    after = bucy.step(bucy.init(1), y.T).predicted
    B = D - D @ H.T @ np.linalg.solve(H @ D @ H.T + N / (2 * T), H @ D)

    def F(x, t):
        """What is left of -(y - S)^T N^-1 (y - S) without its part in y alone."""
        off = y - S.function(x)
        return y.T @ np.linalg.solve(N, y) - off.T @ np.linalg.solve(N, off)

    values = {
        "x": Indexed([column(x), x_next], z),
        "y": Indexed([y], At(lambda t: y, y)),
        r"\xi": Indexed([column(xi)]),
        "n": Indexed([column(n)]),
        "F": At(F, F(z, 0)),
    }
    step = {r"z\leftarrow": column(after.mean), r"D\leftarrow": after.cov.reshape(2, 2), "B": B}
    names = {"c": C, "t": 0.0, "k": range(1), "T": T, "d": D, "D(0)": D, "m": z, "z(0)": z}
    noises = {r"D_\xi": steps.state_noise.cov, "D_n": steps.meter_noise.cov}
    ahead = {r"\Psi": linearised(steps).predict(z.T, D[None]).cov.reshape(2, 2)}
    return known | values | step | names | noises | ahead


def in_short(rng):
    """With the gain, and without the step."""
    own = first(rng)
    del own["T"]
    K = np.linalg.solve(own["N"] / 2, own["H"] @ own["D"]).T
    return own | {r"\partial S/\partial x": own["H"], "K": K}


def western(rng):
    own = in_short(rng)
    names = {
        "z": r"\hat x",
        r"\dot z": r"\dot{\hat x}",
        "D": "P",
        r"\dot D": r"\dot P",
        "A": "F",
        "g": "G",
        "S": "h",
    }
    halves = {"Q": own[r"S_\xi"] / 2, "R": own["N"] / 2}
    same = {name: own[name] for name in ("H", "K", "y", "f", r"S_\xi", "N")}
    return same | {name: own[ours] for ours, name in names.items()} | halves


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


def second(rng):
    """The package's rates with second derivatives; the gradient and the Hessian of F by complex
    steps and differences; the covariance with the data and without them, both at one moment."""
    y = column(rng.normal(size=2))
    known = rates(model(rng), y, second_derivatives=True)
    z, D, A, N, S = (known[name] for name in "zDANS")

    def rate(x):
        return np.linalg.solve(N, 2 * S.function(x)).T @ y - S.function(x).T @ np.linalg.solve(
            N, S.function(x)
        )

    def gradient(x):
        return slope(S.function, x).T @ np.linalg.solve(N, 2 * (y - S.function(x)))

    h = 1e-4
    U = np.hstack(
        [  # of the fourth order
            sum(weight * gradient(z + size * h * e[:, None]) for size, weight in WEIGHTS) / h
            for e in np.eye(2)
        ]
    )
    row, g = slope(rate, z), known["g"].plain
    above = D + covariance(rng, 2)
    dot = A @ above + above @ A.T + g @ known[r"S_\xi"] @ g.T / 2
    return known | {
        "u": gradient(z),
        "U": U,
        r"\frac{\partial F}{\partial x}": row,
        r"\frac{\partial}{\partial x}\Bigl(\frac{\partial F}{\partial x}\Bigr)^T": U,
        r"\partial f/\partial x": A,
        r"\bar D": above,
        r"\dot{\bar D}": dot,
        "E": above - D,
        r"\dot E": dot - known[r"\dot D"],
    }


sizes = r"""
D, N, S'', s: pos
S' = -s
\varepsilon = \sqrt{(2DS''/N)^2N/2/(2DS'^2/N)}
keep: D, S', S'', N, \varepsilon
"""


def short_gain(rng):
    """The gain of the package's discrete filter, by a solver, and what the second derivative of F
    leaves of a covariance, by differences of the exponent."""
    known = first(rng)
    Psi, H, T, U = known[r"\Psi"], known["H"], known["T"], covariance(rng, 2)
    K = np.linalg.solve(H @ Psi @ H.T + known["D_n"], H @ Psi).T

    def exponent(e):
        return T * e @ U @ e / 2 - e @ np.linalg.solve(Psi, e) / 2

    # exact for a square
    bend = [[exponent(a + b) - exponent(a) - exponent(b) for b in np.eye(2)] for a in np.eye(2)]
    same = {name: known[name] for name in ("H", "N", "I", r"\Psi", "T")}
    return same | {"K": K, "U": U, "D_+": -np.linalg.inv(bend)}


def linear_signal(rng):
    """The second derivative of the log-likelihood's rate where the signal is linear, by the slopes
    of its gradient."""
    y = column(rng.normal(size=2))
    known = rates(model(rng, ["x1 + 0.2*x2", "x2 - 0.3*x1"]), y)
    z, H, N, S = (known[name] for name in "zHNS")
    U = slope(lambda x: H.T @ np.linalg.solve(N, 2 * (y - S.function(x))), z)
    return {"U": U, "H": H, "N": N}


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
            r"\delta": At(lambda t: delta, delta),
            r"\delta_0": D_0 - end,
            r"\dot w": -dot / delta**2,
        }
    )


def ranks(rng):
    """A system that is seen and moved."""
    A, mu = covariance(rng, 3), rng.uniform(1, 2)
    known = {"A": A - 2 * np.eye(3), r"\mu": mu, "I": np.eye(3), "n": 3}
    parts = {"H": rng.normal(size=(2, 3)), "G": rng.normal(size=(3, 2))}
    return known | parts | {r"\operatorname{rank}": np.linalg.matrix_rank}


LETTERS = (
    first,
    in_short,
    western,
    stationary,
    second,
    short_gain,
    scalar,
    ranks,
    sizes,
    linear_signal,
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
