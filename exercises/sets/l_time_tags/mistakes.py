"""Known mistakes of set l, question by question: edits of the keys, and what is said of each."""

from __future__ import annotations

from kfcourse.exercises.checks.editing import edits
from kfcourse.exercises.sets import messages
from kfcourse.exercises.sets.l_time_tags.keys import (
    correct,
    cost,
    dimension,
    fit_clock,
    fuse,
    move,
    own_time,
)

# -- l1: two rates in one vector; l2: two time scales

THERE = "(k >= first) & ((k - first) % ratio == 0)"
SUM_FOR_DIFFERENCE = (
    "first is added to the step: how many steps have passed since the first measurement?"
)
WRONG_DIMENSIONS = edits(
    dimension,
    (
        "from-the-first-step",
        "The receiver's first measurement is not at step 0.",
        THERE,
        "k % ratio == 0",
    ),
    (
        "before-the-first",
        "Before its first measurement the receiver gives nothing.",
        "(k >= first) & ",
        "",
    ),
    (
        "one-step-off",
        "It is one step off: steps are counted from 0.",
        "    return",
        "    first = first - 1\n    return",
    ),
    (
        "one-step-late",
        "It is one step late: step `first` itself is that of the first measurement.",
        "    return",
        "    first = first + 1\n    return",
    ),
    (
        "held",
        "Once the receiver has measured, its value is counted at every step: one measurement "
        "taken for many.",
        THERE,
        "k >= first",
    ),
    (
        "only-between",
        "ratio is the number of steps from one measurement to the next, not the number of steps "
        "between them.",
        "% ratio",
        "% (ratio + 1)",
    ),
    (
        "receiver-only",
        "Only the receiver's components are counted; the INS measures at every step.",
        "2.0, 1.0",
        "1.0, 0.0",
    ),
    ("first-left-out", "The receiver's first measurement counts too.", "k >= first", "k > first"),
    ("sum-for-difference", SUM_FOR_DIFFERENCE, "k - first", "k + first"),
    (
        "counted-from-zero",
        "The period is counted from step 0; it begins with the first measurement.",
        "(k - first) %",
        "k %",
    ),
)

WRONG_TIMES = edits(
    own_time,
    (
        "shift-sign",
        "The shift has the wrong sign: a clock that is ahead shows too much.",
        "- shift",
        "+ shift",
    ),
    (
        "rate-multiplied",
        "The rate stands on the wrong side: a clock that is fast shows too much.",
        "/ rate",
        "* rate",
    ),
    (
        "shift-not-divided",
        "The order is wrong: first the shift is taken off, then the rate; undo last what was done "
        "last.",
        "(reading - shift) / rate",
        "reading / rate - shift",
    ),
    ("rate-forgotten", "The rate of the clock is forgotten.", " / rate", ""),
    ("shift-forgotten", "The shift of the clock is forgotten.", " - shift", ""),
    (
        "other-way",
        "That is what the clock shows at a given moment; the moment is asked for.",
        "(reading - shift) / rate",
        "rate * reading + shift",
    ),
)

# -- l3: a correction of varying dimension

WRONG_CORRECTIONS = edits(
    correct,
    (
        "missing-as-zero",
        "A missing component is treated as the number 0; it says nothing.",
        "y, H, R = y[there], H[there], R[np.ix_(there, there)]",
        "y = np.nan_to_num(y)",
    ),
    (
        "missing-as-expected",
        "In place of what is missing stands what was expected: the covariance then shrinks as if "
        "it had been measured.",
        "y, H, R = y[there], H[there], R[np.ix_(there, there)]",
        "y = np.where(there, y, H @ m)",
    ),
    (
        "whole-vector-dropped",
        "One missing component makes the whole vector be dropped; the others still tell something.",
        "there = np.isfinite(y)",
        "there = np.isfinite(y) & np.isfinite(y).all()",
    ),
    (
        "wrong-rows-of-H",
        "H has as many rows as there are components, but not those that belong to them.",
        "y[there], H[there], R[np.ix_(there, there)]\n    F",
        "(y - H @ m)[there] + H[: there.sum()] @ m, H[: there.sum()], R[np.ix_(there, there)]\n   "
        " F",
    ),
    (
        "wrong-part-of-R",
        "R has the right size, but its rows and columns are not those of the components that are "
        "there.",
        "R[np.ix_(there, there)]",
        "R[: there.sum(), : there.sum()]",
    ),
    (
        "correlation-forgotten",
        "Only the diagonal of R is used; the noises of the sensors are correlated here.",
        "R[np.ix_(there, there)]",
        "np.diag(np.diag(R)[there])",
    ),
    ("innovation-sign", messages.INNOVATION_SIGN, "y - H @ m", "H @ m - y"),
    ("covariance-kept", messages.COVARIANCE_KEPT, " - K @ H @ P", ""),
    ("noise-squared", messages.NOISE_SQUARED, "H.T + R", "H.T + R @ R"),
    ("noise-forgotten", "The noise of the meter is missing in the gain.", "H.T + R", "H.T"),
    ("gain-by-noise-alone", messages.GAIN_BY_NOISE_ALONE, "H @ P @ H.T + R", "R"),
)

# -- l4: over any interval; l5: late measurements

Q = "[[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]"
WRONG_MOVES = edits(
    move,
    (
        "constant-in-interval",
        "That is for an acceleration that is constant over the interval. With intervals of any "
        "length it does not fit: two short "
        "ones must give the same as the long one.",
        Q,
        "[[dt**4 / 4, dt**3 / 2], [dt**3 / 2, dt**2]]",
    ),
    (
        "noise-of-fixed-step",
        "The noise does not depend on the interval; a longer one brings more.",
        Q,
        "[[1 / 3, 1 / 2], [1 / 2, 1]]",
    ),
    ("velocity-only", "The noise reaches the position too.", Q, "[[0, 0], [0, dt]]"),
    (
        "diagonal",
        "The noise of position and that of velocity are correlated: they come from one "
        "acceleration.",
        Q,
        "[[dt**3 / 3, 0], [0, dt]]",
    ),
    (
        "covariance-not-carried",
        "The covariance is not carried on: an error of the velocity becomes one of the position.",
        "A @ P @ A.T",
        "P",
    ),
    (
        "intensity-power",
        "The intensity of the noise enters with another power.",
        "q * np",
        "q**2 * np",
    ),
    (
        "factors-forgotten",
        "The factors from the integration are missing in the noise.",
        Q,
        "[[dt**3, dt**2], [dt**2, dt]]",
    ),
    (
        "correlation-sign",
        messages.CORRELATION_SIGN,
        Q,
        "[[dt**3 / 3, -(dt**2) / 2], [-(dt**2) / 2, dt]]",
    ),
    (
        "transition-transposed",
        "A is transposed: in A P A^T the transposed one stands on the right.",
        "A @ P @ A.T",
        "A.T @ P @ A",
    ),
)

WRONG_FUSIONS = edits(
    fuse,
    (
        "arrival-for-tag",
        "The measurements are taken at their arrival; they say where the object was at the tag.",
        "moments, used = 0.0, tags",
        "moments, used = 0.0, arrivals",
        "argsort(tags)",
        "argsort(arrivals)",
    ),
    (
        "mean-delay",
        "The mean delay is subtracted from the arrival; the tag says the moment of each "
        "measurement by itself.",
        "moments, used = 0.0, tags",
        "moments, used = 0.0, arrivals - (arrivals - tags).mean()",
    ),
    (
        "late-dropped",
        "A measurement that arrives out of order is dropped; it still tells something of the "
        "past, and so of the present.",
        "argsort(tags)",
        "argsort(arrivals)",
        "if used[i]",
        "if used[i] and moments[i] >= time",
    ),
    (
        "late-as-present",
        "A measurement that arrives out of order is used without going back to its moment.",
        "        if used",
        "        moments = np.maximum(moments, time)\n        if used",
        "argsort(tags)",
        "argsort(arrivals)",
    ),
    (
        "time-runs-backwards",
        "For a measurement that arrives out of order the filter predicts over a negative "
        "interval: noise would become negative.",
        "argsort(tags)",
        "argsort(arrivals)",
    ),
    (
        "future-used",
        "Measurements are used that have not arrived yet.",
        "arrivals <= now",
        "tags <= now",
    ),
    (
        "not-predicted-to-now",
        "The estimate belongs to the last measurement's moment; predict it to the moment asked "
        "for.",
        "return move(m, P, now - time, q)",
        "return m, P",
    ),
    ("noise-squared", messages.NOISE_SQUARED, "[[r]]", "[[r**2]]"),
    (
        "start-moved",
        "The law at the start belongs to the moment 0, not to the first tag.",
        "time, moments, used = 0.0",
        "time, moments, used = tags.min()",
    ),
)

# -- l6: what ignoring the tag costs; l7: the clock from edges

WRONG_COSTS = edits(
    cost,
    (
        "truth-minus-estimate",
        "The sign is the other way round: the error is the estimate less the truth, and the "
        "estimate is behind.",
        "-V * tau + a * tau**2 / 2, -a",
        "V * tau - a * tau**2 / 2, a",
    ),
    (
        "constant-speed",
        "That is for a constant speed; the vehicle accelerates.",
        " + a * tau**2 / 2, -a * tau",
        ", 0 * V",
    ),
    (
        "past-speed",
        "The speed of the past is taken for the present one: the term of the acceleration has the "
        "wrong sign.",
        "+ a",
        "- a",
    ),
    ("half-forgotten", messages.HALF_MISSING, " / 2", ""),
    (
        "delay-twice",
        "The delay is counted twice, there and back; the data come only one way.",
        "return",
        "tau = 2 * tau; return",
    ),
    (
        "half-in-velocity",
        "The velocity is behind by the whole acceleration times the delay.",
        ", -a * tau",
        ", -a * tau / 2",
    ),
)

WRONG_FITS = edits(
    fit_clock,
    (
        "regression-other-way",
        "The stamps are fitted on the edges; the errors are in the edges, so fit those on the "
        "stamps.",
        "return 1 / slope, -level / slope",
        "return tuple(np.polyfit(edges, stamps, 1))",
    ),
    (
        "inverse-clock",
        "That is the map from stamps to moments; rate and shift tell what the clock shows at a "
        "given moment.",
        "1 / slope, -level / slope",
        "slope, level",
    ),
    (
        "end-points",
        "Only the first pair and the last are used; the others average the delays.",
        "polyfit(stamps, edges, 1)",
        "polyfit(stamps[[0, -1]], edges[[0, -1]], 1)",
    ),
    (
        "shift-only",
        "The rate is taken for 1.",
        "1 / slope, -level / slope",
        "1.0, (stamps - edges).mean()",
    ),
    (
        "through-the-origin",
        "The line goes through the origin: the clock is shifted too.",
        "1 / slope, -level / slope",
        "stamps @ stamps / (stamps @ edges), 0.0",
    ),
    (
        "shift-in-filter-time",
        "The shift is in the filter's time and has the other sign: what does the clock show when "
        "the filter's time is 0?",
        "-level / slope",
        "level",
    ),
    (
        "not-divided",
        "The intercept of the inverse map has to be divided by its slope.",
        "-level / slope",
        "-level",
    ),
    (
        "mean-of-ratios",
        "The rate is a mean of ratios of neighbours: short intervals rule it.",
        "return 1 / slope, -level / slope",
        "rate = np.mean(np.diff(stamps) / np.diff(edges)); return rate, np.mean(stamps - rate * "
        "edges)",
    ),
)
