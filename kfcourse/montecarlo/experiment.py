"""The Monte Carlo engine: all filters on common trajectories, statistics on the fly.

::

    compare(filters, model, runs, steps, seed) -> Comparison

designs the filters that need it on one ensemble, runs all of them on another, and keeps sums over
batches of trajectories, never the trajectories themselves.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from itertools import accumulate, chain, islice
from typing import Any

import numpy as np

from kfcourse.errors import Reason, expect, expect_sizes
from kfcourse.filters.base import Filter, State
from kfcourse.filters.designed import Design
from kfcourse.filters.fused import Fused, fuse
from kfcourse.laws import Array, Gaussian, stacked
from kfcourse.montecarlo.batches import BATCHES, batch_sizes
from kfcourse.montecarlo.blocks import progress_bar, run_block, run_stretches
from kfcourse.montecarlo.comparison import Comparison
from kfcourse.montecarlo.designing import NotFinite, design, design_together
from kfcourse.montecarlo.ensemble import STEPS_AT_ONCE, Ensemble, workers
from kfcourse.montecarlo.exceptional import Chosen, Scores, how_many
from kfcourse.montecarlo.parallel import Cluster, cluster, cores
from kfcourse.montecarlo.slow_filters import LEAST, run_slow_filters
from kfcourse.montecarlo.statistics import Sums
from kfcourse.montecarlo.two_phase import Replicas
from kfcourse.montecarlo.widths import best_width
from kfcourse.symbolic.angular import warn_of_degrees
from kfcourse.symbolic.compiled import REMEDY, is_scalar
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model

DESIGN_RUNS = 1_000_000  # more find coefficients no comparison could tell from these


def run(one: Filter, y: Array) -> Gaussian:
    """Run a filter over stored measurements.

    Parameters
    ----------
    one : Filter
    y : ndarray (steps, runs, p)
        NaN where a measurement is missing.  One trajectory of a scalar meter may come as (steps,), and counts as runs = 1.

    Returns
    -------
    Gaussian
        Estimates (steps, runs, n) and the filter's covariances (steps, runs, n, n).

    Raises
    ------
    ValueError
        Measurements of another shape, none at all, or infinite ones.
    TypeError
        No filter: a `Design`, whose coefficients are still to be found, a model, or structural functions.
    """
    return stacked([state.posterior for state in islice(walk(one, y), 1, None)])


def predictions(one: Filter, y: Array) -> Gaussian:
    """What a filter expects before each measurement: lambda_k (steps, runs, n) and Psi_k (steps, runs, n, n).

    Arguments as in `run`.  `kfcourse.linear.consistency` compares them with what then came.
    """
    return stacked([state.predicted for state in walk(one, y)][:-1])


def states(one: Filter, y: Array) -> list[State]:
    """The filter's states: before the first measurement, and after each.  Arguments and errors as of `run`."""
    return list(walk(one, y))


def walk(one: Filter, y: Array) -> Iterator[State]:
    """The same one after the other: what the exact filter or particles remember of all steps may be gigabytes."""
    y = measurements(one, y)
    return accumulate(y, one.step, initial=one.init(y.shape[1]))


def measurements(one: Filter, y: Array) -> Array:
    """What a filter is to be run over, as (steps, runs, p); ValueError if it is none."""
    expect(one, Filter, "a run")
    y, p = np.asarray(y, dtype=float), one.model.p
    if y.ndim == 1 and p == 1:
        y = y[:, None, None]
    if y.ndim != 3:
        raise ValueError(f"measurements must have the shape (steps, runs, {p}), got {y.shape}{_reshaped(y, p)}")
    if y.shape[2] != p:
        raise ValueError(f"{one.name} expects {p} measurement component(s), got {y.shape[2]}")
    if not y.size:
        raise ValueError(f"there are no measurements to run over: the shape (steps, runs, {p}) is {y.shape}")
    if (endless := np.isinf(y)).any():
        k, run, _ = np.argwhere(endless)[0]
        raise ValueError(f"the measurement of step {k}, run {run} is infinite; write NaN where one is missing")
    warn_of_degrees("a measurement", y, one.model.measured, one.model.angles.y)
    return y


def _reshaped(y: Array, p: int) -> str:
    """How measurements of two axes may be meant."""
    if y.ndim != 2:
        return ""
    ways = ["y[:, None, :] if the columns are components of one trajectory"] if y.shape[1] == p else []
    ways += ["y[:, :, None] if they are trajectories"] if p == 1 else []
    return ": give " + " or ".join(ways) if ways else ""


def compare(
    filters: Sequence[Filter | Design],
    model: Model | JumpModel,
    runs: int,
    steps: int,
    seed: int,
    *,
    design_runs: int | None = None,
    designs: int = 1,
    same_ensemble: bool = False,
    smoothers: Sequence[Filter] = (),
    wide: float | None = None,
    compiled: bool = False,
    slow_runs: int = 2000,
    slow_seconds: float | None = None,
    slow_memory: float | None = None,
    threads: int | None = None,
    dask: str | None = None,
    progress: bool | None = None,
) -> Comparison:
    """Compare filters on common trajectories of a model.

    Parameters
    ----------
    filters : sequence of Filter or Design
        Designs are designed first, on an ensemble of their own.
    model : Model
    runs, steps : int
        Trajectories, and measurements of each.
    seed : int
        The same seed gives the same numbers, bit by bit, whatever the number of threads.  Another NumPy or processor may do
        linear algebra by another kernel (BLAS): then vector models differ by rounding, up to some 1e-12, and scalar ones hardly.
    design_runs : int, optional
        Size of the design ensemble, which is held at once: a trajectory of a scalar model takes 0.15 kB with one designed filter
        and 0.45 kB with the lab's seven, one of a model of two states 0.36 kB with one.  By default `runs`, at most a million:
        coefficients from so many cost a filter about a millionth of its accuracy, and memory does not grow with `runs`.
    designs : int
        Designed filters are designed on so many ensembles.  The first design is reported; how the others differ from it on the
        common trajectories goes into the standard errors.  With 1 these hold for the filters just as they were designed.
    same_ensemble : bool
        Design on the very trajectories of the comparison, as the lab does: optimistic for the designed
        filters, by about the number of coefficients over `runs`.
    smoothers : sequence of Filter
        Filters that look back from the end of each record, such as `aof(gaussian(model))`, and `pointmass(model)` as their bound;
        `Comparison.smoothing` tells how good they are.
    wide : float, optional
        Draw half of the initial states of the comparison from a law so many times as wide as the prior, all by strata, and weight
        every trajectory (importance sampling): where rare far starts dominate the error, that gives the standard errors of many
        times the trajectories.  By default a pilot on the fast filters chooses among 1, 1.5, 2 and 3.
    compiled : bool
        Run compiled code (numba: `pip install kfcourse[fast]`) where a scalar model and its filters have formulas to compile.
        The numbers are the same but for rounding; the first time, compiling takes seconds, and is kept.
    slow_runs : int
        Slow filters (exact, particle) run on this many of the common trajectories, at least 100: the first ones, and those on
        which the fast filters disagree or err the most (`exceptional`).  What they differ by from the Gaussian AOF (or else the
        most accurate fast filter) is found there.  0 leaves them out.
    slow_seconds : float, optional
        The slow filters stop after so long, on fewer trajectories; `Comparison.slow_runs` tells on how many.  With
        the same seed, as many trajectories give the same numbers.  A slow filter that fails, or that does not come through
        the first few in this time, is left out, and `Comparison.left_out` tells why.
    slow_memory : float, optional
        Bytes that the slow filters may take beyond what the process has (Linux).  They then take fewer trajectories at once,
        which changes nothing but the time; one that has not room for the first few is left out.
    threads : int, optional
        How many processor cores to use, by default all there are: threads share the blocks of trajectories, and processes the
        slow filters' chunks, as far as these take more than a moment.
    dask : str, optional
        Address of a Dask scheduler, such as "tcp://scheduler:8786": its workers run the filters, in blocks of trajectories and in
        chunks of the slow filters'; the numbers are the same.  Designed is here.  `slow_memory` is theirs to keep, not limited.
    progress : bool, optional
        Show progress bars; by default if standard error is a terminal.

    Raises
    ------
    ValueError
        Filters of equal name, sizes that are not positive whole numbers; `compiled` without numba.
    NotFinite
        A trajectory or a filter left the finite numbers.
    """
    _check_arguments(filters, model, slow_runs, slow_seconds, slow_memory)
    _check_designs(designs, same_ensemble, wide)
    if smoothers:
        for one in smoothers:
            expect(one, Filter, "smoothers=")
        _check_arguments(smoothers, model, slow_runs, slow_seconds, slow_memory)
    if compiled:
        filters = _compiled(filters)
    threads = cores() if threads is None else threads
    names = [one.name for one in filters]
    slow = [one for one in filters if one.slow and slow_runs]
    fast = [one for one in filters if not one.slow]
    run_seed, pilot_seed, *design_seeds = np.random.SeedSequence(seed).spawn(2 + designs)
    common = Ensemble(model, runs, steps, run_seed, compiled=compiled)
    size = min(runs, DESIGN_RUNS) if design_runs is None else design_runs
    design_ensemble, *others = (
        [common] if same_ensemble else [Ensemble(model, size, steps, one, compiled=compiled) for one in design_seeds]
    )
    to_design = [one for one in fast if isinstance(one, Design)]
    with workers(threads) as pool, cluster(dask) as far:
        ready = _designed(fast, design_ensemble, pool, progress)
        again = [_designed(to_design, one, pool, progress) for one in others]
        if not same_ensemble:
            common = replace(common, wide=best_width(ready, replace(common, seed=pilot_seed)) if wide is None else wide)
        everyone = [*ready, *chain(*again)]
        few, limits = min(slow_runs, runs), (slow_seconds, slow_memory, threads)
        count = how_many(runs) if few and any(one.slow for one in (*filters, *smoothers)) else 0
        executor, judged = far.executor if far else pool, (len(ready), count)
        try:
            everything, exceptional = _run_blocks(everyone, common, executor, progress, judged)
        except NotFinite:
            if wide is not None or not common.wide or common.wide == 1:
                raise
            common = replace(common, wide=1.0)  # some far start is too far: none but the prior's own
            everything, exceptional = _run_blocks(everyone, common, executor, progress, judged)
        sums, replicas = _split(everything, fast, len(others))
        chosen = Chosen.of(few, exceptional)
        slow_part, left_out = None, dict[str, Reason]()
        if slow:
            slow_ready = _designed(slow, design_ensemble, pool, progress)
            slow_part, left_out = run_slow_filters(ready, slow_ready, common, chosen, sums.counts, *limits, progress, far=far)
        smoothing = None
        if smoothers:
            smoothing = _smoothing(smoothers, common, seed, pool, chosen, limits, progress, far)
    quick = tuple(one.name for one in fast)
    found = Comparison(model, tuple(names), quick, runs, steps, seed, sums, slow_part, left_out, replicas)
    return replace(found.without_unhealthy(), smoothing=smoothing)


def without_failing(
    filters: Sequence[Filter | Design], *common: Any, left_out: Mapping[str, Reason] | None = None, **options: Any
) -> Comparison:
    """`compare` of the filters that do not fail; the others are named in `left_out`, beside those given.

    A filter that leaves the finite numbers is taken out, and the comparison starts again.  Other arguments as of `compare`.

    Raises
    ------
    NotFinite
        The model's trajectories become infinite, or no filter is left.
    """
    reasons = dict(left_out or {})
    while True:
        try:
            found = compare(filters, *common, **options)
        except NotFinite as error:
            rest = [one for one in filters if one.name != error.filter_name]
            if not error.filter_name or not [one for one in rest if not one.slow]:
                raise
            filters, reasons[error.filter_name] = rest, error.with_traceback(None)
        else:
            return replace(found, left_out={**reasons, **found.left_out})


def _smoothing(
    smoothers: Sequence[Filter],
    common: Ensemble,
    seed: int,
    pool: Executor,
    chosen: Chosen,
    limits: tuple[float | None, float | None, int],
    progress: bool | None,
    far: Cluster | None,
) -> Comparison:
    """The comparison of smoothers on the same trajectories, the slow ones on those that the slow filters saw."""
    few = len(chosen.places)
    slow, fast = ([one for one in smoothers if one.slow == which and (few or not one.slow)] for which in (True, False))
    sums, _ = _run_blocks(fast, common, far.executor if far else pool, progress, (0, 0), back=True)
    slow_part, left_out = None, dict[str, Reason]()
    if slow:
        given = fast, slow, common, chosen, sums.counts
        slow_part, left_out = run_slow_filters(*given, *limits, progress, back=True, far=far)
    names, quick = (tuple(one.name for one in some) for some in (smoothers, fast))
    found = Comparison(common.model, names, quick, common.runs, common.steps, seed, sums, slow_part, left_out)
    return found.without_unhealthy()


def _check_arguments(
    filters: Sequence[Filter | Design],
    model: Model | JumpModel,
    slow_runs: int,
    slow_seconds: float | None,
    slow_memory: float | None,
) -> None:
    """ValueError for what `compare` cannot do with these arguments."""
    if isinstance(filters, Filter | Design):
        raise TypeError(f"compare expects a list of filters, and one came: compare([{filters.name}], model, ...)")
    for one in filters:
        expect(one, Filter, "compare", Design)
    expect(model, Model, "compare", JumpModel)
    names = [one.name for one in filters]
    if len(set(names)) < len(names) or not names:
        raise ValueError(f"give at least one filter, and each a name of its own: {', '.join(names) or 'none given'}")
    if all(one.slow for one in filters):
        raise ValueError(f"{names[0]} is found through its difference from a fast filter; add one, such as aof-gaussian")
    if not isinstance(slow_runs, int | np.integer) or slow_runs < 0:
        raise ValueError(f"slow_runs must be a whole number of trajectories, 0 for none, got {slow_runs!r}")
    if slow_seconds is not None and not slow_seconds > 0:
        raise ValueError(f"slow_seconds must be positive, got {slow_seconds}; slow_runs=0 leaves the slow filters out")
    if slow_memory is not None and not slow_memory >= LEAST:
        raise ValueError(f"slow_memory must be at least {LEAST:g}, got {slow_memory}; slow_runs=0 leaves the slow filters out")
    for one in filters:
        if (one.model.n, one.model.p) != (model.n, model.p):
            raise ValueError(
                f"{one.name} was built for a model with {one.model.n} states and {one.model.p} measurements; "
                f"this one has {model.n} and {model.p}"
            )


def _compiled(filters: Sequence[Filter | Design]) -> list[Filter | Design]:
    """The filters with compiled steps as far as that can be; ValueError if there is no numba."""
    try:
        return [fuse(one) for one in filters]
    except ImportError:
        raise ValueError(REMEDY) from None


def _check_designs(designs: int, same_ensemble: bool, wide: float | None) -> None:
    expect_sizes(designs=designs)
    if designs > 1 and same_ensemble:
        raise ValueError("there is one ensemble of the comparison: same_ensemble=True goes with designs=1 only")
    if same_ensemble and wide is not None:
        raise ValueError("a design weighs all its trajectories alike: same_ensemble=True goes without wide")


def _split(sums: Sums, fast: Sequence[Filter | Design], again: int) -> tuple[Sums, Replicas | None]:
    """Sums of the fast filters, and of the designed ones for each of their designs."""
    own = sums.of_filters(slice(len(fast)))
    designed = [i for i, one in enumerate(fast) if isinstance(one, Design)]
    if not designed or not again:
        return own, None
    starts = [len(fast) + len(designed) * i for i in range(again)]
    others = (sums.of_filters(slice(start, start + len(designed))) for start in starts)
    return own, Replicas(tuple(fast[i].name for i in designed), (own.of_filters(designed), *others))


def _designed(filters: Sequence[Filter | Design], ensemble: Ensemble, pool: Executor, progress: bool | None) -> list[Filter]:
    """The filters in their order, those that need it designed on the ensemble."""
    found = {one.name: one for one in filters if isinstance(one, Filter)}
    if quick := [one for one in filters if isinstance(one, Fused)]:
        few = progress_bar("designing", -(-ensemble.steps // STEPS_AT_ONCE), "stretch", progress, ensemble.together(pool))
        found |= {one.name: one for one in design_together(quick, few, (ensemble.runs, ensemble.steps), pool)}
    if rest := [one for one in filters if isinstance(one, Design) and one.name not in found]:
        steps = progress_bar("designing", ensemble.steps, "step", progress, ensemble.by_step(pool))
        found |= {one.name: one for one in design(rest, steps, pool)}
    return [found[one.name] for one in filters]


def _run_blocks(
    filters: Sequence[Filter],
    ensemble: Ensemble,
    pool: Executor,
    progress: bool | None,
    judged: tuple[int, int],
    *,
    back: bool = False,
) -> tuple[Sums, Array]:
    """Sums over all trajectories, its blocks in parallel.

    Judged by the first so many filters, also the numbers of so many of the most exceptional trajectories.
    """
    judges, count = judged
    several = ensemble.compiled and is_scalar(ensemble.model) and not back and not count

    def block(index: int) -> tuple[Sums, tuple[Array, Array]]:
        size = ensemble.sizes[index]
        counts = batch_sizes(size, max(1, round(BATCHES * size / ensemble.runs)))
        sums = Sums.empty(len(filters), ensemble.steps, ensemble.model.n, counts)
        scores = Scores(size, judges) if count else None
        if several:
            run_stretches(filters, ensemble.stretches(index), sums, ensemble.weight)
        else:
            run_block(filters, ensemble.block(index), sums, weight_of=ensemble.weight, back=back, scores=scores)
        return sums, scores.highest(count) if scores else (np.empty(0, dtype=int), np.empty(0))

    indices = range(len(ensemble.sizes))
    found, highest = zip(*progress_bar("comparing", len(indices), "block", progress, pool.map(block, indices)), strict=True)
    starts = accumulate(ensemble.sizes, initial=0)
    places = np.concatenate([start + here for start, (here, _) in zip(starts, highest, strict=False)])
    best = np.argsort(-np.concatenate([scores for _, scores in highest]), kind="stable")[:count]
    return Sums.concatenate(found), np.sort(places[best])
