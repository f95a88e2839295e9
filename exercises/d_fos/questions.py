"""Questions of set d: filters of optimal structure (FOS, MFOS), whose coefficients are regressions over an ensemble.

Answers are functions of arrays: vectors of N trajectories (N, n), matrices (r, c), covariances (n, n) or (N, n, n).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from kfcourse.checks.exercises import Exercise, array_functions, full
from kfcourse.checks.question import Answer, Question, catalogue
from kfcourse.checks.registry import ExerciseSet
from kfcourse.exercises.b_aof.questions import correct
from kfcourse.exercises.shared import RUNS, WRONG_REGRESSIONS, Fit, covariance_of, ensemble, predicted, regression
from kfcourse.laws import Array

# -- set d: filters of optimal structure


def condition(x: Array, z: Array) -> tuple[Array, Array]:
    """u = Gamma z + chi and T: what the estimate says of the state."""
    matrix, offset, residual = regression(x, z)
    return z @ matrix.T + offset, residual


def condition_with(fit: Fit) -> Callable[[Array, Array], tuple[Array, Array]]:
    def condition(x: Array, z: Array) -> tuple[Array, Array]:
        matrix, offset, residual = fit(x, z)
        return z @ matrix.T + offset, residual

    return condition


def condition_arguments(exercise: Exercise) -> list[tuple]:
    x, _, _ = ensemble(exercise, "d1")
    return [(x, 0.2 + predicted(exercise, "d1-z", 1.3 * x))]


def _standard_deviation(x: Array, z: Array) -> tuple[Array, Array]:
    u, T = condition(x, z)
    return u, np.sqrt(np.maximum(T, 0.0))


def _error_variance(x: Array, z: Array) -> tuple[Array, Array]:
    return z, (x - z).T @ (x - z) / len(x)


WRONG_CONDITIONS: tuple[tuple[str, str, Callable], ...] = (
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
    (
        "means-not-subtracted",
        "The second moments are taken about zero; covariances are about the means.",
        condition_with(WRONG_REGRESSIONS[0][2]),
    ),
    (
        "offset-forgotten",
        "The offset chi is the state's mean; what Gamma makes of the estimate's mean has to be subtracted.",
        condition_with(WRONG_REGRESSIONS[1][2]),
    ),
    (
        "unbiased-residual",
        "T is divided by N - 1; use 1/N throughout.",
        lambda x, z: (condition(x, z)[0], condition(x, z)[1] * len(x) / (len(x) - 1)),
    ),
)

Condition = Callable[[Array, Array], tuple[Array, Array]]


def _predicting(predict: Callable, mean: Array, cov: Array) -> tuple[Array, Array]:
    return predict(mean, full(np.asarray(cov), len(mean)))


def fos_step(lam: Array, Psi: Array, x: Array, y: Array, measure: Callable, predict: Callable) -> tuple[Array, ...]:
    return fos_step_with()(lam, Psi, x, y, measure, predict)


def fos_step_with(
    condition: Condition = condition, choose: Callable[..., tuple[Array, Array]] = lambda u, T, z, p: (u, T)
) -> Answer:
    """One step of the FOS's design, with another condition or another choice of what the prediction starts from."""

    def step(lam: Array, Psi: Array, x: Array, y: Array, measure: Callable, predict: Callable) -> tuple[Array, ...]:
        h, G, F = measure(lam, Psi)
        z, p = correct(lam, Psi, h, G, F, y)
        return z, *_predicting(predict, *choose(*condition(x, z), z, p))

    return step


def fos_arguments(exercise: Exercise, name: str = "d2") -> list[tuple]:
    x, y, _ = ensemble(exercise, name)
    lam = predicted(exercise, f"{name}-lam", x)
    Psi = full(covariance_of(x - lam, x - lam), RUNS) * (1 + 0.3 * exercise.rng(f"{name}-Psi").random((RUNS, 1, 1)))
    return [(lam, Psi, x, y, *array_functions(exercise.hidden.gaussian))]


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


def mfos_step(
    lam: Array, Psi: Array, x: Array, y: Array, x_next: Array, measure: Callable, predict: Callable
) -> tuple[Array, ...]:
    return mfos_step_with()(lam, Psi, x, y, x_next, measure, predict)


def mfos_step_with(
    fit: Fit = regression,
    correction: bool = True,
    prediction: bool = True,
    target: Callable[[Array, Array], Array] = lambda x, lam: x - lam,
    condition: Condition = condition,
    own_variance: bool = False,
) -> Answer:
    """One step of the MFOS's design, with one thing changed."""

    def step(
        lam: Array, Psi: Array, x: Array, y: Array, x_next: Array, measure: Callable, predict: Callable
    ) -> tuple[Array, ...]:
        h, G, F = measure(lam, Psi)
        z, p = correct(lam, Psi, h, G, F, y)
        sigma = z - lam
        if correction:
            H, e, _ = fit(target(x, lam), sigma)
            z = lam + sigma @ H.T + e
        u, T = condition(x, z)
        s, Psi_next = _predicting(predict, u, p if own_variance else T)
        if prediction:
            F, g, _ = fit(x_next, s)
            s = s @ F.T + g
        return z, s, Psi_next

    return step


def mfos_arguments(exercise: Exercise) -> list[tuple]:
    x, y, x_next = ensemble(exercise, "d3")
    lam, Psi, _, _, measure, predict = fos_arguments(exercise, "d3")[0]
    return [(lam, Psi, x, y, x_next, measure, predict)]


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
    (
        "means-not-subtracted",
        "The second moments are taken about zero; covariances are about the means.",
        mfos_step_with(fit=WRONG_REGRESSIONS[0][2]),
    ),
    (
        "offset-forgotten",
        "An offset is the target's mean; what the matrix makes of the regressor's mean has to be subtracted.",
        mfos_step_with(fit=WRONG_REGRESSIONS[1][2]),
    ),
    *((name, says, mfos_step_with(condition=wrong)) for name, says, wrong in WRONG_CONDITIONS[:3]),
)


def condition_on_both(x: Array, y: Array, z: Array) -> tuple[Array, Array]:
    """u and T from the measurement and the estimate together."""
    return condition(x, np.concatenate([y, z], axis=1))


def three_arguments_hidden(exercise: Exercise) -> list[tuple]:
    x, y, _ = ensemble(exercise, "d4")
    return [(x, y, predicted(exercise, "d4-z", x))]


QUESTIONS = (
    Question(
        "d1",
        "what the estimate says of the state",
        "warm-up",
        condition,
        condition_arguments,
        catalogue(WRONG_CONDITIONS),
        ("u", "T"),
    ),
    Question(
        "d2",
        "one step of the FOS",
        "core",
        fos_step,
        fos_arguments,
        catalogue(WRONG_FOS_STEPS),
        ("z", "lam_next", "Psi_next"),
    ),
    Question(
        "d3",
        "one step of the MFOS",
        "core",
        mfos_step,
        mfos_arguments,
        catalogue(WRONG_MFOS_STEPS),
        ("z", "lam_next", "Psi_next"),
    ),
    Question(
        "d4",
        "three arguments",
        "stretch",
        condition_on_both,
        three_arguments_hidden,
        catalogue(
            (
                (
                    "measurement-unused",
                    "Only the estimate is used; the measurement may tell more.",
                    lambda x, y, z: condition(x, z),
                ),
                (
                    "estimate-unused",
                    "Only the measurement is used; the estimate knows the past.",
                    lambda x, y, z: condition(x, y),
                ),
            )
        ),
        ("u", "T"),
    ),
)

SET = ExerciseSet("d", "Filters of optimal structure", Path(__file__).parent, QUESTIONS)
