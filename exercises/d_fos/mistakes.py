"""Known mistakes of set d, question by question, and what is said of each."""

from __future__ import annotations

import numpy as np

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.d_fos.keys import Condition, condition, fos_step_with, mfos_step_with
from kfcourse.exercises.shared import MOMENTS_ABOUT_ZERO, WITHOUT_OFFSET, Fit, covariance_of
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


WRONG_CONDITIONS: tuple[tuple[str, str, Condition], ...] = (
    ("estimate-itself", "u is not z itself: the estimate's scale and bias are corrected by the regression.", _error_variance),
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
        "T is divided by N - 1; use 1/N throughout.",
        lambda x, z: (condition(x, z)[0], condition(x, z)[1] * len(x) / (len(x) - 1)),
    ),
)


# -- d2: one step of the FOS

WRONG_FOS_STEPS: tuple[tuple[str, str, Answer], ...] = (
    (
        "predicted-as-aof",
        "That is the AOF's prediction, from z and p; the FOS carries no covariance: it predicts from u and T.",
        fos_step_with(choose=lambda u, T, z, p: (z, p)),
    ),
    ("mean-from-estimate", "The prediction's mean starts from u, not from z.", fos_step_with(choose=lambda u, T, z, p: (z, T))),
    (
        "variance-from-aof",
        "The uncertainty of the prediction is T, the same for all trajectories, not p.",
        fos_step_with(choose=lambda u, T, z, p: (u, p)),
    ),
    *((name, says, fos_step_with(wrong)) for name, says, wrong in WRONG_CONDITIONS),
)


# -- d3: one step of the MFOS

MFOS_TOO = ("estimate-itself", "regressed-the-other-way", "residual-is-variance")

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
)
