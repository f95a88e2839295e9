"""The iterated filter: linearise the meter again, where the measurement has moved the estimate.

The Gaussian-approximated AOF takes the structural functions of the meter at the prediction.  After
the correction a better place is known.  The iterated filter takes them there, and corrects the
*same prediction* anew with the affine meter that they describe,

    y = h + G (x - z) + e,   Cov(e) = R = F - G p G^T,        h, G, F at (z, p)

With `linearised(model)` each round is a step of Gauss and Newton's method towards the maximum of
the posterior density,

    1/2 (x - lambda)^T Psi^-1 (x - lambda) + 1/2 (y - S(x))^T D_n^-1 (y - S(x))  ->  min,

the classical iterated extended Kalman filter (Bell and Cathey, 1993); with the moment structures it
is the iterated posterior linearisation filter (Garcia-Fernandez, Svensson, Morelande, Sarkka,
2015).
"""

from __future__ import annotations

from kfcourse.angles import Components, difference
from kfcourse.errors import expect, expect_sizes
from kfcourse.filters import notation as s
from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.laws import (
    Array,
    Gaussian,
    Measurement,
    apply,
    correct,
    product,
    symmetric,
    transpose,
)
from kfcourse.symbolic.structure import Structure

_z_i, _P_i = s.matrix(r"z^{(i)}", s.n, s.ONE), s.matrix(r"p^{(i)}", s.n, s.n)
_z_next, _P_next = s.matrix(r"z^{(i+1)}", s.n, s.ONE), s.matrix(r"p^{(i+1)}", s.n, s.n)
_h_i, _G_i = s.matrix(r"h^{(i)}", s.p, s.ONE), s.matrix(r"G^{(i)}", s.p, s.n)
_F_i, _R_i = s.matrix(r"F^{(i)}", s.p, s.p), s.matrix(r"R^{(i)}", s.p, s.p)
_K_i = s.matrix(r"K^{(i)}", s.n, s.p)
_at = r"(z^{(i)}, p^{(i)})"

# One round of the correction; it starts from z^(0) = lambda, p^(0) = Psi.
EQUATIONS = (
    s.equation(_h_i, s.matrix(f"h{_at}", s.p, s.ONE)),
    s.equation(_G_i, s.matrix(f"G{_at}", s.p, s.n)),
    s.equation(_R_i, s.matrix(f"F{_at}", s.p, s.p) - _G_i * _P_i * _G_i.T),
    s.equation(_F_i, _G_i * s.Psi * _G_i.T + _R_i),
    s.equation(_K_i, s.Psi * _G_i.T * _F_i.I),
    s.equation(_z_next, s.lam + _K_i * (s.y - _h_i - _G_i * (s.lam - _z_i))),
    s.equation(_P_next, s.Psi - _K_i * _G_i * s.Psi),
)


def iterated(structure: Structure, iterations: int = 5) -> Filter:
    """The Gaussian-approximated AOF with an iterated correction.

    (z, p) = (lambda, Psi);  `iterations` times, with h, G, F, R at (z, p):
    K = Psi G^T (G Psi G^T + R)^+,  z = lambda + K (y - h - G (lambda - z)),  p = Psi - K G Psi

    Parameters
    ----------
    structure : Structure
    iterations : int
        Rounds of the correction.  1 is `aof(structure)`.  The rounds are not damped: where a
        measurement is far sharper than the curvature of the meter allows, they may jump about
        instead of settling.

    Returns
    -------
    Filter
        Its covariance p (runs, n, n) is that of the last affine meter.  A missing measurement (NaN)
        leaves the prediction.

    Raises
    ------
    ValueError
        `iterations` is not a whole number above 0.

    Examples
    --------
    >>> import numpy as np
    >>> from kfcourse import Model, linearised, run
    >>> from kfcourse.filters import iterated
    >>> model = Model.define("x + v", "x**3 + 0.1*w", {}, prior=dict(mean=1, variance=1))
    >>> filters = [iterated(linearised(model), count) for count in (1, 2, 20)]
    >>> [round(run(each, np.array([[[8.0]]])).mean.item(), 3) for each in filters]
    [3.331, 2.461, 2.0]
    """
    expect(structure, Structure, "iterated")
    expect_sizes(iterations=iterations)

    def step(state: State, y: Array) -> State:
        prior, now = state.predicted, structure.at(state.step)
        expected = now.measure(*prior)
        posterior = correct(prior, expected, y)
        for _ in range(iterations - 1):
            posterior = correct(prior, *affine_meter(now, posterior, prior, y))
        return State(state.step + 1, posterior, now.predict(*posterior), expected=expected)

    return Filter(
        f"iterated-{structure.name}",
        structure.model,
        initial_state(structure.model),
        step,
        structure=structure,
    )


def affine_meter(
    structure: Structure, at: Gaussian, prior: Gaussian, y: Array
) -> tuple[Measurement, Array]:
    """The meter's structural functions at the law `at`, as those of an affine meter seen from the
    law `prior`; and y.

    h + G (lambda - z),  G,  G Psi G^T + R,  R

    Components of y that are angles get the turns that bring them near h: at z, where the meter is
    affine, not at lambda.
    """
    there, angles = structure.measure(*at), structure.model.angles
    return seen_from(there, at, prior, angles.x), there.h + there.innovation(y) if angles.y else y


def seen_from(there: Measurement, at: Gaussian, prior: Gaussian, angles: Components) -> Measurement:
    """The affine meter that structural functions at the law `at` describe, seen from another law:
    without the turns of y."""
    h, G, _, R = there
    F = symmetric(product(product(G, prior.cov), transpose(G))) + R
    return Measurement(h + apply(G, difference(prior.mean, at.mean, angles)), G, F, R)
