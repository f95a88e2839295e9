"""Known mistakes of set n, question by question: edits of the keys, and what is said of each."""

from __future__ import annotations

from kfcourse.exercises.checks.editing import edits
from kfcourse.exercises.sets import messages
from kfcourse.exercises.sets.n_own_data.keys import (
    follow,
    gate,
    held_out,
    intervals,
    neighbours,
    process_noise,
)

# -- n1: intervals; n2: the noise of an interval

ALIKE = "All steps are made alike; the intervals of the record are not."
KEPT = (
    "That is an acceleration which keeps its value over the interval; here it is white, and it "
    "changes all the time."
)
LAST = "np.append(steps, steps[-1])"
WRONG_INTERVALS = edits(
    intervals,
    (
        "since-the-last",
        "These are the intervals since the row before; the step of a row lasts until the next one.",
        LAST,
        "np.append(steps[0], steps)",
    ),
    (
        "zero-first",
        "These are the intervals since the row before, none for the first.",
        LAST,
        "np.append(0, steps)",
    ),
    (
        "zero-last",
        "The last step has no length; give it that of the one before.",
        LAST,
        "np.append(steps, 0)",
    ),
    ("mean", ALIKE, LAST, "np.full(len(times), steps.mean())"),
    ("median", ALIKE, LAST, "np.full(len(times), np.median(steps))"),
    (
        "times",
        "That is the time since the first row, not the length of each step.",
        LAST,
        "times - times[0]",
    ),
)

Q = "[[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]"
WRONG_NOISES = edits(
    process_noise,
    ("constant-in-interval", KEPT, Q, "[[dt**4 / 4, dt**3 / 2], [dt**3 / 2, dt**2]]"),
    ("constant-in-interval", KEPT, Q, "[[dt**3 / 4, dt**2 / 2], [dt**2 / 2, dt]]"),
    (
        "diagonal",
        "Position and velocity are disturbed by the same noise: they are correlated.",
        Q,
        "[[dt**3 / 3, 0 * dt], [0 * dt, dt]]",
    ),
    (
        "velocity-only",
        "In the interval the disturbed velocity moves the position, too.",
        Q,
        "[[0 * dt, 0 * dt], [0 * dt, dt]]",
    ),
    (
        "mean-interval",
        "All intervals are taken for their mean; each row has its own.",
        "    Q = ",
        "    dt = np.full_like(dt, dt.mean()); Q = ",
    ),
    (
        "unit-interval",
        "All intervals are taken for 1; each row has its own.",
        "    Q = ",
        "    dt = np.ones_like(dt); Q = ",
    ),
    (
        "correlation-sign",
        "A push forwards moves forwards: the covariance is positive.",
        Q,
        "[[dt**3 / 3, -(dt**2) / 2], [-(dt**2) / 2, dt]]",
    ),
    (
        "intensity-squared",
        "The intensity q is a variance for each second already; it is not squared.",
        "q * np",
        "q**2 * np",
    ),
)

# -- n3: a filter over unequal steps with missing measurements

WRONG_FILTERS = edits(
    follow,
    ("missing-as-zero", messages.MISSING_AS_ZERO, "enumerate(y)", "enumerate(np.nan_to_num(y))"),
    (
        "missing-as-expected",
        "A gap is filled by what was expected: the covariance then shrinks as if it had been "
        "measured.",
        "if not missing:",
        "if missing: y_k = m[0]\n        if True:",
    ),
    (
        "missing-stops-time",
        "Where a measurement is missing the body moves on: predict over that interval, too.",
        "if k > 0",
        "if k > 0 and not missing",
    ),
    (
        "next-interval",
        "The interval that leads to a row is the one before it.",
        "steps[k - 1]",
        "steps[min(k, len(steps) - 1)]",
    ),
    (
        "mean-interval",
        "All intervals are taken for their mean; each has its own.",
        "steps[k - 1]",
        "steps.mean()",
    ),
    (
        "predicted-first",
        messages.PREDICTED_FIRST,
        "if k > 0",
        "if True",
        "steps[k - 1]",
        "steps[max(k - 1, 0)]",
    ),
    (
        "noise-forgotten",
        "The noise of the state is missing in the prediction.",
        " + process_noise(np.array([dt]), q)[0]",
        "",
    ),
    (
        "covariance-not-carried",
        "The motion carries the covariance, too: A P A^T.",
        "A @ P @ A.T",
        "P",
    ),
    ("innovation-sign", messages.INNOVATION_SIGN, "y_k - m[0]", "m[0] - y_k"),
    ("noise-squared", messages.NOISE_SQUARED, "P[0, 0] + r", "P[0, 0] + r**2"),
)

# -- n4: the gate

SIZE, CHI = (
    "np.sum(nu * np.linalg.solve(F, nu[..., None])[..., 0], axis=-1)",
    "chdtri(degrees, 1 - probability)",
)
WRONG_GATES = edits(
    gate,
    (
        "not-normalised",
        "The innovation is not divided by what the filter expected of it.",
        SIZE,
        "np.sum(nu**2, axis=-1)",
    ),
    (
        "diagonal",
        "Only the variances in F are used; the components of the innovation are correlated.",
        SIZE,
        "np.sum(nu**2 / np.diagonal(F, axis1=-2, axis2=-1), axis=-1)",
    ),
    (
        "multiplied",
        "The innovation is multiplied by F; it is measured in units of F.",
        "np.linalg.solve(F, nu[..., None])",
        "(F @ nu[..., None])",
    ),
    (
        "one-degree",
        "The edge is that of one component; a measurement has more.",
        "chdtri(degrees",
        "chdtri(1",
    ),
    (
        "degree-less",
        "The edge has one degree of freedom too few; nothing was fitted to this measurement.",
        "chdtri(degrees",
        "chdtri(degrees - 1",
    ),
    (
        "refusal-probability",
        "That is the edge of the opposite event: `probability` is that of passing.",
        "1 - probability",
        "probability",
    ),
    (
        "two-sided",
        "The edge is two-sided; a square is too large on one side only.",
        "1 - probability",
        "(1 - probability) / 2",
    ),
    (
        "normal-edge",
        "That is an edge for a normal number, not for the sum of squares.",
        CHI,
        "ndtri((1 + probability) / 2)",
    ),
)

# -- n5: held-out measurements; n6: neighbours

WRONG_JUDGEMENTS = edits(
    held_out,
    (
        "mean-distance",
        "That is the mean distance; the root of the mean square is asked for.",
        "np.sqrt(size.mean())",
        "np.sqrt(size).mean()",
    ),
    (
        "per-component",
        "Each component counts for itself; the square of a distance is the sum over them.",
        "np.sum(errors**2",
        "np.mean(errors**2",
    ),
    (
        "bias-only",
        "That is the length of the mean error; errors in all directions cancel in it.",
        "np.sqrt(size.mean())",
        "np.linalg.norm(errors.mean(axis=0))",
    ),
    (
        "mean-of-deviations",
        "Standard deviations are averaged; average the variances, and take the root last.",
        "np.sqrt(claimed.mean())",
        "np.sqrt(claimed).mean()",
    ),
    (
        "claimed-per-component",
        "What is claimed is taken for one component; the variance of a distance is the sum over "
        "them.",
        "np.sqrt(claimed.mean())",
        "np.sqrt(claimed.mean() / F.shape[-1])",
    ),
    (
        "ratio-of-means",
        "One ratio of two means; each error is compared with its own covariance, and then "
        "averaged.",
        "nis.mean()",
        "size.mean() / claimed.mean()",
    ),
    (
        "diagonal",
        "Only the variances in F are used; the components of the errors are correlated.",
        "nis.mean()",
        "np.mean(np.sum(errors**2 / np.diagonal(F, axis1=-2, axis2=-1), axis=-1))",
    ),
    (
        "per-degree",
        "The mean is divided by the number of components; here it is not.",
        "nis.mean()",
        "nis.mean() / errors.shape[-1]",
    ),
)

DEVIATION = "1 / np.sqrt(len(pairs))"
WRONG_NEIGHBOURS = edits(
    neighbours,
    (
        "gaps-as-zero",
        "A missing innovation is taken for 0; take the next one that was measured.",
        "float(np.mean(pairs))",
        "np.mean(np.nan_to_num(white)[:-1] * np.nan_to_num(white)[1:])",
    ),
    (
        "neighbours-in-rows",
        "Pairs with a gap between them are left out; the next one that was measured is the "
        "neighbour.",
        "float(np.mean(pairs))",
        "np.nanmean(white[:-1] * white[1:])",
    ),
    (
        "not-normalised",
        "The innovations are not divided by their deviations.",
        "nu / np.sqrt(F)",
        "nu",
    ),
    (
        "by-variance",
        "The innovations are divided by their variances; by the deviations they get the variance "
        "1.",
        "nu / np.sqrt(F)",
        "nu / F",
    ),
    (
        "sum",
        "That is the sum of the products; divide by their number.",
        "np.mean(pairs)",
        "np.sum(pairs)",
    ),
    (
        "own-product",
        "Each innovation is multiplied by itself; its neighbour belongs there.",
        "np.mean(pairs)",
        "np.mean(s**2)",
    ),
    (
        "deviation-of-innovations",
        "The deviation counts innovations; a mean over pairs is asked for.",
        DEVIATION,
        "1 / np.sqrt(len(s))",
    ),
    (
        "gaps-counted",
        "The deviation counts rows in which nothing was measured.",
        DEVIATION,
        "1 / np.sqrt(len(nu) - 1)",
    ),
)
