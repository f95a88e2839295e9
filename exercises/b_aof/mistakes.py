"""Known mistakes of set b, question by question, and what is said of each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kfcourse import laws
from kfcourse.checks.question import Answer
from kfcourse.checks.steps import at_step, full
from kfcourse.exercises import messages
from kfcourse.exercises.b_aof.keys import Gain, correct, gain, run_filter, run_with, step
from kfcourse.exercises.shared import first_step, next_step, step_before
from kfcourse.laws import Array, apply, transpose

# -- b1: the gain


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
    ("gain-without-Psi", messages.GAIN_WITHOUT_PSI, lambda Psi, G, F: laws.gain(transpose(G), F)),
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
    ("gain-multiplied", messages.GAIN_MULTIPLIED, lambda Psi, G, F: Psi @ transpose(G) @ F),
    (
        "state-twice",
        "F is the whole covariance of the measurement already; the state's part is in it twice.",
        lambda Psi, G, F: laws.gain(Psi @ transpose(G), F + G @ Psi @ transpose(G)),
    ),
    (
        "one-for-all",
        "There is one gain for all trajectories; each has its own.",
        lambda Psi, G, F: np.tile(gain(Psi, G, F).mean(axis=0), (len(Psi), 1, 1)),
    ),
    (
        "first-law",
        "The covariances of the first trajectory are taken for all.",
        lambda Psi, G, F: laws.gain(Psi[:1] @ transpose(G), F),
    ),
    (
        "mean-of-F",
        "F is averaged over the trajectories; each has its own.",
        lambda Psi, G, F: laws.gain(Psi @ transpose(G), np.broadcast_to(F.mean(axis=0), F.shape)),
    ),
)


# -- b2: the correction


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


def _state_expected(lam: Array, Psi: Array, h: Array, G: Array, F: Array, y: Array) -> tuple[Array, Array]:
    if y.shape != lam.shape:
        raise ValueError("only with as many measurements as states")
    return correct(lam, Psi, lam, G, F, y)


def _joseph_part(which: int) -> Answer:
    def answer(Psi: Array, G: Array, F: Array, R: Array) -> Array:
        K = gain(Psi, G, F)
        rest = np.eye(Psi.shape[-1]) - K @ G
        return rest @ Psi @ transpose(rest) if which == 0 else K @ R @ transpose(K)

    return answer


def _prediction_forgotten(lam: Array, Psi: Array, h: Array, G: Array, F: Array, y: Array) -> tuple[Array, Array]:
    z, p = correct(lam, Psi, h, G, F, y)
    return z - lam, p


WRONG_CORRECTIONS: tuple[tuple[str, str, Answer], ...] = (
    *((name, says, correction_with(of_gain=wrong)) for name, says, wrong in WRONG_GAINS),
    ("innovation-sign", messages.INNOVATION_SIGN, correction_with(innovation=lambda y, h: h - y)),
    ("innovation-without-h", messages.MEASUREMENT_FOR_INNOVATION, correction_with(innovation=lambda y, h: y)),
    ("covariance-kept", messages.COVARIANCE_KEPT, correction_with(covariance=lambda Psi, K, G, F: Psi)),
    ("covariance-added", messages.COVARIANCE_ADDED, correction_with(covariance=lambda Psi, K, G, F: Psi + K @ G @ Psi)),
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
    ("innovation-plus", messages.EXPECTED_ADDED, correction_with(innovation=lambda y, h: y + h)),
    ("innovation-of-state", messages.STATE_FOR_EXPECTED, _state_expected),
    ("share-only", messages.SHARE_ONLY, correction_with(covariance=lambda Psi, K, G, F: np.eye(Psi.shape[-1]) - K @ G)),
    ("covariance-explained", messages.EXPLAINED_ONLY, correction_with(covariance=lambda Psi, K, G, F: K @ G @ Psi)),
    (
        "noise-of-meter-missing",
        messages.NOISE_INHERITED,
        correction_with(covariance=lambda Psi, K, G, F: _joseph_part(0)(Psi, G, F, None)),
    ),
    ("prediction-not-added", messages.CORRECTION_ALONE, _prediction_forgotten),
    (
        "information",
        messages.INFORMATION_FOR_COVARIANCE,
        correction_with(covariance=lambda Psi, K, G, F: np.linalg.inv(Psi) + transpose(G) @ np.linalg.solve(F, G)),
    ),
    (
        "identity-for-Psi",
        "The identity stands in the place of Psi: check the units.",
        correction_with(covariance=lambda Psi, K, G, F: np.eye(Psi.shape[-1]) - K @ G @ Psi),
    ),
)


# -- b3: a whole step

Functions = tuple[Callable, Callable]


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
    (
        "covariances-added",
        messages.ONE_COVARIANCE_TOO_MANY,
        step_with(following=lambda lam, Psi, z, p, predict: (predict(z, p)[0], predict(z, p)[1] + p)),
    ),
    (
        "covariances-added",
        messages.ONE_COVARIANCE_TOO_MANY,
        step_with(following=lambda lam, Psi, z, p, predict: predict(z, Psi + p)),
    ),
    (
        "predicted-twice",
        "Two predictions are made; one leads to the next step.",
        step_with(following=lambda lam, Psi, z, p, predict: predict(*predict(z, p))),
    ),
)


# -- b4: a whole run, with measurements missing


def _predicted_first(y: Array, mean: Array, cov: Array, measure: Callable, predict: Callable) -> Array:
    lam, Psi = at_step(predict, 0)(mean[None], cov[None])
    return run_with(step, y, lam[0], Psi[0], measure, predict)


def _predictions(y: Array, mean: Array, cov: Array, measure: Callable, predict: Callable) -> Array:
    lam, Psi = np.tile(mean, (y.shape[1], 1)), full(cov, y.shape[1])
    predictions = []
    for k, one in enumerate(y):
        predictions.append(lam)
        *_, lam, Psi = step(lam, Psi, one, at_step(measure, k), at_step(predict, k))
    return np.array(predictions)


def _frozen(y: Array, mean: Array, cov: Array, measure: Callable, predict: Callable) -> Array:
    lam, Psi = np.tile(mean, (y.shape[1], 1)), full(cov, y.shape[1])
    estimates = []
    for k, one in enumerate(y):
        z, _, lam, _ = step(lam, Psi, one, at_step(measure, k), at_step(predict, k))
        estimates.append(z)
    return np.array(estimates)


def _zeros_for_missing(y: Array, mean: Array, cov: Array, measure: Callable, predict: Callable) -> Array:
    return run_filter(np.nan_to_num(y), mean, cov, measure, predict)


def _run_by(beat: Callable, y: Array, mean: Array, cov: Array, measure: Callable, predict: Callable) -> Array:
    """A run with another end of each step: beat(lam, Psi, z, p, missing, predict) -> what is returned, and the next lam, Psi."""
    lam, Psi = np.tile(mean, (y.shape[1], 1)), full(cov, y.shape[1])
    found = []
    for k, one in enumerate(y):
        missing = np.isnan(one).any(axis=-1)[:, None]
        z, p, *_ = step(lam, Psi, np.where(missing, 0.0, one), at_step(measure, k), at_step(predict, k))
        returned, lam, Psi = beat(lam, Psi, np.where(missing, lam, z), p, missing[:, None], at_step(predict, k))
        found.append(returned)
    return np.array(found)


def _next_returned(lam: Array, Psi: Array, z: Array, p: Array, missing: Array, predict: Callable) -> tuple[Array, ...]:
    following = predict(z, np.where(missing, Psi, p))
    return following[0], *following


WRONG_RUNS: tuple[tuple[str, str, Answer], ...] = (
    ("predicted-first", messages.PREDICTED_FIRST, _predicted_first),
    ("predictions-returned", messages.PREDICTIONS_RETURNED, _predictions),
    ("covariance-frozen", "The covariance never changes from step to step: hand Psi on, not only lam.", _frozen),
    ("missing-as-zero", messages.MISSING_AS_ZERO, _zeros_for_missing),
    (
        "surer-of-missing",
        "Where a measurement is missing the estimate stays, but the covariance shrinks all the same: nothing was learnt there.",
        lambda *a: _run_by(lambda lam, Psi, z, p, missing, predict: (z, *predict(z, p)), *a),
    ),
    *(
        (name, says, lambda *a, wrong=wrong: run_with(step_with(wrong), *a))
        for name, says, wrong in WRONG_CORRECTIONS
        if name not in ("gain-multiplied", "gain-not-divided")  # such a run overflows
    ),
    (
        "first-not-used",
        "The first measurement is not used; y_0 is a measurement of x_0 and corrects the prior.",
        lambda y, *rest: run_filter(np.concatenate([np.full_like(y[:1], np.nan), y[1:]]), *rest),
    ),
    ("step-not-passed", messages.STEP_NOT_PASSED, lambda *a: run_with(step, *a, first_step, first_step)),
    ("input-of-next-step", messages.INPUT_OF_NEXT_STEP, lambda *a: run_with(step, *a, predict_at=next_step)),
    ("input-of-step-before", messages.INPUT_OF_STEP_BEFORE, lambda *a: run_with(step, *a, measure_at=step_before)),
    ("input-of-step-before", messages.INPUT_OF_STEP_BEFORE, lambda *a: run_with(step, *a, predict_at=step_before)),
    ("steps-from-one", messages.STEPS_FROM_ONE, lambda *a: run_with(step, *a, next_step, next_step)),
    (
        "next-returned",
        "These are the predictions of the next step; return the estimates of this one.",
        lambda *a: _run_by(_next_returned, *a),
    ),
    (
        "estimate-not-handed-on",
        "The filter goes on from its prediction: what a measurement tells is lost at the next step.",
        lambda *a: _run_by(lambda lam, Psi, z, p, missing, predict: (z, *predict(lam, Psi)), *a),
    ),
)


# -- b5: a covariance that rounding cannot make negative


def _share_added(Psi: Array, G: Array, F: Array) -> Array:
    more = np.eye(Psi.shape[-1]) + gain(Psi, G, F) @ G
    return more @ Psi @ transpose(more)


WRONG_COVARIANCES: tuple[tuple[str, str, Answer], ...] = (
    (
        "cancellation",
        "On paper it is right. Where the meter is sharp it is the difference of two nearly equal numbers, and all digits "
        "are lost: write it as a sum or product of terms that cannot be negative.",
        lambda Psi, G, F, R: Psi - gain(Psi, G, F) @ G @ Psi,
    ),
    (
        "noise-of-meter-missing",
        messages.NOISE_INHERITED,
        _joseph_part(0),
    ),
    ("prior-part-missing", "Only the measurement's noise is there; part of the prediction's error remains too.", _joseph_part(1)),
    (
        "whole-covariance",
        "F has the state's part too; in this sum the noise alone, R, comes through the gain.",
        lambda Psi, G, F, R: _joseph_part(0)(Psi, G, F, R) + _joseph_part(1)(Psi, G, F, F),
    ),
    (
        "prior-part-kept",
        "The prediction's error is not reduced: what remains of it after the correction?",
        lambda Psi, G, F, R: Psi + _joseph_part(1)(Psi, G, F, R),
    ),
    (
        "noise-squared",
        messages.NOISE_SQUARED,
        lambda Psi, G, F, R: _joseph_part(0)(Psi, G, F, R) + _joseph_part(1)(Psi, G, F, R @ R),
    ),
    (
        "one-side-only",
        "What remains of the prediction's error enters once; a covariance has it on both sides.",
        lambda Psi, G, F, R: Psi - gain(Psi, G, F) @ G @ Psi + _joseph_part(1)(Psi, G, F, R),
    ),
    (
        "share-added",
        "What the measurement explains is added to the identity; it is subtracted from it.",
        lambda Psi, G, F, R: _share_added(Psi, G, F) + _joseph_part(1)(Psi, G, F, R),
    ),
    (
        "gain-forgotten",
        "The meter's noise reaches the estimate through the gain, on both sides.",
        lambda Psi, G, F, R: _joseph_part(0)(Psi, G, F, R) + R[..., :1, :1],
    ),
    (
        "noise-by-deviation",
        messages.NOISE_BY_DEVIATION,
        lambda Psi, G, F, R: _joseph_part(0)(Psi, G, F, R) + _joseph_part(1)(Psi, G, F, np.sqrt(R)),
    ),
)
