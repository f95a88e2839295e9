"""How many trajectories the lab takes by default: a hundred thousand, or as many as a student waits for.

A pilot on few trajectories and steps measures what one of them costs the fast filters in processor time, at two sizes, so that
what does not grow with them does not count.  Sizes are coarse: the machine's other work hardly changes the choice.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, NamedTuple

from kfcourse.filters import Design, Filter
from kfcourse.montecarlo.designing import NotFinite
from kfcourse.montecarlo.experiment import compare
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model

SIZES = (100_000, 20_000, 5_000)  # trajectories
SECONDS = 240.0  # of processor time, for the fast filters
PILOT, STEPS = (256, 2304), 4  # trajectories, which are measured by what the larger number takes more, and steps


class Budget(NamedTuple):
    """So many trajectories; and why not the most, in words, or nothing."""

    runs: int
    says: str = ""


def usual_runs(filters: Sequence[Filter | Design], model: Model | JumpModel, steps: int, **options: Any) -> Budget:
    """The most of `SIZES` that the fast filters are through in `SECONDS`, or the least; options as of `compare`."""
    fast = [one for one in filters if not one.slow]
    tried, taken = min(steps, STEPS), list[float]()
    try:
        for runs in (PILOT[0], *PILOT):  # the first time also derives and compiles
            begun = time.process_time()
            compare(fast, model, runs, tried, 1, slow_runs=0, wide=1, threads=1, progress=False, **options)
            taken.append(time.process_time() - begun)
    except (NotFinite, ValueError):
        return Budget(SIZES[0])  # what is wrong is told by the comparison itself
    each = max(taken[2] - taken[1], 0.0) / (PILOT[1] - PILOT[0]) * steps / tried
    return within(each)


def within(each: float) -> Budget:
    """The same from the processor seconds of a trajectory."""
    most, *fewer = SIZES
    if most * each <= SECONDS:
        return Budget(most)
    runs = next((size for size in fewer if size * each <= SECONDS), fewer[-1])
    needed = float(f"{most * each:.1g}")
    return Budget(
        runs,
        f"{runs} trajectories: {most} would take some {needed:.0f} s of processor time, more than the usual {SECONDS:g} s. "
        "More of them, by --runs, make the intervals narrower, as the root of their number.",
    )
