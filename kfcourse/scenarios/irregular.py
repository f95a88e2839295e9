"""A track as it is recorded: fixes of a place in the plane at unequal intervals, some missing, some
grossly wrong.

    x_{k+1} = x_k + dt_k V_k + ...,   V_{k+1} = V_k + ...     on each axis
    y_k = `position` + w_k,           w_k ~ N(0, sigma^2)

White acceleration of intensity q pushes the track; an outlier has `TIMES` the deviation sigma.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kfcourse.laws import Array
from kfcourse.montecarlo.ensemble import simulate
from kfcourse.symbolic.model import Model

STEPS = 300
# shares of the fixes that are missing, and of the others that are grossly wrong
MISSING, OUTLIERS = 0.15, 0.05
TIMES = 20.0  # how many times larger an outlier's errors are, on the average


class IrregularTrack(NamedTuple):
    """A recorded track.

    Attributes
    ----------
    model : Model
        State (x, y, v_x, v_y) in m and m/s; the interval of each step is its input dt, s.
    time : ndarray (steps,)
        s.
    x : ndarray (steps, runs, 4)
        The true states.
    y : ndarray (steps, runs, 2)
        Fixes, m; NaN where missing.
    outlier : ndarray of bool (steps, runs)
        Which are grossly wrong; none of those that are missing.
    """

    model: Model
    time: Array
    x: Array
    y: Array
    outlier: Array


def irregular_track(
    seed: int | np.random.Generator,
    runs: int = 1,
) -> IrregularTrack:
    """Tracks of 300 steps of unequal lengths, 0.1 to 1.5 s, of whose fixes a part is missing and a
    part grossly wrong.

    Parameters
    ----------
    seed : int or numpy.random.Generator
    runs : int
        Records with the same times.
    """
    rng = np.random.default_rng(seed)
    interval = rng.uniform(0.1, 1.5, STEPS)
    model = Model.define(
        [
            "x + dt*v_x + sqrt(q*dt**3)*(v1/2 + v3/sqrt(12))",
            "y + dt*v_y + sqrt(q*dt**3)*(v2/2 + v4/sqrt(12))",
            "v_x + sqrt(q*dt)*v1",
            "v_y + sqrt(q*dt)*v2",
        ],
        ["x + sigma*w1", "y + sigma*w2"],
        {"q": 0.2, "sigma": 2.0},
        symbols={"x": ["x", "y", "v_x", "v_y"]},
        prior={"mean": [0, 0, 10, 0], "variance": [100, 100, 25, 25]},
        inputs={"dt": interval.tolist()},
    )
    x, y = simulate(model, runs, STEPS, seed=int(rng.integers(2**63)))
    wrong = rng.random((STEPS, runs)) < OUTLIERS
    fixes = x[..., :2] + (y - x[..., :2]) * np.where(wrong, TIMES, 1.0)[..., None]
    gone = rng.random((STEPS, runs)) < MISSING
    time = np.concatenate([[0.0], np.cumsum(interval[:-1])])
    return IrregularTrack(model, time, x, np.where(gone[..., None], np.nan, fixes), wrong & ~gone)
