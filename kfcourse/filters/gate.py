r"""A gate before a filter: measurements too far from what it expects are refused, and a track that
is lost is found again.

If the filter is right, the square of its innovation in units of its covariance F is chi-squared
with p degrees of freedom,

    nu^T F^-1 nu <= gamma,      P(chi^2_p <= gamma) = `probability`

and a measurement beyond gamma is taken for a fault and treated as missing.  That has a danger of
its own.  Where the object has done what the model does not know of, every measurement lies beyond
the gate, the filter refuses them all, and never hears that it is wrong.  So patience ends: after
some refusals in a row the prediction is widened until the state alone explains the last innovation,
and the next measurement is let through whatever it is,

    Psi -> s Psi,      s = max(1, nu^T (G Psi G^T)^+ nu / p)

The gate: Bar-Shalom, Li, Kirubarajan (2001); the rule that ends it is ours.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import scipy

from kfcourse.errors import expect, expect_sizes
from kfcourse.filters.base import Filter, State, ahead, structure_of
from kfcourse.laws import (
    Array,
    Gaussian,
    Measurement,
    any_missing,
    log_density,
    normalised_square,
    product,
    transpose,
    without_missing,
)
from kfcourse.symbolic.structure import Structure


class Gate(NamedTuple):
    """What a gated filter remembers.

    Attributes
    ----------
    weight : ndarray (runs,)
        Of the last measurement: 1, or 0 if it was refused; NaN where there was none.
    in_a_row : ndarray of int (runs,)
        How many were refused since the last that was not.
    inner : object
        The memory of the filter behind the gate.
    edge : float
        With which probability the gate lets pass.
    """

    weight: Array
    in_a_row: Array
    inner: Any
    edge: float


def gated(
    filter_: Filter,
    probability: float = 0.999,
    patience: int | None = 5,
    structure: Structure | None = None,
) -> Filter:
    """The same filter behind a gate.

    Parameters
    ----------
    filter_ : Filter
        Any filter: what is refused reaches it as missing (NaN).
    probability : float
        With which the gate lets a measurement pass if the filter is right.
    patience : int, optional
        After so many refusals in a row the track counts as lost, and the prediction is widened;
        None: never.  A filter that goes on from a memory (modes, particles, a grid) hears nothing
        of that: the next measurement passes, but moves it little.
    structure : Structure, optional
        By which the gate knows what to expect, from the filter's prediction N(lambda, Psi); the
        filter's own by default.

    Returns
    -------
    Filter
        `state.memory` is a `Gate`; `kfcourse.records.weights` tells for a whole record what was
        refused.  In its likelihood a refused measurement counts as one at the gate's edge.

    Raises
    ------
    TypeError
        No filter: a `Design`, whose coefficients are still to be found, a model, or structural
        functions.
    ValueError
        A probability or a patience that is none; a filter without structural functions of its own,
        and no `structure`.

    Examples
    --------
    >>> import numpy as np
    >>> from kfcourse import Model, run
    >>> from kfcourse.filters import gated, kalman_filter
    >>> plain = kalman_filter(Model.define("x + 0.1*v", "x + w"))
    >>> y = np.array([0.1, 0.0, 90.0])
    >>> [round(run(each, y).mean[-1].item(), 3) for each in (plain, gated(plain))]
    [23.247, 0.033]
    """
    expect(filter_, Filter, "gated")
    if structure is not None:
        expect(structure, Structure, "structure=")
    if not 0 < probability < 1:
        raise ValueError(f"probability must lie between 0 and 1, got {probability!r}")
    if patience is not None:
        expect_sizes(patience=patience)
    expecting = structure or structure_of(filter_, "a gate")
    # For 0, ..., p components measured; with none there is nothing to refuse.
    limits = np.array(
        [np.inf, *scipy.special.chdtri(np.arange(1, filter_.model.p + 1), 1 - probability)]
    )

    def judged(state: State, y: Array) -> tuple[Measurement, Array, Array, Array]:
        """What was expected; squares of innovations, gamma, whether they are beyond and the track
        not lost: (runs,)."""
        law = ahead(filter_, state._replace(memory=state.memory.inner))
        expected = expecting.at(state.step).measure(*law)
        size = size_of(expected.innovation(y), expected.F)
        limit = limits[(~np.isnan(y)).sum(axis=-1)]
        lost = patience is not None and state.memory.in_a_row >= patience
        return expected, size, limit, (size > limit) & ~np.asarray(lost)

    def init(runs: int) -> State:
        state, none = filter_.init(runs), np.zeros(runs, dtype=int)
        return state._replace(memory=Gate(none + np.nan, none, state.memory, probability))

    def step(state: State, y: Array) -> State:
        expected, _, _, refused = judged(state, y)
        seen = np.where(refused[:, None], np.nan, y)
        after = filter_.step(state._replace(memory=state.memory.inner), seen)
        missing, before = np.isnan(y).all(axis=-1), state.memory.in_a_row
        weight = np.where(missing, np.nan, ~refused)
        in_a_row = np.where(missing, before, (before + 1) * refused)
        if patience is not None and (losing := refused & (in_a_row == patience)).any():
            wider = np.where(losing, _widening(expected, state.predicted, y), 1.0)
            after = after._replace(
                predicted=Gaussian(after.predicted.mean, after.predicted.cov * wider[:, None, None])
            )
        return after._replace(memory=Gate(weight, in_a_row, after.memory, probability))

    def evidence(before: State, y: Array, after: State) -> Array:
        expected, size, limit, beyond = judged(before, y)
        return log_density(expected, y) + 0.5 * np.where(beyond, size - limit, 0.0)

    # what needs the filter's own memories does not go with those of the gate
    return replace(
        filter_,
        name=f"gated-{filter_.name}",
        init=init,
        step=step,
        evidence=evidence,
        look_back=None,
        mixture=None,
        drawn=False,
    )


def size_of(innovation: Array, F: Array) -> Array:
    """nu^T F^-1 nu of what was measured, (runs,)."""
    if any_missing(innovation):
        innovation, _, F, _ = without_missing(innovation, np.zeros_like(F), F, F)
    return normalised_square(innovation, F)


def _widening(expected: Measurement, predicted: Gaussian, y: Array) -> Array:
    """s, (runs,): with Psi -> s Psi the state alone explains the innovation."""
    innovation, G = expected.innovation(y), expected.G
    present = (~np.isnan(innovation)).sum(axis=-1)
    if any_missing(innovation):
        innovation, G, *_ = without_missing(innovation, G, expected.F, expected.R)
    explained = product(product(G, predicted.cov), transpose(G))
    return np.maximum(1.0, normalised_square(innovation, explained) / np.maximum(present, 1))
