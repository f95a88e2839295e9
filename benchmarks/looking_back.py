"""What looking back and likelihood cost, as ratios to the filter's own run, side by side in one
run.

    OMP_NUM_THREADS=1 python benchmarks/looking_back.py [--repeats 9] [--states 1 2 4]
        [--runs 1 300 5000]

Smoother over filter, and likelihood over filter (each runs the filter itself, too), for a chain of
so many states whose last one is driven, and the first measured: linear, by `kalman_filter`, or with
the sine of the first in the last.  And for variant 53, the exact filter and particles.  Ratios of
processor times, the three one after the other in each of so many turns: their medians, and the
smoother's worst.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial
from itertools import pairwise

import numpy as np

from kfcourse import (
    Model,
    gauss_hermite,
    gaussian,
    likelihood,
    linearised,
    run,
    simulate,
    smooth,
    unscented,
)
from kfcourse.filters import Filter, aof, kalman_filter, particle, pointmass
from kfcourse.lab.variants import find_variant

KINDS = {
    "linear": linearised,
    "kalman": linearised,
    "linearised": linearised,
    "gaussian": gaussian,
    "unscented": unscented,
    "gauss-hermite": partial(gauss_hermite, order=3),
}
STEPS = {1: 41, 300: 31, 5000: 11}  # of so many runs


def chain(n: int, curved: bool) -> Model:
    """Each state is driven by the next, the last one by noise; the first is measured."""
    last = f"0.9*x{n} + 0.3*v" + (" - 0.1*sin(x1)" if curved else "")
    names = [f"x{i}" for i in range(1, n + 1)]
    motion = [*(f"{name} + 0.2*{other}" for name, other in pairwise(names)), last]
    return Model.define(
        motion, "x1 + 0.5*w", symbols={"x": names}, prior={"mean": [0] * n, "variance": np.eye(n)}
    )


def seconds(work: Callable[[Filter, np.ndarray], object], filter_: Filter, y: np.ndarray) -> float:
    start = time.process_time()
    work(filter_, y)
    return time.process_time() - start


def ratios(filter_: Filter, y: np.ndarray, repeats: int) -> str:
    """Microseconds of the filter for a step of a run; what the smoother costs beside it, the worst,
    and the likelihood."""
    times = np.array(
        [
            [seconds(work, filter_, y) for work in (run, smooth, likelihood)]
            for _ in range(repeats + 1)
        ]
    )[1:]
    back, evidence = (times[:, 1:] / times[:, :1]).T
    own = 1e6 * np.median(times[:, 0]) / np.prod(y.shape[:2])
    return f"{own:8.3f} {np.median(back):5.2f} {back.max():5.2f} {np.median(evidence):5.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--states", type=int, nargs="*", default=[1, 2, 4])
    parser.add_argument("--runs", type=int, nargs="*", default=[1, 300, 5000])
    given = parser.parse_args()
    print(
        f"{'':18}"
        + "".join(f"{runs:>23} runs" for runs in given.runs)
        + "   us, smoother (median, worst), likelihood"
    )
    for kind, build in KINDS.items():
        for n in given.states:
            filter_ = (
                kalman_filter(chain(n, False))
                if kind == "kalman"
                else aof(build(chain(n, kind != "linear")))
            )
            cells = [
                ratios(filter_, y, given.repeats)
                for runs in given.runs
                for y in [simulate(filter_.model, runs, STEPS.get(runs, 6), seed=1).y]
            ]
            print(f"{kind:14} {n:2} " + "".join(f"{cell:>28}" for cell in cells), flush=True)
    lab = find_variant("53").model
    many = simulate(lab, 20_000, 31, seed=1).y
    others = {
        "53, linearised, 2,000 runs": (aof(linearised(lab)), many[:, :2000]),
        "53, gaussian, 20,000 runs": (aof(gaussian(lab)), many),
        "53, exact, 200 runs": (pointmass(lab), many[:, :200]),
        "53, 500 particles, 20 runs": (particle(lab, 500), many[:8, :20]),
    }
    for name, (filter_, y) in others.items():
        print(f"{name:32} {ratios(filter_, y, given.repeats)}", flush=True)


if __name__ == "__main__":
    main()
