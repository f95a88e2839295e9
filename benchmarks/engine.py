"""Speed of the Monte Carlo engine, as ratios measured side by side in one run.

    .venv/bin/python benchmarks/engine.py [--runs 100000 1000000] [--repeats 3]

Prints
- the linearised AOF, random numbers included, against filterpy's extended Kalman filter in a loop;
- all seven filters of the lab, designed on one ensemble and compared on another, against the time
  one NumPy Generator needs to draw as many normal numbers (four for each trajectory and step), also
  in processor time, which other work on the machine disturbs less.

Absolute figures move with the machine; the ratios are what to keep.  Nothing else should run
meanwhile.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from kfcourse import compare, lab_filters, simulate
from kfcourse.lab.short_names import LAB
from kfcourse.lab.variants import find_variant

STEPS = 51


def best(
    work: Callable[[], object], repeats: int, clock: Callable[[], float] = time.perf_counter
) -> float:
    """Shortest time of several, in seconds: the least disturbed one."""
    times = []
    for _ in range(repeats):
        start = clock()
        work()
        times.append(clock() - start)
    return min(times)


def filterpy_loop(runs: int) -> Callable[[], object]:
    """Variant 53's LAOF as filterpy's users write it: an object for each trajectory, a loop over
    steps."""
    c, e, g, f = 0.9, 0.05, 1.0, 0.02
    _, y = simulate(find_variant("53").model, runs, STEPS, seed=1)

    def work() -> None:
        for trajectory in y[:, :, 0].T:
            ekf = ExtendedKalmanFilter(1, 1)
            ekf.x, ekf.P, ekf.F = np.zeros((1, 1)), np.eye(1), np.array([[c]])
            for measurement in trajectory:
                ekf.R = np.array([[f**2 * ekf.x[0, 0] ** 4 + 1e-300]])
                ekf.update(np.array([[measurement]]), lambda x: np.array([[g]]), lambda x: g * x)
                ekf.Q = np.array([[e**2 * ekf.x[0, 0] ** 2]])
                ekf.predict()

    return work


def draw(numbers: int) -> Callable[[], object]:
    """What one Generator needs for as many normal numbers, in blocks that stay in the cache."""
    block = np.empty(16_384)

    def work() -> None:
        rng = np.random.default_rng(1)
        for _ in range(numbers // len(block)):
            rng.standard_normal(out=block)

    return work


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--runs", type=int, nargs="+", default=[100_000, 1_000_000])
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    model = find_variant("53").model
    filters = lab_filters(model)

    def lab(names, runs) -> Callable[[], object]:
        chosen = [filter_ for filter_ in filters if filter_.name in names]
        return lambda: compare(
            chosen, model, runs, STEPS, seed=1, design_runs=runs, jobs=2, progress=False
        )

    loop = best(filterpy_loop(200), options.repeats) / (200 * STEPS)
    print(f"filterpy EKF loop: {1e6 * loop:.1f} us a trajectory-step")
    for runs in options.runs:
        count = runs * STEPS
        linearised_aof = best(lab(["aof-linearised"], runs), options.repeats) / count
        drawing = best(draw(4 * count), options.repeats)
        of_drawing = best(draw(4 * count), options.repeats, time.process_time)
        print(f"\n{runs} trajectories x {STEPS} steps")
        print(
            f"  linearised AOF, drawing included: {1e9 * linearised_aof:.1f} ns a trajectory-step"
        )
        print(f"  filterpy's loop takes {loop / linearised_aof:.0f} times as long")
        print(
            f"  drawing 4 normals a trajectory-step with one Generator: "
            f"{1e9 * drawing / count:.1f} ns"
        )
        seven = best(lab(LAB, runs), options.repeats)
        of_seven = best(lab(LAB, runs), options.repeats, time.process_time)
        print(
            f"  seven filters, designed and run: {1e9 * seven / count:.1f} ns = "
            f"{seven / drawing:.2f} times that,"
        )
        print(f"    {of_seven / of_drawing:.2f} times in processor time, of two threads")


if __name__ == "__main__":
    main()
