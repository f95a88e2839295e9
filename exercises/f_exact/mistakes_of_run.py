"""Known mistakes in a whole run (f4), and in how many nodes it needs (f5)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.f_exact.companion import Law
from kfcourse.exercises.f_exact.keys import correct, moments, nodes_with, predict, run_filter, run_with
from kfcourse.exercises.f_exact.mistakes_of_step import WRONG_CORRECTIONS, WRONG_PREDICTIONS, _deviation, _second_moment
from kfcourse.laws import Array

# -- f4: a whole run


def _predicted_first(y: Array, x: Array, prior: Array, move: Law, see: Law) -> tuple[Array, Array, Array]:
    return run_filter(y, x, predict(prior, x, move), move, see)


def _zeros_for_missing(y: Array, x: Array, prior: Array, move: Law, see: Law) -> tuple[Array, Array, Array]:
    return run_filter(np.nan_to_num(y), x, prior, move, see)


def _not_predicted_over_gaps(y: Array, x: Array, prior: Array, move: Law, see: Law) -> tuple[Array, Array, Array]:
    """A missing measurement skips the whole step, prediction and all: the estimates before it are repeated."""
    z, p, total = run_filter(y[~np.isnan(y)], x, prior, move, see)
    last = np.maximum(np.cumsum(~np.isnan(y)) - 1, 0)
    return z[last], p[last], total


def _after_run(change: Callable[[Array], Array]) -> Answer:
    """The right run, with another last result made of the densities of the measurements."""

    def answer(y: Array, x: Array, prior: Array, move: Law, see: Law) -> tuple[Array, Array, Array]:
        evidences = []

        def remembered(predicted: Array, y: float, x: Array, see: Law) -> tuple[Array, Array]:
            posterior, evidence = correct(predicted, y, x, see)
            evidences.append(evidence)
            return posterior, evidence

        z, p, _ = run_with(remembered)(y, x, prior, move, see)
        return z, p, change(np.array(evidences))

    return answer


WRONG_RUNS: tuple[tuple[str, str, Answer], ...] = (
    ("predicted-first", messages.PREDICTED_FIRST, _predicted_first),
    (
        "prior-again",
        "Every step starts from the prior again, as if nothing had been measured before: hand the prediction on.",
        run_with(again=True),
    ),
    (
        "not-predicted",
        "The posterior is corrected again without a prediction: the object moves between two measurements.",
        run_with(prediction=lambda posterior, x, move: posterior),
    ),
    ("predictions-returned", "These are the moments before each measurement; return those after it.", run_with(before=True)),
    ("missing-as-zero", messages.MISSING_AS_ZERO, _zeros_for_missing),
    (
        "missing-step-skipped",
        "Where a measurement is missing the whole step is left out; the object moves all the same.",
        _not_predicted_over_gaps,
    ),
    (
        "mode",
        "The estimate is where the density is highest; the best one is its mean.",
        run_with(moments=lambda density, x: (density, x[np.argmax(density)], moments(density, x)[2])),
    ),
    ("about-zero", messages.ABOUT_ZERO, run_with(moments=_second_moment)),
    ("deviation", messages.DEVIATION_FOR_VARIANCE, run_with(moments=_deviation)),
    ("product", "It is the product of the densities; its logarithm is asked for.", _after_run(np.prod)),
    ("sum-of-densities", "The densities are added; the logarithms add, as the densities multiply.", _after_run(np.sum)),
    ("last-only", "That is the last step alone; all measurements count.", _after_run(lambda all_: np.log(all_[-1]))),
    (
        "constant-inverted",
        "The sign is that of the constants C; the density of a measurement is 1/C.",
        _after_run(lambda e: -np.log(e).sum()),
    ),
    *(
        (name, says, run_with(correction=wrong))
        for name, says, wrong in WRONG_CORRECTIONS
        if name in ("prediction-ignored", "deviation-for-variance", "variance-for-deviation", "factor-forgotten")
    ),
    *((name, says, run_with(prediction=wrong)) for name, says, wrong in WRONG_PREDICTIONS if name == "transposed"),
)


# -- f5: how many nodes

WRONG_NODES: tuple[tuple[str, str, Answer], ...] = (
    ("intervals", "That is the number of intervals; there is one node more.", nodes_with(ends=0)),
    ("rounded-down", "Rounded to too few: with one interval less the step is too long. Round up.", nodes_with(rounded=np.floor)),
    (
        "variance",
        "A variance stands where the standard deviation belongs.",
        nodes_with(lambda sigma, error: np.pi * sigma**2 * np.sqrt(2 / np.log(2 / error))),
    ),
    (
        "factor-before",
        "The factor 2 before the exponential is missing.",
        nodes_with(lambda sigma, error: np.pi * sigma * np.sqrt(2 / np.log(1 / error))),
    ),
    (
        "factor-inside",
        "The factor 2 in the exponent is missing.",
        nodes_with(lambda sigma, error: np.pi * sigma / np.sqrt(np.log(2 / error))),
    ),
    (
        "decimal-logarithm",
        messages.DECIMAL_LOGARITHM,
        nodes_with(lambda sigma, error: np.pi * sigma * np.sqrt(2 / np.log10(2 / error))),
    ),
    (
        "root-forgotten",
        "The step enters the exponent squared: a root is missing.",
        nodes_with(lambda sigma, error: np.pi * sigma * 2 / np.log(2 / error)),
    ),
    (
        "one-each",
        "That is one node for each standard deviation, whatever the error asked for.",
        nodes_with(lambda sigma, error: sigma),
    ),
    (
        "not-rounded",
        "A part of an interval needs a whole one: a number of nodes is a whole number.",
        nodes_with(rounded=lambda intervals: np.asarray(intervals)),
    ),
    (
        "logarithm-not-rooted",
        "The logarithm stands under the root too: the step enters the exponent squared.",
        nodes_with(lambda sigma, error: np.pi * sigma * np.sqrt(2) / np.log(2 / error)),
    ),
    *(
        (
            "pi",
            "A factor in the exponent is wrong: solve for the step once more.",
            nodes_with(lambda sigma, error, factor=factor: factor * sigma * np.sqrt(2 / np.log(2 / error))),
        )
        for factor in (1.0, np.pi**2, np.pi * np.sqrt(2), 2 * np.pi, np.pi / 2)
    ),
)
