"""Known mistakes of set c, question by question, and what is said of each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.c_duof.keys import design_and_run, duof_run_with, duof_step_with
from kfcourse.exercises.shared import (
    MOMENTS_ABOUT_ZERO,
    WITHOUT_OFFSET,
    Fit,
    covariance_of,
    first_step,
    next_step,
    raw_moment,
    regression,
    regression_with,
    step_before,
)
from kfcourse.laws import Array

# -- c1: the structure


def _alike(y: Array, lam: Array) -> Array:
    if y.shape != lam.shape:
        raise ValueError("only with as many measurements as states")
    return y


WRONG_STRUCTURES: tuple[tuple[str, str, Answer], ...] = (
    ("omega-sign", messages.INNOVATION_SIGN, lambda lam, z, y, a, b: (b(lam) - y, a(z))),
    (
        "omega-from-estimate",
        "What is expected of y follows from the prediction lam, not from z.",
        lambda lam, z, y, a, b: (y - b(z), a(z)),
    ),
    ("omega-is-y", "The measurement itself is not the innovation.", lambda lam, z, y, a, b: (y, a(z))),
    (
        "alpha-from-prediction",
        "alpha follows from the estimate z, which knows y already.",
        lambda lam, z, y, a, b: (y - b(lam), a(lam)),
    ),
    ("alpha-is-z", "The object moves: alpha is the state equation at z.", lambda lam, z, y, a, b: (y - b(lam), z)),
    ("omega-of-state", messages.STATE_FOR_EXPECTED, lambda lam, z, y, a, b: (_alike(y, lam) - lam, a(z))),
    (
        "equations-swapped",
        "The equations of state and meter are swapped.",
        lambda lam, z, y, a, b: (_alike(y, lam) - a(lam), b(z)),
    ),
    ("twice", "The state equation is applied twice.", lambda lam, z, y, a, b: (y - b(lam), a(a(z)))),
)


# -- c2: regression over the ensemble


def _over_components(a: Array, b: Array) -> Array:
    """Deviations from the mean over the components of each trajectory."""
    return (a - a.mean(axis=1, keepdims=True)).T @ (b - b.mean(axis=1, keepdims=True)) / len(a)


def _residual(left: Callable[[Array, Array, Array], Array]) -> Fit:
    """What is left made of the target's covariance, the explained part and the target."""

    def fit(t: Array, r: Array) -> tuple[Array, Array, Array]:
        matrix, offset, _ = regression(t, r)
        return matrix, offset, left(covariance_of(t, t), matrix @ covariance_of(t, r).T, t)

    return fit


def _offset(of_means: Callable[[Array, Array], Array]) -> Fit:
    def fit(t: Array, r: Array) -> tuple[Array, Array, Array]:
        matrix, _, residual = regression(t, r)
        return matrix, of_means(t.mean(axis=0), matrix @ r.mean(axis=0)), residual

    return fit


def _left(t: Array, r: Array) -> Array:
    matrix, offset, _ = regression(t, r)
    return t - r @ matrix.T - offset


def _whole_design(t: Array, r: Array) -> tuple[Array, Array, Array]:
    """Least squares with a column of ones: where the regressor never varies, another one of the minimisers."""
    found = np.linalg.pinv(np.column_stack([r, np.ones(len(r))])) @ t
    return found[:-1].T, found[-1], regression(t, r)[2]


SUM_FOR_MEAN = "A sum stands where a mean belongs."

WRONG_REGRESSIONS: tuple[tuple[str, str, Fit], ...] = (
    ("means-not-subtracted", messages.MEANS_NOT_SUBTRACTED, MOMENTS_ABOUT_ZERO),
    ("offset-forgotten", messages.OFFSET_FORGOTTEN, WITHOUT_OFFSET),
    (
        "wrong-index",
        "The mean seems to be taken over the components (the second index) instead of the trajectories (the first).",
        regression_with(lambda t, r: (_over_components(t, r), _over_components(r, r))),
    ),
    (
        "biased",
        messages.DIFFERENT_DIVISORS,
        regression_with(lambda t, r: (covariance_of(t, r), covariance_of(r, r) * len(r) / (len(r) - 1))),
    ),
    (
        "biased",
        messages.DIFFERENT_DIVISORS,
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
        messages.UNBIASED_RESIDUAL,
        lambda t, r: (*regression(t, r)[:2], regression(t, r)[2] * len(t) / (len(t) - 1)),
    ),
    ("unbiased-residual", messages.UNBIASED_RESIDUAL, _residual(lambda all_, part, t: all_ * len(t) / (len(t) - 1) - part)),
    ("explained-added", messages.EXPLAINED_ADDED, _residual(lambda all_, part, t: all_ + part)),
    (
        "explained-only",
        "That is what the regression explains; what it leaves is asked for.",
        _residual(lambda all_, part, t: part),
    ),
    ("about-zero", messages.ABOUT_ZERO, _residual(lambda all_, part, t: raw_moment(t, t) - part)),
    (
        "offset-not-removed",
        "The offset is still in what is left.",
        lambda t, r: (*regression(t, r)[:2], raw_moment(t - r @ regression(t, r)[0].T, t - r @ regression(t, r)[0].T)),
    ),
    (
        "offset-sign",
        messages.OFFSET_SIGN,
        _offset(lambda t, explained: t + explained),
    ),
    ("target-mean-forgotten", "The mean of the target is missing in the offset.", _offset(lambda t, explained: explained)),
    (
        "not-divided",
        "The matrix is not divided by the covariance of the regressor.",
        lambda t, r: (covariance_of(t, r), *regression(t, r)[1:]),
    ),
    (
        "another-minimiser",
        "It is one of the best, but where the regressor never varies there are many: take the pseudo-inverse of its covariance.",
        _whole_design,
    ),
    (
        "regularised",
        "Something was added to the covariance of the regressor; the pseudo-inverse needs no such help.",
        regression_with(lambda t, r: (covariance_of(t, r), covariance_of(r, r) + 1e-6 * np.eye(r.shape[1]))),
    ),
    (
        "multiplied",
        "The matrix is multiplied by the covariance of the regressor; it is divided by it.",
        regression_with(lambda t, r: (covariance_of(t, r) @ covariance_of(r, r) @ covariance_of(r, r), covariance_of(r, r))),
    ),
    (
        "one-trajectory",
        "What is left is taken from one trajectory; average over all.",
        lambda t, r: (*regression(t, r)[:2], _left(t, r)[:1].T @ _left(t, r)[:1]),
    ),
    ("sum-for-mean", SUM_FOR_MEAN, _residual(lambda all_, part, t: len(t) * (all_ - part))),
    ("sum-for-mean", SUM_FOR_MEAN, _residual(lambda all_, part, t: len(t) * all_ - part)),
    ("sum-for-mean", SUM_FOR_MEAN, _residual(lambda all_, part, t: len(t) * (all_ - len(t) * part))),
)


# -- c3: one step of the design


def _subtracted(lam: Array, x: Array, y: Array, x_next: Array, a: Callable, b: Callable) -> tuple[Array, Array]:
    H, e, _ = regression(x - lam, y - b(lam))
    z = lam - (y - b(lam)) @ H.T + e
    F, g, _ = regression(x_next, a(z))
    return z, a(z) @ F.T + g


def _change_fitted(lam: Array, x: Array, y: Array, x_next: Array, a: Callable, b: Callable) -> tuple[Array, Array]:
    z, _ = duof_step_with()(lam, x, y, x_next, a, b)
    F, g, _ = regression(x_next - z, a(z))
    return z, a(z) @ F.T + g


WRONG_DUOF_STEPS: tuple[tuple[str, str, Answer], ...] = (
    (
        "state-for-error",
        "The correction is a regression of the prediction's error x - lam on the innovation, not of the state.",
        duof_step_with(first=lambda x, lam: x),
    ),
    (
        "prediction-not-added",
        "H omega + e is only the correction: it is added to lam.",
        duof_step_with(base=lambda lam: 0.0 * lam),
    ),
    (
        "alpha-from-prediction",
        "The prediction uses a(lam): the estimate z knows the measurement, lam does not.",
        duof_step_with(alpha=lambda z, lam, a: a(lam)),
    ),
    ("alpha-is-z", "The regressor of the prediction is alpha = a(z), not z itself.", duof_step_with(alpha=lambda z, lam, a: z)),
    ("means-not-subtracted", messages.MEANS_NOT_SUBTRACTED, duof_step_with(fit=MOMENTS_ABOUT_ZERO)),
    ("offset-forgotten", messages.OFFSET_FORGOTTEN, duof_step_with(fit=WITHOUT_OFFSET)),
    ("correction-subtracted", messages.CORRECTION_SUBTRACTED, _subtracted),
    (
        "error-sign",
        "The target has the wrong sign: the error that is estimated is the state less its prediction.",
        duof_step_with(first=lambda x, lam: lam - x),
    ),
    (
        "prediction-of-error",
        "The target of the second regression is the next state itself.",
        lambda lam, x, y, x_next, a, b: duof_step_with()(lam, x, y, x_next - lam, a, b),
    ),
    ("change-fitted", "The target of the second regression is the next state itself, not how much it changes.", _change_fitted),
)


# -- c4: coefficients found on one ensemble, used on another

Ensemble = tuple[Array, Array]


def _undivided(t: Array, r: Array) -> tuple[Array, Array, Array]:
    matrix = covariance_of(t, r)
    return matrix, t.mean(axis=0) - matrix @ r.mean(axis=0), covariance_of(t, t)


WRONG_DUOF_RUNS: tuple[tuple[str, str, Answer], ...] = (
    (
        "part-of-ensemble",
        "The coefficients seem to come from a part of the design ensemble only; use all of its trajectories.",
        lambda x, yd, y, mean, a, b: design_and_run(x[:, : y.shape[1]], yd[:, : y.shape[1]], y, mean, a, b),
    ),
    ("one-gain", "H and e of the first step are used at every step; each step has its own.", duof_run_with(one_gain=True)),
    ("predictions-returned", messages.PREDICTIONS_RETURNED, duof_run_with(predictions=True)),
    (
        "prediction-not-fitted",
        "The prediction is a(z) as it is; its coefficients F and g, found in the design, are not used.",
        duof_run_with(object_alone=True),
    ),
    ("offset-not-used", "The offset e is not used when the filter runs.", duof_run_with(without_offset=True)),
    (
        "innovation-sign",
        messages.INNOVATION_SIGN,
        duof_run_with(sign=-1.0),
    ),
    ("step-not-passed", messages.STEP_NOT_PASSED, duof_run_with(a_at=first_step, b_at=first_step)),
    ("input-of-next-step", messages.INPUT_OF_NEXT_STEP, duof_run_with(a_at=next_step)),
    ("input-of-step-before", messages.INPUT_OF_STEP_BEFORE, duof_run_with(a_at=step_before)),
    ("input-of-step-before", messages.INPUT_OF_STEP_BEFORE, duof_run_with(b_at=step_before)),
    ("steps-from-one", messages.STEPS_FROM_ONE, duof_run_with(a_at=next_step, b_at=next_step)),
    (
        "prediction-offset-not-used",
        "The offset g of the prediction is not used when the filter runs.",
        duof_run_with(prediction_offset=False),
    ),
    (
        "prediction-not-added",
        messages.CORRECTION_ALONE,
        duof_run_with(base=lambda lam: 0 * lam),
    ),
    (
        "state-for-error",
        "The target of the first regression is the error of the prediction, not the state.",
        duof_run_with(target=lambda x, lam: x),
    ),
    ("means-not-subtracted", messages.MEANS_NOT_SUBTRACTED, duof_run_with(fit=MOMENTS_ABOUT_ZERO)),
    ("offset-forgotten", messages.OFFSET_FORGOTTEN, duof_run_with(fit=WITHOUT_OFFSET)),
    (
        "steps-reversed",
        "The coefficients are those of the steps in the reverse order.",
        lambda x, yd, *rest: design_and_run(x[::-1], yd[::-1], *rest),
    ),
    (
        "part-of-ensemble",
        "The coefficients come from a part of the design ensemble only; use all of its trajectories.",
        lambda x, yd, *rest: design_and_run(x[:, : x.shape[1] // 3], yd[:, : x.shape[1] // 3], *rest),
    ),
    ("gain-not-divided", "The coefficients are not divided by the covariance of the regressor.", duof_run_with(fit=_undivided)),
)
