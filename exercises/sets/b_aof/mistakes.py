"""Known mistakes of set b, question by question: edits of the keys, and what is said of each."""

from __future__ import annotations

from kfcourse.exercises.checks.editing import edits
from kfcourse.exercises.sets import messages
from kfcourse.exercises.sets.b_aof.keys import correct, covariance, gain, run_filter, step

DIVIDED = "laws.gain(Psi @ transpose(G), F)"
WRONG_GAINS = edits(
    gain,
    (
        "gain-not-divided",
        "The gain is not divided by the covariance F of the measurement.",
        DIVIDED,
        "Psi @ transpose(G)",
    ),
    (
        "gain-by-standard-deviation",
        "The gain is divided by a standard deviation; the variance F belongs there.",
        DIVIDED,
        "transpose(np.linalg.solve(transpose(np.linalg.cholesky(F)), G @ Psi))",
    ),
    (
        "gain-without-G",
        "The meter's sensitivity G is missing in the gain.",
        DIVIDED,
        "laws.gain(Psi, F)",
    ),
    ("gain-without-Psi", messages.GAIN_WITHOUT_PSI, "Psi @ transpose(G)", "transpose(G)"),
    (
        "gain-of-noise",
        "The gain is divided by the noise's part only; F is the whole variance of the "
        "measurement, the state's part included.",
        ", F)\n",
        ", F - G @ Psi @ transpose(G))\n",
    ),
    ("gain-multiplied", messages.GAIN_MULTIPLIED, DIVIDED, "Psi @ transpose(G) @ F"),
    (
        "state-twice",
        "F is the whole covariance of the measurement already; the state's part is in it twice.",
        ", F)\n",
        ", F + G @ Psi @ transpose(G))\n",
    ),
    (
        "first-law",
        "The covariances of the first trajectory are taken for all.",
        "(Psi @ transpose(G)",
        "(Psi[:1] @ transpose(G)",
    ),
)

WRONG_CORRECTIONS = edits(
    correct,
    ("innovation-sign", messages.INNOVATION_SIGN, "y - h", "h - y"),
    ("innovation-without-h", messages.MEASUREMENT_FOR_INNOVATION, "y - h)", "y)"),
    ("innovation-of-state", messages.STATE_FOR_EXPECTED, "y - h)", "y - lam)"),
    ("covariance-kept", messages.COVARIANCE_KEPT, " - K @ G @ Psi", ""),
    ("covariance-added", messages.COVARIANCE_ADDED, "- K @ G", "+ K @ G"),
    (
        "covariance-once",
        "K G is a share, without units: it has to be multiplied by Psi before it is subtracted "
        "from it.",
        "K @ G @ Psi",
        "K @ G",
    ),
    (
        "covariance-of-gain",
        "G is missing in the covariance of the estimate.",
        "K @ G @ Psi",
        "K @ Psi",
    ),
    ("prediction-not-added", messages.CORRECTION_ALONE, "return lam + ", "return "),
)

WRONG_STEPS = edits(
    step,
    (
        "beats-swapped",
        "Prediction and correction are swapped: lam and Psi are already the prediction for this "
        "measurement.",
        "    h, G, F",
        "    lam, Psi = predict(lam, Psi)\n    h, G, F",
        "*predict(z, p)",
        "lam, Psi",
    ),
    (
        "predicted-from-prediction",
        "The prediction starts from lam and Psi again, as if nothing had been measured; it starts "
        "from z and p.",
        "predict(z, p)",
        "predict(lam, Psi)",
    ),
    (
        "covariance-not-predicted",
        "Psi for the next step is not p: the object moves and is shaken meanwhile.",
        "*predict(z, p)",
        "predict(z, p)[0], p",
    ),
    (
        "mean-not-predicted",
        "lam for the next step is not z: it is where the object is expected to be then.",
        "*predict(z, p)",
        "z, predict(z, p)[1]",
    ),
    (
        "variance-mixed",
        "The prediction takes Psi in place of p: the uncertainty before the measurement, not "
        "after it.",
        "predict(z, p)",
        "predict(z, Psi)",
    ),
    ("covariances-added", messages.ONE_COVARIANCE_TOO_MANY, "predict(z, p)", "predict(z, Psi + p)"),
    (
        "predicted-twice",
        "Two predictions are made; one leads to the next step.",
        "predict(z, p)",
        "predict(*predict(z, p))",
    ),
)

WRONG_RUNS = edits(
    run_filter,
    (
        "predicted-first",
        messages.PREDICTED_FIRST,
        "    estimates = []",
        "    lam, Psi = at_step(predict, 0)(lam, Psi); estimates = []",
    ),
    ("predictions-returned", messages.PREDICTIONS_RETURNED, "append(z)", "append(lam)"),
    (
        "covariance-frozen",
        "The covariance never changes from step to step: hand Psi on, not only lam.",
        "lam, Psi = predict_k(z, p)",
        "lam, _ = predict_k(z, p)",
    ),
    ("missing-as-zero", messages.MISSING_AS_ZERO, "enumerate(y)", "enumerate(np.nan_to_num(y))"),
    (
        "surer-of-missing",
        "Where a measurement is missing the estimate stays, but the covariance shrinks all the "
        "same: nothing was learnt there.",
        "np.where(missing[:, None], Psi, p)",
        "p",
    ),
    ("innovation-sign", messages.INNOVATION_SIGN, "y - h", "h - y"),
    ("covariance-kept", messages.COVARIANCE_KEPT, " - K @ G @ Psi", ""),
    (
        "step-not-passed",
        messages.STEP_NOT_PASSED,
        "at_step(measure, k), at_step(predict, k)",
        "at_wrong_step(measure, 0), at_wrong_step(predict, 0)",
    ),
    (
        "input-of-next-step",
        messages.INPUT_OF_NEXT_STEP,
        "at_step(predict, k)",
        "at_wrong_step(predict, k + 1)",
    ),
    (
        "input-of-step-before",
        messages.INPUT_OF_STEP_BEFORE,
        "at_step(measure, k)",
        "at_wrong_step(measure, k - 1)",
    ),
    (
        "input-of-step-before",
        messages.INPUT_OF_STEP_BEFORE,
        "at_step(predict, k)",
        "at_wrong_step(predict, k - 1)",
    ),
    (
        "steps-from-one",
        messages.STEPS_FROM_ONE,
        "at_step(measure, k), at_step(predict, k)",
        "at_wrong_step(measure, k + 1), at_wrong_step(predict, k + 1)",
    ),
)

KEPT, NOISE = "rest @ Psi @ transpose(rest)", "K @ R @ transpose(K)"
WRONG_COVARIANCES = edits(
    covariance,
    (
        "cancellation",
        "On paper it is right. Where the meter is sharp it is the difference of two nearly equal "
        "numbers, and all digits "
        "are lost: write it as a sum or product of terms that cannot be negative.",
        f"{KEPT} + {NOISE}",
        "Psi - K @ G @ Psi",
    ),
    ("noise-of-meter-missing", messages.NOISE_INHERITED, f" + {NOISE}", ""),
    (
        "prior-part-missing",
        "Only the measurement's noise is there; part of the prediction's error remains too.",
        f"{KEPT} + ",
        "",
    ),
    (
        "whole-covariance",
        "F has the state's part too; in this sum the noise alone, R, comes through the gain.",
        NOISE,
        "K @ F @ transpose(K)",
    ),
    (
        "prior-part-kept",
        "The prediction's error is not reduced: what remains of it after the correction?",
        KEPT,
        "Psi",
    ),
    ("noise-squared", messages.NOISE_SQUARED, NOISE, "K @ R @ R @ transpose(K)"),
    (
        "one-side-only",
        "What remains of the prediction's error enters once; a covariance has it on both sides.",
        KEPT,
        "rest @ Psi",
    ),
    (
        "share-added",
        "What the measurement explains is added to the identity; it is subtracted from it.",
        "[-1]) - K @ G",
        "[-1]) + K @ G",
    ),
)
