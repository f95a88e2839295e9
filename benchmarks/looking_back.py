"""What looking back and likelihood cost, as ratios to the filter's own run, side by side in one run.

    .venv/bin/python benchmarks/looking_back.py [--repeats 9]

Smoother over filter, and likelihood over filter (each runs the filter itself, too), for variant 53 and the pendulum of Sarkka and
Svensson, one record and many: medians of ratios of processor times that were measured one after the other, as machines change
their speed.  A smoother of normal laws is to cost at most 2.5 times its filter.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

from kfcourse import gaussian, likelihood, linearised, run, simulate, smooth, unscented
from kfcourse.filters import Filter, aof, particle, pointmass
from kfcourse.lab.variants import find_variant
from kfcourse.scenarios.benchmarks import pendulum, pendulum_data


def seconds(work: Callable[[Filter, np.ndarray], object], one: Filter, y: np.ndarray) -> float:
    start = time.process_time()
    work(one, y)
    return time.process_time() - start


def line(name: str, one: Filter, y: np.ndarray, repeats: int) -> str:
    times = np.array([[seconds(work, one, y) for work in (run, smooth, likelihood)] for _ in range(repeats + 1)])[1:]
    each = 1e6 * times[:, 0].min() / np.prod(y.shape[:2])
    back, told = np.median(times[:, 1:] / times[:, :1], axis=0)
    return f"{name:32} {each:12.2f} {back:10.2f} {told:12.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=9)
    repeats = parser.parse_args().repeats
    lab, swing, record = find_variant("53").model, pendulum(), pendulum_data()[1]
    many, hundreds = simulate(lab, 2000, 31, seed=1).y, np.repeat(record[:60], 500, axis=1)
    builds = {"linearised": linearised, "gaussian": gaussian, "unscented": unscented}
    print(f"{'':32} {'us/step':>12} {'smoother':>10} {'likelihood':>12}")
    for kind, build in builds.items():
        print(line(f"53, {kind}, 2,000 runs", aof(build(lab)), many, repeats))
    for kind, build in builds.items():
        print(line(f"pendulum, {kind}, 1 run", aof(build(swing)), record, repeats))
        print(line(f"pendulum, {kind}, 500 runs", aof(build(swing)), hundreds, repeats))
    print(line("53, exact, 200 runs", pointmass(lab), many[:, :200], 3))
    print(line("53, 500 particles, 20 runs", particle(lab, 500), many[:8, :20], 3))


if __name__ == "__main__":
    main()
