"""Known mistakes of set s, question by question: edits of the keys, and what is said of each."""

from __future__ import annotations

from kfcourse.exercises.checks.editing import edits
from kfcourse.exercises.sets import messages
from kfcourse.exercises.sets.s_between.keys import (
    discretised,
    gain_rate,
    moment_rates,
    next_estimate,
)

# -- s1: moment equations

WRONG_RATES = edits(
    moment_rates,
    (
        "mean-at-the-mean",
        "The mean of a cube is not the cube of the mean.",
        " + 3 * z * p",
        "",
    ),
    (
        "slope-at-the-mean",
        "The slope is that of the mean of the drift, not of the drift at the mean.",
        "(z**2 + p)",
        "z**2",
    ),
    (
        "linearised",
        "Both are taken at the mean; here means over the normal law are asked for.",
        " + 3 * z * p",
        "",
        "(z**2 + p)",
        "z**2",
    ),
    (
        "intensity-at-the-mean",
        "The intensity is taken at the mean; its mean over the law has one term more.",
        " + b1**2 * p",
        "",
    ),
    (
        "intensity-not-squared",
        "The variance grows with the square of what multiplies the noise.",
        "(b0 + b1 * z) ** 2 + b1**2 * p",
        "b0 + b1 * z",
    ),
    (
        "one-side-only",
        "The drift acts on both factors of the variance; one of two equal terms is missing.",
        "2 * slope",
        "slope",
    ),
    (
        "discrete",
        "Rates are asked for: the slope enters once, not as its square.",
        "2 * slope * p",
        "slope**2 * p",
    ),
    (
        "second-moment",
        "That is the rate of the second moment about zero; a variance is about the mean.",
        "2 * slope * p + pushed",
        "2 * slope * p + pushed + 2 * z * (a1 * z + a3 * cube)",
    ),
)

# -- s2: exact discretisation

WRONG_DISCRETE = edits(
    discretised,
    (
        "euler",
        "That is Euler's step; over a long interval the velocity decays meanwhile.",
        "    q11",
        "    F = np.array([[1, T], [0, 1 - c * T]])\n    q11",
    ),
    (
        "noise-of-euler",
        "The noise is put into the velocity at the end; on its way it moves the position, too, "
        "and decays.",
        "    return F",
        "    q11, q12, q22 = 0, 0, q * T\n    return F",
    ),
    (
        "undamped",
        "That holds without damping: what came early has decayed.",
        "    return F",
        "    q11, q12, q22 = q * T**3 / 3, q * T**2 / 2, q * T\n    return F",
    ),
    (
        "position-kept",
        "The position does not move in that matrix.",
        "(1 - left) / c]",
        "0]",
    ),
    (
        "transposed",
        "The matrix is transposed: the velocity moves the position.",
        "[[1, (1 - left) / c], [0, left]]",
        "[[1, 0], [(1 - left) / c, left]]",
    ),
    (
        "deviation",
        "The intensity enters with its root; it multiplies variances.",
        "    left =",
        "    q = np.sqrt(q); left =",
    ),
    ("correlation-sign", messages.CORRELATION_SIGN, "[q11, q12], [q12,", "[q11, -q12], [-q12,"),
    (
        "correlation-forgotten",
        "The same noise pushes the velocity and, through it, the position: they are correlated.",
        "[q11, q12], [q12,",
        "[q11, 0], [0,",
    ),
)

# -- s3: a measurement at an instant

WRONG_ESTIMATES = edits(
    next_estimate,
    (
        "euler",
        "That is Euler's step; the decay over an interval is an exponential.",
        "np.exp(-a * tau)",
        "(1 - a * tau)",
    ),
    (
        "noise-undamped",
        "The noise of the interval is summed up without its decay.",
        "q / (2 * a) * (1 - left**2)",
        "q * tau",
    ),
    (
        "variance-once",
        "A variance decays with the square.",
        "left**2 * p",
        "left * p",
    ),
    (
        "noise-forgotten",
        "What pushes the object between the instants is missing.",
        " + q / (2 * a) * (1 - left**2)",
        "",
    ),
    (
        "not-predicted",
        "The measurement corrects the old estimate; the object has moved since.",
        "mean = left * z",
        "mean = z",
    ),
    ("innovation-sign", messages.INNOVATION_SIGN, "0.0, y) - mean)", "0.0, y) + mean)"),
    ("variance-kept", messages.COVARIANCE_KEPT, "(1 - K) * variance", "variance"),
    (
        "missing-as-zero",
        messages.MISSING_AS_ZERO,
        "    K = np.where(missing, 0.0, K)\n",
        "",
    ),
    (
        "prediction-only-if-measured",
        "Where the measurement is missing the object moves all the same.",
        "    return mean + K",
        "    mean, variance = np.where(missing, z, mean), np.where(missing, p, variance)\n"
        "    return mean + K",
    ),
)

# -- s4: the limit of the gain

WRONG_LIMITS = edits(
    gain_rate,
    (
        "variance-of-the-meter",
        "A mean over a shorter interval is noisier: its variance depends on the interval.",
        "r / T",
        "r",
    ),
    (
        "times-interval",
        "The longer a mean is taken over, the less it varies.",
        "r / T",
        "r * T",
    ),
    (
        "euler",
        "The noise of the interval is summed up without its decay.",
        "q / (2 * a) * (1 - left)",
        "q * T",
    ),
    (
        "negative-root",
        messages.NEGATIVE_ROOT,
        "(np.sqrt(half**2 + left * Q * R) - half)",
        "(-np.sqrt(half**2 + left * Q * R) - half)",
    ),
    (
        "predicted",
        "That is the variance before the measurement; the one after it is asked for.",
        "    return p,",
        "    p = left * p + Q\n    return p,",
    ),
    (
        "gain-of-a-step",
        "That is the gain of a step; it tends to zero with the interval. Asked for is the gain in "
        "unit time.",
        "K / T",
        "K",
    ),
    (
        "decay-once",
        "A variance decays with the square of what an error decays with.",
        "np.exp(-2 * a * T)",
        "np.exp(-a * T)",
    ),
    (
        "limit-itself",
        "That is the limit, which no finite interval has.",
        "    return p, K / T",
        "    p = r * (np.sqrt(a**2 + q / r) - a)\n    return p, p / r",
    ),
)
