r"""One smoother for every filter with structural functions: the past of a record, once all of it is
known.

A filter's estimate z_k uses y_0, ..., y_k.  What the measurements after it tell of x_k comes to it
through x_{k+1}, and all that takes is Cov(x_k, x_{k+1}).  If x_k ~ N(z, p), it is p A^T with A =
dtau/dz, whatever the function a: by Stein's lemma

    M[(x - z) a(x, v)^T] = p M[da/dx]^T = p (d M[a] / dz)^T

The slope of the structural function stands to the object as G = dh/dm stands to the meter.  So the
smoother of Rauch, Tung and Striebel (`kfcourse.linear.smoothing`) is at the same time the extended,
the unscented, the quadrature and the normal one.

What none of them can beat is the mean of the density itself: the exact filter looks back on its
nodes (`kfcourse.filters.exact`).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

from kfcourse.angles import difference
from kfcourse.errors import expect, expect_sizes
from kfcourse.filters.approximations import aof
from kfcourse.filters.base import Filter
from kfcourse.filters.iterated_ekf import seen_from
from kfcourse.filters.looking_back import looked_back
from kfcourse.laws import (
    Array,
    Gaussian,
    Measurement,
    Transition,
    apply,
    measurement_of,
    product,
    stacked,
    symmetric,
    transpose,
)
from kfcourse.montecarlo.experiment import measurements, walk
from kfcourse.symbolic.structure import Structure


def smooth(filter_: Filter, y: Array, lag: int | None = None) -> Gaussian:
    """The states given all measurements of a record: the fixed-interval smoother of a filter.

    S = p A^T Psi'^+,   z^s = z + S (z'^s - lambda'),   p^s = p + S (p'^s - Psi') S^T,      primes:
    at the next step

    Parameters
    ----------
    filter_ : Filter
        Whose laws are normal: `aof`, `iterated`, `kalman_filter`; `pointmass`, which looks back
        exactly.
    y : ndarray (steps, runs, p)
        As for `run`; NaN where a measurement, or a component of it, is missing.
    lag : int, optional
        Use the measurements up to so many steps later only (fixed lag): what is known with that
        delay.  Of the exact filter that costs `lag` + 1 times as much as the whole record, as each
        step is looked back to for itself.

    Returns
    -------
    Gaussian
        Estimates (steps, runs, n) and covariances (steps, runs, n, n), as of `run`; the last step's
        are the filter's.

    Raises
    ------
    ValueError
        A filter without structural functions, a lag that is none, measurements of another shape.

    Examples
    --------
    >>> import numpy as np
    >>> from kfcourse import Model, linearised, smooth
    >>> from kfcourse.filters import aof
    >>> walk = Model.define("x + v", "x + w")
    >>> past = smooth(aof(linearised(walk)), np.array([1.0, 2.0, np.nan, 4.0]))
    >>> [round(z, 3) for z in past.mean.ravel().tolist()]
    [0.944, 1.833, 2.556, 3.278]
    """
    expect(filter_, Filter, "smooth")
    y = measurements(filter_, y)
    states = looked_back(filter_, islice(walk(filter_, y), 1, None), y, lag)
    return stacked([state.posterior for state in states])


def smooth_iterated(structure: Structure, y: Array, rounds: int = 5) -> Gaussian:
    """The iterated smoother: object and meter linearised again where all measurements put the
    states.

    With `linearised(model)` each round is a step of Gauss and Newton's method towards the likeliest
    whole trajectory, the iterated extended smoother (Bell, 1994); with the moment structures it is
    the iterated posterior linearisation smoother (Garcia-Fernandez, Svensson, Sarkka, 2017).

    Parameters
    ----------
    structure : Structure
    y : ndarray (steps, runs, p)
        As for `run`.
    rounds : int
        1 is `smooth(aof(structure), y)`.  The rounds are not damped.

    Returns
    -------
    Gaussian
        As of `smooth`.

    Raises
    ------
    ValueError
        `rounds` is not a whole number above 0; measurements of another shape.
    """
    expect(structure, Structure, "smooth_iterated")
    expect_sizes(rounds=rounds)
    law = smooth(aof(structure), y)
    for _ in range(rounds - 1):
        law = smooth(aof(affine_at(structure, law)), y)
    return law


def affine_at(structure: Structure, laws: Gaussian) -> Structure:
    """The affine object and meter that the structural functions describe at given laws, one for
    each step and run.

    x' = tau + A (x - z) + q,  Cov(q) = Q;     y = h + G (x - z) + r,  Cov(r) = R;       all at the
    law N(z, p) of that step
    """
    model = structure.model

    def at(k: int) -> Structure:
        there, now = Gaussian(laws.mean[k], laws.cov[k]), structure.at(k)
        tau, (A, Q) = now.predict(*there).mean, now.transition(*there)

        def predict(z: Array, p: Array) -> Gaussian:
            shift = apply(A, difference(z, there.mean, model.angles.x))
            return Gaussian(tau + shift, symmetric(product(product(A, p), transpose(A))) + Q)

        def measure(m: Array, d: Array) -> Measurement:
            return measurement_of(model.angles.y)(
                *seen_from(now.measure(*there), there, Gaussian(m, d), model.angles.x)
            )

        return Structure(structure.name, model, predict, measure, lambda z, p: Transition(A, Q))

    return replace(at(0), at_step=at)
