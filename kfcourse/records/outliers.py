"""Which measurements of a record a filter did not trust: behind a gate (`gated`), or with weights (`robust`)."""

from __future__ import annotations

import numpy as np

from kfcourse.errors import expect
from kfcourse.filters.base import Filter
from kfcourse.laws import Array
from kfcourse.montecarlo.experiment import states


def weights(one: Filter, y: Array) -> Array:
    """How much each measurement counted, (steps, runs): 1 in full, 0 refused, NaN where it was missing.

    Parameters
    ----------
    one : Filter
        `gated(...)` or `robust(...)`.
    y : ndarray (steps, runs, p)
        As for `run`.

    Raises
    ------
    ValueError
        A filter that weighs nothing, measurements of another shape.
    """
    expect(one, Filter, "weights")
    memories = [state.memory for state in states(one, y)[1:]]
    if not all(hasattr(memory, "weight") for memory in memories):
        raise ValueError(f"{one.name} takes every measurement as it is: ask gated(one) or robust(structure) for weights")
    return np.stack([memory.weight for memory in memories])
