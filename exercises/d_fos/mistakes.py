"""Known mistakes of set d, question by question, and what is said of each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.b_aof.keys import correct
from kfcourse.exercises.d_fos.keys import Condition, condition, fos_step_with, mfos_step_with
from kfcourse.exercises.shared import MOMENTS_ABOUT_ZERO, WITHOUT_OFFSET, Fit, covariance_of, regression
from kfcourse.laws import Array

# -- d1: what the estimate says of the state


def condition_with(fit: Fit) -> Condition:
    """The same by another regression."""

    def condition(x: Array, z: Array) -> tuple[Array, Array]:
        matrix, offset, residual = fit(x, z)
        return z @ matrix.T + offset, residual

    return condition


def _standard_deviation(x: Array, z: Array) -> tuple[Array, Array]:
    u, T = condition(x, z)
    return u, np.sqrt(np.maximum(T, 0.0))


def _error_variance(x: Array, z: Array) -> tuple[Array, Array]:
    return z, (x - z).T @ (x - z) / len(x)


def _shifted_only(x: Array, z: Array) -> tuple[Array, Array]:
    _, offset, residual = regression(x, z)
    return z + offset, residual


ESTIMATE_ITSELF = "u is not z itself: the estimate's scale and bias are corrected by the regression."

WRONG_CONDITIONS: tuple[tuple[str, str, Condition], ...] = (
    ("estimate-itself", ESTIMATE_ITSELF, _error_variance),
    ("estimate-itself", ESTIMATE_ITSELF, lambda x, z: (z, condition(x, z)[1])),
    ("error-for-residual", messages.ERROR_FOR_RESIDUAL, lambda x, z: (condition(x, z)[0], _error_variance(x, z)[1])),
    ("error-for-residual", messages.ERROR_FOR_RESIDUAL, lambda x, z: (condition(x, z)[0], covariance_of(x - z, x - z))),
    ("scale-forgotten", messages.SCALE_FORGOTTEN, _shifted_only),
    (
        "explained-added",
        messages.EXPLAINED_ADDED,
        lambda x, z: (condition(x, z)[0], 2 * covariance_of(x, x) - condition(x, z)[1]),
    ),
    (
        "regressed-the-other-way",
        "The estimate was regressed on the state; the filter knows z and asks for x.",
        lambda x, z: condition(z, x),
    ),
    (
        "residual-is-variance",
        "T is the whole covariance of the state; subtract what the estimate explains.",
        lambda x, z: (condition(x, z)[0], covariance_of(x, x)),
    ),
    ("deviation-for-variance", "T is a variance; its square root stands there.", _standard_deviation),
    ("means-not-subtracted", messages.MEANS_NOT_SUBTRACTED, condition_with(MOMENTS_ABOUT_ZERO)),
    (
        "offset-forgotten",
        "The offset chi is the state's mean; what Gamma makes of the estimate's mean has to be subtracted.",
        condition_with(WITHOUT_OFFSET),
    ),
    (
        "unbiased-residual",
        messages.UNBIASED_RESIDUAL,
        lambda x, z: (condition(x, z)[0], condition(x, z)[1] * len(x) / (len(x) - 1)),
    ),
    (
        "explained-only",
        "That is what the estimate explains of the state; what it leaves is asked for.",
        lambda x, z: (condition(x, z)[0], covariance_of(x, x) - condition(x, z)[1]),
    ),
    (
        "residual-returned",
        "That is what the regression leaves of the state; u is what it says.",
        lambda x, z: (x - condition(x, z)[0], condition(x, z)[1]),
    ),
    (
        "sum-for-mean",
        "T is a sum over the trajectories, not a mean.",
        lambda x, z: (condition(x, z)[0], len(x) * condition(x, z)[1]),
    ),
    (
        "error-for-state",
        "The error of the estimate is regressed; the state itself is asked for.",
        lambda x, z: condition(x - z, z),
    ),
    (
        "not-divided",
        "Gamma is not divided by the covariance of the estimate.",
        lambda x, z: (x.mean(axis=0) + (z - z.mean(axis=0)) @ covariance_of(z, x), condition(x, z)[1]),
    ),
)


# -- d2: one step of the FOS

PREDICTED_AS_AOF = "That is the AOF's prediction, from z and p; the FOS carries no covariance: it predicts from u and T."
MEAN_FROM_ESTIMATE = "The prediction's mean starts from u, not from z."
VARIANCE_FROM_PREDICTION = "The uncertainty Psi from before the measurement is carried on; it is T after it."


def _fos_law(choose: Callable[..., tuple[Array, Array]], sign: float = 1.0) -> Answer:
    """A step that predicts from another law, or corrects with another sign."""

    def step(lam: Array, Psi: Array, x: Array, y: Array, measure: Callable, predict: Callable) -> tuple[Array, ...]:
        z, p = correct(lam, Psi, *measure(lam, Psi), y)
        z = lam + sign * (z - lam)
        mean, cov = choose(*condition(x, z), z, p, lam, Psi)
        return z, *predict(mean, np.broadcast_to(cov, Psi.shape))

    return step


WRONG_FOS_STEPS: tuple[tuple[str, str, Answer], ...] = (
    (
        "predicted-as-aof",
        PREDICTED_AS_AOF,
        fos_step_with(choose=lambda u, T, z, p: (z, p)),
    ),
    ("mean-from-estimate", MEAN_FROM_ESTIMATE, fos_step_with(choose=lambda u, T, z, p: (z, T))),
    (
        "variance-from-aof",
        "The uncertainty of the prediction is T, the same for all trajectories, not p.",
        fos_step_with(choose=lambda u, T, z, p: (u, p)),
    ),
    *((name, says, fos_step_with(wrong)) for name, says, wrong in WRONG_CONDITIONS),
    ("variance-from-prediction", VARIANCE_FROM_PREDICTION, _fos_law(lambda u, T, z, p, lam, Psi: (u, Psi))),
    ("covariances-added", messages.ONE_COVARIANCE_TOO_MANY, _fos_law(lambda u, T, z, p, lam, Psi: (u, T + p))),
    ("innovation-sign", messages.INNOVATION_SIGN, _fos_law(lambda u, T, z, p, lam, Psi: (u, T), sign=-1.0)),
    (
        "u-returned",
        "z is the estimate of the correction; u is what the prediction starts from.",
        lambda lam, Psi, x, y, measure, predict: (
            condition(x, fos_step_with()(lam, Psi, x, y, measure, predict)[0])[0],
            *fos_step_with()(lam, Psi, x, y, measure, predict)[1:],
        ),
    ),
    (
        "certain-state",
        "The prediction starts as if u were the state itself: T is forgotten.",
        fos_step_with(choose=lambda u, T, z, p: (u, 0 * T)),
    ),
    (
        "state-for-u",
        "The prediction starts from the state; a filter does not know it.",
        lambda lam, Psi, x, y, measure, predict: (
            fos_step_with()(lam, Psi, x, y, measure, predict)[0],
            *predict(
                x, np.array(np.broadcast_to(condition(x, fos_step_with()(lam, Psi, x, y, measure, predict)[0])[1], Psi.shape))
            ),
        ),
    ),
)


# -- d3: one step of the MFOS

MFOS_TOO = ("estimate-itself", "regressed-the-other-way", "residual-is-variance")


def _mfos_law(
    choose: Callable[..., tuple[Array, Array]], regressor: Callable[[Array, Array], Array] = lambda sigma, lam: sigma
) -> Answer:
    """A step that predicts from another law, or fits another correction."""

    def step(
        lam: Array, Psi: Array, x: Array, y: Array, x_next: Array, measure: Callable, predict: Callable
    ) -> tuple[Array, ...]:
        z, p = correct(lam, Psi, *measure(lam, Psi), y)
        H, e, _ = regression(x - lam, regressor(z - lam, lam))
        z = lam + (z - lam) @ H.T + e
        mean, cov = choose(*condition(x, z), z, p, Psi)
        s, Psi_next = predict(mean, np.broadcast_to(cov, Psi.shape))
        return z, condition(x_next, s)[0], Psi_next

    return step


def _u_for_z(lam: Array, Psi: Array, x: Array, *rest: Any) -> tuple[Array, ...]:
    z, *following = mfos_step_with()(lam, Psi, x, *rest)
    return condition(x, z)[0], *following


WRONG_MFOS_STEPS: tuple[tuple[str, str, Answer], ...] = (
    (
        "correction-not-fitted",
        "The correction of the FOS is used as it is; the MFOS fits its size and offset over the ensemble.",
        mfos_step_with(correction=False),
    ),
    (
        "prediction-not-fitted",
        "The prediction of the FOS is used as it is; the MFOS fits it to x_next over the ensemble.",
        mfos_step_with(prediction=False),
    ),
    (
        "state-for-error",
        "The correction is fitted to the prediction's error x - lam, not to the state.",
        mfos_step_with(target=lambda x, lam: x),
    ),
    ("variance-from-aof", "Psi for the next step is Theta(u, T), not Theta(u, p).", mfos_step_with(own_variance=True)),
    ("means-not-subtracted", messages.MEANS_NOT_SUBTRACTED, mfos_step_with(fit=MOMENTS_ABOUT_ZERO)),
    ("offset-forgotten", messages.OFFSET_FORGOTTEN, mfos_step_with(fit=WITHOUT_OFFSET)),
    *((name, says, mfos_step_with(condition=wrong)) for name, says, wrong in WRONG_CONDITIONS if name in MFOS_TOO),
    (
        "mean-from-estimate",
        MEAN_FROM_ESTIMATE,
        _mfos_law(lambda u, T, z, p, Psi: (z, T)),
    ),
    ("predicted-as-aof", PREDICTED_AS_AOF, _mfos_law(lambda u, T, z, p, Psi: (z, p))),
    ("variance-from-prediction", VARIANCE_FROM_PREDICTION, _mfos_law(lambda u, T, z, p, Psi: (u, Psi))),
    ("estimate-conditioned", "The first result is the estimate z; u is only what the prediction starts from.", _u_for_z),
    (
        "state-for-correction",
        "The regressor is the correction sigma = z - lam, not the estimate itself.",
        _mfos_law(lambda u, T, z, p, Psi: (u, T), regressor=lambda sigma, lam: lam + sigma),
    ),
)
