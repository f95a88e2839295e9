"""Numbers for the letters that the relations of many pages share: a run of a filter of the package on a random system."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.filters import aof
from kfcourse.filters.kalman import correct, predict
from kfcourse.laws import Gaussian
from kfcourse.linear.system import LinearSystem
from kfcourse.montecarlo.ensemble import simulate
from kfcourse.pages.reader import Indexed
from kfcourse.symbolic.formula import symbol
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import linearised

K_RANGE = range(1, 4)
_STEPS = 5


def covariance(rng: np.random.Generator, size: int) -> np.ndarray:
    """A positive definite matrix (size, size) without any symmetry but its own."""
    root = rng.normal(size=(size, size))
    return root @ root.T + np.eye(size)


def column(values: Any) -> np.ndarray:
    """A vector as a matrix of one column."""
    return np.asarray(values, float).reshape(-1, 1)


def kalman_run(rng: np.random.Generator, seen: int = 2) -> dict[str, Any]:
    r"""The letters A, H, Q, R, I and \\lambda, \\Psi, K, z, p, \\nu, F, y with the index k, from `kfcourse.filters.kalman`.

    K is p H^T R^{-1}, the form of the gain that the package does not compute with.
    """
    states = 3
    A, H = rng.normal(size=(states, states)), rng.normal(size=(seen, states))
    Q, R = covariance(rng, states), covariance(rng, seen)
    system = LinearSystem(A, H, Q, R)
    law = Gaussian(rng.normal(size=states), covariance(rng, states))
    found: dict[str, list[Any]] = {name: [] for name in (r"\lambda", r"\Psi", "y", "K", "z", "p", r"\nu", "F")}
    for _ in range(_STEPS):
        y = rng.normal(size=seen)
        posterior = correct(system, law, y)
        row = (law.mean, law.cov, y, posterior.cov @ H.T @ np.linalg.inv(R), posterior.mean, posterior.cov, y - H @ law.mean)
        for name, value in zip(found, (*row, H @ law.cov @ H.T + R), strict=True):
            found[name].append(column(value) if np.ndim(value) == 1 else value)
        law = predict(system, posterior)
    letters = {name: Indexed(values, values[2]) for name, values in found.items()}
    return {"A": A, "H": H, "Q": Q, "R": R, "I": np.eye(states), "k": K_RANGE} | letters


def _bent(turn: str, mixed: str) -> Model:
    """Three states, two measurements, with these two coefficients."""
    return Model.define(
        [
            f"x1 + {turn}*sin(x2) + 0.2*x3 + 0.4*v1",
            "0.8*x2 - 0.2*x1*x3 + (0.3 + 0.1*x1)*v2",
            "0.9*x3 + 0.1*x1**2 + 0.2*v1 + 0.1*x2*v2",
        ],
        [f"x1 + {mixed}*x2*x3 + 0.5*w1", "exp(0.2*x3) + 0.3*x2 + 0.1*w1 + 0.4*w2"],
        symbols={"x": ["x1", "x2", "x3"], "v": ["v1", "v2"], "w": ["w1", "w2"]},
        prior={"mean": [0.5, -0.3, 0.2], "variance": [0.5, 0.4, 0.3]},
    )


def _bent_scalar(turn: str, mixed: str) -> Model:
    return Model.define(
        f"0.8*x + {turn}*sin(x) + (0.4 + 0.1*x)*v", f"x + {mixed}*x**2 + 0.5*w", {}, prior={"mean": 0.5, "variance": 0.4}
    )


BENT, BENT_SCALAR = _bent("0.3", "0.2"), _bent_scalar("0.3", "0.2")
# Other ones at each step: f_k is not f_{k+1}.
BENT_LATER, BENT_SCALAR_LATER = _bent("0.1*k", "0.1*k"), _bent_scalar("0.1*k", "0.1*k")


def extended_run(rng: np.random.Generator, model: Model = BENT) -> dict[str, Any]:
    r"""The letters of the extended Kalman filter of a model: f, g, S, \\Phi, H, D_\\xi, D_n, I and, with k, those of its run.

    The run is `aof(linearised(model))`, the Jacobians are derivatives by complex steps, K = p H^T D_n^{-1}.  The noises of the
    object are mixed, so that D_\\xi is not the identity.
    """
    quiet = dict.fromkeys([*model.v, *model.w], 0)
    move, see = sp.Matrix(model.state_equation), sp.Matrix(model.meter_equation)

    def functions(matrix: sp.Matrix) -> list[Callable[[Any], np.ndarray]]:
        """Of x, at each step."""
        computed = sp.lambdify([*model.x, symbol("k")], matrix.subs(model.values))

        def at(k: int) -> Callable[[Any], np.ndarray]:
            return lambda x: np.array(computed(*np.ravel(x), k)).reshape(matrix.shape)

        return [at(k) for k in range(_STEPS)]

    f, S = functions(move.subs(quiet)), functions(see.subs(quiet))
    D_xi = covariance(rng, len(model.v))
    unmixed = np.linalg.inv(np.linalg.cholesky(D_xi))
    noise = functions(move.jacobian(model.v))
    D_n = np.array(see.jacobian(model.w) * see.jacobian(model.w).T, dtype=float)
    ekf = aof(linearised(model))
    state = ekf.init(1)
    found: dict[str, list[Any]] = {name: [] for name in (r"\lambda", r"\Psi", "y", "z", "p", "H", "K", r"\nu", r"\Phi", "g")}
    for k, y in enumerate(simulate(model, runs=1, steps=_STEPS, seed=int(rng.integers(1 << 30))).y):
        law, state = state.predicted, ekf.step(state, y)
        (lam, Psi), (z, p) = (_only(law), _only(state.posterior))
        H = slope(S[k], lam)
        K, nu = p @ H.T @ np.linalg.inv(D_n), column(y) - S[k](lam)
        row = (lam, Psi, column(y), z, p, H, K, nu, slope(f[k], z), noise[k](z) @ unmixed)
        for name, value in zip(found, row, strict=True):
            found[name].append(value)
    found |= {"f": f, "S": S}
    letters = {name: Indexed(values, values[2]) for name, values in found.items()}
    return {r"D_\xi": D_xi, "D_n": D_n, "I": np.eye(len(model.x)), "k": K_RANGE} | letters


def _only(law: Gaussian) -> tuple[np.ndarray, np.ndarray]:
    """Mean, as a column, and covariance of the only run."""
    return column(law.mean), np.asarray(law.cov).reshape(np.size(law.mean), -1)


def slope(function: Callable[[Any], np.ndarray], x: np.ndarray) -> np.ndarray:
    """The Jacobian of a function of a column, by complex steps."""
    return np.hstack([function(x + 1e-30j * column(e)).imag / 1e-30 for e in np.eye(len(x))])


def given(before: Indexed, after: Indexed) -> Indexed:
    r"""A letter with two indices, as Western books write it: `P_{k|k-1}` is a prediction, `P_{k|k}` an estimate."""
    return Indexed(lambda at, until: (after if at == until else before)[at,])


def normal_nodes(mean: float, variance: float) -> tuple[np.ndarray, Callable[[Any], float]]:
    r"""Nodes x for a normal law, and the mean of a function of x that is given at the nodes (Gauss and Hermite)."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)
    weights = weights / weights.sum()
    return mean + np.sqrt(variance) * nodes, lambda values: float(np.sum(weights * values))


class Masses(np.ndarray):
    r"""Masses of nodes as a row, (1, n): `\\mu_kP` is a product of matrices, `\\mu_k(j)` the mass of a node."""

    @classmethod
    def of(cls, values: Any) -> Masses:
        return np.asarray(values, float).reshape(1, -1).view(cls)

    def __call__(self, node: int) -> float:
        return float(self[0, int(node)])


def chain_run(
    rng: np.random.Generator, nodes: Any, P: np.ndarray, start: Any, likelihood: Callable[[float, Any], Any]
) -> dict[str, Any]:
    r"""The letters of the Stratonovich equation on masses, \\mu, \\mu^-, C, z, p, y with the index k, and P, x with i and j.

    A plain program: every sum is a loop over the nodes; likelihood(y, x) is p(y | x).
    """
    size = range(len(nodes))
    mass, rows = [float(one) for one in start], []
    for y in rng.normal(size=_STEPS):
        joint = [mass[j] * likelihood(y, nodes[j]) for j in size]
        after = [one / sum(joint) for one in joint]
        z = sum(nodes[j] * after[j] for j in size)
        p = sum(nodes[j] ** 2 * after[j] for j in size) - z**2
        rows.append((Masses.of(mass), Masses.of(after), 1 / sum(joint), z, p, y))
        mass = [sum(after[i] * P[i, j] for i in size) for j in size]
    names = (r"\mu^-", r"\mu", "C", "z", "p", "y")
    found = {name: Indexed([row[place] for row in rows]) for place, name in enumerate(names)}
    return found | {"P": Indexed(P, P), "x": Indexed(nodes), "i": size, "j": size, "k": K_RANGE}
