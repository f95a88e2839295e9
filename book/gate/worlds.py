r"""Numbers for the letters of a page: definitions in LaTeX, read by the reader that reads the page,
and shared runs.

A world is a text whose lines are done one after another::

    \Psi, R: cov 2                     draw: cov n, any n m, eye n, pos (from .5 to 2), in a b, num,
                                       nums n [plain], share n (they sum to one), list n any m
    k: range 0 4                       an index that runs
    x: nodes \lambda \Psi              nodes of a normal law, and the operators \mathsf M and
                                       \mathsf D over it
    K = \Psi G^T(G\Psi G^T+R)^{-1}      define, of letters that stand above
    f(x) = \sin x                      define a function
    \Psi_{k+1} = Ap_kA^T+Q             lines with an index follow each other for k = 0, 1, ...;
                                       \Psi_0 = P begins
    c_j = \sum_i\mu_i\pi_{ij}           for each j of a range
    again:                             what follows, down to `then:`, again and again until nothing
                                       changes
    entries: p                         p_{12} is in row 1 and column 2 of the matrix p
    keep: K, p                         forget all other letters; `forget: a, b` these
    "|v|" = \sqrt{v^Tv}                a letter that looks like something else; `"p(x|z)" of x =
                                       ...` moves with x

A page's relation must hold in a world with all its letters, so a world says things in another way
than the page: an inverse for a gain, a sum or an integral for a closed form.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from itertools import groupby, product
from typing import Any

import numpy as np
import sympy as sp

from gate.relation import Reader, keys_of
from gate.tex import normal
from gate.values import Indexed, Of, Operator
from kfcourse.filters import aof
from kfcourse.filters.kalman import correct, predict
from kfcourse.laws import Gaussian
from kfcourse.linear.system import LinearSystem
from kfcourse.montecarlo.ensemble import simulate
from kfcourse.symbolic.formula import symbol
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import linearised

AGAIN = 5000  # rounds of what comes to rest; those of the pages take some hundred


def world(text: str) -> Callable[[np.random.Generator], dict[str, Any]]:
    """The letters of a text of definitions, drawn with a generator."""
    lines = [
        line for line in (line.partition("#")[0].strip() for line in text.splitlines()) if line
    ]

    stepped = {line.partition("_{k+1}")[0] for line in lines if "_{k+1}" in line.partition("=")[0]}

    def make(rng: np.random.Generator) -> dict[str, Any]:
        letters: dict[str, Any] = {r"\operatorname{tr}": np.trace}
        again = False
        for kind, group in groupby(lines, lambda line: _kind(line, stepped)):
            if kind in ("again", "then"):
                again = kind == "again"
            elif kind == "step":
                _steps(letters, list(group))
            elif kind == "start":
                for left, _, right in (line.partition("=") for line in group):
                    name, at = left.strip().rsplit("_", 1)
                    letters[name] = Indexed({int(at): _computed(right, letters, {})})
            elif kind == "once":
                _define(letters, list(group), AGAIN if again else 1)
            else:
                for line in group:
                    letters = _drawn(letters, rng, *(line.split(": ", 1)))
        return letters

    return make


def _kind(line: str, stepped: set[str]) -> str:
    left, equals, _ = line.partition("=")
    if line in ("again:", "then:"):
        return line[:-1]
    if not equals or line.startswith(("keep: ", "forget: ", "entries: ")):
        return "draw"
    if left.startswith('"'):
        return "once"
    if re.sub(r"_\d$", "", left.strip()) in stepped:
        return "start"
    return "step" if re.search(r"_(k|\{k\+1\})$", left.strip()) else "once"


def _drawn(
    letters: dict[str, Any], rng: np.random.Generator, names: str, what: str
) -> dict[str, Any]:
    if names == "forget":
        return {
            name: value for name, value in letters.items() if name not in what.strip().split(", ")
        }
    if names == "entries":
        matrices = {name: letters[name] for name in what.strip().split(", ")}
        return letters | {
            name: Indexed(lambda i, j, A=A: A[i - 1, j - 1], A) for name, A in matrices.items()
        }
    if names == "keep":
        return {name: letters[name] for name in what.strip().split(", ")}
    kind, *words = what.split()
    if kind == "nodes":
        x, mean = normal_nodes(*(float(_computed(word, letters, {})) for word in words))
        spread = Operator(lambda values: mean(values**2) - mean(values) ** 2)
        return letters | {names: x, r"\mathsf M": Operator(mean), r"\mathsf D": spread}
    if kind == "list":
        count, *each = words
        return letters | {
            name: Indexed([_drawn({}, rng, "", " ".join(each))[""] for _ in range(int(count))])
            for name in names.split(", ")
        }
    draw = {
        "any": lambda *sizes: rng.normal(size=[int(size) for size in (*sizes, 1)[:2]]),
        "cov": lambda size: covariance(rng, int(size)),
        "eye": lambda size: np.eye(int(size)),
        "in": lambda low, high: rng.uniform(float(low), float(high)),
        "num": rng.normal,
        "nums": lambda size, *plain: Indexed(
            rng.normal(size=int(size)), rng.normal() if plain else None
        ),
        "pos": lambda: rng.uniform(0.5, 2),
        "range": lambda *ends: range(*map(int, ends)),
        "share": lambda *sizes: Indexed(
            rng.dirichlet(np.ones(int(sizes[-1])), size=[int(size) for size in sizes[:-1]])
        ),
    }[kind]
    return letters | {name: draw(*words) for name in names.split(", ")}


def _steps(letters: dict[str, Any], lines: list[str]) -> None:
    for k in letters.get("k", range(5)):
        for line in lines:
            left, right = line.split("=", 1)
            name, index = left.strip().rsplit("_", 1)
            values = letters.setdefault(name, Indexed({})).values
            values[k + ("+1" in index)] = _computed(right, letters, {"k": k})


def _define(letters: dict[str, Any], lines: list[str], rounds: int) -> None:
    before: list[Any] = []
    for _ in range(rounds):
        values = []
        for line in lines:
            made = _made(*re.fullmatch('((?:".*")?[^=]*)=(.*)', line).groups(), letters)
            letters |= made
            values += [np.array(value) for value in made.values() if not callable(value)]
        if before and all(
            np.allclose(*pair, rtol=1e-14, atol=1e-300) for pair in zip(values, before, strict=True)
        ):
            return
        before = values


def _made(left: str, right: str, letters: Mapping[str, Any]) -> dict[str, Any]:
    left = left.strip()
    own = dict(letters)
    if left.startswith('"'):  # a letter that looks like a call, or is an expression
        name, _, moved = left.removeprefix('"').partition('"')
        names = moved.removeprefix(" of ").split(", ")
        if not moved:
            return {name: _computed(right, own, {})}
        running = [isinstance(own.get(each), range) for each in names]

        def function(*given: Any) -> Any:
            at = {
                each: value for each, value, runs in zip(names, given, running, strict=True) if runs
            }
            return _computed(
                right,
                own
                | {each: value for each, value in zip(names, given, strict=True) if each not in at},
                at,
            )

        return {name: Of(function, *names)}
    indices = re.fullmatch(r"(.+)_(?:\{(\w+)\}|(\w))", left)
    if indices and all(isinstance(letters.get(index), range) for index in indices[2] or indices[3]):
        names = indices[2] or indices[3]
        values = {at: _computed(right, own, dict(zip(names, at, strict=True)))
                  for at in product(*(letters[index] for index in names))}  # fmt: skip
        return {indices[1]: Indexed(lambda *at: values[at])}
    if not (call := re.fullmatch(r"(.+?)\(([^()]*)\)", left)):
        return {left: _computed(right, letters, {})}
    arguments = [name.strip() for name in call[2].split(",")]
    return {
        call[1]: lambda *given: _computed(
            right, own | dict(zip(arguments[: len(given)], given, strict=True)), {}
        )
    }


def _computed(text: str, letters: Mapping[str, Any], at: Mapping[str, Any]) -> Any:
    reader = Reader(normal(text).split(), keys_of(letters), at)
    value = reader.total()
    if reader.next or reader.failed:
        raise ValueError(f"cannot make {text}: {reader.failed or reader.text[reader.place :]}")
    return value


K_RANGE = range(1, 4)
_STEPS = 5


def covariance(rng: np.random.Generator, size: int) -> np.ndarray:
    """A positive definite matrix (size, size) without any symmetry but its own."""
    root = rng.normal(size=(size, size))
    return root @ root.T + np.eye(size)


def column(values: Any) -> np.ndarray:
    """A vector as a matrix of one column."""
    return np.asarray(values, float).reshape(-1, 1)


def shared_readings(rng: np.random.Generator) -> tuple[Any, ...]:
    """Twelve states that share three measurements: their masses, the states, their means given the
    measurement, and another function of it."""
    mass, x = rng.dirichlet(np.ones(12)), rng.normal(size=12)
    seen = np.repeat(np.arange(3), 4)
    best = np.array([np.average(x[seen == y], weights=mass[seen == y]) for y in seen])
    return mass, x, best, rng.normal(size=3)[seen]


def kalman_run(rng: np.random.Generator, seen: int = 2) -> dict[str, Any]:
    r"""The letters A, H, Q, R, I and \\lambda, \\Psi, K, z, p, \\nu, F, y with the index k, from
    `kfcourse.filters.kalman`.

    K is p H^T R^{-1}, the form of the gain that the package does not compute with.
    """
    states = 3
    A, H = rng.normal(size=(states, states)), rng.normal(size=(seen, states))
    Q, R = covariance(rng, states), covariance(rng, seen)
    system = LinearSystem(A, H, Q, R)
    law = Gaussian(rng.normal(size=states), covariance(rng, states))
    series: dict[str, list[Any]] = {
        name: [] for name in (r"\lambda", r"\Psi", "y", "K", "z", "p", r"\nu", "F")
    }
    for _ in range(_STEPS):
        y = rng.normal(size=seen)
        posterior = correct(system, law, y)
        row = (
            law.mean,
            law.cov,
            y,
            posterior.cov @ H.T @ np.linalg.inv(R),
            posterior.mean,
            posterior.cov,
            y - H @ law.mean,
        )
        for name, value in zip(series, (*row, H @ law.cov @ H.T + R), strict=True):
            series[name].append(column(value) if np.ndim(value) == 1 else value)
        law = predict(system, posterior)
    letters = {name: Indexed(values, values[2]) for name, values in series.items()}
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


BENT = _bent("0.3", "0.2")
BENT_SCALAR = Model.define(
    "0.8*x + 0.3*sin(x) + (0.4 + 0.1*x)*v",
    "x + 0.2*x**2 + 0.5*w",
    {},
    prior={"mean": 0.5, "variance": 0.4},
)
# Another one at each step: f_k is not f_{k+1}.
BENT_LATER = _bent("0.1*k", "0.1*k")


def extended_run(rng: np.random.Generator, model: Model = BENT) -> dict[str, Any]:
    r"""The letters of the extended Kalman filter of a model: f, g, S, \\Phi, H, D_\\xi, D_n, I and,
    with k, those of its run.

    The run is `aof(linearised(model))`, the Jacobians are derivatives by complex steps, K = p H^T
    D_n^{-1}.  The noises of the object are mixed, so that D_\\xi is not the identity.
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
    series: dict[str, list[Any]] = {
        name: [] for name in (r"\lambda", r"\Psi", "y", "z", "p", "H", "K", r"\nu", r"\Phi", "g")
    }
    for k, y in enumerate(simulate(model, runs=1, steps=_STEPS, seed=int(rng.integers(1 << 30))).y):
        law, state = state.predicted, ekf.step(state, y)
        (lam, Psi), (z, p) = (_only(law), _only(state.posterior))
        H = slope(S[k], lam)
        K, nu = p @ H.T @ np.linalg.inv(D_n), column(y) - S[k](lam)
        row = (lam, Psi, column(y), z, p, H, K, nu, slope(f[k], z), noise[k](z) @ unmixed)
        for name, value in zip(series, row, strict=True):
            series[name].append(value)
    series |= {"f": f, "S": S}
    letters = {name: Indexed(values, values[2]) for name, values in series.items()}
    return {r"D_\xi": D_xi, "D_n": D_n, "I": np.eye(len(model.x)), "k": K_RANGE} | letters


def _only(law: Gaussian) -> tuple[np.ndarray, np.ndarray]:
    """Mean, as a column, and covariance of the only run."""
    return column(law.mean), np.asarray(law.cov).reshape(np.size(law.mean), -1)


def slope(function: Callable[[Any], np.ndarray], x: np.ndarray) -> np.ndarray:
    """The Jacobian of a function of a column, by complex steps."""
    return np.hstack([function(x + 1e-30j * column(e)).imag / 1e-30 for e in np.eye(len(x))])


def given(before: Indexed, after: Indexed) -> Indexed:
    r"""A letter with two indices, as Western books write it: `P_{k|k-1}` is a prediction, `P_{k|k}`
    an estimate."""
    return Indexed(lambda at, until: (after if at == until else before)[at,])


def normal_nodes(mean: float, variance: float) -> tuple[np.ndarray, Callable[[Any], float]]:
    r"""Nodes x for a normal law, and the mean of a function of x that is given at the nodes (Gauss
    and Hermite)."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)
    weights = weights / weights.sum()
    return mean + np.sqrt(variance) * nodes, lambda values: float(np.sum(weights * values))


class Masses(np.ndarray):
    r"""Masses of nodes as a row, (1, n): `\\mu_kP` is a product of matrices, `\\mu_k(j)` the mass
    of a node."""

    @classmethod
    def of(cls, values: Any) -> Masses:
        return np.asarray(values, float).reshape(1, -1).view(cls)

    def __call__(self, node: int) -> float:
        return float(self[0, int(node)])


def chain_run(
    rng: np.random.Generator,
    nodes: Any,
    P: np.ndarray,
    start: Any,
    likelihood: Callable[[float, Any], Any],
) -> dict[str, Any]:
    r"""The letters of the Stratonovich equation on masses, \\mu, \\mu^-, C, z, p, y with the index
    k, and P, x with i and j.

    A plain program: every sum is a loop over the nodes; likelihood(y, x) is p(y | x).
    """
    size = range(len(nodes))
    mass, rows = [float(share) for share in start], []
    for y in rng.normal(size=_STEPS):
        joint = [mass[j] * likelihood(y, nodes[j]) for j in size]
        after = [share / sum(joint) for share in joint]
        z = sum(nodes[j] * after[j] for j in size)
        p = sum(nodes[j] ** 2 * after[j] for j in size) - z**2
        rows.append((Masses.of(mass), Masses.of(after), 1 / sum(joint), z, p, y))
        mass = [sum(after[i] * P[i, j] for i in size) for j in size]
    names = (r"\mu^-", r"\mu", "C", "z", "p", "y")
    series = {name: Indexed([row[place] for row in rows]) for place, name in enumerate(names)}
    return series | {"P": Indexed(P, P), "x": Indexed(nodes), "i": size, "j": size, "k": K_RANGE}
