"""What looking back and likelihood cost, as ratios to the filter's own run, side by side in one run.

    .venv/bin/python benchmarks/looking_back.py [--repeats 9]

Smoother over filter, and likelihood over filter (each runs the filter itself, too), for variant 53, the pendulum of Sarkka and
Svensson, and models of three and five states, one record and many: ratios of the least processor times of so many turns, in
which the three follow each other.  A smoother is to cost at most 2.5 times its filter.

Found on two cores that were busy with much else (a load of 12 to 16), before in brackets:

                                    smoother     likelihood
    53, linearised, 2,000 runs     1.9  (2.5)    1.6 (4.7)
    53, gaussian, 2,000 runs       1.9  (2.4)    1.5 (4.3)
    53, linearised, 20,000 runs    2.3  (4.9)    1.3 (4.9)
    53, gaussian, 20,000 runs      2.4  (4.3)    1.1 (4.3)
    pendulum, linearised, 500      2.3  (2.5)    1.2 (1.4)
    pendulum, gaussian, 500        2.2  (2.4)    1.2 (1.4)
    53, exact, 200 runs            2.4  (2.6)    1.1 (1.1)
    three states, 500              2.1  (3.4)    .9
    three states, 5,000            2.2 to 3.0 (3.9)  .9
    turn, 500                      2.2  (3.3)    1.2
    turn, 5,000                    2.3 to 2.6 (3.9)  1.0
    radar D3, 500 and 5,000        1.5, 1.6  (2.3)   1.2

Of three states and 5,000 runs a step of the filter takes .3 us; the figure above 2.5 is of minutes when others used the cache.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

from kfcourse import Model, gaussian, likelihood, linearised, run, simulate, smooth, unscented
from kfcourse.filters import Filter, aof, particle, pointmass
from kfcourse.lab.variants import find_variant
from kfcourse.scenarios.benchmarks import pendulum, pendulum_data


def turn() -> Model:
    """An aircraft that turns: place, course, speed, turn rate; a receiver."""
    place = ["x1 + 0.1*x4*cos(x3) + 0.05*v1", "x2 + 0.1*x4*sin(x3) + 0.05*v2"]
    motion = [*place, "x3 + 0.1*x5 + 0.02*v3", "x4 + 0.1*v4", "0.95*x5 + 0.05*v5"]
    return Model.define(motion, ["x1 + 0.5*w1", "x2 + 0.5*w2"], prior={"mean": [0, 0, 0.5, 5, 0], "variance": np.eye(5)})


def seconds(work: Callable[[Filter, np.ndarray], object], one: Filter, y: np.ndarray) -> float:
    start = time.process_time()
    work(one, y)
    return time.process_time() - start


def line(name: str, one: Filter, y: np.ndarray, repeats: int) -> str:
    times = np.array([[seconds(work, one, y) for work in (run, smooth, likelihood)] for _ in range(repeats + 1)])[1:]
    own, back, told = times.min(axis=0)
    return f"{name:32} {1e6 * own / np.prod(y.shape[:2]):12.2f} {back / own:10.2f} {told / own:12.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=9)
    repeats = parser.parse_args().repeats
    lab, swing, record = find_variant("53").model, pendulum(), pendulum_data()[1]
    many, hundreds = simulate(lab, 20_000, 31, seed=1).y, np.repeat(record[:60], 500, axis=1)
    builds = {"linearised": linearised, "gaussian": gaussian, "unscented": unscented}
    print(f"{'':32} {'us/step':>12} {'smoother':>10} {'likelihood':>12}")
    for kind, build in builds.items():
        print(line(f"53, {kind}, 2,000 runs", aof(build(lab)), many[:, :2000], repeats))
        print(line(f"53, {kind}, 20,000 runs", aof(build(lab)), many, repeats))
    for kind, build in builds.items():
        print(line(f"pendulum, {kind}, 1 run", aof(build(swing)), record, repeats))
        print(line(f"pendulum, {kind}, 500 runs", aof(build(swing)), hundreds, repeats))
    three = Model.define(["x1 + 0.2*x2 + 0.02*x3", "x2 + 0.2*x3", "0.9*x3 + 0.3*v"], ["x1 + 0.5*w"])
    for name, model in {"three states": three, "turn": turn(), "radar D3": find_variant("D3").model}.items():
        seen = simulate(model, 5000, 21, seed=1).y
        for runs in (1, 500, 5000):
            print(line(f"{name}, linearised, {runs}", aof(linearised(model)), seen[:, :runs], repeats))
    print(line("53, exact, 200 runs", pointmass(lab), many[:, :200], 3))
    print(line("53, 500 particles, 20 runs", particle(lab, 500), many[:8, :20], 3))


if __name__ == "__main__":
    main()
