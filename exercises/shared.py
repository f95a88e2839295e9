"""What the questions of several sets share: personal numbers, hidden laws, regressions over an ensemble."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import sympy as sp

from kfcourse.checks.exercises import Exercise
from kfcourse.filters.designed import Scatter
from kfcourse.laws import Array

Map = Callable[[Array], Array]
COURSE = "53"  # the variant that the course itself works through
Ranges = Mapping[str, tuple[float, float]]


def personal(exercise: Exercise, name: str, course: Mapping[str, float], ranges: Ranges) -> dict[str, float]:
    """Numbers of two digits from the ranges, the same for a variant and name; the course's own for its variant."""
    if exercise.variant.name == COURSE:
        return dict(course)
    rng = exercise.rng(name)
    return {key: float(f"{rng.uniform(*limits):.2g}") for key, limits in ranges.items()}


def covariance(rng: np.random.Generator, size: int) -> Array:
    """A hidden covariance: correlated, and well away from singular."""
    root = np.eye(size) + 0.4 * rng.normal(size=(size, size))
    return root @ root.T


def substituted(formulas: sp.MatrixBase, names: tuple[sp.Symbol, ...]) -> Callable[..., sp.ImmutableMatrix]:
    """The formulas as a function of other symbols in the place of these."""
    return lambda *values: sp.ImmutableMatrix(formulas.subs(dict(zip(names, values, strict=True)), simultaneous=True))


# -- regressions over an ensemble

RUNS = 60  # hidden trajectories: a regression over so few differs clearly from one with N - 1 in the place of N

Fit = Callable[[Array, Array], tuple[Array, Array, Array]]


def regression(target: Array, regressor: Array) -> tuple[Array, Array, Array]:
    """matrix (r, s), offset (r,), residual covariance (r, r)."""
    matrix, offset, residual = Scatter.of(target, regressor).regression(target.shape[1])
    return matrix, offset, residual


def ensemble(exercise: Exercise, name: str) -> tuple[Array, Array, Array]:
    """x_k, y_k and x_{k+1} of hidden trajectories, (N, ...), at a step when the filter is under way."""
    x, y = exercise.simulate(RUNS, 4, name)
    return x[2], y[2], x[3]


def predicted(exercise: Exercise, name: str, x: Array) -> Array:
    """What a filter may have predicted of x: near it, and biased a little."""
    spread = x.std(axis=0) + 0.1 * np.sqrt(np.diagonal(exercise.model.prior.cov))
    return x + spread * (0.1 + 0.5 * exercise.rng(name).normal(size=x.shape))


def regression_with(moments: Callable[[Array, Array], tuple[Array, Array]], offset: bool = True, transposed: bool = False) -> Fit:
    """A regression from other second moments: (target, regressor) -> (cross (r, s), of the regressor (s, s))."""

    def fit(target: Array, regressor: Array) -> tuple[Array, Array, Array]:
        cross, own = moments(target, regressor)
        matrix = cross @ np.linalg.pinv(own)
        if transposed:
            matrix = (np.linalg.pinv(own) @ cross.T).reshape(matrix.shape)
        shift = target.mean(axis=0) - matrix @ regressor.mean(axis=0) if offset else target.mean(axis=0)
        return matrix, shift, covariance_of(target, target) - matrix @ covariance_of(target, regressor).T

    return fit


def covariance_of(a: Array, b: Array) -> Array:
    return (a - a.mean(axis=0)).T @ (b - b.mean(axis=0)) / len(a)


def raw_moment(a: Array, b: Array) -> Array:
    return a.T @ b / len(a)


def _over_components(a: Array, b: Array) -> Array:
    """Deviations from the mean over the components of each trajectory."""
    return (a - a.mean(axis=1, keepdims=True)).T @ (b - b.mean(axis=1, keepdims=True)) / len(a)


BIASED = (
    "Cross covariance and covariance are divided by different numbers, N and N - 1; np.cov divides by N - 1 unless told "
    "otherwise."
)
WRONG_REGRESSIONS: tuple[tuple[str, str, Fit], ...] = (
    (
        "means-not-subtracted",
        "The second moments are taken about zero; covariances are about the means.",
        regression_with(lambda t, r: (raw_moment(t, r), raw_moment(r, r))),
    ),
    (
        "offset-forgotten",
        "The offset is the target's mean; what the matrix makes of the regressor's mean has to be subtracted.",
        regression_with(lambda t, r: (covariance_of(t, r), covariance_of(r, r)), offset=False),
    ),
    (
        "wrong-index",
        "The mean seems to be taken over the components (the second index) instead of the trajectories (the first).",
        regression_with(lambda t, r: (_over_components(t, r), _over_components(r, r))),
    ),
    (
        "biased",
        BIASED,
        regression_with(lambda t, r: (covariance_of(t, r), covariance_of(r, r) * len(r) / (len(r) - 1))),
    ),
    (
        "biased",
        BIASED,
        regression_with(lambda t, r: (covariance_of(t, r) * len(r) / (len(r) - 1), covariance_of(r, r))),
    ),
    (
        "regularised",
        "Something was added to the covariance of the regressor to make it invertible: that biases every coefficient. The "
        "pseudo-inverse needs no such help.",
        regression_with(lambda t, r: (covariance_of(t, r), covariance_of(r, r) + 1e-3 * np.eye(r.shape[1]))),
    ),
    (
        "residual-is-variance",
        "The residual covariance is the whole covariance of the target; subtract what the regression explains.",
        lambda t, r: (*regression(t, r)[:2], covariance_of(t, t)),
    ),
    (
        "unbiased-residual",
        "The residual is divided by N - 1; use 1/N throughout, as for the coefficients.",
        lambda t, r: (*regression(t, r)[:2], regression(t, r)[2] * len(t) / (len(t) - 1)),
    ),
)
