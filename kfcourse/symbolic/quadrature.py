"""Structural functions by quadrature over a normal law, for models without a closed form.

A noise that is added with a constant factor, and is correlated with no noise of another kind, needs
no points: its mean and covariance are added.  Nor does the Gauss-Hermite rule need any for noises
with factors that depend on the state alone: at each point of the state their mean and covariance
are known, Cov y = Cov M[y|x] + M Cov[y|x].  The points spread over the state and over the other
noises, s variables together.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from itertools import product as cartesian
from typing import TypeAlias

import numpy as np

from kfcourse.angles import Components, difference, on_circle
from kfcourse.errors import expect
from kfcourse.laws import (
    SINGULAR,
    Array,
    Gaussian,
    square_root,
    symmetric,
    transpose,
)
from kfcourse.symbolic.equations import Equation, compile_model
from kfcourse.symbolic.model import Half, Model
from kfcourse.symbolic.reading import ModelError, exact_matrix
from kfcourse.symbolic.sides import decides
from kfcourse.symbolic.structure import Structure, of_steps, regressed

Rule: TypeAlias = Callable[[int], tuple[Array, Array]]
# (mean, cov, k) -> mean of an equation, slopes by x, covariance of what is not linear in x
Regression: TypeAlias = Callable[..., tuple[Array, Array, Array]]

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
    sizes = []

    def rule(size: int) -> tuple[Array, Array]:
        sizes.append(size)
        return product_rule(1, size)

    _sides(model, rule)
    return max(sizes)


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


def _sides(model: Model, rule: Rule, with_factors: bool = False) -> list[Regression]:
    """Object and meter, with points for the noises that do not enter linearly, or for those
    `with_factors` of the state, too: `rule` makes them."""
    halves = zip(model.halves, compile_model(model), strict=True)
    return [_side(model, rule, with_factors, *pair) for pair in halves]


def _side(
    model: Model, rule: Rule, with_factors: bool, half: Half, function: Equation
) -> Regression:
    """A law of the state through an equation of the model, by regressions on the points."""
    equation, noises, law, angles = half
    factors = equation.subs(model.values).jacobian(list(noises))
    varying = (*model.x, *noises) if with_factors else noises
    pointed = np.array(
        [factors[:, i].has(*varying) or decides(equation, [v]) for i, v in enumerate(noises)]
    )
    for _ in noises:  # and what is correlated with one of them
        pointed |= (law.cov[:, pointed] != 0).any(axis=1)
    # B D B^T of the noises without points; the mean over points of the covariance given x
    cov_without = exact_matrix(np.where(pointed[:, None] | pointed, 0.0, law.cov))
    added = model.compiled([model.x], [factors * cov_without * factors.T])
    root_of_noise = np.eye(len(noises))[:, pointed] @ square_root(law.cov[pointed][:, pointed])
    points, weights = rule(model.n + root_of_noise.shape[1])
    noise = law.mean + points[:, model.n :] @ root_of_noise.T
    central = np.argmin((points**2).sum(axis=1))

    def regressed(mean: Array, cov: Array, k: int | None) -> tuple[Array, Array, Array]:
        root, known = _lower_root(cov)
        standard = np.where(known[..., None, :], 0.0, points[:, : model.n])
        dx = standard @ transpose(root)
        x = mean[..., None, :] + dx
        values = function(x, noise, k)
        middle = values[..., central, :]
        off = difference(values, middle[..., None, :], angles)
        shift = weights @ off
        deviation = off - shift[..., None, :]
        cross = transpose(deviation * weights[:, None]) @ standard
        slopes = transpose(np.linalg.solve(transpose(root), transpose(cross)))
        explained = dx @ transpose(slopes)
        rest = deviation - explained  # no difference of nearly equal matrices
        size = np.abs(deviation) + np.abs(explained) + np.abs(middle)[..., None, :]
        rest = np.where(np.abs(rest) <= LOST * size, 0.0, rest)  # rounding is no noise of the meter
        covs = added(x, k=k)[0]
        if covs.ndim > 2:
            covs = np.einsum("q,...qij->...ij", weights, covs)
        unexplained = transpose(rest * weights[:, None]) @ rest + covs
        return on_circle(middle + shift, angles), slopes, symmetric(unexplained)

    return regressed


def _lower_root(cov: Array) -> tuple[Array, Array]:
    """The Cholesky factor, and which components (..., n) the earlier ones determine: their columns
    are those of I.

    No LAPACK: a trajectory whose covariance rounding has broken leaves the others as they are.
    """
    n = cov.shape[-1]
    rest = cov * (1 + (UNSEEN if n > 1 else 0) * np.eye(n))
    root, known = np.zeros_like(rest), np.zeros(rest.shape[:-1], dtype=bool)
    for j in range(n):
        pivot = rest[..., j, j, None]
        skipped = ~(pivot > n * EPS * cov[..., j, j, None])
        column = rest[..., j] / np.sqrt(np.where(skipped, 1.0, pivot))
        column = np.where(skipped | (np.arange(n) < j), 0.0, column)
        root[..., j], known[..., j] = np.where(skipped, np.eye(n)[j], column), skipped[..., 0]
        rest = rest - column[..., :, None] * column[..., None, :]
    return root, known


def _checked(
    model: Model,
    build: partial[Structure],
    rule: Rule,
    order: int,
    with_factors: bool = False,
) -> Structure:
    """The structure, after a look whether it is finite at the prior law, and a comparison there of
    Gauss-Hermite rules of this order and of twice the order, if these do not take too many
    points."""
    name = build.func.__name__.replace("_", "-")
    expect(model, Model, name)
    if model.between is not None:
        return model.between.structure(model, build)
    by_rule = partial(_by_points, name, model, with_factors)
    structure = by_rule(rule)
    with np.errstate(all="ignore"):
        coarse = fine = _at_prior(structure)
        if all(np.isfinite(part).all() for law in fine for part in law):
            with suppress(ModelError):
                coarse, fine = (
                    _at_prior(by_rule(partial(product_rule, points)))
                    for points in (order, 2 * order)
                )
        laws = zip(coarse, fine, model.angles, strict=True)
        error = np.max([np.abs(part).max() for three in laws for part in apart(*three)])
    if not error <= CONVERGED:
        change = f"change by {100 * error:.2g} %" if np.isfinite(error) else "are not finite"
        warnings.warn(
            f"{name}: with {2 * order} points an axis in place of {order} the moments of {model} "
            f"at the prior law {change}: they may be infinite, or a function too rough for these "
            "points",
            QuadratureWarning,
            stacklevel=3,
        )
    return structure


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


def _by_points(name: str, model: Model, with_factors: bool, rule: Rule) -> Structure:
    """A structure from standard normal points and weights: rule(size) -> (points (q, size), weights
    (q,))."""
    sides = _sides(model, rule, with_factors)

    def at(k: int | None) -> Structure:
        return regressed(name, model, *(partial(side, k=k) for side in sides))

    return of_steps(name, model, at)
