"""Known mistakes in a whole run of the filter (g5)."""

from __future__ import annotations

from typing import Any

import numpy as np

from kfcourse.checks.question import Answer
from kfcourse.checks.steps import at_step
from kfcourse.exercises import messages
from kfcourse.exercises.g_extended.keys import Run, predict, run_filter, run_with
from kfcourse.exercises.g_extended.mistakes_of_filter import WRONG_CORRECTIONS, WRONG_PREDICTIONS
from kfcourse.exercises.shared import Map, first_step, next_step, step_before
from kfcourse.laws import Array

# -- g5: a whole run


def _linearised_once(y: Array, mean: Array, cov: Array, f: Map, Phi: Map, g: Map, D_xi: Array, S: Map, H: Map, D_n: Map) -> Run:
    def at_start(function: Map) -> Map:
        return lambda x: at_step(function, 0)(np.tile(mean, (len(x), 1)))

    return run_filter(y, mean, cov, f, at_start(Phi), g, D_xi, S, at_start(H), D_n)


def _predictions_as_estimates(*arguments: Any) -> Run:
    _, _, lam, Psi = run_filter(*arguments)
    return lam, Psi, lam, Psi


def _predictions_of_next(y: Array, mean: Array, cov: Array, *functions: Any) -> Run:
    z, p, lam, Psi = run_filter(y, mean, cov, *functions)
    f, Phi, g = (at_step(one, len(y) - 1) for one in functions[:3])
    following = predict(z[-1], p[-1], f, Phi, g, functions[3])
    return z, p, np.array([*lam[1:], following[0]]), np.array([*Psi[1:], following[1]])


WRONG_RUNS: tuple[tuple[str, str, Answer], ...] = (
    ("predicted-first", messages.PREDICTED_FIRST, run_with(first=True)),
    (
        "meter-jacobian-at-old-estimate",
        "The Jacobian of the meter is taken at the last estimate; the object has moved since: expand around the prediction.",
        run_with(meter_at=lambda lam, before: before),
    ),
    (
        "object-jacobian-at-prediction",
        "The Jacobian of the object is taken at the prediction for y_k; after the correction the estimate is the better place.",
        run_with(object_at=lambda z, lam: lam),
    ),
    (
        "linearised-once",
        "The Jacobians are taken at the prior mean for ever; the extended filter moves them along with its estimate.",
        _linearised_once,
    ),
    ("covariance-frozen", "The covariance starts anew at every step: hand Psi on, not only lam.", run_with(frozen=True)),
    (
        "covariance-not-predicted",
        "The gain is made of the covariance of the last estimate; it needs that of the prediction, after the object has moved.",
        run_with(lambda z, p, *functions: (predict(z, p, *functions)[0], p)),
    ),
    (
        "predictions-for-estimates",
        "The first two results are the predictions, before each measurement; return the estimates, after it.",
        _predictions_as_estimates,
    ),
    (
        "predictions-shifted",
        "lam and Psi are one step late: return those that y_k was compared with, not those for y_{k+1}.",
        _predictions_of_next,
    ),
    *(
        (name, says, run_with(correction=wrong))
        for name, says, wrong in WRONG_CORRECTIONS
        if name in ("innovation-sign", "covariance-kept", "forms-mixed")
    ),
    *(
        (name, says, run_with(wrong))
        for name, says, wrong in WRONG_PREDICTIONS
        if name in ("noise-forgotten", "jacobian-transposed", "noise-at-prediction")
    ),
    ("step-not-passed", messages.STEP_NOT_PASSED, run_with(f_at=first_step, S_at=first_step)),
    ("input-of-next-step", messages.INPUT_OF_NEXT_STEP, run_with(f_at=next_step)),
    ("input-of-step-before", messages.INPUT_OF_STEP_BEFORE, run_with(f_at=step_before)),
    ("input-of-step-before", messages.INPUT_OF_STEP_BEFORE, run_with(S_at=step_before)),
    ("steps-from-one", messages.STEPS_FROM_ONE, run_with(f_at=next_step, S_at=next_step)),
)
