"""Questions of sets c and d: filters whose coefficients are regressions over an ensemble.

Set c is Pugachev's two-step conditionally optimal filter (DUOF), set d Rudenko's filters of optimal structure (FOS, MFOS).
Answers are functions of arrays: vectors of N trajectories (N, n), matrices (r, c), covariances (n, n) or (N, n, n).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from kfcourse.checks.exercises import Exercise
from kfcourse.checks.question import Answer, Question, catalogue
from kfcourse.checks.registry import ExerciseSet
from kfcourse.exercises.shared import RUNS, WRONG_REGRESSIONS, Fit, ensemble, predicted, regression
from kfcourse.laws import Array


def noiseless(exercise: Exercise) -> tuple[Callable, Callable]:
    """a(x, m_v) and b(x, m_w) of the hidden model, (N, n) -> (N, n) and (N, p)."""
    return exercise.hidden_noiseless


# -- c1: the structure


def structure(lam: Array, z: Array, y: Array, a: Callable, b: Callable) -> tuple[Array, Array]:
    return y - b(lam), a(z)


def structure_arguments(exercise: Exercise) -> list[tuple]:
    x, y, _ = ensemble(exercise, "c1")
    return [(predicted(exercise, "c1-lam", x), predicted(exercise, "c1-z", x), y, *noiseless(exercise))]


WRONG_STRUCTURES: tuple[tuple[str, str, Answer], ...] = (
    ("omega-sign", "The innovation is what came minus what was expected.", lambda lam, z, y, a, b: (b(lam) - y, a(z))),
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
)

# -- c2 and d1: regression


def regression_arguments(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("c2")
    n, p = exercise.model.n, exercise.model.p
    regressor = 0.7 + rng.normal(size=(RUNS, p))
    target = regressor @ rng.normal(size=(p, n)) + 1.3 + 0.5 * rng.normal(size=(RUNS, n))
    constant = np.concatenate([regressor, np.full((RUNS, 1), 2.0)], axis=1)  # a component that never varies
    return [(target, regressor), (target, constant)]


# -- c3: one step of the design


def design_step(lam: Array, x: Array, y: Array, x_next: Array, a: Callable, b: Callable) -> tuple[Array, Array]:
    return duof_step_with()(lam, x, y, x_next, a, b)


def duof_step_with(
    fit: Fit = regression,
    first: Callable[[Array, Array], Array] = lambda x, lam: x - lam,
    base: Callable[[Array], Array] = lambda lam: lam,
    alpha: Callable[[Array, Array, Callable], Array] = lambda z, lam, a: a(z),
) -> Answer:
    """One step of the DUOF's design on an ensemble, with one thing changed."""

    def step(lam: Array, x: Array, y: Array, x_next: Array, a: Callable, b: Callable) -> tuple[Array, Array]:
        omega = y - b(lam)
        H, e, _ = fit(first(x, lam), omega)
        z = base(lam) + omega @ H.T + e
        regressor = alpha(z, lam, a)
        F, g, _ = fit(x_next, regressor)
        return z, regressor @ F.T + g

    return step


def duof_arguments(exercise: Exercise) -> list[tuple]:
    x, y, x_next = ensemble(exercise, "c3")
    return [(predicted(exercise, "c3-lam", x), x, y, x_next, *noiseless(exercise))]


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
    (
        "means-not-subtracted",
        "The second moments are taken about zero; covariances are about the means.",
        duof_step_with(fit=WRONG_REGRESSIONS[0][2]),
    ),
    (
        "offset-forgotten",
        "The offset is the target's mean; what the matrix makes of the regressor's mean has to be subtracted.",
        duof_step_with(fit=WRONG_REGRESSIONS[1][2]),
    ),
)


# -- c4: coefficients found on one ensemble, used on another

Ensemble = tuple[Array, Array]


def design_and_run(x: Array, y_design: Array, y: Array, mean: Array, a: Callable, b: Callable) -> Array:
    return duof_run_with()(x, y_design, y, mean, a, b)


def duof_run_with(
    own_coefficients: bool = False, one_gain: bool = False, predictions: bool = False, object_alone: bool = False
) -> Answer:
    """Design over x, y (steps, N, ...), then filter other measurements; with one thing changed."""

    def run(x: Array, y_design: Array, y: Array, mean: Array, a: Callable, b: Callable) -> Array:
        lam, other = np.tile(mean, (x.shape[1], 1)), np.tile(mean, (y.shape[1], 1))
        estimates, first = [], None
        for k in range(len(x)):
            omega = y_design[k] - b(lam)
            H, e, _ = regression(x[k] - lam, omega)
            first = (H, e) if first is None else first
            if one_gain:
                H, e = first
            z = lam + omega @ H.T + e
            if own_coefficients:
                H, e = H, 0 * e
            z_other = other + (y[k] - b(other)) @ H.T + e
            estimates.append(other if predictions else z_other)
            if k + 1 < len(x):
                F, g, _ = regression(x[k + 1], a(z))
                lam, other = a(z) @ F.T + g, a(z_other) if object_alone else a(z_other) @ F.T + g
        return np.array(estimates)

    return run


def duof_run_arguments(exercise: Exercise) -> list[tuple]:
    x, y = exercise.simulate(RUNS, 4, "c4-design")
    return [(x, y, exercise.simulate(5, 4, "c4").y, exercise.model.prior.mean, *noiseless(exercise))]


WRONG_DUOF_RUNS: tuple[tuple[str, str, Answer], ...] = (
    (
        "part-of-ensemble",
        "The coefficients seem to come from a part of the design ensemble only; use all of its trajectories.",
        lambda x, yd, y, mean, a, b: design_and_run(x[:, : y.shape[1]], yd[:, : y.shape[1]], y, mean, a, b),
    ),
    ("one-gain", "H and e of the first step are used at every step; each step has its own.", duof_run_with(one_gain=True)),
    ("predictions-returned", "These are the predictions; return the estimates.", duof_run_with(predictions=True)),
    (
        "prediction-not-fitted",
        "The prediction is a(z) as it is; its coefficients F and g, found in the design, are not used.",
        duof_run_with(object_alone=True),
    ),
    ("offset-not-used", "The offset e is not used when the filter runs.", duof_run_with(own_coefficients=True)),
)

QUESTIONS = (
    Question(
        "c1",
        "innovation and alpha",
        "warm-up",
        structure,
        structure_arguments,
        catalogue(WRONG_STRUCTURES),
        ("omega", "alpha"),
    ),
    Question(
        "c2",
        "regression over the ensemble",
        "core",
        regression,
        regression_arguments,
        catalogue(WRONG_REGRESSIONS),
        ("matrix", "offset", "residual"),
    ),
    Question(
        "c3",
        "one step of the design",
        "core",
        design_step,
        duof_arguments,
        catalogue(WRONG_DUOF_STEPS),
        ("z", "lam_next"),
    ),
    Question(
        "c4", "designed on one ensemble, run on another", "core", design_and_run, duof_run_arguments, catalogue(WRONG_DUOF_RUNS)
    ),
)

SET = ExerciseSet("c", "The two-step conditionally optimal filter", Path(__file__).parent, QUESTIONS)
