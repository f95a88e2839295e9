"""Known mistakes of set m, question by question: edits of the keys, and what is said of each."""

from __future__ import annotations

from kfcourse.exercises.checks.editing import edits
from kfcourse.exercises.sets import messages
from kfcourse.exercises.sets.m_smoothing.keys import (
    gate,
    log_likelihood,
    neighbours,
    new_r,
    smooth,
    step_back,
    weight,
)

# -- m1: the gate

WRONG_GATES = edits(
    gate,
    (
        "other-side",
        "That is the value that is exceeded with the probability beta; the gate lets the right "
        "ones pass with it.",
        "1 - beta",
        "beta",
    ),
    (
        "half-forgotten",
        "The exponent of the law of the radius has a half: a factor is missing.",
        "-2 *",
        "-1 *",
    ),
    (
        "radius",
        "That is the radius; the gate is on the square, nu^T F^-1 nu.",
        "-2 * np.log(1 - beta)",
        "np.sqrt(-2 * np.log(1 - beta))",
    ),
    (
        "one-component",
        "That is the gate of one component; two are measured.",
        "-2 * np.log(1 - beta)",
        "scipy.special.chdtri(1, 1 - beta)",
    ),
    (
        "both-tails",
        "The density is solved for its argument, not the probability.",
        "(1 - beta)",
        "(2 * (1 - beta))",
    ),
)

# -- m2: the likelihood of one innovation

SQUARE, VOLUME = "-(nu**2) / F / 2", " - sp.log(2 * sp.pi * F) / 2"
WRONG_LOGARITHMS = edits(
    log_likelihood,
    (
        "density",
        "That is the density itself; its logarithm is asked for.",
        SQUARE + VOLUME,
        f"sp.exp({SQUARE}{VOLUME})",
    ),
    (
        "volume-sign",
        "The larger F is, the flatter the density: the logarithm of F enters with the other sign.",
        "- sp.log",
        "+ sp.log",
    ),
    (
        "volume-forgotten",
        "Only the exponent is there: without the factor before it the largest F would always win.",
        VOLUME,
        "",
    ),
    ("constant-forgotten", "The factor 2 pi is missing.", "2 * sp.pi * F", "F"),
    (
        "half-of-volume",
        "The factor before the exponent is a root: a half is missing.",
        "sp.pi * F) / 2",
        "sp.pi * F)",
    ),
    ("half-of-square", "The half of the exponent is missing.", " / F / 2", " / F"),
    (
        "root-of-F",
        "The square of the innovation is divided by a standard deviation; F is a variance.",
        "/ F /",
        "/ sp.sqrt(F) /",
    ),
    ("not-squared", "The innovation is not squared.", "nu**2", "nu"),
)

# -- m3: neighbours; m4: one step back

WRONG_PAIRS = edits(
    neighbours,
    (
        "A-not-transposed",
        "A stands on the right of p, and there it is transposed.",
        "cross = p @ A.T",
        "cross = p @ A",
    ),
    (
        "carried-twice",
        "What becomes of p in a step stands there; only one of the two states has moved.",
        "cross = p",
        "cross = A @ p",
    ),
    (
        "A-forgotten",
        "The object is missing: the next state is not this one.",
        "cross = p @ A.T",
        "cross = p",
    ),
    (
        "Q-forgotten",
        "The noise of the object is missing where the gain is divided: x_{k+1} is not known from "
        "x_k alone.",
        " + Q",
        "",
    ),
    (
        "divided-by-p",
        "The gain is divided by the covariance of x_k; it corrects x_k by x_{k+1}.",
        "(A @ p @ A.T + Q)",
        "(p)",
    ),
    (
        "divided-by-Q",
        "The gain is divided by the noise of the object alone; what is not known of x_k belongs "
        "to the prediction too.",
        "A @ p @ A.T + Q",
        "Q",
    ),
    (
        "not-carried",
        "p is added to Q as it is; the prediction's covariance has it carried by A.",
        "A @ p @ A.T",
        "p",
    ),
    (
        "gain-multiplied",
        "The gain is multiplied by the covariance of the prediction; it is divided by it.",
        "np.linalg.inv",
        "",
    ),
)

MEAN, COV = "z + S @ (later - ahead)", "p + S @ (later_p - Psi) @ S.T"
WRONG_STEPS = edits(
    step_back,
    (
        "innovation-sign",
        "The innovation has the wrong sign: it is what is known later, less what was predicted.",
        "later - ahead",
        "ahead - later",
    ),
    (
        "later-for-innovation",
        "The later mean itself is multiplied by the gain; subtract what was predicted.",
        "(later - ahead)",
        "later",
    ),
    (
        "filtered-subtracted",
        "The estimate of this step is subtracted; the prediction of the next one is what was "
        "expected.",
        "later - ahead",
        "later - z",
    ),
    (
        "correction-alone",
        "That is the correction alone; it is added to the estimate.",
        "z + S",
        "S",
    ),
    (
        "from-the-prediction",
        "The correction is added to the prediction of the next step; it belongs to the estimate "
        "of this one.",
        "z + S",
        "ahead + S",
    ),
    (
        "covariance-sign",
        "The two covariances are subtracted the wrong way round: a smoother is surer than its "
        "filter.",
        "later_p - Psi",
        "Psi - later_p",
    ),
    (
        "as-if-known",
        "That holds if the next state were known exactly; its own uncertainty comes on top.",
        "later_p - Psi",
        "-Psi",
    ),
    (
        "nothing-explained",
        "What the next state explains is not subtracted.",
        "later_p - Psi",
        "later_p",
    ),
    ("gain-once", "The gain acts from both sides on a covariance.", " @ S.T", ""),
)

# -- m5: a whole record

WRONG_RECORDS = edits(
    smooth,
    (
        "one-step-only",
        "Each step is corrected by the filter's next estimate; take the smoothed one, which knows "
        "all the rest.",
        "means[-1], covs[-1]",
        "z[k + 1], p[k + 1]",
    ),
    (
        "prediction-of-same-step",
        "The prediction of the same step is subtracted; that of the next one is what x_{k+1} was "
        "expected to be.",
        "ahead[k + 1], Psi[k + 1]",
        "ahead[k], Psi[k]",
    ),
    (
        "from-the-prediction",
        "The look back starts from the last prediction; the last estimate already knows all "
        "measurements.",
        "[z[-1]], [p[-1]]",
        "[ahead[-1]], [Psi[-1]]",
    ),
    (
        "one-gain",
        "One gain is used for all steps; the filter's covariance changes from step to step.",
        "neighbours(p[k]",
        "neighbours(p[-2]",
    ),
    (
        "gain-of-next-step",
        "The gain is made of the covariance of the next step; it is that of the step to be "
        "corrected.",
        "neighbours(p[k]",
        "neighbours(p[k + 1]",
    ),
)

# -- m6: a round of EM; m7: a weight

WRONG_ROUNDS = edits(
    new_r,
    (
        "variance-forgotten",
        "The square of the mean error is not the mean square: the states are not known exactly.",
        " + p",
        "",
    ),
    (
        "variance-subtracted",
        "The smoother's uncertainty makes the mean square larger, not smaller.",
        " + p",
        " - p",
    ),
    (
        "variance-everywhere",
        "The smoother's variance is averaged over all steps; only those with a measurement count.",
        "y[there], z[there], p[there]",
        "y[there], z[there], p.mean()",
    ),
    (
        "missing-counted",
        "It is divided by the number of all steps; what is missing tells nothing of the meter.",
        "return float(",
        "return float(there.mean() * ",
    ),
    (
        "missing-as-zero",
        "A missing measurement is treated as the number 0; it tells nothing of the meter: leave "
        "its step out.",
        "there = np.isfinite(y)",
        "y = np.nan_to_num(y); there = np.isfinite(y)",
    ),
    (
        "about-the-mean",
        "The mean error is subtracted first; the meter's errors have the mean zero by the model.",
        "(y - z) ** 2",
        "(y - z - np.mean(y - z)) ** 2",
    ),
    ("deviation-added", "A standard deviation is added to a square.", " + p", " + np.sqrt(p)"),
)

WRONG_WEIGHTS = edits(
    weight,
    (
        "trace-forgotten",
        "The residual is only the mean of the error: what is not known of the state is missing.",
        " + np.trace(inverse @ G @ p @ G.T)",
        "",
    ),
    (
        "p-not-seen",
        "The state's covariance enters as the meter sees it, through G from both sides.",
        "inverse @ G @ p @ G.T",
        "p",
    ),
    (
        "trace-without-R",
        "The uncertainty is compared with the noise, like the residual: R is missing.",
        "inverse @ G @ p",
        "G @ p",
    ),
    (
        "R-forgotten",
        "The residual is not compared with the noise: R is missing.",
        "r @ inverse @ r",
        "r @ r",
    ),
    (
        "correlation-forgotten",
        messages.CORRELATIONS_IGNORED,
        "r @ inverse @ r",
        "r @ (r / np.diag(R))",
    ),
    (
        "components-of-state",
        "The state's components are counted; the measurement's are asked for.",
        "len(r)",
        "len(p)",
    ),
    (
        "components-forgotten",
        "The number of components is missing above the line: a measurement that fits would not "
        "count in full.",
        "s + len(r)",
        "s",
    ),
    ("degrees-forgotten", "The degrees are missing below the line.", "(s + size)", "size"),
)
