"""Structural functions by quadrature over a normal law, for models without a closed form.

A noise that is added with a constant factor, and is correlated with no noise of another kind, needs
no points: its mean and covariance are added.  Nor does the Gauss-Hermite rule need any for noises
with factors that depend on the state alone: at each point of the state their mean and covariance
are known, Cov y = Cov M[y|x] + M Cov[y|x].  The points spread over the state and over the other
noises, s variables together.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from functools import partial
from itertools import product as cartesian
from typing import NamedTuple, TypeAlias

import numpy as np
import sympy as sp

from kfcourse.angles import Components, difference, on_circle
from kfcourse.errors import expect
from kfcourse.laws import (
    SINGULAR,
    Array,
    Gaussian,
    Measurement,
    Transition,
    measurement_of,
    square_root,
    symmetric,
    transpose,
)
from kfcourse.symbolic.choices import decides
from kfcourse.symbolic.codegen import Compiled
from kfcourse.symbolic.equations import compile_model
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError, exact_matrix
from kfcourse.symbolic.structure import Structure, of_steps

Rule: TypeAlias = Callable[[int], tuple[Array, Array]]

MOST_POINTS = 100_000
# Means may change by this part of a standard deviation when the order is doubled, covariances by
# this part of themselves.
CONVERGED = 0.1
EPS = np.finfo(float).eps
# Variances are enlarged by this part of themselves (2e-14), so that a root has pivots of 1e-7 at
# least, and its inverse half of the digits: in directions that a singular covariance knows exactly
# there would be no points, and no slope.
UNSEEN = 2 * SINGULAR**2 * EPS
LOST = 4 * EPS  # what is not above this part of the numbers that it is a difference of is rounding


class QuadratureWarning(UserWarning):
    """The points do not integrate a function of the model at its prior law: the structural
    functions may be far off."""


def unscented(model: Model, kappa: float | None = None) -> Structure:
    """Structural functions by the unscented transform.

    2 s + 1 points, the mean and +-sqrt(s + kappa) times the columns of the lower triangular root of
    the covariance.  Means are exact for quadratic functions, covariances for linear ones only: no
    point lies off the axes, so a product like x^2 w is not seen.

    Parameters
    ----------
    kappa : float, optional
        The spread is s + kappa; kappa = 3 - s by default (Julier and Uhlmann), but not below 0, so
        that no weight is negative.

    Raises
    ------
    ModelError
        s + kappa is not positive and finite.

    Warns
    -----
    QuadratureWarning
        A function is not finite at a point of the prior law, or too rough for its moments there to
        be found by points.
    """

    def rule(size: int) -> tuple[Array, Array]:
        k = max(3.0 - size, 0.0) if kappa is None else float(kappa)
        if not 0 < size + k < np.inf:
            raise ModelError(f"kappa = {kappa}: {size} + kappa must be positive and finite")
        axes = np.sqrt(size + k) * np.eye(size)
        weights = np.full(2 * size + 1, 0.5 / (size + k))
        weights[0] = k / (size + k)
        return np.concatenate([np.zeros((1, size)), axes, -axes]), weights

    return _checked(model, partial(unscented, kappa=kappa), rule, 5, with_factors=True)


def gauss_hermite(model: Model, order: int = 5) -> Structure:
    """Structural functions by the Gauss-Hermite product rule; exact for polynomials below degree
    2*order.

    `order` points an axis, so order**s evaluations, s = `axes(model)`.

    Raises
    ------
    ModelError
        Fewer than two points an axis or no whole number, or too many points together.

    Warns
    -----
    QuadratureWarning
        A function is not finite at a point of the prior law, or twice as many points an axis give
        other moments there.
    """
    if not isinstance(order, int | np.integer) or order < 2:
        raise ModelError(
            f"Gauss-Hermite quadrature needs an order of at least 2, a whole number, got {order!r}"
        )
    build = partial(gauss_hermite, order=order)
    return _checked(model, build, partial(product_rule, order), order)


def axes(model: Model) -> int:
    """Over how many variables the Gauss-Hermite rule spreads: the state, and the noises of an
    equation that need points."""
    return max(side.points.shape[1] for side in _sides(model, partial(product_rule, 1)))


def product_rule(order: int, size: int) -> tuple[Array, Array]:
    """Points (q, size) and weights (q,) of the Gauss-Hermite rule, `order` points an axis."""
    if order**size > MOST_POINTS:
        raise ModelError(
            f"{order} points on each of {size} axes are too many; lower the order or use "
            f"unscented(model)"
        )
    nodes, weights = np.polynomial.hermite_e.hermegauss(order)
    points = np.array(list(cartesian(nodes, repeat=size)))
    return points, np.prod(list(cartesian(weights / weights.sum(), repeat=size)), axis=1)


class _Side(NamedTuple):
    """An equation of the model as f(x, noises, k), what noises without points add to the
    covariance, and the points (q, s), standard normal, with their weights (q,)."""

    model: Model
    function: Callable[..., Array]
    mean: Array  # of all noises
    root: Array  # of the covariance of the noises with points, columns for them only
    factors: Compiled  # B D B^T of those without points
    angles: Components  # components of the function's value
    points: Array
    weights: Array

    def added(self, x: Array, k: int | None) -> Array:
        """sum_q w_q B(x_q) D B(x_q)^T, the mean over points x (..., q, n) of the covariance given
        x."""
        covs = self.factors(x, k=k)[0]
        if covs.ndim > 2:
            covs = np.einsum("q,...qij->...ij", self.weights, covs)
        return symmetric(covs)

    def propagated(self, mean: Array, cov: Array, k: int | None) -> tuple[Array, ...]:
        """A law of the state through the function: its mean, its deviations from that at the points
        (0 exactly for what does not vary), deviations of x, the root of cov with 1 for what is
        known, and the covariance that noises without points add."""
        n = self.model.n
        root, known = _lower_root(cov * (1 + (UNSEEN if n > 1 else 0) * np.eye(n)))
        dx = np.where(known[..., None, :], 0.0, self.points[:, :n]) @ transpose(root)
        _warn_of_turns(self.model, dx)
        x = mean[..., None, :] + dx
        values = self.function(x, self.mean + self.points[:, n:] @ self.root.T, k)
        middle = values[..., np.argmin((self.points**2).sum(axis=1)), :]
        off = difference(values, middle[..., None, :], self.angles)
        shift = self.weights @ off
        value, deviation = on_circle(middle + shift, self.angles), off - shift[..., None, :]
        return value, deviation, dx, root, self.added(x, k)

    def spread(self, deviation: Array) -> Array:
        return symmetric(transpose(deviation * self.weights[:, None]) @ deviation)

    def regressed(self, mean: Array, cov: Array, k: int | None) -> tuple[Array, Array, Array]:
        """Mean of the function, its slopes by x, and the covariance of what is not linear in x:
        regressions on the points."""
        value, deviation, dx, root, added = self.propagated(mean, cov, k)
        weighed = deviation * self.weights[:, None]
        cross = transpose(weighed) @ self.points[:, : self.model.n]
        # A sum over points that ought to cancel leaves some units of precision: as a gain a
        # measurement in disguise.
        variance = np.maximum((weighed * deviation).sum(axis=-2), 0.0)
        cross = np.where(np.abs(cross) <= LOST * np.sqrt(variance)[..., None], 0.0, cross)
        slopes = transpose(np.linalg.solve(transpose(root), transpose(cross)))
        explained = dx @ transpose(slopes)
        rest = deviation - explained  # no difference of nearly equal matrices
        size = (np.abs(deviation) + np.abs(explained)).max(axis=-2, keepdims=True)
        size = size + np.abs(value)[..., None, :]
        rest = np.where(np.abs(rest) <= LOST * size, 0.0, rest)  # rounding is no noise of the meter
        return value, slopes, self.spread(rest) + added


def _sides(model: Model, rule: Rule, with_factors: bool = False) -> tuple[_Side, _Side]:
    """Object and meter, with points for the noises that do not enter linearly, or for those
    `with_factors` of the state, too: `rule` makes them."""
    state, meter = compile_model(model)
    of_rule = partial(_side, model, rule, with_factors)
    return (
        of_rule(state, model.state_equation, model.v, model.state_noise, model.angles.x),
        of_rule(meter, model.meter_equation, model.w, model.meter_noise, model.angles.y),
    )


def _side(
    model: Model,
    rule: Rule,
    with_factors: bool,
    function: Callable[..., Array],
    equation: sp.MatrixBase,
    noises: Sequence[sp.Symbol],
    law: Gaussian,
    angles: Components,
) -> _Side:
    factors = equation.subs(model.values).jacobian(list(noises))
    varying = (*model.x, *noises) if with_factors else noises
    columns = zip(noises, factors.T.tolist(), strict=True)
    pointed = np.array(
        [sp.Matrix(column).has(*varying) or decides(equation, [v]) for v, column in columns]
    )
    for _ in noises:  # and what is correlated with one of them
        pointed |= (law.cov[:, pointed] != 0).any(axis=1)
    cov = exact_matrix(np.where(pointed[:, None] | pointed, 0.0, law.cov))
    covariance = model.compiled([model.x], [factors * cov * factors.T])
    root = np.eye(len(noises))[:, pointed] @ square_root(law.cov[np.ix_(pointed, pointed)])
    return _Side(
        model, function, law.mean, root, covariance, angles, *rule(model.n + root.shape[1])
    )


def _checked(
    model: Model,
    build: partial[Structure],
    rule: Rule,
    order: int,
    with_factors: bool = False,
) -> Structure:
    """The structure, after a comparison at the prior law of Gauss-Hermite rules of this order and
    of twice the order."""
    name = build.func.__name__.replace("_", "-")
    expect(model, Model, name)
    if model.between is not None:
        return model.between.structure(model, build)
    by_rule = partial(_by_points, name, model, with_factors)
    structure = by_rule(rule)
    with np.errstate(all="ignore"):
        if not all(np.isfinite(part).all() for law in _at_prior(structure) for part in law):
            _warn(f"{name}: a function of {model} is not finite at the points of the prior law")
        elif problem := _disagreement(by_rule, order):
            _warn(f"{name}: {problem}")
    return structure


def _disagreement(by_rule: Callable[[Rule], Structure], order: int) -> str:
    """What Gauss-Hermite rules of this order and of twice the order say otherwise at the prior law;
    empty if nothing, or if they take too many points."""
    rules = (partial(product_rule, points) for points in (order, 2 * order))
    with warnings.catch_warnings():
        # these points are not those that the filter uses
        warnings.simplefilter("ignore", QuadratureWarning)
        try:
            structure, finer = map(by_rule, rules)
        except ModelError:
            return ""
        model, coarse, fine = structure.model, _at_prior(structure), _at_prior(finer)
    parts = zip(("next state", "measurement"), coarse, fine, model.angles, strict=True)
    for what, less, more, angles in parts:
        for moment, error in zip(("mean", "covariance"), apart(less, more, angles), strict=True):
            if not (largest := np.abs(error).max()) <= CONVERGED:
                return (
                    f"with {2 * order} points an axis in place of {order} the {moment} of "
                    f"the {what} of {model} at the prior law changes by {100 * largest:.2g} %: it "
                    "may be infinite, or the function too rough for these points"
                )
    return ""


def apart(less: Gaussian, more: Gaussian, angles: Components) -> tuple[Array, Array]:
    """How far two laws lie apart: the means, in standard deviations of the second, and the
    covariances, in products of two of these."""
    # what does not vary has no size of its own but that of rounding
    sd = np.sqrt(np.maximum(np.diagonal(more.cov, axis1=-2, axis2=-1), 0.0))
    sd = sd + 1e-12 * (1 + np.abs(more.mean))
    spread = (less.cov - more.cov) / (sd[..., :, None] * sd[..., None, :])
    return difference(less.mean, more.mean, angles) / sd, spread


def _at_prior(structure: Structure) -> tuple[Gaussian, Gaussian]:
    """Laws of the next state and of the measurement at the prior law."""
    now, prior = structure.at(0), structure.model.prior
    h, _, F, _ = now.measure(*prior)
    return now.predict(*prior), Gaussian(h, F)


def _warn(text: str) -> None:
    warnings.warn(text, QuadratureWarning, stacklevel=4)


def _warn_of_turns(model: Model, deviation: Array) -> None:
    """QuadratureWarning if points of an angle go round the circle: their mean is then that of other
    angles."""
    for i in model.angles.x:
        if (widest := np.nanmax(np.abs(deviation[..., i]), initial=0.0)) > np.pi:
            _warn(
                f"points of the angle {model.x[i]} lie {widest:.3g} to either side of its "
                f"mean, more than half a turn: "
                "its variance is too large for these points; take linearised(model), or a smaller "
                "prior variance"
            )


def _lower_root(cov: Array) -> tuple[Array, Array]:
    """The Cholesky factor, and which components (..., n) the earlier ones determine: their columns
    are those of I."""
    n, known = cov.shape[-1], np.zeros(cov.shape[:-1], dtype=bool)
    try:
        return np.linalg.cholesky(cov), known
    except np.linalg.LinAlgError:
        root, rest = np.zeros_like(cov), cov
    for j in range(n):
        pivot = rest[..., j, j, None]
        skipped = ~(pivot > n * EPS * cov[..., j, j, None])
        column = rest[..., j] / np.sqrt(np.where(skipped, 1.0, pivot))
        column = np.where(skipped | (np.arange(n) < j), 0.0, column)
        root[..., j], known[..., j] = np.where(skipped, np.eye(n)[j], column), skipped[..., 0]
        rest = rest - column[..., :, None] * column[..., None, :]
    return root, known


def _by_points(name: str, model: Model, with_factors: bool, rule: Rule) -> Structure:
    """A structure from standard normal points and weights: rule(size) -> (points (q, size), weights
    (q,))."""
    state, meter = _sides(model, rule, with_factors)
    measurement = measurement_of(model.angles.y)

    def at(k: int | None) -> Structure:
        def predict(z: Array, p: Array) -> Gaussian:
            tau, deviation, *_, added = state.propagated(z, p, k)
            return Gaussian(tau, state.spread(deviation) + added)

        def measure(m: Array, d: Array) -> Measurement:
            h, G, R = meter.regressed(m, d, k)
            return measurement(h, G, symmetric(G @ d @ transpose(G)) + R, R)

        def transition(z: Array, p: Array) -> Transition:
            return Transition(*state.regressed(z, p, k)[1:])

        return Structure(name, model, predict, measure, transition)

    return of_steps(name, model, at)
