"""Structural functions by quadrature over a normal law, for models without a closed form.

A noise that is added with a constant factor, and is correlated with no noise of another kind, needs no points: its mean
and covariance are added.  Nor does the Gauss-Hermite rule need any for noises with factors that depend on the state alone: at
each point of the state their mean and covariance are known, Cov y = Cov M[y|x] + M Cov[y|x].  The points spread over the state
and over the other noises, s variables together.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import product as cartesian
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
import sympy as sp

from kfcourse.angles import Components, difference, near, on_circle
from kfcourse.errors import expect
from kfcourse.laws import (
    SINGULAR,
    Array,
    Gaussian,
    Measurement,
    Transition,
    apply,
    measurement_of,
    square_root,
    symmetric,
    transpose,
)
from kfcourse.symbolic.choices import decides
from kfcourse.symbolic.equations import compile_model
from kfcourse.symbolic.known import Stepwise
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError, exact_matrix
from kfcourse.symbolic.structure import Structure, object_equation, of_steps

Rule: TypeAlias = Callable[[int], tuple[Array, Array]]

MOST_POINTS = 100_000


class QuadratureWarning(UserWarning):
    """The points do not integrate a function of the model at its prior law: the structural functions may be far off."""


def unscented(model: Model, kappa: float | None = None) -> Structure:
    """Structural functions by the unscented transform.

    2 s + 1 points, the mean and +-sqrt(s + kappa) times the columns of the lower triangular root of the covariance.  Means are
    exact for quadratic functions, covariances for linear ones only: no point lies off the axes, so a product like x^2 w is not
    seen.

    Parameters
    ----------
    kappa : float, optional
        The spread is s + kappa; kappa = 3 - s by default (Julier and Uhlmann), but not below 0, so that no weight is negative.

    Raises
    ------
    ModelError
        s + kappa is not positive and finite.

    Warns
    -----
    QuadratureWarning
        A function is not finite at a point of the prior law, or too rough for its moments there to be found by points.
    """

    expect(model, Model, "unscented")
    if model.between is not None:
        return model.between.structure(model, partial(unscented, kappa=kappa))

    def rule(size: int) -> tuple[Array, Array]:
        k = max(3.0 - size, 0.0) if kappa is None else float(kappa)
        if not 0 < size + k < np.inf:
            raise ModelError(f"kappa = {kappa}: {size} + kappa must be positive and finite")
        axes = np.sqrt(size + k) * np.eye(size)
        weights = np.full(2 * size + 1, 0.5 / (size + k))
        weights[0] = k / (size + k)
        return np.concatenate([np.zeros((1, size)), axes, -axes]), weights

    return _checked("unscented", model, rule, _Equations.of(model, "not only added"), order=5)


def gauss_hermite(model: Model, order: int = 5) -> Structure:
    """Structural functions by the Gauss-Hermite product rule; exact for polynomials below degree 2*order.

    `order` points an axis, so order**s evaluations, s = `axes(model)`.

    Raises
    ------
    ModelError
        Fewer than two points an axis or no whole number, or too many points together.

    Warns
    -----
    QuadratureWarning
        A function is not finite at a point of the prior law, or twice as many points an axis give other moments there.
    """
    expect(model, Model, "gauss_hermite")
    if model.between is not None:
        return model.between.structure(model, partial(gauss_hermite, order=order))
    if not isinstance(order, int | np.integer) or order < 2:
        raise ModelError(f"Gauss-Hermite quadrature needs an order of at least 2, a whole number, got {order!r}")
    return _checked("gauss-hermite", model, product_rule(order), _Equations.of(model, _NOT_LINEAR), order)


def axes(model: Model) -> int:
    """Over how many variables the Gauss-Hermite rule spreads: the state, and the noises of an equation that need points."""
    return _Equations.of(model, _NOT_LINEAR).size(model)


def product_rule(order: int) -> Rule:
    def rule(size: int) -> tuple[Array, Array]:
        if order**size > MOST_POINTS:
            raise ModelError(f"{order} points on each of {size} axes are too many; lower the order or use unscented(model)")
        nodes, weights = np.polynomial.hermite_e.hermegauss(order)
        weights = weights / weights.sum()
        points = np.array(list(cartesian(nodes, repeat=size)))
        return points, np.array([np.prod(c) for c in cartesian(weights, repeat=size)])

    return rule


Pointed: TypeAlias = Literal["not only added", "not linear"]  # the noises over which points spread
_NOT_LINEAR: Pointed = "not linear"


class _Equation(NamedTuple):
    """One equation of the model as f(x, noises with points, k), and what the other noises add, at a step k."""

    function: Callable[..., Array]
    size: int
    noise: Gaussian  # all noises; the covariance of those without points
    root: Array  # of the covariance of those with points, columns for them only
    factors: Stepwise  # B D B^T of those without points
    of_state: bool  # whether it depends on the state
    angles: Components  # components of the function's value
    k: int | None = None

    def added(self, x: Array, weights: Array) -> Array:
        """sum_q w_q B(x_q) D B(x_q)^T, the mean over points x (..., q, n) of the covariance given x."""
        factors = self.factors.at(self.k)
        if not self.of_state:
            return symmetric(factors()[0])
        each = np.broadcast_to(factors(x)[0], (*x.shape[:-1], self.size, self.size))
        mean = weights @ each.reshape(*x.shape[:-1], self.size**2)
        return symmetric(mean.reshape(*x.shape[:-2], self.size, self.size))


class _Equations(NamedTuple):
    state: _Equation
    meter: _Equation

    @classmethod
    def of(cls, model: Model, pointed: Pointed) -> _Equations:
        state, meter = compile_model(model)
        return cls(
            _equation(state, model.state_equation, model.v, model.state_noise, model, pointed, model.angles.x),
            _equation(meter, model.meter_equation, model.w, model.meter_noise, model, pointed, model.angles.y),
        )

    def size(self, model: Model) -> int:
        """Variables with points, of the equation that has more."""
        return model.n + max(equation.root.shape[1] for equation in self)


def _equation(function, formulas, noises, law: Gaussian, model: Model, pointed: Pointed, angles: Components):
    factors = sp.Matrix(formulas).subs(model.values).jacobian(list(noises)) if noises else sp.zeros(len(formulas), 0)
    varying = noises if pointed == _NOT_LINEAR else (*model.x, *noises)
    plain = [
        not (factors[:, j].has(*varying) and factors[:, j].applyfunc(sp.simplify).has(*varying))
        and not decides(formulas, [noise])
        for j, noise in enumerate(noises)
    ]
    other = ~np.array(plain, dtype=bool)
    while (correlated := ~other & (law.cov[:, other] != 0).any(axis=1)).any():
        other |= correlated
    rest = sp.Matrix(len(formulas), len(noises), lambda i, j: 0 if other[j] else factors[i, j])
    cov = np.where(other[:, None] | other, 0.0, law.cov)
    added = rest * exact_matrix(cov) * rest.T
    arguments = {"x": sp.Matrix(model.x)} if added.has(*model.x) else {}
    stepwise = Stepwise.compile(model.known, "added", arguments, {"added": added}, [*arguments])
    root = np.zeros((len(noises), int(other.sum())))
    root[other] = square_root(law.cov[np.ix_(other, other)]) if other.any() else root[other]
    return _Equation(function, len(formulas), law._replace(cov=cov), root, stepwise, bool(arguments), angles)


def _checked(name: str, model: Model, rule: Rule, equations: _Equations, order: int) -> Structure:
    """The structure, after a comparison at the prior law of Gauss-Hermite rules of this order and of twice the order."""
    structure = _quadrature(name, model, rule, equations)
    size = equations.size(model)
    with np.errstate(all="ignore"):
        found = _moments(structure)
        if not all(np.isfinite(moment).all() for _, moment, *_ in found):
            _warn(f"{name}: a function of {model} is not finite at the points of the prior law", stacklevel=4)
        elif (2 * order) ** size <= MOST_POINTS:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", QuadratureWarning)  # these points are not those that the filter uses
                coarse = found if name == "gauss-hermite" else _moments(_quadrature(name, model, product_rule(order), equations))
                fine = _moments(_quadrature(name, model, product_rule(2 * order), equations))
            for (what, less, *_), (_, more, scale, angles) in zip(coarse, fine, strict=True):
                more = near(more, less, angles)
                if not (np.abs(more - less) <= CONVERGED * scale).all():
                    worst = np.unravel_index(np.argmax(np.nan_to_num(np.abs(more - less) / scale, nan=np.inf)), less.shape)
                    _warn(
                        f"{name}: the {what} of {model} at the prior law is {less[worst]:.4g} with {order} points an axis and "
                        f"{more[worst]:.4g} with {2 * order}: it may be infinite, or the function too rough for these points",
                        stacklevel=4,
                    )
                    break
    return structure


# Means may change by this part of a standard deviation when the order is doubled, covariances by this part of themselves.
CONVERGED = 0.1


def _moments(structure: Structure) -> list[tuple[str, Array, Array, Components]]:
    """Name, value and natural size of the moments at the prior law, and which components are angles."""
    mean, cov = structure.model.prior
    first = structure.at(0)
    tau, theta = first.predict(mean, cov)
    h, _, F, _ = first.measure(mean, cov)
    moments = []
    angles = structure.model.angles
    for what, centre, spread, which in (("next state", tau, theta, angles.x), ("measurement", h, F, angles.y)):
        sd = np.sqrt(np.maximum(np.diagonal(spread), 0.0))
        tiny = 1e-12 * (1 + np.abs(centre))  # rounding: what does not vary has no size of its own
        moments.append((f"mean of the {what}", centre, sd + tiny, which))
        moments.append((f"covariance of the {what}", spread, (sd + tiny)[:, None] * (sd + tiny), ()))
    return moments


def _warn(text: str, stacklevel: int) -> None:
    warnings.warn(text, QuadratureWarning, stacklevel=stacklevel)


def _warn_of_turns(name: str, model: Model, deviation: Array) -> None:
    """QuadratureWarning if points of an angle go round the circle: their mean is then that of other angles."""
    for i in model.angles.x:
        if (widest := np.nanmax(np.abs(deviation[..., i]), initial=0.0)) > np.pi:
            _warn(
                f"{name}: points of the angle {model.x[i]} lie {widest:.3g} to either side of its mean, more than half a turn: "
                "its variance is too large for these points; take linearised(model), or a smaller prior variance",
                stacklevel=3,
            )


def _lower_root(cov: Array) -> Array:
    """The Cholesky factor; where cov is singular its column is 0 for a component that the earlier ones determine."""
    try:
        return np.linalg.cholesky(cov)
    except np.linalg.LinAlgError:
        pass
    n = cov.shape[-1]
    lower, rest = np.zeros_like(cov), cov.copy()
    for j in range(n):
        pivot = rest[..., j, j]
        regular = pivot > n * np.finfo(cov.dtype).eps * cov[..., j, j]
        column = rest[..., :, j] / np.sqrt(np.where(regular, pivot, 1.0))[..., None]
        lower[..., :, j] = np.where(regular[..., None] & (np.arange(n) >= j), column, 0.0)
        rest = rest - lower[..., :, j, None] * lower[..., None, :, j]
    return lower


def _quadrature(name: str, model: Model, rule: Rule, equations: _Equations) -> Structure:
    """A structure from standard normal points and weights: rule(size) -> (points (q, size), weights (q,))."""
    rules = [rule(model.n + equation.root.shape[1]) for equation in equations]
    whole = of_steps(name, model, lambda k: _of_step(name, model, rules, _Equations(*(side._replace(k=k) for side in equations))))
    state = equations.state
    numbers = tuple(one.tobytes() for one in (*rules[0], *state.noise, state.root))
    return replace(whole, moving=(name, numbers, *object_equation(model)))


def _of_step(name: str, model: Model, rules: Sequence[tuple[Array, Array]], equations: _Equations) -> Structure:
    n, measurement = model.n, measurement_of(model.angles.y)

    def propagate(equation: _Equation, mean: Array, cov: Array, points: Array, weights: Array):
        """Root of cov, deviations of x, mean of the function, its deviations from that (0 exactly for what does not vary),
        and the covariance that noises without points add."""
        scale = _lower_root(cov)
        deviation = points[:, :n] @ transpose(scale)
        _warn_of_turns(name, model, deviation)
        x = mean[..., None, :] + deviation
        noise = equation.noise.mean + points[:, n:] @ equation.root.T
        values = equation.function(x, np.broadcast_to(noise, x.shape[:-1] + noise.shape[-1:]), equation.k)
        values = np.broadcast_to(values, (*x.shape[:-1], equation.size))
        middle = values[..., np.argmin((points**2).sum(axis=1)), :]
        values = difference(values, middle[..., None, :], equation.angles)
        shift = weights @ values
        value = on_circle(middle + shift, equation.angles)
        return scale, deviation, value, values - shift[..., None, :], equation.added(x, weights)

    def predict(z: Array, p: Array) -> Gaussian:
        points, weights = rules[0]
        _, _, tau, following, added = propagate(equations.state, z, p, points, weights)
        return Gaussian(tau, _weighted(weights, following) + added)

    def regressed(equation: _Equation, rule: tuple[Array, Array], mean: Array, cov: Array):
        """Mean of the function, its slopes by x, covariance of what is not linear in x, deviations, what is added."""
        points, weights = rule
        # In directions that a singular covariance knows exactly there would be no points, and no slope.
        spread = cov if n == 1 else cov * (1 + UNSEEN * np.finfo(float).eps * np.eye(n))
        scale, dx, value, deviation, added = propagate(equation, mean, spread, points, weights)
        dx = np.broadcast_to(dx, (*deviation.shape[:-1], n))
        weighed = deviation * weights[:, None]
        cross = transpose(weighed) @ points[:, :n]
        slopes = _slopes(np.where(np.abs(cross) <= _rounding_of(weighed, deviation), 0.0, cross), scale)
        # No difference of nearly equal matrices.
        explained = dx @ transpose(slopes)
        rest = deviation - explained
        size = (np.abs(deviation) + np.abs(explained)).max(axis=-2, keepdims=True) + np.abs(value)[..., None, :]
        rest = np.where(np.abs(rest) <= LOST * np.finfo(float).eps * size, 0.0, rest)  # rounding is no noise of the meter
        return value, slopes, _weighted(weights, rest) + added, deviation, added

    def measure(m: Array, d: Array) -> Measurement:
        d = np.broadcast_to(d, (*m.shape, n))
        h, G, R, dy, added = regressed(equations.meter, rules[1], m, d)
        if n == 1:
            return measurement(h, G, _weighted(rules[1][1], dy) + added, R)
        F = symmetric(G @ d @ transpose(G)) + R
        return measurement(h, *_without_rounding(G, d, F, R))

    def transition(z: Array, p: Array) -> Transition:
        _, A, Q, *_ = regressed(equations.state, rules[0], z, np.broadcast_to(p, (*z.shape, n)))
        return Transition(A, Q)

    return Structure(name, model, predict, measure, transition)


# Variances are enlarged by this many units of precision (2e-14 of themselves), so that a root has pivots of 1e-7 at least and
# its inverse half of the digits; a variance that is 0 stays 0.
UNSEEN = 2 * SINGULAR**2


def _slopes(cross: Array, root: Array) -> Array:
    """cross root^+, for cross = Cov(y, u) and x = root u, Cov(u) = I: the regression of y on x, without squaring the root."""
    size = np.sqrt((root**2).sum(axis=-1))
    size = np.where(size > 0, size, 1.0)
    regular = root / size[..., None]
    try:
        slopes = transpose(np.linalg.solve(transpose(regular), transpose(cross)))
    except np.linalg.LinAlgError:
        slopes = cross @ np.linalg.pinv(regular, rcond=root.shape[-1] * np.finfo(float).eps)
    return slopes / size[..., None, :]


def _rounding_of(weighed: Array, deviation: Array) -> Array:
    """What of a covariance with a standard normal variable is only rounding, (..., p, 1): a tiny part of the deviation of y.

    A sum over points that ought to cancel, where a meter does not tell the sign of a state, leaves some units of precision.  As a
    gain they would do no harm, but the estimate made with it is a measurement in disguise, and a regression would find it.
    """
    return LOST * np.finfo(float).eps * np.sqrt(np.maximum((weighed * deviation).sum(axis=-2), 0.0))[..., None]


# d is known to some units of precision, so G d G^T to as many times (sum_j |G_ij| sd_j)^2, the variance if all components were
# fully correlated, in whatever units.  Where F is not above that it has no right digit.
LOST = 4


def _without_rounding(G: Array, d: Array, F: Array, R: Array) -> tuple[Array, Array, Array]:
    """G, F, R with rows of 0 for measurements of what is known to the last digit: they cannot vary, and tell nothing."""
    sd = np.sqrt(np.maximum(np.diagonal(d, axis1=-2, axis2=-1), 0.0))
    left = LOST * np.finfo(float).eps * apply(np.abs(G), sd) ** 2
    varies = ~(np.diagonal(F, axis1=-2, axis2=-1) <= left)
    if varies.all():
        return G, F, R
    both = varies[..., :, None] & varies[..., None, :]
    return np.where(varies[..., None], G, 0.0), np.where(both, F, 0.0), np.where(both, R, 0.0)


def _weighted(weights: Array, deviation: Array) -> Array:
    return symmetric(transpose(deviation * weights[:, None]) @ deviation)
