"""The Monte Carlo engine: all filters on common trajectories, statistics on the fly.

::

    compare(filters, model, runs, steps, seed) -> Comparison

designs the filters that need it on an ensemble of their own, runs all of them on the same
trajectories, and keeps sums over batches of these, never the trajectories themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import accumulate, islice
from typing import Any, TypeVar

import joblib
import numpy as np
from tqdm import tqdm

from kfcourse.angles import difference
from kfcourse.errors import NotFinite, Reason, expect, expect_sizes
from kfcourse.filters.base import Filter, State, ahead
from kfcourse.filters.designed import Design
from kfcourse.filters.looking_back import looked_back
from kfcourse.laws import Array, Gaussian, stacked
from kfcourse.montecarlo import BATCHES
from kfcourse.montecarlo.comparison import EXACT, Comparison
from kfcourse.montecarlo.designing import check_sizes, design, failed
from kfcourse.montecarlo.ensemble import Ensemble, Instant, check_finite, side_by_side, weights
from kfcourse.montecarlo.parallel import cluster
from kfcourse.montecarlo.scores import scored
from kfcourse.montecarlo.statistics import Sums, claimed
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import Structure

# trajectories of a piece of work: a pass over fewer takes as long as the interpreter does
PIECE = 2500
# coefficients of so many cost a filter some hundred-thousandth of its accuracy
DESIGN_RUNS = 200_000
# times as wide as the prior: a law from which half of the initial states are drawn; rare far ones
# carry what filters differ by, and standard errors of mean gaps of variant 53 are a third for it
WIDE = 1.5

T = TypeVar("T")
F = TypeVar("F", Filter, Filter | Design)


def run(filter_: Filter, y: Array) -> Gaussian:
    """Run a filter over stored measurements.

    Parameters
    ----------
    filter_ : Filter
    y : ndarray (steps, runs, p)
        NaN where a measurement is missing.  One trajectory of a scalar meter may come as (steps,),
        and counts as runs = 1.

    Returns
    -------
    Gaussian
        Estimates (steps, runs, n) and the filter's covariances (steps, runs, n, n).

    Raises
    ------
    ValueError
        Measurements of another shape, none at all, or infinite ones.
    TypeError
        No filter: a `Design`, whose coefficients are still to be found, a model, or structural
        functions.
    """
    return stacked([state.posterior for state in islice(walk(filter_, y), 1, None)])


def predictions(filter_: Filter, y: Array) -> Gaussian:
    """What a filter expects before each measurement: lambda_k (steps, runs, n) and Psi_k (steps,
    runs, n, n).

    Arguments as in `run`.  `kfcourse.linear.consistency` compares them with what then came.
    """
    return stacked([ahead(filter_, state) for state in walk(filter_, y)][:-1])


def states(filter_: Filter, y: Array) -> list[State]:
    """The filter's states: before the first measurement, and after each.  Arguments and errors as
    of `run`."""
    return list(walk(filter_, y))


def walk(filter_: Filter, y: Array) -> Iterator[State]:
    """The same one after the other: what the exact filter or particles remember of all steps may be
    gigabytes."""
    y = measurements(filter_, y)
    return accumulate(y, filter_.step, initial=filter_.init(y.shape[1]))


def measurements(filter_: Filter, y: Array) -> Array:
    """What a filter is to be run over, as (steps, runs, p); ValueError if it is none."""
    expect(filter_, Filter, "a run")
    y, p = np.asarray(y, dtype=float), filter_.model.p
    if y.ndim == 1 and p == 1:
        y = y[:, None, None]
    if y.ndim != 3:
        raise ValueError(
            f"measurements must have the shape (steps, runs, {p}), got {y.shape}; of two axes give "
            f"y[:, None, :] if the columns are components of one trajectory, y[:, :, None] if they "
            f"are trajectories"
        )
    if y.shape[2] != p:
        raise ValueError(f"{filter_.name} expects {p} measurement component(s), got {y.shape[2]}")
    if not y.size:
        raise ValueError(
            f"there are no measurements to run over: the shape (steps, runs, {p}) is {y.shape}"
        )
    if (endless := np.isinf(y)).any():
        k, run, _ = np.argwhere(endless)[0]
        raise ValueError(
            f"the measurement of step {k}, run {run} is infinite; write NaN where one is missing"
        )
    return y


def compare(
    filters: Sequence[Filter | Design],
    model: Model | JumpModel,
    runs: int,
    steps: int,
    seed: int,
    *,
    design_runs: int | None = None,
    same_ensemble: bool = False,
    smoothers: Sequence[Filter] = (),
    scores: Structure | None = None,
    jobs: int | None = None,
    dask: str | None = None,
    progress: bool | None = None,
) -> Comparison:
    """Compare filters on common trajectories of a model.

    Parameters
    ----------
    filters : sequence of Filter or Design
        Designs are designed first, on an ensemble of their own; standard errors hold for the
        filters as they were designed. One that cannot go on, as it leaves the finite numbers or
        says so itself, is left out, and `Comparison.left_out` tells why.
    model : Model
    runs, steps : int
        Trajectories, and measurements of each.
    seed : int
        The same seed gives the same numbers, bit by bit, whatever the number of jobs.  Another
        processor rounds otherwise, and so does a process that compiles the exact filter for the
        first time: up to some 1e-12.
    design_runs : int, optional
        Size of the design ensemble; by default ten times `runs`, at most 200,000.
    same_ensemble : bool
        Design on the very trajectories of the comparison, as the lab does: optimistic for the
        designed filters, by about the number of coefficients over `runs`.
    smoothers : sequence of Filter
        Filters that look back from the end of each record, such as `aof(gaussian(model))`, and
        `pointmass(model)` as their bound; `Comparison.smoothing` tells how good they are.
    scores : Structure, optional
        Judge each filter's prediction of the measurement, too (`Comparison.log_score`, `crps`): by
        these structural functions where a filter has none of its own.
    jobs : int, optional
        How many threads share the work, by default one for each processor core.
    dask : str, optional
        Address of a Dask scheduler, such as "tcp://scheduler:8786": its workers run the filters;
        the numbers are the same but for rounding.  Designed is here.
    progress : bool, optional
        Show progress bars; by default if standard error is a terminal.

    Raises
    ------
    ValueError
        Filters of equal name, sizes that are not positive whole numbers.
    NotFinite
        The model's trajectories become infinite, or no filter is left.
    """
    _check_arguments(filters, model)
    if smoothers:
        for filter_ in smoothers:
            expect(filter_, Filter, "smoothers=")
        _check_arguments(smoothers, model)
    jobs = joblib.cpu_count() if jobs is None else jobs
    expect_sizes(runs=runs, steps=steps, jobs=jobs)
    design_runs = min(10 * runs, DESIGN_RUNS) if design_runs is None else design_runs
    expect_sizes(design_runs=design_runs)
    if not isinstance(seed, int | np.integer) or seed < 0:
        raise ValueError(f"the seed must be a whole number, not negative, got {seed!r}")
    design_seed, *seeds = np.random.SeedSequence(seed).spawn(1 + min(BATCHES, runs))
    wide = None if same_ensemble else width(model)
    batches = [
        Ensemble(model, size, steps, each, wide)
        for size, each in zip(batch_sizes(runs), seeds, strict=True)
    ]
    ensemble = batches if same_ensemble else [Ensemble(model, design_runs, steps, design_seed)]
    work: dict[str, Any] = {"jobs": jobs, "progress": progress}
    left_out = dict[str, Reason]()

    def designed(those: Sequence[Filter | Design]) -> list[Filter]:
        shown = _progress("designing", steps, "step", progress, side_by_side(ensemble))
        return design(those, shown, jobs)

    ready = _able(filters, left_out, designed)
    with cluster(dask):
        result = _compared(ready, batches, seed, left_out, scores=scores, **work)
        if smoothers:
            looking_back = _compared(smoothers, batches, seed, {}, back=True, **work)
            result = replace(result, smoothing=looking_back)
    if same_ensemble:
        return result
    designs = [filter_.name for filter_ in filters if isinstance(filter_, Design)]
    return replace(result, designed=tuple(designs))


def width(model: Model | JumpModel) -> float | None:
    """How much wider half of the initial states are drawn: not at all where they are angles, or
    where nothing is drawn."""
    return WIDE if not model.angles.x and np.any(model.prior.cov) else None


def batch_sizes(runs: int) -> list[int]:
    """Trajectories of each batch: nearly equal."""
    return np.diff(np.linspace(0, runs, min(BATCHES, runs) + 1).astype(int)).tolist()


def _able(filters: Sequence[F], left_out: dict[str, Reason], work: Callable[[Sequence[F]], T]) -> T:
    """What the work makes of the filters that can do it; it begins again without one that cannot,
    and `left_out` gets the reason."""
    while True:
        try:
            return work(filters)
        except NotFinite as error:
            rest = [filter_ for filter_ in filters if filter_.name != error.filter_name]
            if not rest or len(rest) == len(filters):
                raise
            filters, left_out[error.filter_name] = rest, error.with_traceback(None)


def _compared(
    filters: Sequence[Filter],
    batches: Sequence[Ensemble],
    seed: int,
    left_out: dict[str, Reason],
    **options: Any,
) -> Comparison:
    """All filters on the batches that can go on; the others are left out.  Options of `_summed`."""

    first = batches[0]

    def summed(those: Sequence[Filter]) -> tuple[Sequence[Filter], Sums]:
        try:
            return those, _summed(those, batches, **options)
        except NotFinite:
            if first.wide is None:
                raise
            # some far start is too far: none but the prior's own
            return those, _summed(those, [replace(b, wide=None) for b in batches], **options)

    able, sums = _able(filters, left_out, summed)
    names, runs = tuple(filter_.name for filter_ in able), sum(batch.runs for batch in batches)
    comparison = Comparison(first.model, names, runs, first.steps, seed, sums)
    return replace(comparison, left_out=left_out)


def _summed(
    filters: Sequence[Filter],
    batches: Sequence[Ensemble],
    *,
    jobs: int,
    progress: bool | None,
    back: bool = False,
    scores: Structure | None = None,
) -> Sums:
    """The sums over all batches, of which pieces are shared out."""
    # slow filters take much memory for each trajectory, and so does looking back
    dear = back or any(filter_.slow for filter_ in filters)
    each = 1 if dear else max(1, PIECE // batches[0].runs)
    parts = [batches[b : b + each] for b in range(0, len(batches), each)]
    work = (joblib.delayed(run_batches)(filters, part, back=back, scores=scores) for part in parts)
    done = joblib.Parallel(jobs, prefer="threads", return_as="generator")(work)
    sums = [*_progress("comparing", len(parts), "part", progress, done)]
    return {kind: np.concatenate([part[kind] for part in sums], axis=-1) for kind in sums[0]}


def run_batches(
    filters: Sequence[Filter],
    batches: Sequence[Ensemble],
    *,
    back: bool = False,
    scores: Structure | None = None,
) -> Sums:
    """Advance all filters together over the steps of some batches; `back`: let them look back from
    the end; `scores`: judge what they expect of measurements."""
    model, angles = batches[0].model, batches[0].model.angles.x
    starts = np.cumsum([0, *(batch.runs for batch in batches[:-1])])
    exact = next((i for i, filter_ in enumerate(filters) if filter_.name == EXACT), None)
    sizes, rows = list[Array](), list[list[Sums]]()

    def total(values: Array) -> Array:
        """The weighted sums over each batch, of (..., runs)."""
        return np.add.reduceat(weight * values, starts, axis=-1)

    # what diverges is reported by name
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for k, (instant, before, laws) in enumerate((_back if back else _onward)(filters, batches)):
            if k == 0:
                weight = weights(model.prior, instant.x, batches[0].wide)
            sizes.append(total((instant.x**2).sum(axis=1)))
            check_finite(k, sizes[-1], instant.y)
            row, twice = list[Sums](), None if exact is None else _twice(laws[exact])
            for i, (filter_, state) in enumerate(zip(filters, laws, strict=True)):
                mean = state.posterior.mean
                with _named(filter_, k):
                    error = difference(instant.x, mean, angles)
                    square = error**2
                    own, normalised = claimed(error, state.posterior.cov)
                    parts = {"error": error.T, "square": square.T, "own": own}
                    parts["normalised"] = normalised
                    if scores is not None:
                        parts["log_score"], parts["crps"] = scored(
                            filter_, scores, before[i], instant.y, state, batches[0]
                        )
                if twice:
                    first, second = (difference(mean, other, angles) for other in twice[:2])
                    parts["distance"] = (
                        twice[2] ** 2 if i == exact else (first * second).sum(axis=1)
                    )
                row.append({kind: total(values) for kind, values in parts.items()})
                row[i]["largest"] = np.maximum.reduceat(weight * square.sum(axis=1), starts)
                if np.isnan(row[i]["own"]).any() or not np.isfinite(row[i]["square"]).all():
                    raise NotFinite(
                        f"step {k}: {filter_.name} became infinite or NaN although the "
                        f"trajectories are finite: the filter diverges, or its model is another",
                        filter_.name,
                        "infinite",
                        step=k,
                    )
            rows.append(row)
    of_filters = {
        kind: np.array([[row[i][kind] for row in rows] for i in range(len(filters))])
        for kind in rows[0][0]
    }
    return {"weight": np.add.reduceat(weight, starts), "size": np.array(sizes), **of_filters}


def _begun(filter_: Filter, batches: Sequence[Ensemble]) -> State:
    """A filter's state before the first measurement; what draws random numbers draws others for
    each piece of work."""
    state = filter_.init(sum(batch.runs for batch in batches))
    if not hasattr(state.memory, "part"):
        return state
    return state._replace(memory=replace(state.memory, part=batches[0].seed.spawn_key))


Stage = tuple[Instant, list[State], list[State]]


def _onward(filters: Sequence[Filter], batches: Sequence[Ensemble]) -> Iterator[Stage]:
    """The states of all filters before and after each measurement."""
    states = [_begun(filter_, batches) for filter_ in filters]
    for k, instant in enumerate(side_by_side(batches)):
        before = [*states]
        for i, filter_ in enumerate(filters):
            with _named(filter_, k):
                states[i] = filter_.step(states[i], instant.y)
        yield instant, before, states


def _back(filters: Sequence[Filter], batches: Sequence[Ensemble]) -> Iterator[Stage]:
    """What all filters tell of each step once they have seen the last."""
    record = list(side_by_side(batches))
    y = np.stack([instant.y for instant in record])
    laws = []
    for filter_ in filters:
        with _named(filter_, len(record) - 1):
            states = accumulate(y, filter_.step, initial=_begun(filter_, batches))
            laws.append(looked_back(filter_, islice(states, 1, None), y))
    for instant, after in zip(record, map(list, zip(*laws, strict=True)), strict=True):
        yield instant, [], after


def _twice(state: State) -> tuple[Array, Array, Array]:
    """Two estimates of the exact filter whose errors, if it has any, are independent, and its own
    error (runs,).

    Those of both clouds of particles, and half their distance: a product of distances from them
    then does not hold their errors. Of point masses twice the same, and what discretisation leaves.
    """
    mean = state.posterior.mean
    return *getattr(state.memory, "halves", (mean, mean)), state.memory.discretisation_error()


@contextmanager
def _named(filter_: Filter, step: int) -> Iterator[None]:
    """What goes wrong in a filter is said with its name: it can be left out."""
    try:
        yield
    except (ValueError, ArithmeticError, MemoryError) as error:
        raise failed(filter_.name, step, error) from None


def _progress(
    what: str, total: int, unit: str, progress: bool | None, items: Iterable[T]
) -> Iterable[T]:
    """The items, with a progress bar."""
    # tqdm: disable=None means "unless standard error is a terminal"
    return tqdm(
        items,
        desc=what,
        total=total,
        unit=unit,
        disable=None if progress is None else not progress,
        delay=0.5,
    )


def _check_arguments(filters: Sequence[Filter | Design], model: Model | JumpModel) -> None:
    """TypeError or ValueError for what `compare` cannot do with these arguments."""
    if isinstance(filters, Filter | Design):
        raise TypeError(
            f"compare expects a list of filters, and one came: compare([{filters.name}], model, "
            f"...)"
        )
    for filter_ in filters:
        expect(filter_, Filter, "compare", Design)
    expect(model, Model, "compare", JumpModel)
    names = [filter_.name for filter_ in filters]
    if len(set(names)) < len(names) or not names:
        raise ValueError(
            f"give at least one filter, and each a name of its own: "
            f"{', '.join(names) or 'none given'}"
        )
    check_sizes(filters, model.n, model.p)
