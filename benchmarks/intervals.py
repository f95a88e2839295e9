"""How often the intervals of a comparison hold the truth, at all steps, with the defaults of
`kfcourse lab`.

    .venv/bin/python benchmarks/intervals.py [--variants 53 5 7 2] [--seeds 200] [--runs N]
        [--jobs 2]

For each variant the lab's filters are designed once, and compared on fresh trajectories with each
seed.  The truth is the mean over the seeds.  Printed are, for gaps, differences from the control,
mean gaps and their differences: the coverage over all filters and steps, that of the worst place,
and how probable so bad a place would be among so many if each covered with `LEAST`. Then the
filters are designed again, with `--designs` other seeds, and run on one and the same sample: how
much another design moves a gap, its standard deviation in units of the interval's whole width, in
the median over filters and steps and at most.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import numpy as np
import scipy

from kfcourse import Ensemble, compare, design
from kfcourse.filters import Design, Filter
from kfcourse.lab.admission import admissions
from kfcourse.lab.short_names import JUMP_LAB, LAB
from kfcourse.lab.variants import find_variant
from kfcourse.laws import Array
from kfcourse.montecarlo.comparison import EXACT, Comparison
from kfcourse.montecarlo.experiment import DESIGN_RUNS
from kfcourse.montecarlo.statistics import Estimate
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model

LEAST = 0.92  # coverage that is good enough


def filters_of(name: str) -> list[Filter | Design]:
    """Those that `kfcourse lab` compares."""
    model = find_variant(name).model
    names = [*(JUMP_LAB if isinstance(model, JumpModel) else LAB), EXACT]
    return [known.built for known in admissions(model, names) if known.built]


def questions(result: Comparison) -> dict[str, list[Estimate]]:
    """What a report states with an interval."""
    control, others = result.control, [name for name in result.entrants if name != result.control]
    return {
        "gap": [result.gap(name) for name in (result.entrants if result.has_bound else others)],
        "difference": [result.difference(name, control) for name in others],
        "mean gap": [
            result.mean_gap(name) for name in (result.entrants if result.has_bound else others)
        ],
        "difference of means": [result.mean_gap_difference(name, control) for name in others],
    }


def coverage(estimates: Sequence[Sequence[Estimate]]) -> tuple[float, float, float]:
    """Of (seeds, filters) estimates: over all places, at the worst, and how probable so bad a place
    is.

    Where the truth varies by rounding only (filters that coincide) there is nothing to be covered.
    """
    values = np.array([[estimate.value for estimate in row] for row in estimates])
    halves = np.array([[estimate.half_width() for estimate in row] for row in estimates])
    truth = np.nanmean(values, axis=0)
    varies = np.nanstd(values, axis=0) > 1e-10 * np.nanmax(np.abs(truth))
    hits = (np.abs(values - truth) <= halves)[:, varies]
    worst = hits.mean(axis=0).min()
    so_bad = hits[0].size * scipy.stats.binom.cdf(round(worst * len(hits)), len(hits), LEAST)
    return hits.mean(), worst, min(1.0, so_bad)


def another_design(
    filters: Sequence[Filter | Design],
    model: Model | JumpModel,
    runs: int,
    steps: int,
    designs: int,
    jobs: int,
) -> tuple[float, float]:
    """Standard deviation of the designed filters' gaps over designs, over the width of the
    interval: median and largest."""
    ensembles = [
        Ensemble(model, min(10 * runs, DESIGN_RUNS), steps, 1000 + i) for i in range(designs)
    ]
    work = {"jobs": jobs, "progress": False}
    results = [
        compare(design(filters, ensemble, jobs), model, runs, steps, 1, **work)
        for ensemble in ensembles
    ]
    names = [filter_.name for filter_ in filters if isinstance(filter_, Design)]
    gaps = np.array([[result.gap(name).value for name in names] for result in results])
    widths: Array = np.array([2 * results[0].gap(name).half_width() for name in names])
    moved = gaps.std(axis=0, ddof=1) / widths
    return float(np.median(moved)), float(moved.max())


def line(
    name: str, seeds: int, runs: int | None, steps: int | None, designs: int, jobs: int
) -> str:
    """A row of the table."""
    variant, start = find_variant(name), time.monotonic()
    steps, runs = steps or variant.steps, runs or variant.runs
    filters = filters_of(name)
    model, work = variant.model, {"jobs": jobs, "progress": False}
    ready = design(filters, Ensemble(model, min(10 * runs, DESIGN_RUNS), steps, 0), jobs)
    results = [
        questions(compare(ready, model, runs, steps, seed, **work)) for seed in range(1, 1 + seeds)
    ]
    cells = [
        "{:6.3f} {:6.3f} {:6.2f}".format(*coverage([result[kind] for result in results]))
        for kind in results[0]
    ]
    moved = "{:6.2f} {:6.2f}".format(*another_design(filters, model, runs, steps, designs, jobs))
    return f"{name:>12} " + " | ".join([*cells, moved]) + f" | {time.monotonic() - start:6.0f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--variants", nargs="+", default=["53", "5", "7", "2"])
    parser.add_argument("--steps", type=int, help="[default: the variant's]")
    parser.add_argument("--runs", type=int, help="[default: the variant's]")
    for option, default in (("--seeds", 200), ("--designs", 8), ("--jobs", 2)):
        parser.add_argument(option, type=int, default=default)
    args = parser.parse_args()
    print(
        f"{args.seeds} seeds, 95 %: mean, worst place, chance of it; another design: median, most"
    )
    kinds = " | ".join(
        f"{kind:>20}" for kind in ("gap", "difference", "mean gap", "difference of means")
    )
    print(f"{'variant':>12} {kinds} | {'another design':>13} | {'s':>6}")
    for name in args.variants:
        print(line(name, args.seeds, args.runs, args.steps, args.designs, args.jobs), flush=True)


if __name__ == "__main__":
    main()
