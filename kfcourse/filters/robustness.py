r"""A correction that doubts its measurements: noise with heavy tails, and weights instead of a
gate.

The meter's noise is taken for a Student one, normal with a covariance R / u whose u is drawn anew
at each step,

    y = h + G (x - lambda) + e,    e | u ~ N(0, R / u),    u ~ Gamma(`degrees` / 2, `degrees` / 2)

The joint law of x and u given y has no closed form.  The nearest product of a law of x and a law of
u (variational Bayes) has

    x ~ N(z, p), corrected with R / w,
    w = M[u] = (`degrees` + p) / (`degrees` + r^T R^-1 r + tr R^-1 G p G^T)

with the residual r = y - h - G (z - lambda), and is found by going round.  A measurement that fits
has w of about 1, one that is ten standard deviations off next to none, and none is refused for
ever.  Piche, Sarkka, Hartikainen (2012).

Huber's (1964) weights are milder: within an edge c a residual costs its square, beyond it grows
only linearly,

    w = min(1, c / sqrt(r^T R^-1 r)):
        z minimises (x - lambda)^T Psi^-1 (x - lambda) / 2 + rho(|R^(-1/2) r|)

An outlier then still pulls, but with a bounded force.

`adaptive` learns how large the noise is.  It has the covariance s R with an unknown factor s.
After a correction with it the residual and what is still unknown of the state make up the noise
again,

    M[r r^T] + G p G^T = s R,        r = y - h - G (z - lambda)

so each measurement tells of s, and a mean that forgets follows it (a round of expectation and
maximisation at each step; Mohamed and Schwarz, 1999).  What is large for another reason, a
manoeuvre or a fault, is taken for noise as well.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kfcourse.errors import expect, expect_sizes
from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.laws import (
    Array,
    Gaussian,
    Measurement,
    apply,
    correct,
    gain,
    product,
    transpose,
    without_missing,
)
from kfcourse.symbolic.structure import Structure


class Trust(NamedTuple):
    """What the filter remembers: the weight w of the last measurement, (runs,); NaN where there was
    none."""

    weight: Array


def robust(
    structure: Structure, degrees: float = 4.0, rounds: int = 10, edge: float | None = None
) -> Filter:
    """The Gaussian-approximated AOF with Student noise in the meter, or with Huber's weights.

    w = 1;  `rounds` times:  K = Psi G^T (G Psi G^T + R / w)^+,  z = lambda + K (y - h),  p = Psi -
    K G Psi,  then w anew

    Parameters
    ----------
    structure : Structure
    degrees : float
        Of freedom of the meter's noise, above 0: 4 has one measurement in a hundred beyond 4.6
        standard deviations of a normal one; at infinity it is `aof(structure)`.
    rounds : int
        Of weighting.
    edge : float, optional
        Huber's c, above 0, in standard deviations: his weights in the place of Student's.  1.5 is
        usual; at infinity it is `aof(structure)`.

    Returns
    -------
    Filter
        `state.memory.weight` is w; `kfcourse.records.weights` tells it for a whole record.

    Raises
    ------
    TypeError
        A model or a filter in the place of the structure.
    ValueError
        Degrees or an edge that are not positive, rounds that are none.
    """
    expect(structure, Structure, "robust")
    if not degrees > 0:
        raise ValueError(f"degrees must be positive, got {degrees!r}")
    if edge is not None and not edge > 0:
        raise ValueError(f"edge must be positive, or None for Student's weights; got {edge!r}")
    expect_sizes(rounds=rounds)

    def init(runs: int) -> State:
        return initial_state(structure.model)(runs)._replace(memory=Trust(np.full(runs, np.nan)))

    def step(state: State, y: Array) -> State:
        now = structure.at(state.step)
        expected = now.measure(*state.predicted)
        weight = np.ones(len(y))
        for _ in range(rounds):
            posterior = correct(state.predicted, trusted(expected, weight), y)
            weight = _weight(expected, state.predicted, posterior, y, degrees, edge)
        posterior = correct(state.predicted, trusted(expected, weight), y)
        missing = np.isnan(y).all(axis=-1)
        return State(
            state.step + 1,
            posterior,
            now.predict(*posterior),
            Trust(np.where(missing, np.nan, weight)),
            expected,
        )

    return Filter(f"robust-{structure.name}", structure.model, init, step, structure=structure)


def trusted(expected: Measurement, weight: Array) -> Measurement:
    """The measurement with the noise R / w."""
    R = expected.R / weight[:, None, None]
    return expected._replace(F=expected.F - expected.R + R, R=R)


def _weight(
    expected: Measurement,
    prior: Gaussian,
    posterior: Gaussian,
    y: Array,
    degrees: float,
    edge: float | None,
) -> Array:
    """w, (runs,), at this posterior; 1 where nothing was measured."""
    if edge is not None:
        size = residual_square(expected, prior, posterior, y, unsure=False)
        # 1 where nothing is left to explain
        return np.minimum(1.0, edge / np.maximum(np.sqrt(size), 1e-300))
    present = (~np.isnan(y)).sum(axis=-1)
    size = residual_square(expected, prior, posterior, y)
    return np.where(present > 0, (1 + present / degrees) / (1 + size / degrees), 1.0)


def residual_square(
    expected: Measurement, prior: Gaussian, posterior: Gaussian, y: Array, unsure: bool = True
) -> Array:
    """r^T R^-1 r, (runs,), of what was measured; with tr R^-1 G p G^T, its mean square over the
    posterior, by default."""
    innovation, G, _, R = without_missing(
        expected.innovation(y), expected.G, expected.F, expected.R
    )
    residual = innovation - apply(G, posterior.mean - prior.mean)
    precision = gain(np.eye(R.shape[-1]), R)
    size = (apply(precision, residual) * residual).sum(axis=-1)
    return (
        size + (precision * product(product(G, posterior.cov), transpose(G))).sum(axis=(-2, -1))
        if unsure
        else size
    )


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
        Measurements over which the mean forgets, above 1; of one component it knows s to 1 /
        sqrt(window) of itself.  At infinity it is `aof(structure)`.

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
        of_model = now.measure(*state.predicted)
        expected = trusted(of_model, 1 / scale)
        posterior = correct(state.predicted, expected, y)
        present = (~np.isnan(y)).sum(axis=-1)
        square = residual_square(of_model, state.predicted, posterior, y) / np.maximum(present, 1)
        learnt = np.where(present > 0, scale + (square - scale) / window, scale)
        return State(state.step + 1, posterior, now.predict(*posterior), Learnt(learnt), expected)

    return Filter(f"adaptive-{structure.name}", structure.model, init, step, structure=structure)
