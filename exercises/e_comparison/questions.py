"""Questions of set e: comparing filters by Monte Carlo, with standard errors.

Answers are functions of stored trajectories: x and z are (steps, N, n), p is (steps, N, n, n); results are (steps,).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kfcourse.checks.exercises import Exercise
from kfcourse.checks.question import Answer, Question, catalogue
from kfcourse.checks.registry import ExerciseSet
from kfcourse.filters import aof
from kfcourse.laws import Array
from kfcourse.montecarlo.experiment import run

RUNS, STEPS = 40, 5


def hidden(exercise: Exercise, name: str) -> tuple[Array, Array, Array, Array]:
    """States, the estimates of two filters and the first one's covariances, on common trajectories."""
    x, y = exercise.simulate(RUNS, STEPS, name)
    first = run(aof(exercise.structures.gaussian), y)
    noise = exercise.rng(f"{name}-other").normal(size=x.shape) * x.std(axis=1, keepdims=True)
    return x, first.mean + 0.03 * noise, first.mean + 0.08 * noise[::-1], first.cov


def squared_error(x: Array, z: Array) -> Array:
    return np.sum((x - z) ** 2, axis=2)


def spread_of_mean(values: Array) -> Array:
    """Standard error of the mean over trajectories, of values (steps, N)."""
    return values.std(axis=1, ddof=1) / np.sqrt(values.shape[1])


def error_variance(x: Array, z: Array) -> Array:
    return squared_error(x, z).mean(axis=1)


def with_standard_error(x: Array, z: Array) -> tuple[Array, Array]:
    return error_variance(x, z), spread_of_mean(squared_error(x, z))


def difference(x: Array, z_first: Array, z_second: Array) -> tuple[Array, Array]:
    paired = squared_error(x, z_first) - squared_error(x, z_second)
    return paired.mean(axis=1), spread_of_mean(paired)


def ratio(x: Array, z_first: Array, z_second: Array) -> tuple[Array, Array]:
    D, base = error_variance(x, z_first), error_variance(x, z_second)
    r = D / base
    return r, spread_of_mean(squared_error(x, z_first) - r[:, None] * squared_error(x, z_second)) / base


def normalised_error(x: Array, z: Array, p: Array) -> Array:
    error = x - z
    return np.mean(np.sum(error * np.linalg.solve(p, error[..., None])[..., 0], axis=2), axis=1) / x.shape[2]


def _pairs(x: Array, z: Array, other: Array) -> tuple[Array, Array]:
    return squared_error(x, z), squared_error(x, other)


def _unpaired(x: Array, z: Array, other: Array) -> tuple[Array, Array]:
    a, b = _pairs(x, z, other)
    return (a - b).mean(axis=1), np.hypot(spread_of_mean(a), spread_of_mean(b))


def _ratio_of_errors(x: Array, z: Array, other: Array, sign: float) -> Array:
    """Relative errors combined as if the two were independent, or simply added."""
    a, b = _pairs(x, z, other)
    first, second = spread_of_mean(a) / a.mean(axis=1), spread_of_mean(b) / b.mean(axis=1)
    return ratio(x, z, other)[0] * (np.hypot(first, second) if sign > 0 else first + second)


WRONG_VARIANCES: tuple[tuple[str, str, Answer], ...] = (
    (
        "about-the-mean",
        "The errors' mean is subtracted: D_k is the mean of the square, bias included.",
        lambda x, z: np.sum((x - z).var(axis=1), axis=1),
    ),
    ("root", "It is a standard deviation; D_k is a variance.", lambda x, z: np.sqrt(error_variance(x, z))),
    (
        "wrong-index",
        "The mean is taken over the steps; it is over the trajectories, and there is one number a step.",
        lambda x, z: np.resize(squared_error(x, z).mean(axis=0), len(x)),
    ),
    ("sum-for-mean", "It is a sum over the trajectories, not a mean.", lambda x, z: squared_error(x, z).sum(axis=1)),
    ("absolute", "It is the mean of absolute values, not of squares.", lambda x, z: np.abs(x - z).sum(axis=2).mean(axis=1)),
    (
        "component-mean",
        "The squares of the components are averaged; D_k is their sum.",
        lambda x, z: ((x - z) ** 2).mean(axis=(1, 2)),
    ),
)

WRONG_ERRORS: tuple[tuple[str, str, Answer], ...] = (
    (
        "spread-for-error",
        "That is the spread of single trajectories; the mean of N of them varies less.",
        lambda x, z: (error_variance(x, z), squared_error(x, z).std(axis=1, ddof=1)),
    ),
    (
        "not-root",
        "The variance of the mean, not its square root: a standard error has the units of D_k.",
        lambda x, z: (error_variance(x, z), spread_of_mean(squared_error(x, z)) ** 2),
    ),
    (
        "divided-by-N",
        "Divided by N instead of its root.",
        lambda x, z: (error_variance(x, z), squared_error(x, z).std(axis=1, ddof=1) / x.shape[1]),
    ),
    (
        "of-error",
        "That is the standard error of the mean error; here the mean of its square is estimated.",
        lambda x, z: (error_variance(x, z), spread_of_mean(np.sqrt(squared_error(x, z)))),
    ),
    (
        "biased-spread",
        "The spread is divided by N; an estimate from N trajectories around their own mean has N - 1 (ddof=1).",
        lambda x, z: (error_variance(x, z), squared_error(x, z).std(axis=1) / np.sqrt(x.shape[1])),
    ),
    (
        "normal-theory",
        "That formula, D times the root of 2/N, holds for normal errors only; use the spread of the squared errors themselves.",
        lambda x, z: (error_variance(x, z), error_variance(x, z) * np.sqrt(2 / x.shape[1])),
    ),
)

WRONG_DIFFERENCES: tuple[tuple[str, str, Answer], ...] = (
    (
        "unpaired",
        "The standard errors are combined as if the filters had run on different trajectories. They share them: take the spread "
        "of the difference, trajectory by trajectory.",
        _unpaired,
    ),
    (
        "errors-subtracted",
        "Standard errors do not subtract; take the spread of the difference.",
        lambda x, z, o: (
            difference(x, z, o)[0],
            np.abs(spread_of_mean(squared_error(x, z)) - spread_of_mean(squared_error(x, o))),
        ),
    ),
    (
        "errors-added",
        "Standard errors do not add; take the spread of the difference.",
        lambda x, z, o: (difference(x, z, o)[0], spread_of_mean(squared_error(x, z)) + spread_of_mean(squared_error(x, o))),
    ),
    (
        "distance-of-estimates",
        "That is how far the two estimates are from each other, not which of them is closer to the state.",
        lambda x, z, o: (error_variance(z, o), spread_of_mean(squared_error(z, o))),
    ),
    ("order", "The difference is the first filter's D_k minus the second's.", lambda x, z, o: difference(x, o, z)),
)

WRONG_RATIOS: tuple[tuple[str, str, Answer], ...] = (
    (
        "unpaired",
        "The relative errors are combined as if the filters had run on different trajectories; they share them.",
        lambda x, z, o: (ratio(x, z, o)[0], _ratio_of_errors(x, z, o, 1)),
    ),
    (
        "errors-added",
        "Relative errors do not add here; the two means are correlated.",
        lambda x, z, o: (ratio(x, z, o)[0], _ratio_of_errors(x, z, o, -1)),
    ),
    (
        "mean-of-ratios",
        "It is the mean of the trajectories' ratios; a ratio of means is asked for (one small denominator would rule it).",
        lambda x, z, o: (
            (squared_error(x, z) / squared_error(x, o)).mean(axis=1),
            spread_of_mean(squared_error(x, z) / squared_error(x, o)),
        ),
    ),
    (
        "base-exact",
        "The denominator varies too, together with the numerator.",
        lambda x, z, o: (ratio(x, z, o)[0], spread_of_mean(squared_error(x, z)) / error_variance(x, o)),
    ),
    ("order", "The ratio is the first filter's D_k over the second's.", lambda x, z, o: ratio(x, o, z)),
)

WRONG_NORMALISED: tuple[tuple[str, str, Answer], ...] = (
    (
        "by-deviation",
        "The squared error is divided by a standard deviation; p is the variance that belongs there.",
        lambda x, z, p: np.mean(np.sum((x - z) ** 2 / np.sqrt(np.diagonal(p, axis1=-2, axis2=-1)), axis=2), axis=1) / x.shape[2],
    ),
    (
        "ratio-of-means",
        "It is the mean squared error over the mean variance; the quotient is taken for every trajectory, then averaged.",
        lambda x, z, p: ((x - z) ** 2).mean(axis=1).sum(axis=1) / np.trace(p.mean(axis=1), axis1=-2, axis2=-1),
    ),
    (
        "not-per-component",
        "Divide by the number of components: a filter that is right should give 1.",
        lambda x, z, p: normalised_error(x, z, p) * x.shape[2],
    ),
    (
        "correlations-ignored",
        "Only the variances of the components are used; the errors are correlated: use the inverse of the whole matrix.",
        lambda x, z, p: np.mean((x - z) ** 2 / np.diagonal(p, axis1=-2, axis2=-1), axis=(1, 2)),
    ),
    (
        "inverted",
        "It is upside down: the error over what the filter believes.",
        lambda x, z, p: np.mean(np.diagonal(p, axis1=-2, axis2=-1) / (x - z) ** 2, axis=(1, 2)),
    ),
)

TWO = ("value", "standard_error")
QUESTIONS = (
    Question(
        "e1",
        "the error variance",
        "warm-up",
        error_variance,
        lambda e: [hidden(e, "e1")[:2]],
        catalogue(WRONG_VARIANCES),
    ),
    Question(
        "e2",
        "its standard error",
        "core",
        with_standard_error,
        lambda e: [hidden(e, "e2")[:2]],
        catalogue(WRONG_ERRORS),
        TWO,
    ),
    Question(
        "e3",
        "a paired difference",
        "core",
        difference,
        lambda e: [hidden(e, "e3")[:3]],
        catalogue(WRONG_DIFFERENCES),
        TWO,
    ),
    Question("e4", "a ratio", "stretch", ratio, lambda e: [hidden(e, "e4")[:3]], catalogue(WRONG_RATIOS), TWO),
    Question(
        "e5",
        "does the filter know its own error?",
        "core",
        normalised_error,
        lambda e: [(hidden(e, "e5")[0], hidden(e, "e5")[1], hidden(e, "e5")[3])],
        catalogue(WRONG_NORMALISED),
    ),
)

SET = ExerciseSet("e", "Comparison by Monte Carlo", Path(__file__).parent, QUESTIONS)
