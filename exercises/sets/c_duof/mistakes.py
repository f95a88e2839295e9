"""Known mistakes of set c, question by question: edits of the keys, and what is said of each."""

from __future__ import annotations

from kfcourse.exercises.checks.editing import edits
from kfcourse.exercises.sets import messages
from kfcourse.exercises.sets.c_duof.keys import design_and_run, design_step, structure
from kfcourse.exercises.sets.shared import MOMENTS, OFFSET, regression

WRONG_STRUCTURES = edits(
    structure,
    ("omega-sign", messages.INNOVATION_SIGN, "y - b(lam)", "b(lam) - y"),
    (
        "omega-from-estimate",
        "What is expected of y follows from the prediction lam, not from z.",
        "b(lam)",
        "b(z)",
    ),
    ("omega-is-y", "The measurement itself is not the innovation.", "y - b(lam)", "y"),
    (
        "alpha-from-prediction",
        "alpha follows from the estimate z, which knows y already.",
        "a(z)\n",
        "a(lam)\n",
    ),
    ("alpha-is-z", "The object moves: alpha is the state equation at z.", ", a(z)\n", ", z\n"),
    ("omega-of-state", messages.STATE_FOR_EXPECTED, "y - b(lam), a(z)\n", "y - lam, a(z)\n"),
    ("twice", "The state equation is applied twice.", ", a(z)\n", ", a(a(z))\n"),
)

RESIDUAL = "t.T @ t / len(t) - matrix @ cross.T"
WRONG_REGRESSIONS = edits(
    regression,
    ("means-not-subtracted", messages.MEANS_NOT_SUBTRACTED, *MOMENTS),
    ("offset-forgotten", messages.OFFSET_FORGOTTEN, *OFFSET),
    (
        "wrong-index",
        "The mean seems to be taken over the components (the second index) instead of the "
        "trajectories (the first).",
        "target - target.mean(axis=0), regressor - regressor.mean(axis=0)",
        "target - target.mean(axis=1, keepdims=True), regressor - regressor.mean(axis=1, "
        "keepdims=True)",
    ),
    ("biased", messages.DIFFERENT_DIVISORS, "r.T @ r / len(r)", "r.T @ r / (len(r) - 1)"),
    ("biased", messages.DIFFERENT_DIVISORS, "t.T @ r / len(t)", "t.T @ r / (len(t) - 1)"),
    (
        "regularised",
        "Something was added to the covariance of the regressor to make it invertible: that "
        "biases every coefficient. The "
        "pseudo-inverse needs no such help.",
        "r.T @ r / len(r)",
        "r.T @ r / len(r) + 1e-3 * np.eye(r.shape[1])",
    ),
    (
        "residual-is-variance",
        "The residual covariance is the whole covariance of the target; subtract what the "
        "regression explains.",
        " - matrix @ cross.T",
        "",
    ),
    (
        "unbiased-residual",
        messages.UNBIASED_RESIDUAL,
        RESIDUAL,
        f"({RESIDUAL}) * len(t) / (len(t) - 1)",
    ),
    ("about-zero", messages.ABOUT_ZERO, RESIDUAL, "target.T @ target / len(t) - matrix @ cross.T"),
    (
        "another-minimiser",
        "It is one of the best, but where the regressor never varies there are many: take the "
        "pseudo-inverse of its covariance.",
        "return matrix, offset",
        "fit = np.linalg.pinv(np.column_stack([regressor, np.ones(len(r))])) @ target; return "
        "fit[:-1].T, fit[-1]",
    ),
)

WRONG_DUOF_STEPS = edits(
    design_step,
    (
        "state-for-error",
        "The correction is a regression of the prediction's error x - lam on the innovation, not "
        "of the state.",
        "regression(x - lam",
        "regression(x",
    ),
    (
        "prediction-not-added",
        "H omega + e is only the correction: it is added to lam.",
        "z = lam + ",
        "z = ",
    ),
    (
        "alpha-from-prediction",
        "The prediction uses a(lam): the estimate z knows the measurement, lam does not.",
        "a(z)",
        "a(lam)",
    ),
    ("alpha-is-z", "The regressor of the prediction is alpha = a(z), not z itself.", "a(z)", "z"),
    ("correction-subtracted", messages.CORRECTION_SUBTRACTED, "lam + omega", "lam - omega"),
    (
        "error-sign",
        "The target has the wrong sign: the error that is estimated is the state less its "
        "prediction.",
        "regression(x - lam",
        "regression(lam - x",
    ),
    (
        "prediction-of-error",
        "The target of the second regression is the next state itself.",
        "regression(x_next,",
        "regression(x_next - lam,",
    ),
    (
        "change-fitted",
        "The target of the second regression is the next state itself, not how much it changes.",
        "regression(x_next,",
        "regression(x_next - z,",
    ),
)

WRONG_DUOF_RUNS = edits(
    design_and_run,
    (
        "part-of-ensemble",
        "The coefficients come from a part of the design ensemble only; use all of its "
        "trajectories.",
        "lam, other = np.tile",
        "x, y_design = x[:, : y.shape[1]], y_design[:, : y.shape[1]]; lam, other = np.tile",
    ),
    (
        "one-gain",
        "H and e of the first step are used at every step; each step has its own.",
        "H, e, _ = regression(x[k] - lam, omega)",
        "H, e, _ = regression(x[k] - lam, omega) if k == 0 else (H, e, _)",
    ),
    ("predictions-returned", messages.PREDICTIONS_RETURNED, "append(own)", "append(other)"),
    (
        "prediction-not-fitted",
        "The prediction is a(z) as it is; its coefficients F and g, found in the design, are not "
        "used.",
        "a_k(own) @ F.T + g",
        "a_k(own)",
    ),
    (
        "offset-not-used",
        "The offset e is not used when the filter runs.",
        "(y[k] - b_k(other)) @ H.T + e",
        "(y[k] - b_k(other)) @ H.T",
    ),
    ("innovation-sign", messages.INNOVATION_SIGN, "y[k] - b_k(other)", "b_k(other) - y[k]"),
    (
        "step-not-passed",
        messages.STEP_NOT_PASSED,
        "at_step(a, k), at_step(b, k)",
        "at_wrong_step(a, 0), at_wrong_step(b, 0)",
    ),
    ("input-of-next-step", messages.INPUT_OF_NEXT_STEP, "at_step(a, k)", "at_wrong_step(a, k + 1)"),
    (
        "input-of-step-before",
        messages.INPUT_OF_STEP_BEFORE,
        "at_step(b, k)",
        "at_wrong_step(b, k - 1)",
    ),
    (
        "prediction-offset-not-used",
        "The offset g of the prediction is not used when the filter runs.",
        "a_k(own) @ F.T + g",
        "a_k(own) @ F.T",
    ),
    ("prediction-not-added", messages.CORRECTION_ALONE, "own = other + ", "own = "),
)
