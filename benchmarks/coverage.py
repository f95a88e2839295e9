"""How often the 95 % intervals of a comparison hold the truth, over many seeds.

    .venv/bin/python benchmarks/coverage.py [--variants 53 2] [--seeds 400] [--runs 100000] [--exact-runs 4000] [--steps 12]

For every variant that is shipped: the share of the intervals of `gap`, `difference` and `bound` that hold the truth, over seeds,
filters and steps, and for the step and filter where it is lowest; and on which side of the interval the truth lies where it is
missed.  The truth is the mean over all seeds: its own error is a twentieth of one seed's, and costs a tenth of a per cent of
coverage.  DUOF, FOS and MFOS are designed once: intervals of one design hold for the filters as they were designed.
"""

from __future__ import annotations

import argparse
import time

import joblib
import numpy as np

from kfcourse import Ensemble, compare, design, lab_filters, load_variants
from kfcourse.filters.designed import Design
from kfcourse.lab.short_names import LAB
from kfcourse.montecarlo.comparison import EXACT, Comparison
from kfcourse.montecarlo.statistics import Estimate

CONFIDENCE = 0.95


def estimates(result: Comparison) -> dict[str, Estimate]:
    """What is asked of a comparison, each (filters, steps)."""
    entrants, control = result.entrants, result.control
    asked = {
        "gap": [result.gap(name) for name in entrants],
        "difference": [result.difference(name, control) for name in entrants if name != control],
        "bound": [result.bound()],
    }
    return {
        what: Estimate(*(np.array([np.broadcast_to(getattr(one, field), result.steps) for one in found]) for field in FIELDS))
        for what, found in asked.items()
    }


FIELDS = ("value", "standard_error", "freedom", "skewness")


def covered(found: list[Estimate], unit: np.ndarray | float) -> tuple[float, float, float, float]:
    """Coverage over all, at the worst place, its standard error there, and the part of the misses that are too low.

    Of what varies by less than 1e-10 of the unit, filters that coincide, only the rounding is seen.
    """
    values = np.array([one.value for one in found])
    truth, limits = values.mean(axis=0), np.array([one.interval(CONFIDENCE) for one in found])
    varies = values.std(axis=0) > 1e-10 * unit
    if not varies.any():
        return 1.0, 1.0, 0.0, 0.5
    low, high = (limits[:, 0] > truth)[:, varies], (limits[:, 1] < truth)[:, varies]
    shares = 1 - (low | high).mean(axis=0)
    worst = shares.min()
    return shares.mean(), worst, np.sqrt(worst * (1 - worst) / len(found)), high.sum() / max(high.sum() + low.sum(), 1)


def line(name: str, seeds: int, runs: int, exact_runs: int, steps: int, jobs: int) -> str:
    model, start = load_variants()[name].model, time.monotonic()
    filters = lab_filters(model, [*LAB, EXACT])
    to_design = [one for one in filters if isinstance(one, Design)]
    ready = {one.name: one for one in design(to_design, Ensemble(model, runs, steps, np.random.SeedSequence(0)).by_step())}
    filters = [ready.get(one.name, one) for one in filters]

    def one(seed: int) -> dict[str, Estimate]:
        return estimates(compare(filters, model, runs, steps, seed, subset_runs=exact_runs, threads=1, progress=False))

    found = joblib.Parallel(jobs, prefer="threads" if jobs == 1 else None)(
        joblib.delayed(one)(seed) for seed in range(1, seeds + 1)
    )
    cells, bound = [], np.mean([result["bound"].value[0] for result in found], axis=0)
    for what, unit in (("gap", 1.0), ("difference", bound), ("bound", bound)):
        share, worst, error, low = covered([result[what] for result in found], unit)
        cells.append(f"{share:7.3f} {worst:6.3f} ± {error:.3f} {low:5.2f}")
    return f"{name:>8}" + " |".join(cells) + f" | {time.monotonic() - start:6.0f}"


def main() -> None:
    parser = argparse.ArgumentParser(description="Coverage of the intervals of a comparison")
    parser.add_argument("--variants", nargs="+", default=list(load_variants()))
    for option, default in (("--seeds", 400), ("--runs", 100_000), ("--exact-runs", 4000), ("--steps", 12), ("--jobs", 2)):
        parser.add_argument(option, type=int, default=default)
    args = parser.parse_args()
    print(f"{args.seeds} seeds, {args.runs} trajectories, the exact AOF on {args.exact_runs}, {args.steps} steps; nominal 0.95")
    part = f"{'mean':>7} {'worst':>14} {'low':>5}"
    print(f"{'':>8}{'gap':>28} |{'difference':>28} |{'bound':>28} |\n{'variant':>8}{part} |{part} |{part} | {'s':>6}")
    for name in args.variants:
        print(line(name, args.seeds, args.runs, args.exact_runs, args.steps, args.jobs), flush=True)


if __name__ == "__main__":
    main()
