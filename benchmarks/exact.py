"""Speed and errors of the exact filter, against the adaptive filter that checks it, side by side in one run.

    .venv/bin/python benchmarks/exact.py [--runs 512] [--steps 51] [--checked 8] [--variants 53 2]

For every variant that is shipped, and variant 53 with a meter ten times worse (53/f=.2): microseconds a trajectory-step of one
thread, plain and compiled (numba), and how many times faster the latter is (four runs: 8.9 to 11.3 for variant 53, 7.4 to
8.3 for 1, 13 to 16 for 5); how many times faster than the adaptive filter, which was the exact filter once, the plain one is;
nodes of a posterior, the share of steps left to the adaptive filter, and the estimated errors, in posterior standard deviations:
50 %, 99 % and the worst of all steps.
Vector variants are done by particles; the error is half the distance of the two clouds' estimates.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from kfcourse import load_variants, run, simulate
from kfcourse.filters import Filter, adaptive_pointmass, pointmass
from kfcourse.filters.fused import fuse
from kfcourse.lab.short_names import exact
from kfcourse.symbolic.model import Model


def seconds(one: Filter, y: np.ndarray) -> tuple[float, list]:
    """Processor time of a filter over measurements y (steps, runs, 1), and what it remembered after each."""
    state, memories = one.init(y.shape[1]), []
    start = time.process_time()
    for measurement in y:
        state = one.step(state, measurement)
        memories.append(state.memory)
    return time.process_time() - start, memories


def line(name: str, model: Model, runs: int, steps: int, checked: int, repeats: int) -> str:
    y = simulate(model, runs, steps, seed=1).y
    plain = pointmass(model)
    both = plain, fuse(plain)
    for one in both:
        seconds(one, y[:2])  # what is imported, allocated or compiled once
    found = [[seconds(one, y) for one in both] for _ in range(repeats)]
    fast, quick = (min(spent for spent, _ in each) for each in zip(*found, strict=True))  # the least disturbed
    memories = found[0][0][1]
    slow, _ = seconds(adaptive_pointmass(model), y[:, :checked])
    rate, quick_rate, slow_rate = fast / (runs * steps), quick / (runs * steps), slow / (checked * steps)
    nodes = np.mean([len(grid.x) for memory in memories for grid in memory.fine])
    share = np.mean([memory.adaptive for memory in memories])
    errors = np.array([memory.error for memory in memories])
    rates = f"{name:>8} {1e6 * rate:8.1f} {1e6 * quick_rate:8.1f} {fast / quick:8.1f} {slow_rate / rate:8.1f}"
    return f"{rates} {nodes:8.0f} {100 * share:9.3f} %" + quantiles(errors)


def quantiles(errors: np.ndarray) -> str:
    """50 %, 99 % and the worst; not interpolated, as one may be infinite."""
    return "".join(f"{error:10.0e}" for error in np.quantile(errors, [0.5, 0.99, 1], method="higher"))


def line_by_particles(name: str, model: Model, runs: int, steps: int) -> str:
    y, one = simulate(model, runs, steps, seed=1).y, exact(model)
    seconds(one, y[:2])
    fast, memories = seconds(one, y)
    spread = np.sqrt(np.trace(run(one, y).cov, axis1=-2, axis2=-1))
    apart = np.array([np.linalg.norm(memory.halves[0] - memory.halves[1], axis=-1) for memory in memories])
    count = memories[0].x[0, ..., 0].size
    return f"{name:>8} {1e6 * fast / (runs * steps):8.1f} {'':>8} {'':>8} {'':>8} {count:8.0f} {'particles':>11}" + quantiles(
        0.5 * apart / spread
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--runs", type=int, default=512)
    parser.add_argument("--steps", type=int, default=51)
    parser.add_argument("--checked", type=int, default=8, help="trajectories of the adaptive filter")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--variants", nargs="*")
    options = parser.parse_args()
    models = {name: variant.model for name, variant in load_variants().items()}
    models["53/f=.2"] = models["53"].replace(f=0.2)
    errors = f"{'error 50 %':>12}{'99 %':>10}{'worst':>10}"
    print(f"{'variant':>8} {'us':>8} {'compiled':>8} {'ratio':>8} {'times':>8} {'nodes':>8} {'adaptive':>9}{errors}")
    for name in options.variants or models:
        if models[name].n == models[name].p == 1:
            print(line(name, models[name], options.runs, options.steps, options.checked, options.repeats), flush=True)
        else:
            print(line_by_particles(name, models[name], options.runs, options.steps), flush=True)


if __name__ == "__main__":
    main()
