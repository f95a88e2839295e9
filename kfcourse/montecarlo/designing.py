"""Finding the coefficients of the designed filters (DUOF, FOS and their kin) over an ensemble.

The equations of a step run until they ask for a regression; the ensemble answers it, and its
coefficients are sent back into the equations.  Each design does so by itself, so that threads can
share the designs.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import joblib
import numpy as np

from kfcourse.errors import NotFinite, Refused, expect
from kfcourse.filters.base import Filter, State, with_angles_on_circle
from kfcourse.filters.designed import Affine, Design
from kfcourse.laws import NegativeVariance
from kfcourse.montecarlo.ensemble import Instant, check_finite


def failed(name: str, step: int, error: Exception) -> NotFinite:
    """What a filter raised at a step, as the reason for which it is left out."""
    kind = "negative" if isinstance(error, NegativeVariance) else ""
    names_itself = isinstance(error, Refused)
    words = str(error) if names_itself else f"step {step}: {name} failed: {error}"
    return NotFinite(words, name, kind, step=step)


def design(
    filters: Sequence[Filter | Design], ensemble: Iterable[Instant], jobs: int = 1
) -> list[Filter]:
    """Fit every design on the same trajectories.

    Parameters
    ----------
    filters : sequence of Design
        A `Filter` among them stays as it is.
    ensemble : iterable of Instant
        For each step x_k, y_k and x_{k+1}: an `Ensemble`, or stored trajectories.
    jobs : int
        Threads that share the designs.

    Returns
    -------
    list of Filter
        In the order of `filters`; the designed ones for as many steps as the ensemble has.

    Raises
    ------
    TypeError, ValueError
        What is no design; a model with other numbers of states or measurements than the ensemble's.
    NotFinite
        If a regression meets infinite or NaN values, or a filter a negative variance: the model or
        the filter diverges.
    """
    for filter_ in filters:
        expect(filter_, Design, "design", Filter)
    designs = [filter_ for filter_ in filters if isinstance(filter_, Design)]
    coefficients: list[list[list[Affine]]] = [[] for _ in designs]
    states = list[State]()
    with joblib.Parallel(jobs, prefer="threads") as parallel:
        for k, instant in enumerate(ensemble if designs else ()):
            if k == 0:
                check_sizes(designs, instant.x.shape[1], instant.y.shape[1])
                states = [design_.init(len(instant.x)) for design_ in designs]
            check_finite(k, instant.x_next)
            results = parallel(
                joblib.delayed(_fitted)(design_, state, instant, k)
                for design_, state in zip(designs, states, strict=True)
            )
            states = [state for state, _ in results]
            for table, (_, fits) in zip(coefficients, results, strict=True):
                table.append(fits)
    tables = iter(coefficients)
    return [
        filter_.with_coefficients(next(tables)) if isinstance(filter_, Design) else filter_
        for filter_ in filters
    ]


def check_sizes(filters: Iterable[Filter | Design], n: int, p: int) -> None:
    """ValueError if one was built for other numbers of states or measurements."""
    for filter_ in filters:
        model = filter_.model
        if (model.n, model.p) != (n, p):
            raise ValueError(
                f"{filter_.name} was built for a model with {model.n} states and {model.p} "
                f"measurements; this one has {n} and {p}"
            )


def _fitted(design_: Design, state: State, instant: Instant, k: int) -> tuple[State, list[Affine]]:
    """One step of a design: the next state, angles between -pi and pi, and the coefficients of its
    regressions."""
    fits = list[Affine]()
    equations = design_.equations(state, instant.y)
    # what diverges is reported, by name
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        try:
            request = next(equations)
            while True:
                moments = request.scatter(instant.x, instant.x_next, instant.mode)
                if not moments.size:
                    raise NotFinite(
                        f"step {k}: no trajectory of the design is in a mode that {design_.name} "
                        f"fits; take more trajectories",
                        design_.name,
                    )
                if not np.isfinite(moments.scatter).all():
                    raise NotFinite(
                        f"{design_.name}, step {k}: the design met infinite or NaN values; the "
                        f"model or this filter diverges",
                        design_.name,
                        "infinite",
                        step=k,
                    )
                fits.append(moments.regression())
                request = equations.send(fits[-1])
        except StopIteration as stop:
            return with_angles_on_circle(stop.value, design_.model.angles.x), fits
        except (NegativeVariance, np.linalg.LinAlgError) as error:
            raise failed(design_.name, k, error) from None
