r"""Looking back from the states that a filter has left: what the whole record tells of each.

A filter whose laws are normal takes the step of Rauch, Tung and Striebel (1965;
`kfcourse.linear.smoothing`), with Cov(x_k, x_{k+1}) = p A^T from its structural functions; the
exact filter has a way of its own, `Filter.look_back`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from itertools import islice

import numpy as np

from kfcourse.filters.base import Filter, State, structure_of
from kfcourse.laws import Array, Gaussian, product, transpose
from kfcourse.linear.smoothing import Backward, check_lag, look_back
from kfcourse.symbolic.structure import Structure

# of a prediction's standard deviations: by so much A p A^T + Q may be another than Psi without a
# reason
ROUNDING = 1e-8


def looked_back(
    filter_: Filter, states: Iterable[State], y: Array, lag: int | None = None
) -> list[State]:
    """States whose laws are those given the whole record y (steps, runs, p), from the filter's
    after each measurement.

    With a lag, given so many later measurements: a way of a filter's own then looks back as often
    as there are steps. ValueError for a filter that has no way to look back, or a lag that is none.
    """
    if filter_.look_back is None:
        structure, back, laws = (
            structure_of(filter_, "looking back"),
            list[Backward](),
            list[Gaussian](),
        )
        before: State | None = None
        for state in states:
            back += [] if before is None else [_backward(structure, before)]
            laws.append(state.posterior)
            before = state
        return [
            State(k, law, law)
            for k, law in enumerate(look_back(back, laws, lag, filter_.model.angles.x), start=1)
        ]
    check_lag(lag)
    back_to, reach = filter_.look_back(states, y), len(y) if lag is None else min(lag + 1, len(y))
    early = [deque(islice(back_to(end), reach), maxlen=1)[0] for end in range(reach, len(y))]
    return [*early, *reversed([*islice(back_to(len(y)), reach)])]


def _backward(structure: Structure, state: State) -> Backward:
    """The regression on the next step.  What a filter that remembers more than laws (`gated`) has
    added counts as noise."""
    posterior, predicted = state.posterior, state.predicted
    A, Q = structure.at(state.step - 1).transition(*posterior)
    if state.memory is not None:
        added = predicted.cov - product(product(A, posterior.cov), transpose(A)) - Q
        sd = np.sqrt(np.abs(np.diagonal(predicted.cov, axis1=-2, axis2=-1)))
        Q = Q + np.where(np.abs(added) > ROUNDING * sd[..., :, None] * sd[..., None, :], added, 0.0)
    return Backward.regress(posterior, predicted, A, Q)
