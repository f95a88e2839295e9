"""Finding the coefficients of the designed filters (DUOF, FOS and their kin) over an ensemble.

All designs advance together, step by step.  At each step the equations of every block run until they
ask for a regression; the moments of all blocks are merged, the regression solved, and its coefficients
sent back into the equations.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import Executor, Future

import numpy as np

from kfcourse.errors import NotFinite, expect
from kfcourse.filters.base import Filter, State, with_angles_on_circle
from kfcourse.filters.designed import Affine, Design, Scatter
from kfcourse.filters.fused import Fused
from kfcourse.laws import Array, NegativeVariance
from kfcourse.montecarlo.ensemble import Instant, Serial


def failed(name: str, step: int, error: Exception) -> NotFinite:
    """What a filter's linear algebra raised at a step, as the reason for which it is left out."""
    kind = "negative" if isinstance(error, NegativeVariance) else ""
    return NotFinite(f"step {step}: {name} failed: {error}", name, kind, step=step)


def design(designs: Sequence[Design], ensemble: Iterable[list[Instant]], pool: Executor | None = None) -> list[Filter]:
    """Fit every design on the same trajectories.

    Parameters
    ----------
    designs : sequence of Design
    ensemble : iterable
        For each step the list of blocks `Instant(x, y, x_next)`: `Ensemble.by_step(pool)`, or stored trajectories.
    pool : Executor, optional
        Blocks of a step are computed in its threads.

    Returns
    -------
    list of Filter
        In the order of `designs`, for as many steps as the ensemble has.

    Raises
    ------
    TypeError, ValueError
        What is no design; a model with other numbers of states or measurements than the ensemble's.
    NotFinite
        If a regression meets infinite or NaN values, or a filter a negative variance: the model or the filter diverges.
    """
    for one in designs:
        expect(one, Design, "design")
    coefficients: list[list[list[Affine]]] = [[] for _ in designs]
    states: list[list[State]] = []  # [block][design]
    for k, blocks in enumerate(ensemble):
        if not states:
            drawn = blocks[0].x.shape[1], blocks[0].y.shape[1]
            for one in designs:
                if (one.model.n, one.model.p) != drawn:
                    raise ValueError(
                        f"{one.name} was built for a model with {one.model.n} states and {one.model.p} measurements; "
                        f"the ensemble has {drawn[0]} and {drawn[1]}"
                    )
            states = [[one.init(len(block.x)) for one in designs] for block in blocks]
        runs = [_BlockStep(designs, before, block, k) for before, block in zip(states, blocks, strict=True)]
        fits = _fit_step(designs, runs, k, pool or Serial())
        states = [run.after() for run in runs]
        for table, row in zip(coefficients, fits, strict=True):
            table.append(row)
    return [one.with_coefficients(table) for one, table in zip(designs, coefficients, strict=True)]


def design_together(
    designs: Sequence[Fused], ensemble: Iterable[tuple[Array, Array]], size: tuple[int, int], pool: Executor
) -> list[Filter]:
    """`design` by compiled loops, of `size` runs and steps: each design passes over `Ensemble.together` in a thread of its own.

    A design that meets infinite or NaN values is missing: `design` tells why, or gets along with them.
    """
    begun = [pool.submit(one.begin, *size) for one in designs]
    running, end = list[Future[None]](), 0
    for x, y in ensemble:  # the next is drawn while the designs work on this one
        work = [(one, *future.result()) for one, future in zip(designs, begun, strict=True)]
        for future in running:
            future.result()
        first, end = end, end + len(y)
        running = [pool.submit(one.find, table[first:end], y, x, *law) for one, table, law in work]
    for future in running:
        future.result()
    return [one.fitted(table) for one, table, _ in work if np.isfinite(table).all()]


class _BlockStep:
    """The equations of all designs over one step of one block of trajectories."""

    def __init__(self, designs: Sequence[Design], states: Sequence[State], block: Instant, k: int):
        self.block, self.names, self.k = block, [one.name for one in designs], k
        self.angles = [one.model.angles.x for one in designs]
        self.running = [one.equations(before, block.y) for one, before in zip(designs, states, strict=True)]
        self.results: list[State | None] = [None] * len(designs)

    def advance(self, answers: dict[int, Affine | None]) -> list[Scatter | None]:
        """Answer the waiting designs; the moments of the regression each asks for next, None if it is through."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # what diverges is reported, by name
            return [self._advance(i, answer) for i, answer in answers.items()]

    def _advance(self, i: int, answer: Affine | None) -> Scatter | None:
        try:
            request = self.running[i].send(answer)  # type: ignore[arg-type]  # None starts a generator
        except StopIteration as stop:
            self.results[i] = stop.value
            return None
        except (NegativeVariance, np.linalg.LinAlgError) as error:
            raise failed(self.names[i], self.k, error) from None
        return request.scatter(self.block.x, self.block.x_next, getattr(self.block, "mode", None))

    def after(self) -> list[State]:
        """The states of the designs, which are all through: angles between -pi and pi, as when they run."""
        done = [state for state in self.results if state is not None]
        return [with_angles_on_circle(state, angles) for state, angles in zip(done, self.angles, strict=True)]


def _fit_step(designs: Sequence[Design], runs: Sequence[_BlockStep], k: int, pool: Executor) -> list[list[Affine]]:
    """One step of every design: its coefficients, each regression answered from the whole ensemble."""
    fits: list[list[Affine]] = [[] for _ in designs]
    active = list(range(len(designs)))
    while active:
        answers = {i: fits[i][-1] if fits[i] else None for i in active}
        moments = list(pool.map(lambda run, answers=answers: run.advance(answers), runs))
        asked = []
        for i, parts in zip(active, zip(*moments, strict=True), strict=True):
            if parts[0] is None:
                continue
            known = [part for part in parts if part is not None]
            if not any(part.size for part in known):
                raise NotFinite(
                    f"step {k}: no trajectory of the design is in a mode that {designs[i].name} fits; take more trajectories",
                    designs[i].name,
                )
            with np.errstate(over="ignore", invalid="ignore"):
                merged = Scatter.together(known)
            if not np.isfinite(merged.scatter).all():
                if not all(np.isfinite(run.block.x_next).all() and np.isfinite(run.block.y).all() for run in runs):
                    raise NotFinite(f"step {k}: the model's trajectories become infinite, check its equations and parameters")
                said = f"{designs[i].name}, step {k}: the design met infinite or NaN values; the model or this filter diverges"
                raise NotFinite(said, designs[i].name, "infinite", step=k)
            fits[i].append(merged.regression())
            asked.append(i)
        active = asked
    return fits
