"""The slow filters on one core and on several, side by side in one run: seconds, ratio, and whether the numbers are the same.

    .venv/bin/python benchmarks/cores.py [--variants 53 20] [--runs 4000] [--steps 51] [--cores 1 2] [--repeats 3]

The exact filter, or the particles that stand for it, beside the linearised AOF, as `kfcourse lab` runs them.  Of several times
the shortest is taken; nothing else should run meanwhile.
"""

from __future__ import annotations

import argparse
import resource
import time

import numpy as np

from kfcourse import Model, load_variants
from kfcourse.lab.short_names import lab_filters
from kfcourse.montecarlo.comparison import SlowPart
from kfcourse.montecarlo.ensemble import Ensemble
from kfcourse.montecarlo.exceptional import Chosen
from kfcourse.montecarlo.parallel import cores
from kfcourse.montecarlo.slow_filters import run_slow_filters


def processor_seconds() -> float:
    """Of this process and those that it has had."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def timed(model: Model, runs: int, steps: int, jobs: int) -> tuple[float, float, SlowPart]:
    """Seconds by the clock and by the processors, and what was found."""
    fast, slow = lab_filters(model, ["aof-linearised", "aof-exact"])
    ensemble = Ensemble(model, runs, steps, np.random.SeedSequence(1), 1.0)
    start, used = time.perf_counter(), processor_seconds()
    first = Chosen.of(runs, np.empty(0, dtype=int))
    found, _ = run_slow_filters([fast], [slow], ensemble, first, np.array([runs]), None, None, jobs, False)
    assert found is not None
    return time.perf_counter() - start, processor_seconds() - used, found


def same(one: SlowPart, other: SlowPart) -> bool:
    """Whether all sums are, bit by bit."""
    fields = type(one.first).__dataclass_fields__
    return all(np.array_equal(getattr(one.first, name), getattr(other.first, name), equal_nan=True) for name in fields)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--variants", nargs="+", default=["53", "20"])
    parser.add_argument("--runs", type=int, default=4000)
    parser.add_argument("--steps", type=int, default=51)
    parser.add_argument("--cores", type=int, nargs="+", default=sorted({1, cores()}))
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    print(f"{'variant':>8} {'cores':>6} {'s':>8} {'CPU-s':>8} {'ratio':>6}  numbers")
    for name in options.variants:
        model = load_variants()[name].model
        times: dict[int, list[tuple[float, float, SlowPart]]] = {jobs: [] for jobs in options.cores}
        for _ in range(options.repeats):
            for jobs in options.cores:
                times[jobs].append(timed(model, options.runs, options.steps, jobs))
        first = times[options.cores[0]]
        for jobs, found in times.items():
            wall, used = (min(one[i] for one in found) for i in (0, 1))
            equal = "the same" if all(same(one[2], first[0][2]) for one in found) else "DIFFERENT"
            print(f"{name:>8} {jobs:6} {wall:8.2f} {used:8.2f} {min(one[0] for one in first) / wall:6.2f}  {equal}", flush=True)


if __name__ == "__main__":
    main()
