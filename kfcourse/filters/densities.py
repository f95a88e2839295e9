"""Conditional densities of a model whose noises enter linearly: what exact and particle filters need.

x_{k+1} | x_k ~ N(a(x, m_v), a_v D_v a_v^T),    y_k | x_k ~ N(b(x, m_w), b_w D_w b_w^T)
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product as cartesian
from typing import NamedTuple, Protocol

import numpy as np
import sympy as sp
from sympy.core.relational import Relational

from kfcourse.angles import TURN, Components, difference, wrapped
from kfcourse.filters.inverted import by_change_of_variable
from kfcourse.laws import MANY, Array, Gaussian, runs_last, solve_by_entries
from kfcourse.symbolic.choices import decides, jumps
from kfcourse.symbolic.known import Stepwise
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError, exact_matrix

TINY = 1e-300  # in place of a variance of exactly 0
TRIALS, ROUNDING = 50, 1e-12  # states on which a covariance is tried; eigenvalue of correlations that is none
FORMULAS = 64  # more than one choice has
MOST_TURNS = 50  # of an angle whose noise is so large that it tells nothing


class LogLikelihood(Protocol):
    """(y (..., p), x (..., n)) -> log p(y | x) (...); of a model that depends on the step, at step k."""

    def __call__(self, y: Array, x: Array, k: int | None = None) -> Array: ...


def transition(model: Model) -> Callable[..., Gaussian]:
    """x (..., n), and the step if the model has one -> law of the next state; ModelError if the noise enters nonlinearly."""
    law = _conditional("transition", model.state_equation, model.v, model.state_noise, model)

    def transition_law(x: Array, k: int | None = None) -> Gaussian:
        return Gaussian(*law.at(k)(x))

    return transition_law


def likelihood(model: Model) -> LogLikelihood:
    """(y (..., p), x (..., n)) -> log p(y | x) (...); what of y is missing (NaN) does not enter, 0 where all is.

    The law of a component that is an angle is wound around the circle: the densities of y and of y plus whole turns add up.
    """
    if is_nonlinear(model) and (solved := by_change_of_variable(model)):
        return lambda y, x, k=None: solved(y, x)
    law = _conditional("likelihood", model.meter_equation, model.w, model.meter_noise, model)

    def log_likelihood(y: Array, x: Array, k: int | None = None) -> Array:
        mean, cov = law.at(k)(x)
        innovation, missing = difference(y, mean, model.angles.y), np.isnan(y)
        sd = np.sqrt(np.diagonal(cov, axis1=-2, axis2=-1).reshape(-1, model.p).max(axis=0))
        if model.p == 1 or not missing.any():
            value = wound(lambda turns: log_normal(innovation + turns, cov), sd, model.angles.y)
            return np.where(missing.any(axis=-1), 0.0, value)
        either = missing[..., :, None] | missing[..., None, :]
        innovation, cov = np.where(missing, 0.0, innovation), np.where(either, np.eye(model.p), cov)

        def of_present(turns: Array) -> Array:  # what is missing is counted once, in no turn, as N(0; 0, 1)
            return np.where((missing & (turns != 0)).any(axis=-1), -np.inf, log_normal(innovation + turns, cov))

        value = wound(of_present, sd, model.angles.y) + 0.5 * np.log(2 * np.pi) * missing.sum(axis=-1)
        return np.where(missing.all(axis=-1), 0.0, value)

    def log_normal(innovation: Array, cov: Array) -> Array:
        if model.p == 1:
            return _log_normal(innovation[..., 0], cov[..., 0, 0])
        if cov.shape[:-1] == innovation.shape and cov.size >= MANY * model.p**2:
            weighted, factor = runs_last(innovation[..., None]), runs_last(cov)
            if solve_by_entries(weighted, factor):
                square = np.einsum("...i,i...->...", innovation, weighted[:, 0])
                logdet = -2 * np.log(np.einsum("ii...->i...", factor)).sum(axis=0)  # the inverses of Cholesky's pivots
                return -0.5 * (square + logdet + model.p * np.log(2 * np.pi))
        _, logdet = np.linalg.slogdet(cov)
        square = (innovation * np.linalg.solve(cov, innovation[..., None])[..., 0]).sum(axis=-1)
        return -0.5 * (square + logdet + model.p * np.log(2 * np.pi))

    return log_likelihood


def wound(log_density: Callable[[Array], Array], sd: Array, angles: Components) -> Array:
    """log of the density of angles: the sum over all turns (p,) of the density of what was measured plus these turns.

    Eight standard deviations (p,) are covered, and one turn at least.
    """
    if not angles:
        return log_density(np.zeros(len(sd)))
    most = np.clip(np.ceil((8 * sd + np.pi) / TURN), 1, MOST_TURNS).astype(int)
    total = np.array(-np.inf)
    for numbers in cartesian(*(range(-most[i], most[i] + 1) if i in angles else (0,) for i in range(len(sd)))):
        total = np.logaddexp(total, log_density(TURN * np.array(numbers)))
    return total


class ScalarDensities(NamedTuple):
    """What the exact filter must know of a scalar model at a step; all functions are elementwise.

    Attributes
    ----------
    kernel : function of x
        Mean and standard deviation of the next state, given x.
    kernel_slope : function of x
        The derivatives of both.
    log_likelihood : function of y and x
        log p(y | x); 0 where y is missing (NaN).
    signal, slope : functions of x
        b(x, m_w) and its derivative; the noise's standard deviation and its, if b(x, m_w) lacks x.
    residual : function of y and x
        The signal that explains y, minus the signal at x, for an angle the short way round.  What explains y is y itself; |y - b|
        if the signal is the noise's deviation.
    meter_width : function of x
        Standard deviation of the meter's noise over |slope|: how well y tells x.
    jump : float
        pi for an angle, whose residual changes its sign on the far side of the circle too, by a jump; otherwise infinite.
    noiseless : bool
        Whether the meter has no noise at this step: there is no density of y, and log_likelihood must not be asked.
    piece : function of x, optional
        A number for each of the formulas that an object which jumps has, by the one that holds at x.
    at_step : function of k, optional
        All this at step k, where the model depends on it.
    """

    kernel: Callable[[Array], tuple[Array, Array]]
    kernel_slope: Callable[[Array], tuple[Array, Array]]
    log_likelihood: Callable[[Array, Array], Array]
    signal: Callable[[Array], Array]
    slope: Callable[[Array], Array]
    residual: Callable[[Array, Array], Array]
    meter_width: Callable[[Array], Array]
    jump: float = np.inf
    noiseless: bool = False
    piece: Callable[[Array], Array] | None = None
    at_step: Callable[[int], ScalarDensities] | None = None

    def at(self, k: int) -> ScalarDensities:
        """Those of step k: kernels from k to k + 1, the likelihood of y_k."""
        return self if self.at_step is None else self.at_step(k)


class Moments(NamedTuple):
    """Of a scalar model, as formulas of x and the parameters: mean and variance of the next state, and of the measurement."""

    state: sp.Expr
    variance: sp.Expr
    meter: sp.Expr
    meter_variance: sp.Expr


def formulas(model: Model) -> Moments:
    """Of a noise that enters nonlinearly what is linear in it, at its mean."""

    def both(equation: sp.MatrixBase, noise: tuple[sp.Symbol, ...], law: Gaussian) -> tuple[sp.Expr, sp.Expr]:
        B = _at_mean(equation.jacobian(sp.Matrix(noise)), noise, law)
        return _at_mean(equation, noise, law)[0], (B * exact_matrix(law.cov) * B.T)[0]

    state = both(model.state_equation, model.v, model.state_noise)
    return Moments(*state, *both(model.meter_equation, model.w, model.meter_noise))


def scalar_densities(model: Model) -> ScalarDensities:
    """The densities of a model of one state and one measurement; ModelError if a noise enters nonlinearly.

    Of a model that depends on the step they are those of step 0, and `at(k)` those of step k.
    """
    next_state = _conditional("transition", model.state_equation, model.v, model.state_noise, model, noiseless=True)
    solved = by_change_of_variable(model) if is_nonlinear(model) else None
    meter = _conditional(
        "likelihood", model.meter_equation, model.w, model.meter_noise, model, noiseless=True, solved=bool(solved)
    )
    x, (mean, variance, b, meter_variance) = model.x[0], (part.subs(model.values) for part in formulas(model))
    parts = {"state": mean, "variance": variance, "meter": b, "meter_variance": meter_variance}
    outputs = {name: sp.Matrix([part.diff(x)]) for name, part in parts.items()}
    pieces = _pieces(sp.Matrix([mean, variance]), x)
    if pieces is not None:
        outputs |= {name: outputs[name].replace(sp.DiracDelta, lambda *place: sp.S.Zero) for name in ("state", "variance")}
    rough = pieces is None or any(part.has(sp.Derivative, sp.DiracDelta) for part in outputs.values())
    if rough or any(jumps(one, model.x) for one in model.meter_equation.atoms(sp.Piecewise)):
        raise ModelError(
            f"{model} jumps at a state, where the point-mass filter needs a smooth meter, and an object whose jumps lie at "
            "single thresholds; use particle(model), or a Gaussian filter, unscented(model)"
        )
    lacks_x = not b.has(x)
    if lacks_x and meter_variance.is_zero:
        raise ModelError(f"{list(model.meter_equation)}: the meter shows neither the state nor any noise")
    slopes = Stepwise.compile(model.known, "slopes", {"x": sp.Matrix(model.x)}, outputs, ["x", "state", "meter"])
    number = Stepwise.compile(model.known, "piece", {"x": sp.Matrix(model.x)}, {"piece": sp.Matrix([pieces])}, ["x", "piece"])

    def at(k: int) -> ScalarDensities:
        functions = (one.at(k) for one in (next_state, meter, slopes))
        found = _elementwise(model, *functions, lacks_x=lacks_x, at_step=at if model.timed else None)
        if solved is not None:
            found = found._replace(log_likelihood=lambda y, x: solved(y[..., None], x[..., None]))
        if pieces:
            numbered = number.at(k)
            found = found._replace(piece=lambda x: numbered(x[..., None])[0][..., 0])
        here = dict(zip(model.known.symbols, model.known.at(k), strict=True)) if model.timed else {}
        return found._replace(noiseless=meter_variance.subs(here).is_zero is True)

    return at(0)


def _pieces(moments: sp.Matrix, x: sp.Symbol) -> sp.Expr | None:
    """A number for each of the formulas between jumps, 0 if there is none; None if their thresholds are not looked into."""
    choices = [one for one in sorted(moments.atoms(sp.Piecewise), key=str) if jumps(one, (x,))]
    if any(not isinstance(condition, Relational) for one in choices for _, condition in one.args[:-1]):
        return None
    numbers = [sp.Piecewise(*((i, condition) for i, (_, condition) in enumerate(one.args))) for one in choices]
    numbers += [one for one in sorted(moments.atoms(sp.sign, sp.Heaviside), key=str) if one.has(x)]
    return sp.Add(*(one / sp.Integer(FORMULAS) ** i for i, one in enumerate(numbers)))


def _elementwise(
    model: Model,
    next_state: Callable[[Array], tuple[Array, Array]],
    meter: Callable[[Array], tuple[Array, Array]],
    slopes: Callable[[Array], tuple[Array, Array, Array, Array]],
    *,
    lacks_x: bool,
    at_step: Callable[[int], ScalarDensities] | None,
) -> ScalarDensities:
    """The densities of one step, from its laws of the next state and of y, and the derivatives of their moments."""

    def moments(law: Callable[[Array], tuple[Array, Array]], x: Array) -> tuple[Array, Array]:
        mean, variance = law(x[..., None])
        return _spread(mean[..., 0], x.shape), _spread(variance[..., 0, 0], x.shape)

    def kernel(x: Array) -> tuple[Array, Array]:
        mean, variance = moments(next_state, x)
        return mean, np.maximum(np.sqrt(variance), 1e-150)

    def log_likelihood(y: Array, x: Array) -> Array:
        mean, variance = moments(meter, x)
        if model.angles.y:
            innovation, sd = wrapped(y - mean), np.sqrt(variance.max(initial=0.0)).reshape(1)
            value = wound(lambda turns: _log_normal(innovation + turns[0], variance), sd, model.angles.y)
        else:
            value = _log_normal(y - mean, variance)
        missing = np.isnan(y)
        return np.where(missing, 0.0, value) if missing.any() else value

    def kernel_slope(x: Array) -> tuple[Array, Array]:
        of_mean, of_variance, _, _ = slopes(x[..., None])
        twice = 2 * kernel(x)[1]
        return np.broadcast_to(of_mean[..., 0], x.shape), np.broadcast_to(of_variance[..., 0, 0], x.shape) / twice

    def signal(x: Array) -> Array:
        of_mean, of_variance = moments(meter, x)
        return np.sqrt(of_variance) if lacks_x else of_mean

    def slope(x: Array) -> Array:
        _, _, of_mean, of_variance = slopes(x[..., None])
        if lacks_x:
            with np.errstate(divide="ignore", invalid="ignore"):
                return np.broadcast_to(of_variance[..., 0, 0], x.shape) / (2 * signal(x))
        return np.broadcast_to(of_mean[..., 0], x.shape)

    def residual(y: Array, x: Array) -> Array:
        around = wrapped if model.angles.y else np.asarray
        return np.abs(around(y - moments(meter, x)[0])) - signal(x) if lacks_x else around(y - signal(x))

    def meter_width(x: Array) -> Array:
        return np.sqrt(moments(meter, x)[1]) / np.abs(slope(x))

    jump = np.pi if model.angles.y else np.inf
    return ScalarDensities(kernel, kernel_slope, log_likelihood, signal, slope, residual, meter_width, jump, at_step=at_step)


def _spread(values: Array, shape: tuple[int, ...]) -> Array:
    """`np.broadcast_to` that costs nothing where there is nothing to do."""
    return values if values.shape == shape else np.broadcast_to(values, shape)


def is_nonlinear(model: Model) -> bool:
    """Whether the meter's noise enters nonlinearly."""
    return model.meter_equation.jacobian(sp.Matrix(model.w)).has(*model.w)


def _at_mean(matrix: sp.MatrixBase, noise: tuple[sp.Symbol, ...], law: Gaussian) -> sp.MatrixBase:
    return matrix.subs(dict(zip(noise, exact_matrix(law.mean), strict=True)))


def _log_normal(deviation: Array, variance: Array) -> Array:
    variance = np.maximum(variance, TINY)
    with np.errstate(over="ignore"):  # a deviation infinitely many sigmas away has log-density -inf
        return -0.5 * (deviation**2 / variance + np.log(2 * np.pi * variance))


def _conditional(
    name: str,
    equation: sp.MatrixBase,
    noise: tuple[sp.Symbol, ...],
    law: Gaussian,
    model: Model,
    *,
    noiseless: bool = False,
    solved: bool = False,
) -> Stepwise:
    B = equation.jacobian(sp.Matrix(noise))
    if solved:  # the density is known otherwise; what is linear in the noise tells where it lies
        B = _at_mean(B, noise, law)
    elif B.has(*noise) or decides(equation, noise):
        raise _no_density(
            f"{list(equation)}: the noise enters nonlinearly, so there is no simple {name} density; "
            "the Gaussian filters (gaussian, unscented, gauss_hermite) do not need one"
        )
    if not noiseless and (B * exact_matrix(law.cov) * B.T).subs(model.values).is_zero_matrix:
        raise _no_density(
            f"{list(equation)}: without noise there is no {name} density; "
            "use the Gaussian filters (gaussian, unscented, gauss_hermite)"
        )
    mean = equation.subs(dict(zip(noise, exact_matrix(law.mean), strict=True)))
    cov = B * exact_matrix(law.cov) * B.T
    outputs = {"mean": mean.subs(model.values), "cov": cov.subs(model.values)}
    x = sp.Matrix(model.x)
    found = Stepwise.compile(model.known, name, {"x": x}, outputs, ["x", "mean"], f"{name} law of {model}")
    if name == "likelihood" and len(equation) > 1 and _singular(found, model):
        raise _no_density(
            f"{list(equation)}: the noises of these components depend on one another, so a combination of them has no noise and "
            f"there is no {name} density; leave a component out, or use the Gaussian filters (gaussian, unscented, gauss_hermite)"
        )
    return found


def _singular(law: Stepwise, model: Model) -> bool:
    """Whether the covariance is singular at all states tried: the determinant of long formulas takes SymPy minutes."""
    x = model.prior.mean + np.random.default_rng(0).standard_normal((TRIALS, model.n)) * np.sqrt(np.diagonal(model.prior.cov))
    with np.errstate(all="ignore"):
        cov = law.at(0)(x)[1]
        deviation = np.sqrt(np.diagonal(cov, axis1=-2, axis2=-1))
        correlation = cov / (deviation[..., :, None] * deviation[..., None, :])
    good = np.isfinite(correlation).all(axis=(-2, -1))
    return not (np.linalg.eigvalsh(correlation[good])[..., 0] > ROUNDING).any()


def _no_density(message: str) -> ModelError:
    return ModelError(message, "no_density")
