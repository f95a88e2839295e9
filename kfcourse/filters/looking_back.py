r"""Looking back from the states that a filter has left: what the whole record tells of each.

A filter whose laws are normal takes the step of Rauch, Tung and Striebel (1965; `kfcourse.linear.smoothing`), with
Cov(x_k, x_{k+1}) = p A^T from its structural functions; the exact filter and particles have ways of their own,
`Filter.look_back`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from itertools import islice

import numpy as np

from kfcourse.filters.base import Filter, State, structure_of
from kfcourse.laws import Array, Gaussian, product, transpose
from kfcourse.linear.smoothing import AT_ONCE, Passages, Regression, check_lag, look_back, regressions
from kfcourse.symbolic.structure import Structure

ROUNDING = 1e-8  # of a prediction's standard deviations: by so much A p A^T + Q may be another than Psi without a reason


def looked_back(one: Filter, states: Iterable[State], y: Array, lag: int | None = None) -> list[State]:
    """States whose laws are those given the whole record y (steps, runs, p), from the filter's after each measurement.

    With a lag, given so many later measurements: a way of a filter's own then looks back as often as there are steps.
    ValueError for a filter that has no way to look back, or a lag that is none.
    """
    if one.look_back is None:
        mean, cov = normal_laws(one, states, lag)
        return [State(k + 1, law, law) for k, law in enumerate(map(Gaussian, mean, cov))]
    check_lag(lag)
    back, reach = one.look_back(states, y), len(y) if lag is None else min(lag + 1, len(y))
    early = [deque(islice(back(end), reach), maxlen=1)[0] for end in range(reach, len(y))]
    return [*early, *reversed([*islice(back(len(y)), reach)])]


def normal_laws(
    one: Filter, states: Iterable[State], lag: int | None = None, into: Gaussian | None = None, room: Array | None = None
) -> Gaussian:
    """The normal laws of the states (steps, runs, ...) given all measurements, or so many later ones.

    They are put into `into`, and matrices stay in the room of all steps but the last until they are used, if these are given.
    """
    structure = structure_of(one, "looking back")
    back, waiting, laws = list[Regression](), list[State](), list[Gaussian]()

    def look(visited: Sequence[State]) -> None:
        if visited:
            here = None if room is None else room[:, len(back) : len(back) + len(visited)]
            back.extend(regressions(_passages(structure, visited), here))

    for state in states:
        if waiting and len(waiting) * _weight(waiting[-1]) >= AT_ONCE:
            look(waiting)
            waiting = []
        waiting.append(state)
        laws = [*(laws if lag is not None else ()), state.posterior]  # all are kept only if needed
    look(waiting[:-1])
    return look_back(back, laws, lag, one.model.angles.x, into)


def _weight(state: State) -> int:
    """For how many laws a step counts: where all runs have one covariance, it is means alone that are put together."""
    mean, cov = state.predicted
    return len(mean) if cov.ndim == 3 else 1 + len(mean) // 16


def _passages(structure: Structure, visited: Sequence[State]) -> Passages:
    """A filter's ways to its predictions.  What one that remembers more than laws (`gated`) has added counts as noise."""
    posterior, predicted = (_together([getattr(state, name) for state in visited]) for name in ("posterior", "predicted"))
    if structure.at_step is None:
        A, Q = structure.transition(*posterior)
    else:
        each = [structure.at(state.step - 1).transition(*state.posterior) for state in visited]
        A, Q = (_by_step(parts) for parts in zip(*each, strict=True))
    if any(state.memory is not None for state in visited):
        added = predicted.cov - product(product(A, posterior.cov), transpose(A)) - Q
        sd = np.sqrt(np.abs(np.diagonal(predicted.cov, axis1=-2, axis2=-1)))
        Q = Q + np.where(np.abs(added) > ROUNDING * sd[..., :, None] * sd[..., None, :], added, 0.0)
    return Passages(posterior, predicted, A, Q)


def _together(laws: Sequence[Gaussian]) -> Gaussian:
    """Laws of successive steps: means (steps, runs, n), covariances (steps, runs, n, n), or (steps, 1, n, n) if all share it."""
    mean = laws[0].mean[None] if len(laws) == 1 else np.stack([law.mean for law in laws])
    return Gaussian(mean, _by_step([law.cov for law in laws]))


def _by_step(matrices: Sequence[Array]) -> Array:
    """Matrices of successive steps, (runs, n, n) or (n, n), as (steps, runs or 1, n, n)."""
    whole = matrices[0][None] if len(matrices) == 1 else np.stack(np.broadcast_arrays(*matrices))
    return whole if whole.ndim == 4 else whole[:, None]
