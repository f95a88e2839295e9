"""Known mistakes of set f, question by question: edits of the keys, and what is said of each."""

from __future__ import annotations

from kfcourse.exercises.checks.editing import edits
from kfcourse.exercises.sets import messages
from kfcourse.exercises.sets.f_exact.keys import correct, moments, nodes_needed, predict, run_filter

# -- f1: mass, mean and variance

Q = "q = density / (h * density.sum())"
WRONG_MOMENTS = edits(
    moments,
    (
        "not-normalised",
        "The density is not normalised: its integral has to be one before moments are taken.",
        Q,
        "q = density",
    ),
    (
        "step-forgotten",
        "The values at the nodes add up to one. It is the integral that is one; the step of the "
        "grid is missing.",
        "return q,",
        "return density / density.sum(),",
    ),
    (
        "step-forgotten",
        "An integral is approximated by a sum times the step of the grid; the step is missing.",
        "mean = h * np",
        "mean = np",
        "variance = h * np",
        "variance = np",
    ),
    (
        "weights-forgotten",
        "That is a moment of the nodes themselves; the density has to weigh them.",
        "mean, variance\n",
        "x.mean(), x.var()\n",
    ),
    (
        "mode",
        "That is where the density is highest, not its mean.",
        "return q, mean",
        "return q, x[np.argmax(q)]",
    ),
    (
        "highest-is-one",
        "The density is divided by its highest value; it is the integral that has to be one.",
        Q,
        "q = density / density.max()",
    ),
    (
        "mean-subtracted-twice",
        "The mean is subtracted twice: the deviations are about it already.",
        "mean, variance\n",
        "mean, variance - mean**2\n",
    ),
)

# -- f2: the correction

KERNELS = (
    (
        "deviation-for-variance",
        "A standard deviation stands where the variance belongs in the normal density.",
        "    return np.exp",
        "    variance = np.sqrt(variance); return np.exp",
    ),
    (
        "variance-for-deviation",
        "A variance stands where the standard deviation belongs: the scale of scipy's norm is a "
        "standard deviation.",
        "    return np.exp",
        "    variance = variance**2; return np.exp",
    ),
    (
        "factor-forgotten",
        "The factor before the exponential is missing in the normal density; it matters, as the "
        "variance depends on the state.",
        " / np.sqrt(2 * np.pi * variance)",
        "",
    ),
    (
        "half-forgotten",
        "The exponent of the normal density lacks its factor one half.",
        "(2 * variance)",
        "variance",
    ),
    (
        "half-a-factor",
        "The factor before the exponential is not complete: the variance depends on the state, "
        "and belongs there too.",
        "np.sqrt(2 * np.pi * variance)",
        "np.sqrt(2 * np.pi)",
    ),
)
WRONG_CORRECTIONS = edits(
    correct,
    *KERNELS,
    (
        "added",
        "Likelihood and prediction are added; by Bayes' rule they are multiplied.",
        "predicted * normal",
        "predicted + normal",
    ),
    (
        "prediction-ignored",
        "That is the likelihood alone: what the filter knew before is not used.",
        "predicted * normal",
        "normal",
    ),
    (
        "not-normalised",
        "The product is not a density yet: it has to be divided by its integral.",
        "joint / evidence, evidence",
        "joint, evidence",
    ),
    (
        "constant-inverted",
        "You return the constant C itself; its inverse, the density of the measurement, is asked "
        "for.",
        "evidence, evidence\n",
        "evidence, 1 / evidence\n",
    ),
    (
        "signal-forgotten",
        "The measurement is compared with the state itself; its mean is what the meter makes of "
        "the state.",
        "*see(x)",
        "x, see(x)[1]",
    ),
)

# -- f3: the prediction

NORMAL_PREDICTION = (
    "A normal density takes the place of the integral; the law after a step is as "
    "a rule not normal."
)
WRONG_PREDICTIONS = edits(
    predict,
    *KERNELS[:3],
    (
        "normalised",
        "The result is normalised; a prediction loses the mass that leaves the grid, and that "
        "should be seen.",
        "return h * P @ posterior",
        "return P @ posterior / (h * (P @ posterior).sum())",
    ),
    (
        "transposed",
        "The matrix is transposed: the sum runs over the state after the step. Integrate over the "
        "state before it.",
        "P @ posterior",
        "P.T @ posterior",
    ),
    (
        "posterior-ignored",
        "The transition density is integrated alone; weigh it by the posterior density of the "
        "state before the step.",
        "P @ posterior",
        "P.sum(axis=1)",
    ),
    (
        "variance-of-target",
        "The variance of the step is taken at the state after it; it belongs to the state before "
        "it.",
        "mean, variance)\n    return",
        "mean, variance[:, None])\n    return",
    ),
    (
        "object-at-rest",
        "Each node spreads around itself; it spreads around where the object takes it.",
        "[:, None], mean",
        "[:, None], x",
    ),
    (
        "normal-prediction",
        NORMAL_PREDICTION,
        "return h * P @ posterior",
        "z = h * mean @ posterior; return normal(x, z, h * (variance + mean**2) @ posterior - "
        "z**2)",
    ),
)

# -- f4: a whole run; f5: how many nodes

WRONG_RUNS = edits(
    run_filter,
    ("predicted-first", messages.PREDICTED_FIRST, "= prior, []", "= predict(prior, x, move), []"),
    (
        "prior-again",
        "Every step starts from the prior again, as if nothing had been measured before: hand the "
        "prediction on.",
        "predicted = predict(q, x, move)",
        "predicted = prior",
    ),
    (
        "not-predicted",
        "The posterior is corrected again without a prediction: the object moves between two "
        "measurements.",
        "predicted = predict(q, x, move)",
        "predicted = q",
    ),
    (
        "predictions-returned",
        "These are the moments before each measurement; return those after it.",
        "moments(q, x)",
        "moments(predicted, x)",
    ),
    ("missing-as-zero", messages.MISSING_AS_ZERO, "in y:", "in np.nan_to_num(y):"),
    (
        "missing-step-skipped",
        "Where a measurement is missing the whole step is left out; the object moves all the same.",
        "predict(q, x, move)",
        "q if missing else predict(q, x, move)",
    ),
    ("about-zero", messages.ABOUT_ZERO, "(x - mean) ** 2", "x**2"),
    (
        "sum-of-densities",
        "The densities are added; the logarithms add, as the densities multiply.",
        "np.log(evidence)",
        "(0 if missing else evidence)",
    ),
    (
        "last-only",
        "That is the last step alone; all measurements count.",
        "total + np.log(evidence)",
        "(total if missing else np.log(evidence))",
    ),
)

FACTOR = "A factor in the exponent is wrong: solve for the step once more."
WRONG_NODES = edits(
    nodes_needed,
    ("intervals", "That is the number of intervals; there is one node more.", " + 1", ""),
    (
        "rounded-down",
        "Rounded to too few: with one interval less the step is too long. Round up.",
        "np.ceil",
        "np.floor",
    ),
    (
        "variance",
        "A variance stands where the standard deviation belongs.",
        "sigma * np",
        "sigma**2 * np",
    ),
    (
        "factor-before",
        "The factor 2 before the exponential is missing.",
        "np.log(2 /",
        "np.log(1 /",
    ),
    ("factor-inside", "The factor 2 in the exponent is missing.", "np.sqrt(2 /", "np.sqrt(1 /"),
    ("decimal-logarithm", messages.DECIMAL_LOGARITHM, "np.log", "np.log10"),
    (
        "root-forgotten",
        "The step enters the exponent squared: a root is missing.",
        "np.sqrt(2 / np.log(2 / error))",
        "2 / np.log(2 / error)",
    ),
    ("pi", FACTOR, "np.pi * sigma", "sigma"),
    ("pi", FACTOR, "np.pi * sigma", "2 * np.pi * sigma"),
)
