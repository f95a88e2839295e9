"""Known mistakes of set k, question by question: edits of the keys, and what is said of each."""

from __future__ import annotations

from kfcourse.exercises.checks.editing import edits
from kfcourse.exercises.sets import messages
from kfcourse.exercises.sets.k_integration.keys import (
    bias_error,
    error_meter,
    gained,
    integrate,
    lost,
    steady_state,
)

GAIN_BY_NOISE = (
    "The gain is divided by the receiver's noise alone; the prediction's error "
    "belongs to the innovation too."
)
DEVIATIONS = "Standard deviations stand where variances belong: check the units."

# -- k1: the error of the slow sensor as the state

WRONG_METERS = edits(
    error_meter,
    (
        "error-sign",
        "The error of the slow sensor is added; it measures too much by it, so the quantity "
        "itself is smaller.",
        "y - eps",
        "y + eps",
    ),
    (
        "slope-sign",
        "The derivative is taken by the quantity, not by the error: what does the chain rule add?",
        "sp.diff(h, eps)",
        "-sp.diff(h, eps)",
    ),
    (
        "slope-at-reading",
        "The derivative is taken at the sensor's reading; the error has to be removed from it "
        "first.",
        "sp.diff(h, eps)",
        "sp.diff(h, eps).subs(eps, 0)",
    ),
    (
        "signal-of-error",
        "The receiver measures the quantity; its error alone was put into the signal function.",
        "y - eps",
        "eps",
    ),
    (
        "reading-minus-signal",
        "The reading is inside the signal function, not outside.",
        "signal(y - eps)",
        "y - signal(eps)",
    ),
    (
        "difference-reversed",
        "The difference is reversed: it is the reading minus its error.",
        "y - eps",
        "eps - y",
    ),
    ("second-derivative", "The slope is the first derivative.", "diff(h, eps)", "diff(h, eps, 2)"),
)

# -- k2: the steady state

ROOT = "sp.sqrt(sigma_xi**4 + 4 * sigma_xi**2 * sigma_n**2)"
WRONG_STEADY = edits(
    steady_state,
    ("minus-root", messages.NEGATIVE_ROOT, "+ sp.sqrt", "- sp.sqrt"),
    (
        "deviation-for-variance",
        DEVIATIONS,
        f"(sigma_xi**2 + {ROOT})",
        "(sigma_xi + sp.sqrt(sigma_xi**2 + 4 * sigma_xi * sigma_n))",
    ),
    (
        "root-of-one-term",
        "The root goes over the sum, not over one of its terms.",
        ROOT,
        "sp.sqrt(sigma_xi**4) + 4 * sigma_xi**2 * sigma_n**2",
    ),
    (
        "four-forgotten",
        "A factor is missing under the root: write down the discriminant again.",
        "+ 4 * ",
        "+ ",
    ),
    (
        "half-forgotten",
        "A factor is missing in front: the root of a quadratic equation is divided by twice its "
        "first coefficient.",
        ")) / 2",
        "))",
    ),
    (
        "gain-of-estimate",
        "The gain is made of the variance after the correction; at the measurement the filter is "
        "as sure as Psi says.",
        "-Psi / (Psi + sigma_n**2)",
        "-p / (p + sigma_n**2)",
    ),
    (
        "gain-by-noise-alone",
        GAIN_BY_NOISE,
        "K = -Psi / (Psi + sigma_n**2)",
        "K = -Psi / sigma_n**2",
    ),
    ("small-drift", messages.SMALL_DRIFT, f"(sigma_xi**2 + {ROOT}) / 2", "sigma_xi * sigma_n"),
    (
        "share-sign",
        "The share that a correction leaves is less than one, and K is negative: check a sign.",
        "return Psi, p",
        "return Psi, (1 - K) * Psi",
    ),
)

# -- k3: the filter

WRONG_FILTERS = edits(
    integrate,
    (
        "error-added",
        "The estimated error is added to the reading of the INS; it reads too much by that.",
        "append(ins - eps)",
        "append(ins + eps)",
    ),
    (
        "gain-sign",
        "The gain has the wrong sign: the INS reads too much where the receiver's minus its "
        "velocity is negative.",
        "else -Psi",
        "else Psi",
        "(1 + K)",
        "(1 - K)",
    ),
    (
        "variance-grows",
        "The variance grows with a measurement: K is negative, so it is 1 + K that is less than 1.",
        "(1 + K)",
        "(1 - K)",
    ),
    (
        "drift-forgotten",
        "The drift of the INS is not added to the variance: the filter becomes surer and surer "
        "and falls asleep.",
        "p + sigma_xi**2",
        "p",
    ),
    (
        "receiver-for-difference",
        "The receiver's velocity is compared with the error; compare it with what the INS reads, "
        "less its error.",
        "(sr - (ins - eps))",
        "(sr - eps)",
    ),
    (
        "error-not-removed",
        "The innovation is made with the raw reading of the INS; its estimated error has to be "
        "taken off first.",
        "(sr - (ins - eps))",
        "(sr - ins)",
    ),
    (
        "noise-as-deviation",
        "In the gain the receiver's noise is a standard deviation beside a variance: square "
        "sigma_n.",
        "sigma_n**2",
        "sigma_n",
    ),
    (
        "drift-as-deviation",
        "A standard deviation is added to the variance from step to step: square sigma_xi.",
        "sigma_xi**2",
        "sigma_xi",
    ),
    (
        "missing-as-zero",
        "A missing measurement is treated as the number 0; it says nothing, so the error keeps "
        "its estimate.",
        "lost = np.isnan(sr).any()",
        "lost, sr = False, np.nan_to_num(sr)",
    ),
    (
        "no-drift-in-gap",
        "While the receiver is lost the variance stands still; the INS drifts on.",
        "p + sigma_xi**2",
        "p if lost else p + sigma_xi**2",
    ),
)

# -- k4: what is gained

WRONG_IMPROVEMENTS = edits(
    gained,
    (
        "variance-ratio",
        "That is a ratio of variances; errors are compared by their standard deviations.",
        "sigma_n / sp.sqrt(p)",
        "sigma_n**2 / p",
    ),
    (
        "variance-for-deviation",
        "A standard deviation is divided by a variance: check the units.",
        "sp.sqrt(p)",
        "p",
    ),
    (
        "prediction",
        "That compares with the prediction's error; the integrated velocity has that of the "
        "estimate.",
        "_, p, K =",
        "p, _, K =",
    ),
    ("gain-sign", messages.LEFT_AFTER_A_STEP, "-T / sp.log(1 + K)", "T / sp.log(1 - K)"),
    (
        "first-order",
        "That is the leading term for a small gain; take the logarithm of what is left after a "
        "step.",
        "sp.log(1 + K)",
        "K",
    ),
    (
        "in-steps",
        "The time constant is in steps; in seconds it is T times longer.",
        "-T / ",
        "-1 / ",
    ),
    (
        "half-life",
        "That is the time after which a half is left; a time constant is that to one e-th.",
        "-T / ",
        "-T * sp.log(2) / ",
    ),
    ("decimal-logarithm", messages.DECIMAL_LOGARITHM, "-T / ", "-T * sp.log(10) / "),
)

# -- k5: the receiver drops out; k6: the receiver is biased

DEVIATION, UNTIL = "sp.sqrt(p + n * sigma_xi**2)", "T * (sigma_n**2 - p) / sigma_xi**2"
WRONG_GROWTHS = edits(
    lost,
    (
        "drifts-in-line",
        "The drifts of the periods are added as if all went the same way; they are independent.",
        "n * sigma_xi**2",
        "n**2 * sigma_xi**2",
    ),
    (
        "deviations-added",
        "Standard deviations are added; of independent errors the variances add.",
        f"{DEVIATION}, {UNTIL}",
        "sp.sqrt(p) + sp.sqrt(n) * sigma_xi, T * (sigma_n - sp.sqrt(p)) ** 2 / sigma_xi**2",
    ),
    (
        "grows-as-n",
        "The standard deviation of a Wiener process grows with the root of the time, not with the "
        "time.",
        f"{DEVIATION}, {UNTIL}",
        "sp.sqrt(p) + n * sigma_xi, T * (sigma_n - sp.sqrt(p)) / sigma_xi",
    ),
    (
        "variance-for-deviation",
        "That is a variance; the standard deviation is asked for.",
        "sp.sqrt(p + n * sigma_xi**2)",
        "p + n * sigma_xi**2",
    ),
    (
        "start-forgotten",
        "The error at the beginning of the gap is forgotten: the filter did not know the INS "
        "exactly.",
        f"{DEVIATION}, {UNTIL}",
        "sp.sqrt(n) * sigma_xi, T * sigma_n**2 / sigma_xi**2",
    ),
    ("in-periods", "That is a number of periods; the time is asked for in seconds.", "T * (", "("),
    (
        "start-added",
        "The variance at the beginning is added; part of the way is gone already when the gap "
        "begins.",
        "sigma_n**2 - p",
        "sigma_n**2 + p",
    ),
)

WRONG_BIASES = edits(
    bias_error,
    ("gain-sign", messages.LEFT_AFTER_A_STEP, "(1 + K)", "(1 - K)"),
    (
        "innovation",
        "That is the mean of the innovation, the part of the bias that has not passed yet.",
        "(1 - (1 + K) ** j)",
        "(1 + K) ** j",
    ),
    (
        "in-line",
        "Each step passes on a share of what has not passed yet, not of the whole bias.",
        "(1 - (1 + K) ** j)",
        "(-K) * j",
    ),
    ("one-step", "That is what the first biased measurement does.", "(1 - (1 + K) ** j)", "(-K)"),
    (
        "one-step-late",
        "It is one step late: the first biased measurement counts already.",
        "** j",
        "** (j - 1)",
    ),
    (
        "one-step-early",
        "It is one step early: after no biased measurement the error is zero.",
        "** j",
        "** (j + 1)",
    ),
    (
        "power-of-K",
        "What is left after a step is not K: take what has not passed yet to the power.",
        "(1 + K) ** j",
        "K**j",
    ),
)
