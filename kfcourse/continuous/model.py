r"""Continuous time: white noise of given spectral density, simulation, and the extended Kalman-Bucy filter.

    dx/dt = f(x) + g(x) xi(t)        xi: white, one-sided spectral density S_xi, intensity S_xi / 2
    y(t)  = S(x) + n(t)              n:  white, one-sided spectral density N,    intensity N / 2

in Ito's sense: over a short step T the state changes by T f + g times a normal number of variance S_xi T / 2, with f and g at
the *beginning* of the step.  That is what a discrete model turns into when T -> 0; `symmetrised_drift` is the difference from
the other (symmetrised, Stratonovich) sense.

White noise has no values, only means over intervals: a stored measurement is y_k = (1/T) Integral y dt over step k, with the
noise variance N / (2 T).  A continuous filter is therefore an ordinary `Filter` of this y_k, made for one step T; it tends to
its differential equations as T -> 0.

`ContinuousModel`, `simulate`, `coarsen`: model and trajectories.  `to_discrete`: the discrete model with the same limit.
`log_likelihood_rate`, `filter_equations`: the filter's formulas, derived.  `extended_kalman_bucy`, `steady_state`: the filter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
import sympy as sp

from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.laws import Array, Gaussian, Measurement, apply, correct, product, square_root, symmetric, transpose
from kfcourse.montecarlo.designing import NotFinite
from kfcourse.symbolic.codegen import compile_function
from kfcourse.symbolic.formula import symbol
from kfcourse.symbolic.model import (
    Formula,
    Formulas,
    Model,
    ModelError,
    Names,
    _as_list,
    _by_name,
    _checked,
    _exact,
    _law,
    _read,
    _table,
    exact_matrix,
)


@dataclass(frozen=True)
class ContinuousModel:
    """A continuous-time model with white noises; build it with `ContinuousModel.define`.

    Attributes
    ----------
    drift, diffusion, signal : sympy.Matrix
        f(x), n x 1; g(x), n x r; S(x), p x 1, with parameters as symbols.
    x : tuple of sympy.Symbol
    parameters : dict
        Parameter name to value (exact rational numbers).
    prior : Gaussian
        Law of x(0).
    spectral_density, noise_density : ndarray (r, r), (p, p)
        One-sided spectral densities S_xi of xi and N of n: units squared per hertz.
    """

    drift: sp.ImmutableMatrix
    diffusion: sp.ImmutableMatrix
    signal: sp.ImmutableMatrix
    x: tuple[sp.Symbol, ...]
    parameters: Mapping[str, sp.Rational]
    prior: Gaussian = field(compare=False)
    spectral_density: Array = field(compare=False)
    noise_density: Array = field(compare=False)

    @classmethod
    def define(
        cls,
        drift: Formulas,
        diffusion: Formula | Sequence[Sequence[Formula]] | sp.MatrixBase,
        signal: Formulas,
        parameters: Mapping[str, float] | None = None,
        *,
        symbols: Names | None = None,
        prior: Mapping[str, Any] | None = None,
        spectral_density: Any = 1.0,
        noise_density: Any = 1.0,
    ) -> ContinuousModel:
        """Build a model from formulas.

        Parameters
        ----------
        drift, signal : str, sympy expression, or a list of them
            f(x) and S(x).  A single drift formula is a scalar model in x; lists use x1, x2, ... unless `symbols` names them.
        diffusion : str, sympy expression, or a list of rows
            g(x), one row for each state component, one column for each noise.
        parameters : dict
            Name to number, for every other symbol in the formulas.
        symbols : sequence of str, optional
            Names of the state components.
        prior : dict, optional
            Keys "mean" and "variance", as in `Model.define`.
        spectral_density, noise_density : number, list of numbers, or matrix
            One-sided densities of xi and n.

        Raises
        ------
        FormulaError, ModelError
            As `Model.define`; also a meter without noise (its density must be positive definite).

        Examples
        --------
        >>> ContinuousModel.define("-a*x", "s", "sin(x)", dict(a=0.5, s=1), noise_density=0.2)
        ContinuousModel(dx/dt = -a*x + s*xi, y = sin(x) + n; a = 1/2, s = 1)
        """
        values = {_checked(name): _exact(name, value) for name, value in _table("parameters", parameters).items()}
        f, S = (_as_list(what, _plain(formulas)) for what, formulas in (("drift", drift), ("signal", signal)))
        g = _rows(diffusion)
        n, noises = len(f), len(g[0])
        names = [*([symbols] if isinstance(symbols, str) else symbols or (["x"] if n == 1 else [f"x{i + 1}" for i in range(n)]))]
        if len(names) != n or len(g) != n:
            raise ModelError(
                f"{n} drift formula(s), {len(g)} row(s) of diffusion and the state symbols {names}: one each is needed"
            )
        twice = sorted({name for name in names if names.count(name) > 1 or name in values})
        if twice:
            raise ModelError(f"{', '.join(twice)} named twice: state and parameters need different names")
        x = tuple(symbol(_checked(name)) for name in names)
        known = {name: symbol(name) for name in values} | _by_name(x)
        N = _law("noise_density", {"variance": noise_density}, len(S)).cov
        if np.linalg.eigvalsh(N).min() <= 1e-12 * np.linalg.eigvalsh(N).max():  # rounding of eigvalsh
            raise ModelError(
                f"`noise_density` must be positive definite, got {N.tolist()}: without noise, y(t) would give S(x) exactly"
            )
        model = cls(
            sp.ImmutableMatrix([_read(formula, known, "drift") for formula in f]),
            sp.ImmutableMatrix([[_read(formula, known, "diffusion") for formula in row] for row in g]),
            sp.ImmutableMatrix([_read(formula, known, "signal") for formula in S]),
            x,
            values,
            _law("prior", prior, n),
            _law("spectral_density", {"variance": spectral_density}, noises).cov,
            N,
        )
        to_discrete(model, 1.0)  # its checks are this model's too: real and finite, and the signal depends on the state
        return model

    @property
    def n(self) -> int:
        """Number of state components."""
        return len(self.x)

    @property
    def p(self) -> int:
        """Number of measurement components."""
        return len(self.signal)

    @cached_property
    def values(self) -> dict[sp.Symbol, sp.Rational]:
        """Parameter symbols and their values, for `subs`."""
        return {symbol(name): value for name, value in self.parameters.items()}

    def fresh(self, name: str) -> sp.Symbol:
        """A symbol of that name, with underscores if the model uses it already."""
        while name in self.parameters or name in _by_name(self.x):
            name += "_"
        return symbol(name)

    def __repr__(self) -> str:
        xi = [symbol(name) for name in _numbered("xi", self.diffusion.cols)]
        rates = self.drift + self.diffusion * sp.Matrix(xi)
        rows = [f"d{x}/dt = {rate}" for x, rate in zip(self.x, rates, strict=True)]
        rows += [f"{y} = {S} + n{y[1:]}" for y, S in zip(_numbered("y", self.p), self.signal, strict=True)]
        values = ", ".join(f"{name} = {value}" for name, value in self.parameters.items())
        return f"ContinuousModel({', '.join(rows)}{'; ' if values else ''}{values})"


def _numbered(name: str, size: int) -> list[str]:
    return [name] if size == 1 else [f"{name}{i + 1}" for i in range(size)]


def _plain(formulas: Any) -> Any:
    """A matrix as a list: SymPy's immutable matrices are expressions, too."""
    return list(formulas) if isinstance(formulas, sp.MatrixBase) else formulas


def _rows(diffusion: Any) -> list[list[Formula]]:
    rows = diffusion.tolist() if isinstance(diffusion, sp.MatrixBase) else diffusion
    if isinstance(rows, str | sp.Expr):
        return [[rows]]
    if not isinstance(rows, list | tuple) or not rows or not all(isinstance(row, list | tuple) for row in rows):
        raise ModelError(f"`diffusion` must be one formula or a list of rows such as [['0'], ['s']], got {diffusion!r}")
    found = [_as_list("diffusion", list(row)) for row in rows]
    if len({len(row) for row in found}) > 1:
        raise ModelError(
            f"`diffusion`: rows of different lengths {[len(row) for row in found]}; write 0 where a noise does not enter"
        )
    return found


class Path(NamedTuple):
    """Trajectories of a continuous model, seen with the step T.

    step : float
    x : (steps + 1, runs, n), the state at the times 0, T, ..., steps T
    y : (steps, runs, p), the mean of y(t) over each step
    """

    step: float
    x: Array
    y: Array


def simulate(
    model: ContinuousModel, step: float, steps: int, runs: int, seed: int | np.random.Generator, substeps: int = 1
) -> Path:
    """Trajectories by the Euler-Maruyama scheme with the step T / substeps.

    x' = x + dt f(x) + g(x) N(0, S_xi dt / 2),     y_k = mean over the step of S(x) + N(0, N / (2 dt))

    The error of a trajectory is of the order dt if g is constant, and sqrt(dt) if g depends on x; that of its moments is of the
    order dt in both cases.

    Raises
    ------
    ValueError
        A step that is not positive, sizes that are not positive whole numbers.
    NotFinite
        The trajectories became infinite.
    """
    _check_step(step)
    for name, value in {"steps": steps, "runs": runs, "substeps": substeps}.items():
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
            raise ValueError(f"{name} must be a positive whole number, got {value!r}")
    rng, dt = np.random.default_rng(seed), step / substeps
    formulas = {"f": model.drift, "g": model.diffusion, "S": model.signal}
    equations = _compile(model, {"x": sp.Matrix(model.x)}, formulas, ["x", "f", "S"])
    xi_root, n_root = square_root(model.spectral_density * dt / 2), square_root(model.noise_density / (2 * dt))
    x = np.empty((steps + 1, runs, model.n))
    y = np.zeros((steps, runs, model.p))
    now = model.prior.mean + rng.standard_normal((runs, model.n)) @ square_root(model.prior.cov).T
    x[0] = now
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # what becomes infinite is reported below
        for k in range(steps):
            for _ in range(substeps):
                f, g, S = equations(now)
                y[k] += (S + rng.standard_normal((runs, model.p)) @ n_root.T) / substeps
                now = now + dt * f + apply(g, rng.standard_normal((runs, len(xi_root))) @ xi_root.T)
            x[k + 1] = now
            if not (np.isfinite(now).all() and np.isfinite(y[k]).all()):
                raise NotFinite(
                    f"step {k}, time {(k + 1) * step:g}: a trajectory became infinite; check the model, or use more substeps"
                )
    return Path(step, x, y)


def coarsen(path: Path, factor: int) -> Path:
    """The same trajectories seen with a step `factor` times as long: every factor-th state, means of the measurements."""
    steps = len(path.y)
    if isinstance(factor, bool) or not isinstance(factor, int | np.integer) or factor < 1 or steps % factor:
        raise ValueError(f"the factor must be a whole number that divides the {steps} steps, got {factor!r}")
    return Path(path.step * factor, path.x[::factor], path.y.reshape(steps // factor, factor, *path.y.shape[1:]).mean(axis=1))


def to_discrete(model: ContinuousModel, step: float) -> Model:
    """The discrete model whose limit for T -> 0 the continuous one is.

    x_{k+1} = x_k + T f(x_k) + T g(x_k) v_k,  v ~ N(0, S_xi / (2 T));    y_k = S(x_k) + w_k,  w ~ N(0, N / (2 T))

    Both noises are means of white noise over the step.  All discrete filters run on it.
    """
    _check_step(step)
    T = sp.Rational(str(float(step)))
    v = [model.fresh(name) for name in _numbered("v", model.diffusion.cols)]
    w = [model.fresh(name) for name in _numbered("w", model.p)]
    return Model.define(
        list(sp.Matrix(model.x) + T * (model.drift + model.diffusion * sp.Matrix(v))),
        list(model.signal + sp.Matrix(w)),
        model.parameters,
        symbols={"x": [s.name for s in model.x], "v": [s.name for s in v], "w": [s.name for s in w]},
        prior={"mean": model.prior.mean, "variance": model.prior.cov},
        state_noise={"variance": model.spectral_density / (2 * step)},
        meter_noise={"variance": model.noise_density / (2 * step)},
    )


def log_likelihood_rate(signal: sp.MatrixBase, y: sp.MatrixBase, noise_density: sp.MatrixBase) -> sp.Expr:
    """F(x, t) = 2 S^T N^-1 (y - S / 2), what the log-likelihood gains in unit time: (p, 1), (p, 1), (p, p) -> scalar."""
    return (2 * signal.T * noise_density.inv() * (y - signal / 2))[0]


def symmetrised_drift(
    rates: sp.MatrixBase, state: Sequence[sp.Symbol], noise: Sequence[sp.Symbol], intensity: sp.MatrixBase
) -> sp.ImmutableMatrix:
    """What is added to ds/dt = rates(s, noise) in Ito's sense to give the same in the symmetrised (Stratonovich) sense, (n, 1).

    With b_l = d rates / d noise_l:   1/2 sum_lm intensity_lm (d b_l / d s) b_m;   for scalar g(x) xi: g g' S_xi / 4.
    """
    b, q = rates.jacobian(sp.Matrix(noise)), range(len(noise))
    terms = [intensity[i, j] / 2 * b.col(i).jacobian(sp.Matrix(state)) * b.col(j) for i in q for j in q]
    return sp.ImmutableMatrix(sum(terms, sp.zeros(len(rates), 1)))


class FilterEquations(NamedTuple):
    """The extended Kalman-Bucy filter in formulas, parameters as symbols.

    dz/dt = f + D u,     dD/dt = A D + D A^T + Q + D U D,     u = (dF/dx)^T,  U = d2F/dx2  at x = z

    Attributes
    ----------
    z, D, y : sympy.Matrix
        Symbols: estimate (n, 1), covariance (n, n), measurement (p, 1).
    f, A, Q : sympy.Matrix
        f(z), df/dx, g S_xi g^T / 2.
    S, H : sympy.Matrix
        S(z), dS/dx.
    F : sympy expression
        The gain of the log-likelihood in unit time, at z.
    u, U : sympy.Matrix
        Its derivatives.  Without second derivatives of S, U is its noise-free part -H^T 2 N^-1 H.
    """

    z: sp.ImmutableMatrix
    D: sp.ImmutableMatrix
    y: sp.ImmutableMatrix
    f: sp.ImmutableMatrix
    A: sp.ImmutableMatrix
    Q: sp.ImmutableMatrix
    S: sp.ImmutableMatrix
    H: sp.ImmutableMatrix
    F: sp.Expr
    u: sp.ImmutableMatrix
    U: sp.ImmutableMatrix

    @property
    def state(self) -> list[sp.Symbol]:
        """z, and D row by row from its diagonal on."""
        return [*self.z, *_upper(self.D)]

    @property
    def rates(self) -> sp.ImmutableMatrix:
        """dz/dt and dD/dt, in the order of `state`."""
        dD = self.A * self.D + self.D * self.A.T + self.Q + self.D * self.U * self.D
        return sp.ImmutableMatrix([*(self.f + self.D * self.u), *_upper(dD)])


def _upper(matrix: sp.MatrixBase) -> list[sp.Expr]:
    return [matrix[i, j] for i in range(matrix.rows) for j in range(i, matrix.cols)]


def filter_equations(model: ContinuousModel, second_derivatives: bool = True) -> FilterEquations:
    """Derive the filter's equations from f, g, S and F(x, t).

    The second derivatives of S enter U times y - S, so without them U is U at y = S.
    """
    n = model.n
    z = sp.ImmutableMatrix([model.fresh(name) for name in _numbered("z", n)])
    D = sp.ImmutableMatrix(n, n, lambda i, j: model.fresh("D" if n == 1 else f"D{min(i, j) + 1}{max(i, j) + 1}"))
    y = sp.ImmutableMatrix([model.fresh(name) for name in _numbered("y", model.p)])
    at = dict(zip(model.x, z, strict=True))
    f, g, S = (sp.ImmutableMatrix(matrix.subs(at, simultaneous=True)) for matrix in (model.drift, model.diffusion, model.signal))
    F = log_likelihood_rate(S, y, exact_matrix(model.noise_density))
    U = sp.ImmutableMatrix(sp.hessian(F, list(z)))
    if not second_derivatives:
        U = _without_noise(U, y, S)
    Q = g * exact_matrix(model.spectral_density) * g.T / 2
    return FilterEquations(z, D, y, f, f.jacobian(z), Q, S, S.jacobian(z), F, sp.ImmutableMatrix([F]).jacobian(z).T, U)


def _without_noise(U: sp.MatrixBase, y: sp.MatrixBase, S: sp.MatrixBase) -> sp.ImmutableMatrix:
    return sp.ImmutableMatrix(U.subs(dict(zip(y, S, strict=True)))).applyfunc(sp.expand)


def extended_kalman_bucy(
    model: ContinuousModel, step: float, second_derivatives: bool = False, symmetrised: bool = False
) -> Filter:
    """The extended Kalman filter in continuous time, as a filter of the means y_k over steps of length T.

    dz/dt = f + K (y - S),   K = D H^T 2 N^-1,     dD/dt = A D + D A^T + Q - K H D  [+ D W D],   W = U + H^T 2 N^-1 H

    are integrated by Euler's scheme, except that the term -K H D is taken implicitly, so that no step is too long for it:

        B  = (D^-1 + T H^T 2 N^-1 H)^-1
        z' = z + T (f + B H^T 2 N^-1 (y - S))
        D' = (M + T A) B (M + T A)^T + T Q,      M = (I + T B V / 8)^-1 (I + T B W / 2),   V = T Mean[W B W]

    D' is never negative.  Without second derivatives M = I; with them W contains white noise of the size 1 / sqrt(T), so
    (T B W)^2 is of the order T, and V makes Mean[M B M^T] = B to that order, as Ito's sense demands.

    Parameters
    ----------
    model : ContinuousModel
    step : float
        T, the interval over which every y_k is the mean of y(t).
    second_derivatives : bool
        Keep the term D W D with the second derivatives of S.
    symmetrised : bool
        Read the equations in the symmetrised (Stratonovich) sense.

    Returns
    -------
    Filter
        For `run`, `compare`, and `predictions(filter, y)`, which gives z and D at the times 0, T, 2 T, ...
        Its `model` is `to_discrete(model, step)`.  A run whose y has a NaN does without the missing components and without W.

    Raises
    ------
    NotFinite
        While running: an estimate became infinite, or, with `symmetrised`, a covariance negative.
    """
    discrete = to_discrete(model, step)
    name = "kalman-bucy" + "-second" * second_derivatives + "-symmetrised" * symmetrised
    equations = filter_equations(model, second_derivatives)
    z, D, y = equations.z, equations.D, equations.y
    arguments = {"z": z, "D": D, "y": y}
    linear = _compile(model, {"z": z}, {key: getattr(equations, key) for key in "fAQSH"}, ["z", "f", "S"])
    W = equations.U - _without_noise(equations.U, y, equations.S)
    intensity = exact_matrix(model.noise_density) / 2
    slopes = [W.diff(component) for component in y]  # W is linear in y
    V = sum((intensity[i, j] * a * D * b for i, a in enumerate(slopes) for j, b in enumerate(slopes)), sp.zeros(*D.shape))
    added = sp.zeros(len(equations.state), 1)
    if symmetrised:
        added = symmetrised_drift(equations.rates, equations.state, list(y), intensity)
    by_state = dict(zip(equations.state, added, strict=True))
    outputs = {"W": W, "V": V, "dz": z.applyfunc(by_state.get), "dD": D.applyfunc(by_state.get)}
    second = _compile(model, arguments, outputs, ["z", "y", "dz"]) if second_derivatives or symmetrised else None
    identity, R = np.eye(model.n), model.noise_density / (2 * step)

    def step_forward(state: State, y: Array) -> State:
        with np.errstate(over="ignore", invalid="ignore"):  # what becomes infinite is reported below
            z, D = state.predicted
            f, A, Q, S, H = linear(z)
            measurement = Measurement(S, H, symmetric(product(product(H, D), transpose(H))) + R, R)
            mean, B = correct(state.predicted, measurement, y)
            M, cov = identity, B
            if second is not None:
                missing: Array = np.asarray(np.isnan(y).any(axis=-1))
                W, V, dz, dD = second(z, B, np.where(missing[:, None], 0.0, y))
                W, V, dD = (np.where(missing[:, None, None], 0.0, matrix) for matrix in (W, V, dD))
                M = _solve(identity + step / 8 * product(B, V), identity + step / 2 * product(B, W))
                mean, Q = mean + step * np.where(missing[:, None], 0.0, dz), Q + dD
                cov = _propagated(M, B, step * dD)
            predicted = Gaussian(mean + step * f, _propagated(M + step * A, B, step * Q))
        _check_law(name, state.step, step, predicted, symmetrised)
        return State(state.step + 1, Gaussian(mean, cov), predicted)

    return Filter(name, discrete, initial_state(discrete), step_forward)


def _compile(model: ContinuousModel, arguments: dict[str, Any], outputs: dict[str, Any], vectors: list[str]) -> Any:
    numeric = {name: sp.ImmutableMatrix(matrix.subs(model.values)) for name, matrix in outputs.items()}
    return compile_function("continuous", arguments, numeric, vectors, f"{', '.join(outputs)} of {model}").function


def _solve(left: Array, right: Array) -> Array:
    return right / left if left.shape[-1] == 1 else np.linalg.solve(left, right)


def _propagated(M: Array, cov: Array, added: Array) -> Array:
    """M cov M^T + added."""
    return symmetric(product(product(M, cov), transpose(M)) + added)


def _check_law(name: str, k: int, step: float, law: Gaussian, may_be_negative: bool) -> None:
    lost = ~np.asarray(np.isfinite(law.mean).all(axis=-1) & np.isfinite(law.cov).all(axis=(-2, -1)))
    if may_be_negative and not lost.any():
        lost = np.asarray(np.linalg.eigvalsh(law.cov).min(axis=-1) < 0)
    if lost.any():
        raise NotFinite(
            f"step {k}, time {(k + 1) * step:g}: {name} became infinite{' or negative' if may_be_negative else ''} in "
            f"{np.count_nonzero(lost)} of {len(law.mean)} runs; take a smaller step than {step:g}"
            + (", and if that does not help, leave out the second derivatives" if "-" in name[7:] else "")
        )


def _check_step(step: float) -> None:
    if (
        isinstance(step, bool)
        or not isinstance(step, int | float | np.integer | np.floating)
        or not (np.isfinite(step) and step > 0)
    ):
        raise ValueError(f"the step must be a positive number of time units, got {step!r}")


class Linear(NamedTuple):
    """Matrices of a linear continuous model: A (n, n), G (n, r), H (p, n)."""

    A: Array
    G: Array
    H: Array


def linear_matrices(model: ContinuousModel) -> Linear:
    """A = df/dx, G = g, H = dS/dx; ModelError if the model is not linear."""
    x = sp.Matrix(model.x)
    matrices = [m.subs(model.values) for m in (model.drift.jacobian(x), model.diffusion, model.signal.jacobian(x))]
    if any(matrix.has(*model.x) for matrix in matrices):
        raise ModelError(
            f"{model} is not linear: it has no steady state that holds everywhere; use extended_kalman_bucy(model, step)"
        )
    return Linear(*(np.array(matrix, dtype=float) for matrix in matrices))


class Steady(NamedTuple):
    """The stationary Kalman-Bucy filter: covariance (n, n), gain (n, p)."""

    cov: Array
    gain: Array


def steady_state(model: ContinuousModel) -> Steady:
    """Limit of D and of the gain K = D H^T 2 N^-1 of a linear model, from the algebraic Riccati equation.

    A D + D A^T + G S_xi G^T / 2 - D H^T 2 N^-1 H D = 0

    Raises
    ------
    ModelError
        The model is not linear.
    ValueError
        There is no limit that the filter reaches from every start.
    """
    A, G, H = linear_matrices(model)
    R = model.noise_density / 2
    try:
        cov = symmetric(scipy.linalg.solve_continuous_are(A.T, H.T, G @ model.spectral_density @ G.T / 2, R))
        gain = np.linalg.solve(R, H @ cov).T
        closed = np.linalg.eigvals(A - gain @ H)
        settles = closed.real.max() < -1e-8 * np.abs(closed).max()  # a root at 0 is found to the square root of rounding
    except (np.linalg.LinAlgError, ValueError):
        settles = False
    if not settles:
        raise ValueError(
            "the Riccati equation has no stabilising solution: a part of the state is neither seen by the meter nor decays, "
            "or has no noise; follow D with extended_kalman_bucy(model, step)"
        )
    return Steady(cov, gain)
