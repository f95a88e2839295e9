r"""A filter that learns how large its meter's noise is, from what is left of each measurement.

The meter's noise has the covariance s R with an unknown factor s.  After a correction with it the residual and what is still
unknown of the state make up the noise again,

    M[r r^T] + G p G^T = s R,        r = y - h - G (z - lambda)

so each measurement tells of s, and a mean that forgets follows it (a round of expectation and maximisation at each step;
Mohamed and Schwarz, 1999).  What is large for another reason, a manoeuvre or a fault, is taken for noise as well.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kfcourse.errors import expect
from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.filters.heavy_tails import residual_square, trusted
from kfcourse.laws import Array, correct, log_density
from kfcourse.symbolic.structure import Structure


class Learnt(NamedTuple):
    """What the filter remembers: s, (runs,)."""

    scale: Array


def adaptive(structure: Structure, window: float = 50.0) -> Filter:
    """The Gaussian-approximated AOF with a noise of the meter s times the model's.

    K = Psi G^T (G Psi G^T + s R)^+,   s' = s + ((r^T R^-1 r + tr R^-1 G p G^T) / p - s) / `window`

    Parameters
    ----------
    structure : Structure
    window : float
        Measurements over which the mean forgets, above 1; of one component it knows s to 1 / sqrt(window) of itself.  At
        infinity it is `aof(structure)`.

    Returns
    -------
    Filter
        `state.memory.scale` is s, 1 at first.

    Raises
    ------
    ValueError
        A window of one measurement or less.
    """
    expect(structure, Structure, "adaptive")
    if not window > 1:
        raise ValueError(f"window must be more than one measurement, got {window!r}")

    def init(runs: int) -> State:
        return initial_state(structure.model)(runs)._replace(memory=Learnt(np.ones(runs)))

    def step(state: State, y: Array) -> State:
        now, scale = structure.at(state.step), state.memory.scale
        expected = now.measure(*state.predicted)
        posterior = correct(state.predicted, trusted(expected, 1 / scale), y)
        present = (~np.isnan(y)).sum(axis=-1)
        told = residual_square(expected, state.predicted, posterior, y) / np.maximum(present, 1)
        learnt = np.where(present > 0, scale + (told - scale) / window, scale)
        return State(state.step + 1, posterior, now.predict(*posterior), Learnt(learnt))

    def evidence(before: State, y: Array, after: State) -> Array:
        expected = structure.at(before.step).measure(*before.predicted)
        return log_density(trusted(expected, 1 / before.memory.scale), y)

    return Filter(f"adaptive-{structure.name}", structure.model, init, step, structure=structure, evidence=evidence)
