"""How often the 95 % intervals of a comparison hold the truth, over many seeds.

    .venv/bin/python benchmarks/intervals.py [--variants 53 2] [--seeds 400] [--runs 100000] [--slow-runs 4000] [--steps 12]
    .venv/bin/python benchmarks/intervals.py --pages filters-that-remember models-that-jump [--seeds 100]

For every variant that is shipped: the share of the intervals of `difference` and, with an exact filter, of `gap` and `bound` that
hold the truth, over seeds, filters and steps, and for the step and filter where it is lowest; with what chance one of so many
places would be so low, if all covered with 92 %; and on which side of the interval the truth lies where it is missed.  Intervals
of which a report says that they cannot be trusted (`Comparison.trusted`) are counted apart: `told` is their share.  The truth is
the mean over all seeds: its own error is a twentieth of one seed's, and costs a tenth of a per cent of coverage.  DUOF, FOS and
MFOS are designed once: intervals of one design hold for the filters as they were designed.

Found with 20,000 trajectories, the exact AOF on 2,000, 5 steps; of each kind the mean and, after the bar, the worst place:

    variant      seeds       gap         difference        bound     told
    53              80   .945 | .906   .959 | .900   .948 | .938      .02
    2               31   .954 | .903   .954 | .871   .948 | .903      0
    3               80   .950 | .912   .943 | .912   .965 | .950      .06
    4               30   .946 | .867   .957 | .833   .967 | .933      .04
    5               76   .933 | .882   .934 | .882   .963 | .947      0
    6               11   .985 | .909   .973 | .909   .909 | .818      0
    7               74   .928 | .878   .930 | .878   .939 | .904      0
    9               80   .950 | .912   .945 | .900   .938 | .900      0
    10              20   .974 | .900   .981 | .950   .929 | .895      0
    11              80   .942 | .863   .942 | .875   .922 | .850      .01
    J1-lasting      40   .921 | .903   .926 | .892   .985 | .950      .12
    8               80   .927 | .863   .943 | .887   .928 | .887      .01
    12              80   .956 | .900   .968 | .938   .943 | .925      .01
    20              79   .945 | .897   .965 | .942   .964 | .937      .54
    21              40   .925 | .875   .959 | .875   .954 | .921      .02
    J1              79   .938 | .857   .943 | .886   .939 | .873      .04
    J2              79                 .948 | .911                    .01
    J3              40                 .978 | .950                    0

No worst place is below .92 by more than chance: the least probable, of 11's bound, is so with .10, of J1's with .49, all others
with .76 or more.  J2 (10,000 trajectories) and J3 (4,000) have no exact filter: their filters are compared with each other.
J1-lasting ran with 10,000 trajectories and three filters.  With the exact AOF on 320 of them only, .57 of its gaps are told, and
the others cover .936; judged by the largest single trajectory alone, those at the worst place cover .83.

With 100,000 trajectories and the exact AOF on 4,000, the sizes of `kfcourse lab`, 5 steps:

    variant      seeds       gap         difference        bound     told
    53             400   .949 | .932   .945 | .930   .950 | .935      0
    1              400   .947 | .935   .947 | .935   .927 | .907      .09
    2              200   .956 | .915   .945 | .910   .943 | .915      0
    9              400   .944 | .925   .952 | .925   .951 | .938      0
    3              200   .940 | .913   .944 | .910   .952 | .930      .06
    4              200   .956 | .920   .950 | .930   .941 | .920      .01
    5              200   .932 | .905   .939 | .910   .935 | .910      0
    6              100   .946 | .920   .957 | .930   .945 | .900      0
    7              200   .937 | .905   .947 | .910   .947 | .935      0
    8              200   .954 | .934   .954 | .935   .954 | .945      0
    10             200   .938 | .895   .937 | .905   .942 | .935      0
    11             200   .954 | .901   .952 | .920   .951 | .930      .01
    12             200   .943 | .915   .942 | .900   .948 | .940      0
    20             100   .938 | .846   .955 | .885   .970 | .950      .29
    21             100   .975 | .930   .952 | .920   .970 | .950      .01
    J1             100   .935 | .900   .947 | .920   .938 | .920      0

Each worst place here is such as chance alone would bring among so many.

These are the first five steps, and slow parts of the first trajectories alone.  Then, on variant 5 at the same sizes, .90 down to
.75 of the GAOF's gaps and .83 down to .58 of the FOS's held the truth from step 5 to 11, and `trusted` said nothing: the sine
meter loses these filters now and then, a single one of 40,000 trajectories makes 5 to 10 % of the distance, and 4,000 often had
none like it.  Since the slow part has the exceptional trajectories (`montecarlo.exceptional`), with 12 steps, all filters of the
lab, compiled; the last kind are means over the steps, of each filter and of its difference from the control:

    variant      seeds       gap         difference        bound          mean      told
    53             160   .938 | .899   .947 | .906   .955 | .931   .958 | .925   .01
    1               80   .950 | .900   .950 | .900                 .943 | .912   0
    2               60   .941 | .867   .950 | .883   .953 | .917   .943 | .917   0
    3               60   .945 | .879   .944 | .721   .953 | .867   .947 | .883   .01
    4              120   .932 | .850   .949 | .883   .948 | .917   .933 | .908   .07
    5              120   .940 | .900   .946 | .892   .953 | .925   .938 | .908   0
    6               20   .927 | .750   .955 | .850   .959 | .900   .954 | .900   0
    7               80   .930 | .875   .941 | .875   .941 | .911   .929 | .875   0
    8               40   .955 | .850   .953 | .850   .959 | .900   .979 | .950   0
    9               40   .948 | .850   .961 | .900   .931 | .875   .954 | .875   0
    10              40   .954 | .875   .951 | .850   .946 | .900   .958 | .875   0
    11              80   .952 | .887   .957 | .887   .952 | .925   .970 | .950   0
    12             100   .946 | .908   .944 | .910   .957 | .930   .927 | .900   0

But for one, each worst place is such as chance would bring, were the coverage .92.  That one is the DUOF of variant 3 at step 1,
which misses by trajectories of which 100,000 have one or none (chance .01): no choice among those that came tells of others.
Smaller slow parts, 100 seeds each, all trajectories / the slow ones: where each exceptional one stands for several, gaps
cover less, and a part of them is told.  The last line are the smoothers of `looking-back` (two seeds have no exact one):

    5,  100,000 / 512    .918 | .845   .953 | .863   .956 | .936   .928 | .870   .23
    53, 100,000 / 512    .913 | .880   .961 | .920   .954 | .917   .975 | .950   .66
    5,  20,000 / 2000    .949 | .888   .929 | .827   .956 | .910   .938 | .900   .01
    53, 20,000 / 2000    .942 | .890   .946 | .870   .943 | .920   .949 | .910   .04
    53, 20,000 / 1000    .937 | .908   .951 | .929   .956 | .939   .954 | .949   .50

With `--pages` the comparisons of a page of the book are made again, at its sizes, and asked what the page asks: all is drawn anew
with each seed, design ensembles too:

    models-that-jump, all filters                 100 seeds   .949 | .900
    models-that-jump, GPB2 and the bound          100         .943 | .840   (chance .12)
    models-that-jump, question 4                  100         .953 | .910
    filters-that-remember, variant 53              60         .959 | .933
    filters-that-remember, cubic sensor            60         .941 | .883
    filters-that-remember, growth model            60         .942 | .817   (chance .32)
    filters-that-remember, question 4              60         .954 | .933

Question 4 was asked of variant 5, with 400 exact trajectories and eight steps: .75 | .68.  These, too, had no exceptional ones.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import time
import warnings
from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import joblib
import matplotlib
import numpy as np
import scipy
from myst_nb.core.read import myst_nb_reader_plugin

import kfcourse
from kfcourse import Ensemble, JumpModel, compare, design, load_variants
from kfcourse.filters.designed import Design
from kfcourse.lab.admission import admissions
from kfcourse.lab.short_names import JUMP_LAB, LAB
from kfcourse.lab.variants import find_variant
from kfcourse.montecarlo.comparison import EXACT, Comparison
from kfcourse.montecarlo.statistics import Estimate

CONFIDENCE = 0.95
LEAST = 0.92  # coverage that is good enough
WITH_MODES = ("J1", "J1-lasting", "J-switching", "J2", "J3")


def estimates(result: Comparison) -> dict[str, tuple[Estimate, np.ndarray]]:
    """What is asked of a comparison, each (filters, steps), and whether the report lets its interval be trusted."""
    entrants, control = result.entrants, result.control
    others = [name for name in entrants if name != control]
    differences = {name: result.difference(name, control) for name in others}
    asked = {"difference": [(differences[name], result.trusted(differences[name], name, control)) for name in others]}
    if EXACT in result.names:
        gaps, bound = {name: result.gap(name) for name in entrants}, result.bound()
        asked["gap"] = [(gaps[name], result.trusted(gaps[name], name)) for name in entrants]
        asked["bound"] = [(bound, result.trusted(bound))]
    of_mean = [result.mean_gap(name) for name in others], [result.mean_gap_difference(name, control) for name in others]
    asked["mean"] = [(found, np.ones(result.steps, dtype=bool)) for found in chain(*of_mean)]
    return {
        what: (
            Estimate(*(np.array([np.broadcast_to(getattr(one, field), result.steps) for one, _ in found]) for field in FIELDS)),
            np.array([good for _, good in found]),
        )
        for what, found in asked.items()
    }


FIELDS = ("value", "standard_error", "freedom", "skewness")


def covered(found: list[tuple[Estimate, np.ndarray]], unit: np.ndarray | float) -> tuple[float, float, float, float, float]:
    """Coverage over all, at the worst place, how probable so bad a place is, the part of misses too low, and of the untrusted.

    The probability is that of a place so bad or worse among so many, if each covered with `LEAST`.

    Of what varies by less than 1e-10 of the unit, filters that coincide, only the rounding is seen.
    """
    values, trusted = np.array([one.value for one, _ in found]), np.array([good for _, good in found])
    limits = np.array([one.interval(CONFIDENCE) for one, _ in found])
    with warnings.catch_warnings(action="ignore", category=RuntimeWarning):  # a step that is usable for no seed has no mean
        truth, spread = np.nanmean(values, axis=0), np.nanstd(values, axis=0)
    varies = np.broadcast_to(spread > 1e-10 * unit, trusted.shape[1:])
    low, high = ((limits[:, 0] > truth) & trusted)[:, varies], ((limits[:, 1] < truth) & trusted)[:, varies]
    counted = trusted[:, varies].sum(axis=0)
    told = 1 - counted.sum() / max(trusted[:, varies].size, 1)
    some = counted >= len(found) / 2  # a place at which most are told is none to be judged by
    if not some.any():
        return 1.0, 1.0, 1.0, 0.5, told
    missed = (low | high).sum(axis=0)
    hits = counted[some] - missed[some]
    so_bad = min(1.0, some.sum() * scipy.stats.binom.cdf(hits, counted[some], LEAST).min())
    return 1 - missed.sum() / counted.sum(), (hits / counted[some]).min(), so_bad, high.sum() / max(missed.sum(), 1), told


def line(name: str, seeds: int, runs: int, slow_runs: int, steps: int, jobs: int, compiled: bool) -> str:
    model, start = find_variant(name).model, time.monotonic()
    names = JUMP_LAB if isinstance(model, JumpModel) else LAB
    filters = [found.one for found in admissions(model, [*names, EXACT]) if found.one is not None]
    to_design = [one for one in filters if isinstance(one, Design)]
    ready = {one.name: one for one in design(to_design, Ensemble(model, runs, steps, np.random.SeedSequence(0)).by_step())}
    filters = [ready.get(one.name, one) for one in filters]

    def one(seed: int) -> dict[str, tuple[Estimate, np.ndarray]]:
        options = {"slow_runs": slow_runs, "threads": 1, "progress": False, "compiled": compiled}
        return estimates(compare(filters, model, runs, steps, seed, **options))

    found = joblib.Parallel(jobs, prefer="threads" if jobs == 1 else None)(
        joblib.delayed(one)(seed) for seed in range(1, seeds + 1)
    )
    of_size = "bound" if "bound" in found[0] else "difference"
    cells, size = [], np.mean([np.abs(result[of_size][0].value).max(axis=0) for result in found], axis=0)
    for what, unit in (("gap", 1.0), ("difference", size), ("bound", size), ("mean", 1.0)):
        if what not in found[0]:
            cells.append(" " * 36)
            continue
        share, worst, so_bad, low, told = covered([result[what] for result in found], unit)
        cells.append(f"{share:7.3f} {worst:6.3f} {so_bad:6.2f} {low:5.2f} {told:5.2f}")
    return f"{name:>8}" + " |".join(cells) + f" | {time.monotonic() - start:6.0f}"


class Asked:
    """A comparison as a page made it, which keeps how it was made and what the page asks it for."""

    def __init__(self, filters: Sequence[Any], model: Any, runs: int, steps: int, seed: int, **options: Any):
        self.made, self.options = (filters, model, runs, steps), {**options, "progress": False, "threads": 1}
        self.first, self.questions = compare(*self.made, seed, **options), dict[str, tuple[str, tuple[Any, ...]]]()

    def __getattr__(self, name: str) -> Any:
        known = getattr(self.first, name)

        def ask(*given: Any) -> Any:
            found = known(*given)
            if isinstance(found, Estimate):
                self.questions[f"{name}{given}"] = name, given
            return found

        return ask if callable(known) else known


def again(made: tuple[Any, ...], options: dict[str, Any], questions: list[Any], seed: int) -> tuple[Estimate, np.ndarray]:
    """The answers to all questions with another seed, designs included, side by side, and that all count."""
    result = compare(*made, seed, **options)
    answers = [getattr(result, name)(*given) for name, given in questions]
    fields = (
        np.concatenate([np.broadcast_to(getattr(one, field), np.shape(one.value)).ravel() for one in answers]) for field in FIELDS
    )
    together = Estimate(*fields)
    return together, np.ones(together.value.shape, dtype=bool)


def comparisons_of(page: str) -> list[Asked]:
    """The comparisons that a page of the book makes and asks for an estimate."""
    made = list[Asked]()

    def recorded(*given: Any, **named: Any) -> Asked:
        made.append(Asked(*given, **named))
        return made[-1]

    matplotlib.use("Agg")
    book, names = Path(__file__).resolve().parents[1] / "book", dict[str, Any]()
    kfcourse.compare = recorded  # type: ignore[assignment]
    with contextlib.redirect_stdout(io.StringIO()):
        for cell in myst_nb_reader_plugin(str(book / f"{page}.md")).cells:
            if cell.cell_type == "code":
                exec(cell.source, names)
    kfcourse.compare = compare
    return [one for one in made if one.questions]


def page_lines(page: str, seeds: int, jobs: int) -> list[str]:
    """For each comparison of a page how often what it is asked for holds the truth."""
    lines = []
    for i, asked in enumerate(comparisons_of(page)):
        start = time.monotonic()
        found = joblib.Parallel(jobs, prefer="threads" if jobs == 1 else None)(
            joblib.delayed(again)(asked.made, asked.options, [*asked.questions.values()], seed) for seed in range(1, seeds + 1)
        )
        size = np.mean([np.abs(one.value) for one, _ in found], axis=0)
        share, worst, so_bad, low, _ = covered(found, size)
        lines.append(
            f"{page:>24} {i + 1}: {len(asked.questions):3} questions {share:7.3f} {worst:6.3f} {so_bad:6.2f} {low:5.2f}"
            f" | {time.monotonic() - start:6.0f}"
        )
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description="Coverage of the intervals of a comparison")
    parser.add_argument("--variants", nargs="+", default=[*load_variants(), *WITH_MODES])
    parser.add_argument("--pages", nargs="+", default=[], help="pages of the book in place of variants")
    for option, default in (("--seeds", 400), ("--runs", 100_000), ("--slow-runs", 4000), ("--steps", 12), ("--jobs", 2)):
        parser.add_argument(option, type=int, default=default)
    parser.add_argument("--compiled", action="store_true", help="by compiled code: the same numbers but for rounding")
    args = parser.parse_args()
    if args.pages:
        part = f"{'mean':>7} {'worst':>6} {'chance':>6} {'low':>5}"
        print(f"{args.seeds} seeds, at the sizes of the page; nominal 0.95: {part} | {'s':>6}")
        for page in args.pages:
            print("\n".join(page_lines(page, args.seeds, args.jobs)), flush=True)
        return
    print(f"{args.seeds} seeds, {args.runs} trajectories, the exact AOF on {args.slow_runs}, {args.steps} steps; nominal 0.95")
    part = f"{'mean':>7} {'worst':>6} {'chance':>6} {'low':>5} {'told':>5}"
    kinds = "|".join(f"{kind:>33} " for kind in ("gap", "difference", "bound", "mean over steps"))
    print(f"{'':>8}{kinds}|\n{'variant':>8}{part} |{part} |{part} |{part} | {'s':>6}")
    for name in args.variants:
        print(line(name, args.seeds, args.runs, args.slow_runs, args.steps, args.jobs, args.compiled), flush=True)


if __name__ == "__main__":
    main()
