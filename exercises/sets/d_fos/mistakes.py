"""Known mistakes of set d, question by question: edits of the keys, and what is said of each."""

from __future__ import annotations

from kfcourse.exercises.checks.editing import edits
from kfcourse.exercises.sets import messages
from kfcourse.exercises.sets.d_fos.keys import condition, condition_on_both, fos_step, mfos_step
from kfcourse.exercises.sets.shared import MOMENTS, OFFSET

ESTIMATE_ITSELF = (
    "u is not z itself: the estimate's scale and bias are corrected by the regression."
)
PREDICTED_AS_AOF = (
    "That is the AOF's prediction, from z and p; the FOS carries no covariance: it "
    "predicts from u and T."
)
MEAN_FROM_ESTIMATE = "The prediction's mean starts from u, not from z."
VARIANCE_FROM_PREDICTION = (
    "The uncertainty Psi from before the measurement is carried on; it is T after it."
)
ERROR = "(x - z).T @ (x - z) / len(x)"

WRONG_CONDITIONS = edits(
    condition,
    ("estimate-itself", ESTIMATE_ITSELF, "z @ Gamma.T + chi, T", f"z, {ERROR}"),
    ("estimate-itself", ESTIMATE_ITSELF, "z @ Gamma.T + chi", "z"),
    ("error-for-residual", messages.ERROR_FOR_RESIDUAL, "+ chi, T", f"+ chi, {ERROR}"),
    ("scale-forgotten", messages.SCALE_FORGOTTEN, "z @ Gamma.T + chi", "z + chi"),
    (
        "regressed-the-other-way",
        "The estimate was regressed on the state; the filter knows z and asks for x.",
        "    Gamma",
        "    x, z = z, x\n    Gamma",
    ),
    (
        "residual-is-variance",
        "T is the whole covariance of the state; subtract what the estimate explains.",
        " - matrix @ cross.T",
        "",
    ),
    ("means-not-subtracted", messages.MEANS_NOT_SUBTRACTED, *MOMENTS),
    (
        "offset-forgotten",
        "The offset chi is the state's mean; what Gamma makes of the estimate's mean has to be "
        "subtracted.",
        *OFFSET,
    ),
    (
        "unbiased-residual",
        messages.UNBIASED_RESIDUAL,
        "+ chi, T",
        "+ chi, T * len(x) / (len(x) - 1)",
    ),
)

LAW = "predict(u, full(np.asarray(T), len(u)))"
WRONG_FOS_STEPS = edits(
    fos_step,
    ("predicted-as-aof", PREDICTED_AS_AOF, LAW, "predict(z, aof[1])"),
    ("mean-from-estimate", MEAN_FROM_ESTIMATE, "predict(u,", "predict(z,"),
    (
        "variance-from-aof",
        "The uncertainty of the prediction is T, the same for all trajectories, not p.",
        LAW,
        "predict(u, aof[1])",
    ),
    ("variance-from-prediction", VARIANCE_FROM_PREDICTION, LAW, "predict(u, Psi)"),
    ("innovation-sign", messages.INNOVATION_SIGN, "y - h", "h - y"),
    (
        "u-returned",
        "z is the estimate of the correction; u is what the prediction starts from.",
        "return z, ",
        "return u, ",
    ),
    (
        "state-for-u",
        "The prediction starts from the state; a filter does not know it.",
        "predict(u,",
        "predict(x,",
    ),
)

WRONG_MFOS_STEPS = edits(
    mfos_step,
    (
        "correction-not-fitted",
        "The correction of the FOS is used as it is; the MFOS fits its size and offset over the "
        "ensemble.",
        "lam + sigma @ H.T + e",
        "aof[0]",
    ),
    (
        "prediction-not-fitted",
        "The prediction of the FOS is used as it is; the MFOS fits it to x_next over the ensemble.",
        "s @ L.T + n",
        "s",
    ),
    (
        "state-for-error",
        "The correction is fitted to the prediction's error x - lam, not to the state.",
        "regression(x - lam",
        "regression(x",
    ),
    (
        "variance-from-aof",
        "Psi for the next step is Theta(u, T), not Theta(u, p).",
        LAW,
        "predict(u, aof[1])",
    ),
    ("mean-from-estimate", MEAN_FROM_ESTIMATE, "predict(u,", "predict(z,"),
    ("predicted-as-aof", PREDICTED_AS_AOF, LAW, "predict(z, aof[1])"),
    (
        "estimate-conditioned",
        "The first result is the estimate z; u is only what the prediction starts from.",
        "return z, ",
        "return u, ",
    ),
    (
        "state-for-correction",
        "The regressor is the correction sigma = z - lam, not the estimate itself.",
        "regression(x - lam, sigma)",
        "regression(x - lam, aof[0])",
    ),
)

WIDE = "condition(x, np.concatenate([y, z], axis=1))"
WRONG_BOTH = edits(
    condition_on_both,
    (
        "measurement-unused",
        "Only the estimate is used; the measurement may tell more.",
        WIDE,
        "condition(x, z)",
    ),
    (
        "estimate-unused",
        "Only the measurement is used; the estimate knows the past.",
        WIDE,
        "condition(x, y)",
    ),
    (
        "one-after-the-other",
        "What the estimate leaves is fitted on the measurement afterwards; they are correlated: "
        "fit them together.",
        f"return {WIDE}",
        "u, _ = condition(x, z); more, T = condition(x - u, y); return u + more, T",
    ),
    (
        "residual-of-one",
        "T is what the estimate alone leaves; both together leave less.",
        WIDE,
        f"{WIDE}[0], condition(x, z)[1]",
    ),
    (
        "mean-of-both",
        "The two regressions are averaged; fit both together.",
        WIDE,
        f"(condition(x, y)[0] + condition(x, z)[0]) / 2, {WIDE}[1]",
    ),
)
