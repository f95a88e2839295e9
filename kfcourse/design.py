"""Finding the coefficients of the designed filters (DUOF, FOS, MFOS) over an ensemble.

All designs advance together, step by step.  At each step the equations of every block run until they
ask for a regression; the moments of all blocks are merged, the regression solved, and its coefficients
sent back into the equations.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from kfcourse.ensemble import Moment
from kfcourse.filters.base import Design, Equations, Filter, Regression, Step
from kfcourse.gaussian import Affine, Gaussian, Moments


class NotFinite(ArithmeticError):
    """A filter or trajectory left the finite numbers."""


def design(designs: Sequence[Design], ensemble: Iterable[list[Moment]]) -> list[Filter]:
    """Fit every design on the same trajectories.

    Parameters
    ----------
    designs : sequence of Design
    ensemble : iterable
        For each step the list of blocks `Moment(x, y, x_next)`: `Ensemble.by_step()`, or stored trajectories.

    Returns
    -------
    list of Filter
        In the order of `designs`, for as many steps as the ensemble has.

    Raises
    ------
    NotFinite
        If a regression meets infinite or NaN values: the model or the filter diverges.
    """
    coefficients: list[list[list[Affine]]] = [[] for _ in designs]
    predicted: list[list[Gaussian]] = []
    for k, blocks in enumerate(ensemble):
        if not predicted:
            predicted = [[Gaussian(np.tile(d.model.prior.mean, (len(b.x), 1)), d.model.prior.cov) for b in blocks] for d in designs]
        for i, one in enumerate(designs):
            running = [one.equations(before, block.y) for before, block in zip(predicted[i], blocks, strict=True)]
            steps, fits = _fit_step(running, blocks, f"{one.name}, step {k}")
            predicted[i] = [step.predicted for step in steps]
            coefficients[i].append(fits)
    return [one.with_coefficients(table) for one, table in zip(designs, coefficients, strict=True)]


def _fit_step(running: list[Equations], blocks: list[Moment], where: str) -> tuple[list[Step], list[Affine]]:
    """Run one step of every block, answering its regressions from the whole ensemble."""
    fits: list[Affine] = []
    answer: Affine | None = None
    while True:
        moments: Moments | None = None
        finished: list[Step] = []
        for equations, block in zip(running, blocks, strict=True):
            try:
                request = equations.send(answer)  # type: ignore[arg-type]  # None starts a generator
            except StopIteration as stop:
                finished.append(stop.value)
                continue
            part, size = _moments(request, block)
            moments = part if moments is None else moments.merge(part)
        if moments is None:
            return finished, fits
        if not np.isfinite(moments.scatter).all():
            raise NotFinite(f"{where}: the design met infinite or NaN values; the model or this filter diverges, check the variant")
        answer = moments.regression(size)
        fits.append(answer)


def _moments(request: Regression, block: Moment) -> tuple[Moments, int]:
    target = request.target(block.x, block.x_next)
    return Moments.of(target, request.regressor), target.shape[-1]
