r"""Structural functions: the seam between a model and every filter of the course.

The first two conditional moments as functions of a Gaussian's mean and covariance,

    tau(z, p), Theta(z, p)          mean and covariance of x_{k+1}  when x_k ~ N(z, p)
    h(m, d),  G(m, d),  F(m, d)     mean of y_k, its sensitivity dh/dm, its covariance when x_k ~ N(m, d)

`linearised` and `gaussian` derive them symbolically from the model; `unscented` and `gauss_hermite`
compute them numerically, for models without a closed form.  All four give a `Structure`, and one
predict/correct step serves them all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import product as cartesian

import numpy as np
import sympy as sp

from kfcourse.laws import Array, Gaussian, Measurement, gain, square_root, symmetric, transpose
from kfcourse.symbolic.codegen import Compiled, compile_function
from kfcourse.symbolic.formula import symbol
from kfcourse.symbolic.model import Model, ModelError, exact_matrix
from kfcourse.symbolic.moments import GaussianMoments, NoClosedForm

FUNCTION_LATEX = {"tau": r"\tau", "Theta": r"\Theta", "h": "h", "G": "G", "F": "F"}


@dataclass(frozen=True)
class Structure:
    """The structural functions of a model, as functions of arrays and (if derived) as formulas.

    Attributes
    ----------
    name : str
        "linearised", "gaussian", "unscented" or "gauss-hermite".
    model : Model
    predict : callable
        (z (..., n), p (..., n, n)) -> Gaussian(tau, Theta).
    measure : callable
        (m (..., n), d (..., n, n)) -> Measurement(h (..., p), G (..., p, n), F (..., p, p), R).
    formulas : StructuralFormulas or None
        The symbolic functions; None for the numerical structures.

    Covariances, G and h that do not depend on the trajectory may come without the leading axes.
    """

    name: str
    model: Model
    predict: Callable[[Array, Array], Gaussian]
    measure: Callable[[Array, Array], Measurement]
    formulas: StructuralFormulas | None = None

    def __getitem__(self, function: str) -> sp.Expr | sp.MatrixBase:
        """The formula of "tau", "Theta", "h", "G", "F" or "R": an expression if scalar, else a matrix."""
        formulas = self._derived()
        matrix = formulas.R if function == "R" else formulas.functions[function]
        return matrix[0] if matrix.shape == (1, 1) else matrix

    def latex(self) -> str:
        """The five functions as a LaTeX `aligned` block, parameters as symbols; matrices entry by entry."""
        formulas = self._derived()
        lines = []
        for name, matrix in formulas.functions.items():
            before_state = name in ("tau", "Theta")
            arguments = formulas.state_arguments if before_state else formulas.meter_arguments
            names = ", ".join(sp.latex(a) for a in arguments) if self.model.n == 1 else ("z, p" if before_state else "m, d")
            for i, j in cartesian(range(matrix.rows), range(matrix.cols)):
                if name in ("Theta", "F") and i > j:
                    continue  # symmetric
                index = "" if len(matrix) == 1 else f"_{{{i + 1}}}" if matrix.cols == 1 else f"_{{{i + 1}{j + 1}}}"
                lines.append(rf"{FUNCTION_LATEX[name]}{index}({names}) &= {sp.latex(matrix[i, j])}")
        return "\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}"

    def source(self) -> str:
        """The generated NumPy code that runs."""
        formulas = self._derived()
        return formulas.compiled_predict.source + "\n\n" + formulas.compiled_measure.source

    def _derived(self) -> StructuralFormulas:
        if self.formulas is None:
            raise NoClosedForm(
                f"the {self.name} structure is computed by quadrature and has no formulas; see linearised(model), gaussian(model)"
            )
        return self.formulas


@dataclass(frozen=True)
class StructuralFormulas:
    """Symbolic structural functions with parameters as symbols.

    Attributes
    ----------
    model : Model
    z, p, m, d : sympy.Matrix
        Arguments: mean and covariance before the state equation, and before the meter equation.
    functions : dict
        "tau", "Theta", "h", "G", "F" to matrices of expressions.
    """

    model: Model
    name: str
    z: sp.ImmutableMatrix
    p: sp.ImmutableMatrix
    m: sp.ImmutableMatrix
    d: sp.ImmutableMatrix
    functions: dict[str, sp.ImmutableMatrix]

    @property
    def state_arguments(self) -> list[sp.Symbol]:
        return _distinct(self.z, self.p)

    @property
    def meter_arguments(self) -> list[sp.Symbol]:
        return _distinct(self.m, self.d)

    @cached_property
    def R(self) -> sp.ImmutableMatrix:
        """F - G d G^T, the part of the measurement's covariance that the state does not explain."""
        G, F = self.functions["G"], self.functions["F"]
        return sp.ImmutableMatrix(F - G * self.d * G.T).applyfunc(sp.expand)

    @cached_property
    def compiled_predict(self) -> Compiled:
        return self._compile(
            "predict", {"z": self.z, "p": self.p}, {key: self.functions[key].subs(self.model.values) for key in ("tau", "Theta")}
        )

    @cached_property
    def compiled_measure(self) -> Compiled:
        h, G, R = (part.subs(self.model.values) for part in (self.functions["h"], self.functions["G"], self.R))
        explained = G * self.d * G.T
        # F is computed as G d G^T + R: R enters both outputs, and is found once.
        auxiliary = {(i, j): sp.Dummy(f"R{i}{j}") for i in range(R.rows) for j in range(i, R.rows) if R[i, j].free_symbols}
        named = sp.ImmutableMatrix(*R.shape, lambda i, j: auxiliary.get((min(i, j), max(i, j)), R[i, j]))
        outputs = {"h": h, "G": G, "F": explained + named, "R": named}
        return self._compile("measure", {"m": self.m, "d": self.d}, outputs, {name: R[ij] for ij, name in auxiliary.items()})

    def _compile(
        self,
        name: str,
        arguments: dict[str, sp.MatrixBase],
        outputs: dict[str, sp.MatrixBase],
        definitions: dict[sp.Symbol, sp.Expr] | None = None,
    ) -> Compiled:
        doc = f"{', '.join(outputs)}: {self.name} structural functions of {self.model}"
        return compile_function(name, arguments, outputs, ["z", "m", "tau", "h"], doc, definitions)

    def structure(self) -> Structure:
        predict, measure = self.compiled_predict.function, self.compiled_measure.function
        return Structure(
            self.name,
            self.model,
            lambda z, p: _spread(Gaussian(*predict(z, p)), z),
            lambda m, d: Measurement(*measure(m, d)),
            self,
        )


def _spread(law: Gaussian, over: Array) -> Gaussian:
    """A mean that no argument enters is still one for each trajectory."""
    return law if law.mean.ndim == over.ndim else Gaussian(np.broadcast_to(law.mean, over.shape), law.cov)


def _distinct(mean: sp.MatrixBase, cov: sp.MatrixBase) -> list[sp.Symbol]:
    return list(dict.fromkeys([*mean, *cov]))


def gaussian_symbols(model: Model, mean: str, cov: str) -> tuple[sp.ImmutableMatrix, sp.ImmutableMatrix]:
    """Symbols of a mean (n, 1) and a symmetric covariance (n, n): z, p or z1, z2, ..., p11, p12, ...

    A name that the model already uses gets a trailing underscore.
    """
    taken = set(model.parameters) | {s.name for s in (*model.x, *model.v, *model.w)}

    def fresh(name: str) -> sp.Symbol:
        while name in taken:
            name += "_"
        return symbol(name)

    n = model.n
    if n == 1:
        return sp.ImmutableMatrix([fresh(mean)]), sp.ImmutableMatrix([fresh(cov)])
    means = [fresh(f"{mean}{i + 1}") for i in range(n)]
    covs = [[fresh(f"{cov}{min(i, j) + 1}{max(i, j) + 1}") for j in range(n)] for i in range(n)]
    return sp.ImmutableMatrix(means), sp.ImmutableMatrix(covs)


def linearised(model: Model) -> Structure:
    """Structural functions of the model linearised at the mean (the extended Kalman filter's).

    tau = a(z, m_v),  Theta = a_x p a_x^T + a_v D_v a_v^T,
    h = b(m, m_w),  G = b_x,  F = b_x d b_x^T + b_w D_w b_w^T,   derivatives at (z, m_v) and (m, m_w)

    Raises
    ------
    NoClosedForm
        If an equation is not differentiable.
    """
    (z, p), (m, d) = gaussian_symbols(model, "z", "p"), gaussian_symbols(model, "m", "d")
    tau, A, B = _taylor(model.state_equation, model.x, z, model.v, exact_matrix(model.state_noise.mean))
    h, H, C = _taylor(model.meter_equation, model.x, m, model.w, exact_matrix(model.meter_noise.mean))
    functions = {
        "tau": tau,
        "Theta": A * p * A.T + B * exact_matrix(model.state_noise.cov) * B.T,
        "h": h,
        "G": H,
        "F": H * d * H.T + C * exact_matrix(model.meter_noise.cov) * C.T,
    }
    return StructuralFormulas(model, "linearised", z, p, m, d, _expanded(functions)).structure()


def _taylor(equation, x, mean, noise, noise_mean):
    """Value and Jacobians by state and by noise, at (mean, noise_mean)."""
    point = dict(zip(x, mean, strict=True)) | dict(zip(noise, noise_mean, strict=True))
    parts = [equation, equation.jacobian(sp.Matrix(x)), equation.jacobian(sp.Matrix(noise))]
    for part in parts:
        if part.has(sp.Derivative, sp.DiracDelta):
            raise NoClosedForm(
                f"{list(equation)} is not differentiable and cannot be linearised; use unscented(model) or gauss_hermite(model)"
            )
    return [part.subs(point, simultaneous=True) for part in parts]


def gaussian(model: Model) -> Structure:
    """Structural functions as exact moments over x ~ N (the normal, or Gaussian, filters').

    tau = M a(x, v),  Theta = Cov a(x, v),  h = M b(x, w),  G = dh/dm,  F = Cov b(x, w)

    Raises
    ------
    NoClosedForm
        If a term has no closed-form Gaussian mean: use `unscented` or `gauss_hermite`.
    """
    (z, p), (m, d) = gaussian_symbols(model, "z", "p"), gaussian_symbols(model, "m", "d")
    tau, Theta = _moments(model.state_equation, model.x, z, p, model.v, model.state_noise)
    h, F = _moments(model.meter_equation, model.x, m, d, model.w, model.meter_noise)
    functions = {"tau": tau, "Theta": Theta, "h": h, "G": h.jacobian(m), "F": F}
    return StructuralFormulas(model, "gaussian", z, p, m, d, _expanded(functions)).structure()


def _moments(equation, x, mean, cov, noise, law: Gaussian):
    """Mean and covariance of equation(x, noise), x ~ N(mean, cov) and the noise independent."""
    joint = GaussianMoments(
        [*x, *noise], [*mean, *exact_matrix(law.mean)], sp.diag(sp.Matrix(cov), sp.Matrix(exact_matrix(law.cov)))
    )
    size = len(equation)
    means = sp.Matrix([joint.mean_of(formula) for formula in equation])
    covs = sp.zeros(size, size)
    for i in range(size):
        for j in range(i, size):
            covs[i, j] = covs[j, i] = joint.covariance(equation[i], equation[j])
    return means, covs


def _expanded(functions) -> dict[str, sp.ImmutableMatrix]:
    return {name: sp.ImmutableMatrix(matrix).applyfunc(sp.expand) for name, matrix in functions.items()}


def unscented(model: Model, kappa: float | None = None) -> Structure:
    """Structural functions by the unscented transform over (x, v) and (x, w).

    2 s + 1 points at distance sqrt(s + kappa), s the joint dimension; exact for quadratic functions.

    Parameters
    ----------
    kappa : float, optional
        Spread; 3 - s by default (Julier and Uhlmann), but not below 0, so that no weight is negative.
    """

    def rule(size: int) -> tuple[Array, Array]:
        k = max(3.0 - size, 0.0) if kappa is None else float(kappa)
        if not size + k > 0:
            raise ModelError(f"kappa = {kappa} is too small: {size} + kappa must be positive")
        axes = np.sqrt(size + k) * np.eye(size)
        weights = np.full(2 * size + 1, 0.5 / (size + k))
        weights[0] = k / (size + k)
        return np.concatenate([np.zeros((1, size)), axes, -axes]), weights

    return _quadrature(model, "unscented", rule)


def gauss_hermite(model: Model, order: int = 5) -> Structure:
    """Structural functions by the Gauss-Hermite product rule; exact for polynomials below degree 2*order.

    `order` points an axis, so order**(n + number of noises) evaluations.
    """
    if order < 2:
        raise ModelError(f"Gauss-Hermite quadrature needs an order of at least 2, got {order}")

    def rule(size: int) -> tuple[Array, Array]:
        if order**size > 100_000:
            raise ModelError(f"{order} points on each of {size} axes are too many; lower the order or use unscented(model)")
        nodes, weights = np.polynomial.hermite_e.hermegauss(order)
        weights = weights / weights.sum()
        points = np.array(list(cartesian(nodes, repeat=size)))
        return points, np.array([np.prod(c) for c in cartesian(weights, repeat=size)])

    return _quadrature(model, "gauss-hermite", rule)


def _quadrature(model: Model, name: str, rule: Callable[[int], tuple[Array, Array]]) -> Structure:
    """A structure from standard normal points and weights: rule(size) -> (points (q, size), weights (q,))."""
    n = model.n
    state, meter = compile_model(model)

    def propagate(function, size, mean, cov, law: Gaussian, points: Array):
        x = mean[..., None, :] + points[:, :n] @ transpose(square_root(cov))
        noise = law.mean + points[:, n:] @ square_root(law.cov).T
        values = function(x, np.broadcast_to(noise, x.shape[:-1] + noise.shape[-1:]))
        return x, np.broadcast_to(values, (*x.shape[:-1], size))

    state_points, state_weights = rule(n + len(model.v))
    meter_points, meter_weights = rule(n + len(model.w))

    def predict(z: Array, p: Array) -> Gaussian:
        _, following = propagate(state, n, z, p, model.state_noise, state_points)
        tau = state_weights @ following
        return Gaussian(tau, _weighted(state_weights, following - tau[..., None, :]))

    def measure(m: Array, d: Array) -> Measurement:
        x, y = propagate(meter, model.p, m, d, model.meter_noise, meter_points)
        h = meter_weights @ y
        deviation = y - h[..., None, :]
        cross = transpose(deviation * meter_weights[:, None]) @ (x - m[..., None, :])
        G, F = gain(cross, np.broadcast_to(d, (*m.shape, n))), _weighted(meter_weights, deviation)
        # The part of y that is not linear in x: no difference of nearly equal matrices.
        unexplained = deviation - (x - m[..., None, :]) @ transpose(G)
        return Measurement(h, G, F, _weighted(meter_weights, unexplained))

    return Structure(name, model, predict, measure)


def _weighted(weights: Array, deviation: Array) -> Array:
    return symmetric(transpose(deviation * weights[:, None]) @ deviation)


def compile_model(model: Model) -> tuple[Callable[[Array, Array], Array], Callable[[Array, Array], Array]]:
    """The state and meter equations as functions of arrays: (x (..., n), v (..., r)) -> (..., n)."""
    state = _compile_equation("state", model.state_equation, {"x": model.x, "v": model.v}, model)
    meter = _compile_equation("meter", model.meter_equation, {"x": model.x, "w": model.w}, model)
    return lambda x, v: state(x, v)[0], lambda x, w: meter(x, w)[0]


def compile_noiseless(model: Model) -> tuple[Callable[[Array], Array], Callable[[Array], Array]]:
    """a(x, m_v) and b(x, m_w), the equations with the noises at their means: x (..., n) -> (..., n), (..., p)."""
    state_equation = model.state_equation.subs(dict(zip(model.v, exact_matrix(model.state_noise.mean), strict=True)))
    meter_equation = model.meter_equation.subs(dict(zip(model.w, exact_matrix(model.meter_noise.mean), strict=True)))
    state = _compile_equation("state", state_equation, {"x": model.x}, model)
    meter = _compile_equation("meter", meter_equation, {"x": model.x}, model)
    return lambda x: state(x)[0], lambda x: meter(x)[0]


def _compile_equation(
    name: str, equation: sp.MatrixBase, arguments: dict[str, tuple[sp.Symbol, ...]], model: Model
) -> Callable[..., tuple[Array]]:
    matrices = {key: sp.Matrix(symbols) for key, symbols in arguments.items()}
    numeric = equation.subs(model.values)
    return compile_function(name, matrices, {name: numeric}, [*arguments, name], f"{name} equation of {model}").function
