"""One block of trajectories: all filters advance together over its steps, and what each estimates is recorded."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import accumulate, islice
from typing import TypeVar

import numpy as np
from tqdm import tqdm

from kfcourse.angles import near
from kfcourse.errors import Reason
from kfcourse.filters.base import Filter, State
from kfcourse.filters.fused import Steps
from kfcourse.filters.looking_back import looked_back
from kfcourse.laws import Array, NegativeVariance, any_missing
from kfcourse.montecarlo.designing import NotFinite, failed
from kfcourse.montecarlo.ensemble import Instant
from kfcourse.montecarlo.exceptional import Scores
from kfcourse.montecarlo.statistics import Sums

T = TypeVar("T")


class Failed(Exception):
    """A slow filter failed: its name, and why."""

    def __init__(self, name: str, reason: Reason):
        super().__init__(name, reason)
        self.name, self.reason = name, reason


class TooMuch(MemoryError):
    """A slow filter would need more memory than it may take: its name, and the step."""

    def __init__(self, name: str, step: int):
        super().__init__(name, step)
        self.name, self.step = name, step


def run_block(
    filters: Sequence[Filter],
    instants: Iterable[Instant],
    sums: Sums,
    reference: int | None = None,
    weight_of: Callable[[Array], Array | None] = lambda x: None,
    *,
    back: bool = False,
    scores: Scores | None = None,
) -> None:
    """Advance all filters together over the steps of one block of trajectories; `back`: let them look back from its end.

    With a reference filter, the distance of every other estimate from its own is recorded too, and in `scores`, if there are any,
    how exceptional the trajectories are.  The initial states tell the weights of the trajectories.
    """
    size, weight = int(sums.counts.sum()), None
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # what diverges is reported below, by name
        for k, (instant, states) in enumerate((_back if back else _onward)(filters, instants, size)):
            weight = weight_of(instant.x) if k == 0 else weight
            sums.record_states(k, instant.x, weight)
            for i, (one, state) in enumerate(zip(filters, states, strict=True)):
                with _affair_of(one, k):
                    estimate = state.posterior
                    sums.record(i, k, near(instant.x, estimate.mean, one.model.angles.x), estimate, weight)
            if scores is not None:
                scores.add(instant.x, [state.posterior.mean for state in states], filters[0].model.angles.x, weight)
            if reference is not None:
                twice = _twice(states[reference])
                sums.record_doubt(k, _doubt(states[reference]), weight)
                for i, state in enumerate(states):
                    if i != reference:
                        mean, angles = state.posterior.mean, filters[i].model.angles.x
                        first, second = (near(one, mean, angles) for one in twice)
                        sums.record_distance(i, k, mean, (first, second), weight)
    _check_finite(filters, sums)


def run_stretches(
    filters: Sequence[Filter],
    stretches: Iterable[tuple[Array, Array]],
    sums: Sums,
    weight_of: Callable[[Array], Array | None],
) -> None:
    """`run_block` over several steps of a scalar model at once: x (K + 1, N) and y (K, N) of each stretch.

    A filter that is not compiled, and any whose trajectories have left the numbers, goes step by step.
    """
    from kfcourse.filters.loops import squares

    size, k, weight = int(sums.counts.sum()), 0, None
    states, starts = [one.init(size) for one in filters], np.append(sums.starts, size)
    room, weights = np.empty((2, int(sums.counts.max()))), np.ones(size)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # what diverges is reported below, by name
        for x, y in stretches:
            if k == 0 and (weight := weight_of(x[0][:, None])) is not None:
                weights = sums.weigh(weight)
            steps, missing = slice(k, k + len(y)), any_missing(y)
            squares(x[:-1], weights, starts, sums.size[steps])
            for i, one in enumerate(filters):
                if isinstance(one.step, Steps) and not missing:
                    states[i] = one.step.several(states[i], y, x[:-1], weights, starts, sums.of_scalar(i, steps), room)
                    continue
                for j, step in enumerate(range(k, k + len(y))):
                    with _affair_of(one, step):
                        states[i] = one.step(states[i], y[j][:, None])
                        sums.record(i, step, x[j][:, None], states[i].posterior, weight)
            k += len(y)
    _check_finite(filters, sums)


def _onward(filters: Sequence[Filter], instants: Iterable[Instant], size: int) -> Iterator[tuple[Instant, list[State]]]:
    """The states of all filters after each measurement."""
    states = [one.init(size) for one in filters]
    for k, instant in enumerate(instants):
        for i, one in enumerate(filters):
            with _affair_of(one, k):
                states[i] = one.step(states[i], instant.y)
        yield instant, states


def _back(filters: Sequence[Filter], instants: Iterable[Instant], size: int) -> Iterator[tuple[Instant, list[State]]]:
    """What all filters tell of each step once they have seen the last."""
    record = list(instants)
    y = np.stack([instant.y for instant in record])
    found = []
    for one in filters:
        with _affair_of(one, len(record) - 1):
            found.append(looked_back(one, islice(accumulate(y, one.step, initial=one.init(size)), 1, None), y))
    yield from zip(record, map(list, zip(*found, strict=True)), strict=True)


def _twice(state: State) -> tuple[Array, Array]:
    """Two estimates of the reference whose errors, if it has any, are independent: those of both clouds of particles."""
    first, second = getattr(state.memory, "halves", (state.posterior.mean,) * 2)
    return first, second


def _doubt(state: State) -> Array:
    """The reference's own error, (runs,): half the distance of two clouds; what discretisation leaves of the nodes' mean."""
    if hasattr(state.memory, "apart"):
        return state.memory.apart()
    found = getattr(state.memory, "discretisation_error", None)
    return np.zeros(len(state.posterior.mean)) if found is None else found()


@contextmanager
def _affair_of(one: Filter, step: int) -> Iterator[None]:
    """What goes wrong in a filter is its own affair: it can be left out."""
    try:
        yield
    except (ValueError, ArithmeticError, MemoryError) as error:
        if one.slow:
            raise TooMuch(one.name, step) if isinstance(error, MemoryError) else Failed(one.name, error) from None
        if isinstance(error, NegativeVariance | np.linalg.LinAlgError):
            raise failed(one.name, step, error) from None
        raise


def _check_finite(filters: Sequence[Filter], sums: Sums) -> None:
    finite = np.asarray(np.isfinite(sums.square).all(axis=(2, 3)) & ~np.isnan(sums.own).any(axis=(2, 3)))
    if finite.all():
        return
    step = int(np.argmin(finite.all(axis=0)))
    if not finite[:, step].any():
        raise NotFinite(
            f"step {step}: every filter fails; the model's trajectories become infinite, check its equations and parameters"
        )
    one = filters[int(np.argmin(finite[:, step]))]
    said = f"step {step}: {one.name} became infinite or NaN although the trajectories are finite"
    if one.slow:
        raise Failed(one.name, NotFinite(said, one.name, "infinite", step=step))
    raise NotFinite(f"{said}: it diverges; leave it out, or check the model", one.name, "infinite", step=step)


def progress_bar(what: str, total: int, unit: str, progress: bool | None, items: Iterable[T] | None = None) -> tqdm[T]:
    """A progress bar, around the items if there are any."""
    # tqdm: disable=None means "unless standard error is a terminal"
    return tqdm(items, desc=what, total=total, unit=unit, disable=None if progress is None else not progress, delay=0.5)
