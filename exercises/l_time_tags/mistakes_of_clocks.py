"""Known mistakes with clocks and tags: two time scales (l2), what ignoring the tag costs (l6), the clock from edges (l7)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.l_time_tags.keys import cost, fit_clock
from kfcourse.laws import Array

# -- l2: two time scales

WRONG_TIMES: tuple[tuple[str, str, Answer], ...] = (
    (
        "shift-sign",
        "The shift has the wrong sign: a clock that is ahead shows too much.",
        lambda reading, rate, shift: (reading + shift) / rate,
    ),
    (
        "rate-multiplied",
        "The rate stands on the wrong side: a clock that is fast shows too much.",
        lambda reading, rate, shift: (reading - shift) * rate,
    ),
    (
        "shift-not-divided",
        "The order is wrong: first the shift is taken off, then the rate; undo last what was done last.",
        lambda reading, rate, shift: reading / rate - shift,
    ),
    ("rate-forgotten", "The rate of the clock is forgotten.", lambda reading, rate, shift: reading - shift),
    ("shift-forgotten", "The shift of the clock is forgotten.", lambda reading, rate, shift: reading / rate),
    (
        "other-way",
        "That is what the clock shows at a given moment; the moment is asked for.",
        lambda reading, rate, shift: rate * reading + shift,
    ),
)


# -- l6: what ignoring the tag costs; l7: the clock from edges

WRONG_COSTS: tuple[tuple[str, str, Answer], ...] = (
    (
        "truth-minus-estimate",
        "The sign is the other way round: the error is the estimate less the truth, and the estimate is behind.",
        lambda V, a, tau: (V * tau - a * tau**2 / 2, a * tau),
    ),
    ("constant-speed", "That is for a constant speed; the vehicle accelerates.", lambda V, a, tau: (-V * tau, 0 * V)),
    (
        "past-speed",
        "The speed of the past is taken for the present one: the term of the acceleration has the wrong sign.",
        lambda V, a, tau: (-V * tau - a * tau**2 / 2, -a * tau),
    ),
    ("half-forgotten", messages.HALF_MISSING, lambda V, a, tau: (-V * tau + a * tau**2, -a * tau)),
    (
        "delay-twice",
        "The delay is counted twice, there and back; the data come only one way.",
        lambda V, a, tau: cost(V, a, 2 * tau),
    ),
    (
        "half-in-velocity",
        "The velocity is behind by the whole acceleration times the delay.",
        lambda V, a, tau: (-V * tau + a * tau**2 / 2, -a * tau / 2),
    ),
    ("per-second", "The velocity is not multiplied by the delay.", lambda V, a, tau: (-V + a * tau / 2, -a)),
)


def _least_squares(x: Array, y: Array) -> tuple[float, float]:
    """Slope and intercept of y on x."""
    slope = np.cov(x, y)[0, 1] / np.var(x, ddof=1)
    return float(slope), float(y.mean() - slope * x.mean())


def _rate_of(edges: Array, stamps: Array, of_ratios: Callable[[Array], float]) -> tuple[float, float]:
    """A rate made of the ratios of neighbours, and the shift that goes with it."""
    rate = float(of_ratios(np.diff(stamps) / np.diff(edges)))
    return rate, float(np.mean(stamps - rate * edges))


WRONG_FITS: tuple[tuple[str, str, Answer], ...] = (
    (
        "regression-other-way",
        "The stamps are fitted on the edges; the errors are in the edges, so fit those on the stamps.",
        _least_squares,
    ),
    (
        "inverse-clock",
        "That is the map from stamps to moments; rate and shift tell what the clock shows at a given moment.",
        lambda edges, stamps: _least_squares(stamps, edges),
    ),
    (
        "end-points",
        "Only the first pair and the last are used; the others average the delays.",
        lambda edges, stamps: (
            (stamps[-1] - stamps[0]) / (edges[-1] - edges[0]),
            stamps[0] - (stamps[-1] - stamps[0]) / (edges[-1] - edges[0]) * edges[0],
        ),
    ),
    ("shift-only", "The rate is taken for 1.", lambda edges, stamps: (1.0, (stamps - edges).mean())),
    (
        "through-the-origin",
        "The line goes through the origin: the clock is shifted too.",
        lambda edges, stamps: (stamps @ stamps / (stamps @ edges), 0.0),
    ),
    (
        "shift-in-filter-time",
        "The shift is in the filter's time and has the other sign: what does the clock show when the filter's time is 0?",
        lambda edges, stamps: (fit_clock(edges, stamps)[0], _least_squares(stamps, edges)[1]),
    ),
    (
        "not-divided",
        "The intercept of the inverse map has to be divided by its slope.",
        lambda edges, stamps: (fit_clock(edges, stamps)[0], -_least_squares(stamps, edges)[1]),
    ),
    (
        "coefficients-swapped",
        "Slope and intercept are taken for each other.",
        lambda edges, stamps: (
            1 / _least_squares(stamps, edges)[1],
            -_least_squares(stamps, edges)[0] / _least_squares(stamps, edges)[1],
        ),
    ),
    (
        "mean-of-ratios",
        "The rate is a mean of ratios of neighbours: short intervals rule it.",
        lambda edges, stamps: _rate_of(edges, stamps, np.mean),
    ),
    (
        "spreads",
        "The ratio of the two spreads is no least squares: the delays widen one of them.",
        lambda edges, stamps: (stamps.std() / edges.std(), stamps.mean() - stamps.std() / edges.std() * edges.mean()),
    ),
    (
        "median-of-ratios",
        "The rate is a median of ratios of neighbours: least squares uses all pairs at once.",
        lambda edges, stamps: _rate_of(edges, stamps, np.median),
    ),
    (
        "one-pair",
        "The shift is taken from one pair; the line goes through the means.",
        lambda edges, stamps: (fit_clock(edges, stamps)[0], stamps[0] - fit_clock(edges, stamps)[0] * edges[0]),
    ),
    (
        "inverse-slope",
        "Rate and its inverse have changed places in the shift.",
        lambda edges, stamps: (fit_clock(edges, stamps)[0], stamps.mean() - edges.mean() / fit_clock(edges, stamps)[0]),
    ),
    (
        "different-divisors",
        messages.DIFFERENT_DIVISORS,
        lambda edges, stamps: _rate_of(edges, stamps, lambda _: np.cov(stamps, edges)[0, 1] / np.var(edges)),
    ),
)
