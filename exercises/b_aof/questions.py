"""Questions of set b: the Gaussian approximation of the absolutely optimal filter, step by step.

Answers are functions of arrays over an ensemble: vectors (N, n), matrices (N, r, c).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from kfcourse import laws
from kfcourse.checks.exercises import Exercise, array_functions, full
from kfcourse.checks.question import Answer, Question, catalogue
from kfcourse.checks.registry import ExerciseSet
from kfcourse.laws import Array, Gaussian, Measurement, apply, transpose

RUNS = 6  # hidden trajectories


def law(exercise: Exercise, name: str) -> Gaussian:
    """A hidden normal law for every trajectory, near the prior; correlated where the state has components."""
    rng, prior = exercise.rng(name), exercise.model.prior
    n = exercise.model.n
    scale = np.sqrt(np.diagonal(prior.cov))
    mean = prior.mean + scale * rng.normal(size=(RUNS, n))
    roots = scale[:, None] * (np.eye(n) + 0.4 * rng.normal(size=(RUNS, n, n)))
    return Gaussian(mean, 0.3 * roots @ transpose(roots))


def measurement(exercise: Exercise, at: Gaussian) -> Measurement:
    """Structural functions of a hidden meter at a law, one of each for every trajectory."""
    h, G, F, R = exercise.hidden.gaussian.measure(*at)
    return Measurement(np.array(np.broadcast_to(h, (RUNS, exercise.model.p))), full(G, RUNS), full(F, RUNS), full(R, RUNS))


def measured(exercise: Exercise, name: str, expected: Measurement) -> Array:
    """Hidden measurements about one standard deviation from what is expected, (N, p)."""
    deviation = np.sqrt(np.diagonal(expected.F, axis1=-2, axis2=-1))
    return expected.h + deviation * exercise.rng(name).normal(size=expected.h.shape)


def structure_functions(exercise: Exercise) -> tuple[Callable, Callable]:
    """(measure, predict) as students get them: h, G, F and tau, Theta, full arrays."""
    return array_functions(exercise.hidden.gaussian)


# -- b1: the gain

Gain = Callable[[Array, Array, Array], Array]


def gain(Psi: Array, G: Array, F: Array) -> Array:
    return laws.gain(Psi @ transpose(G), F)


def gain_arguments(exercise: Exercise) -> list[tuple]:
    at = law(exercise, "b1")
    _, G, F, _ = measurement(exercise, at)
    return [(at.cov, G, F)]


def _root(F: Array) -> Array:
    return np.linalg.cholesky(F)


def _only_square(G: Array) -> Array:
    if G.shape[-1] != G.shape[-2]:
        raise ValueError("only with as many measurements as states")
    return np.broadcast_to(np.eye(G.shape[-1]), G.shape)


WRONG_GAINS: tuple[tuple[str, str, Gain], ...] = (
    ("gain-not-divided", "The gain is not divided by the covariance F of the measurement.", lambda Psi, G, F: Psi @ transpose(G)),
    (
        "gain-by-standard-deviation",
        "The gain is divided by a standard deviation; the variance F belongs there.",
        lambda Psi, G, F: np.linalg.solve(transpose(_root(F)), transpose(Psi @ transpose(G))).swapaxes(-1, -2),
    ),
    (
        "gain-without-G",
        "The meter's sensitivity G is missing in the gain.",
        lambda Psi, G, F: laws.gain(Psi @ _only_square(G), F),
    ),
    (
        "gain-without-Psi",
        "The covariance Psi of the prediction is missing in the gain: how sure was the filter before?",
        lambda Psi, G, F: laws.gain(transpose(G), F),
    ),
    (
        "gain-transposed",
        "The gain is transposed: it has as many rows as states and as many columns as measurements.",
        lambda Psi, G, F: transpose(gain(Psi, G, F)),
    ),
    (
        "gain-of-noise",
        "The gain is divided by the noise's part only; F is the whole variance of the measurement, the state's part included.",
        lambda Psi, G, F: laws.gain(Psi @ transpose(G), F - G @ Psi @ transpose(G)),
    ),
)

# -- b2: the correction


def correct(lam: Array, Psi: Array, h: Array, G: Array, F: Array, y: Array) -> tuple[Array, Array]:
    z, p = laws.correct(Gaussian(lam, Psi), Measurement(h, G, F, F - G @ Psi @ transpose(G)), y)
    return z, full(p, len(lam))


def correction_with(
    of_gain: Gain = gain,
    innovation: Callable[[Array, Array], Array] = lambda y, h: y - h,
    covariance: Callable[[Array, Array, Array, Array], Array] = lambda Psi, K, G, F: Psi - K @ G @ Psi,
) -> Answer:
    """A correction with one thing changed."""

    def answer(lam: Array, Psi: Array, h: Array, G: Array, F: Array, y: Array) -> tuple[Array, Array]:
        K = of_gain(Psi, G, F)
        return lam + apply(K, innovation(y, h)), covariance(Psi, K, G, F)

    return answer


def correction_arguments(exercise: Exercise) -> list[tuple]:
    at = law(exercise, "b2")
    expected = measurement(exercise, at)
    return [(at.mean, at.cov, expected.h, expected.G, expected.F, measured(exercise, "b2-y", expected))]


WRONG_CORRECTIONS: tuple[tuple[str, str, Answer], ...] = (
    *((name, says, correction_with(of_gain=wrong)) for name, says, wrong in WRONG_GAINS),
    (
        "innovation-sign",
        "The innovation has the wrong sign: it is what came minus what was expected.",
        correction_with(innovation=lambda y, h: h - y),
    ),
    (
        "innovation-without-h",
        "The measurement itself is multiplied by the gain; subtract what was expected, h.",
        correction_with(innovation=lambda y, h: y),
    ),
    (
        "covariance-kept",
        "The covariance is unchanged: a measurement must make the filter surer.",
        correction_with(covariance=lambda Psi, K, G, F: Psi),
    ),
    (
        "covariance-added",
        "The covariance grows: what the measurement explains is subtracted.",
        correction_with(covariance=lambda Psi, K, G, F: Psi + K @ G @ Psi),
    ),
    (
        "covariance-once",
        "K G is a share, without units: it has to be multiplied by Psi before it is subtracted from it.",
        correction_with(covariance=lambda Psi, K, G, F: Psi - K @ G),
    ),
    (
        "covariance-of-gain",
        "G is missing in the covariance of the estimate.",
        correction_with(covariance=lambda Psi, K, G, F: Psi - K @ _only_square(G) @ Psi),
    ),
)

# -- b3: a whole step

Functions = tuple[Callable, Callable]


def step(lam: Array, Psi: Array, y: Array, measure: Callable, predict: Callable) -> tuple[Array, ...]:
    h, G, F = measure(lam, Psi)
    z, p = correct(lam, Psi, h, G, F, y)
    return z, p, *predict(z, p)


def step_with(correction: Answer = correct, following: Callable[..., tuple[Array, Array]] | None = None) -> Answer:
    """A step with another correction, or another prediction: (lam, Psi, z, p, predict) -> (lam, Psi)."""

    def answer(lam: Array, Psi: Array, y: Array, measure: Callable, predict: Callable) -> tuple[Array, ...]:
        z, p = correction(lam, Psi, *measure(lam, Psi), y)
        return z, p, *(predict(z, p) if following is None else following(lam, Psi, z, p, predict))

    return answer


def _swapped(lam: Array, Psi: Array, y: Array, measure: Callable, predict: Callable) -> tuple[Array, ...]:
    lam, Psi = predict(lam, Psi)
    h, G, F = measure(lam, Psi)
    z, p = correct(lam, Psi, h, G, F, y)
    return z, p, lam, Psi


def step_arguments(exercise: Exercise) -> list[tuple]:
    at = law(exercise, "b3")
    y = measured(exercise, "b3-y", measurement(exercise, at))
    return [(*at, y, *structure_functions(exercise))]


WRONG_STEPS: tuple[tuple[str, str, Answer], ...] = (
    (
        "beats-swapped",
        "Prediction and correction are swapped: lam and Psi are already the prediction for this measurement.",
        _swapped,
    ),
    (
        "predicted-from-prediction",
        "The prediction starts from lam and Psi again, as if nothing had been measured; it starts from z and p.",
        step_with(following=lambda lam, Psi, z, p, predict: predict(lam, Psi)),
    ),
    (
        "covariance-not-predicted",
        "Psi for the next step is not p: the object moves and is shaken meanwhile.",
        step_with(following=lambda lam, Psi, z, p, predict: (predict(z, p)[0], p)),
    ),
    (
        "mean-not-predicted",
        "lam for the next step is not z: it is where the object is expected to be then.",
        step_with(following=lambda lam, Psi, z, p, predict: (z, predict(z, p)[1])),
    ),
    (
        "variance-mixed",
        "The prediction takes Psi in place of p: the uncertainty before the measurement, not after it.",
        step_with(following=lambda lam, Psi, z, p, predict: predict(z, Psi)),
    ),
    *((name, says, step_with(wrong)) for name, says, wrong in WRONG_CORRECTIONS if name.startswith(("innovation", "covariance"))),
)

# -- b4: a whole run, with measurements missing


def run_filter(y: Array, mean: Array, cov: Array, measure: Callable, predict: Callable) -> Array:
    return run_with(step, y, mean, cov, measure, predict)


def run_with(step: Answer, y: Array, mean: Array, cov: Array, measure: Callable, predict: Callable) -> Array:
    """Estimates of a filter over y (steps, N, p); a trajectory whose measurement is missing keeps its prediction."""
    lam, Psi = np.tile(mean, (y.shape[1], 1)), full(cov, y.shape[1])
    estimates = []
    for measurement_k in y:
        missing = np.isnan(measurement_k).any(axis=-1)
        z, p, *_ = step(lam, Psi, np.where(missing[:, None], 0.0, measurement_k), measure, predict)
        z, p = np.where(missing[:, None], lam, z), np.where(missing[:, None, None], Psi, p)
        estimates.append(z)
        lam, Psi = predict(z, p)
    return np.array(estimates)


def run_arguments(exercise: Exercise) -> list[tuple]:
    y = exercise.simulate(runs=RUNS, steps=6, name="b4").y
    gaps = y.copy()
    gaps[2, 1] = gaps[4, :3] = np.nan
    prior = exercise.model.prior
    return [(values, prior.mean, prior.cov, *structure_functions(exercise)) for values in (y, gaps)]


def _predicted_first(y: Array, mean: Array, cov: Array, measure: Callable, predict: Callable) -> Array:
    lam, Psi = predict(mean[None], cov[None])
    return run_with(step, y, lam[0], Psi[0], measure, predict)


def _predictions(y: Array, mean: Array, cov: Array, measure: Callable, predict: Callable) -> Array:
    lam, Psi = np.tile(mean, (y.shape[1], 1)), full(cov, y.shape[1])
    predictions = []
    for one in y:
        predictions.append(lam)
        *_, lam, Psi = step(lam, Psi, one, measure, predict)
    return np.array(predictions)


def _frozen(y: Array, mean: Array, cov: Array, measure: Callable, predict: Callable) -> Array:
    lam, Psi = np.tile(mean, (y.shape[1], 1)), full(cov, y.shape[1])
    estimates = []
    for one in y:
        z, _, lam, _ = step(lam, Psi, one, measure, predict)
        estimates.append(z)
    return np.array(estimates)


def _zeros_for_missing(y: Array, mean: Array, cov: Array, measure: Callable, predict: Callable) -> Array:
    return run_filter(np.nan_to_num(y), mean, cov, measure, predict)


WRONG_RUNS: tuple[tuple[str, str, Answer], ...] = (
    (
        "predicted-first",
        "The filter predicts before the first measurement; the prior is already the law of x_0, so correct with y_0 first.",
        _predicted_first,
    ),
    ("predictions-returned", "These are the predictions, before each measurement; return the estimates, after it.", _predictions),
    ("covariance-frozen", "The covariance never changes from step to step: hand Psi on, not only lam.", _frozen),
    (
        "missing-as-zero",
        "A missing measurement is treated as the number 0; it says nothing, so the prediction stays.",
        _zeros_for_missing,
    ),
    *(
        (name, says, lambda *a, wrong=wrong: run_with(step_with(wrong), *a))
        for name, says, wrong in WRONG_CORRECTIONS
        if name in ("innovation-sign", "covariance-kept")
    ),
)

# -- b5: a covariance that rounding cannot make negative


def covariance(Psi: Array, G: Array, F: Array, R: Array) -> Array:
    at = Gaussian(np.zeros(Psi.shape[:-1]), Psi)
    zero = np.zeros(F.shape[:-1])
    return full(laws.correct(at, Measurement(zero, G, F, R), zero).cov, len(Psi))


def covariance_arguments(exercise: Exercise) -> list[tuple]:
    at = law(exercise, "b5")
    _, G, _, R = measurement(exercise, at)
    one, sharp = np.full((RUNS, 1, 1), 0.7), np.full((RUNS, 1, 1), 1e-18)  # a scalar meter, far sharper than the prediction
    return [(Psi, G, G @ Psi @ transpose(G) + R, R) for Psi, G, R in ((at.cov, G, R), (one, 2 * one, sharp))]


def _joseph_part(which: int) -> Answer:
    def answer(Psi: Array, G: Array, F: Array, R: Array) -> Array:
        K = gain(Psi, G, F)
        rest = np.eye(Psi.shape[-1]) - K @ G
        return (rest @ Psi @ transpose(rest), K @ R @ transpose(K))[which]

    return answer


WRONG_COVARIANCES: tuple[tuple[str, str, Answer], ...] = (
    (
        "cancellation",
        "On paper it is right. Where the meter is sharp it is the difference of two nearly equal numbers, and all digits "
        "are lost: write it as a sum or product of terms that cannot be negative.",
        lambda Psi, G, F, R: Psi - gain(Psi, G, F) @ G @ Psi,
    ),
    (
        "noise-of-meter-missing",
        "The estimate inherits noise from the measurement through the gain: a term is missing.",
        _joseph_part(0),
    ),
    ("prior-part-missing", "Only the measurement's noise is there; part of the prediction's error remains too.", _joseph_part(1)),
)


QUESTIONS = (
    Question("b1", "the gain", "warm-up", gain, gain_arguments, catalogue(WRONG_GAINS)),
    Question(
        "b2",
        "the correction",
        "core",
        correct,
        correction_arguments,
        catalogue(WRONG_CORRECTIONS),
        ("z", "p"),
    ),
    Question(
        "b3",
        "one step",
        "core",
        step,
        step_arguments,
        catalogue(WRONG_STEPS),
        ("z", "p", "lam_next", "Psi_next"),
    ),
    Question("b4", "a run", "core", run_filter, run_arguments, catalogue(WRONG_RUNS)),
    Question(
        "b5",
        "a covariance that survives rounding",
        "stretch",
        covariance,
        covariance_arguments,
        catalogue(WRONG_COVARIANCES),
        tolerance=1e-6,
    ),
)

SET = ExerciseSet("b", "Approximations of the absolutely optimal filter", Path(__file__).parent, QUESTIONS)
