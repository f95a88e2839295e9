r"""Looking back: the backward pass of Rauch, Tung and Striebel (1965) along the laws that a filter
left.

When x_{k+1} is known, what the filter knew of x_k, N(z, p), can be corrected once more.  The
regression of x_k on it is

    S = Cov(x_k, x_{k+1}) Psi^+ = p A^T Psi^+,   A = dtau/dz,   lambda, Psi: prediction of x_{k+1}
    C = Cov(x_k | x_{k+1}) = (I - S A) p (I - S A)^T + S Q S^T,      Q = Psi - A p A^T

and since x_{k+1} itself is known only as N(z', p'), from all measurements, what they tell of x_k is

    z_k^s = z + S (z' - lambda),      p_k^s = C + S p' S^T  =  p + S (p' - Psi) S^T

The first form of p_k^s is a sum of non-negative terms: a wide prior cannot make it negative by
rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kfcourse.angles import Components, difference, on_circle
from kfcourse.laws import Array, Gaussian, apply, product, regression, stacked, symmetric, transpose
from kfcourse.linear.runs import Run
from kfcourse.linear.system import LinearSystem


class Backward(NamedTuple):
    """What a filter knew of x_k, and how it changes with what becomes known of x_{k+1}.

    Attributes
    ----------
    z, expected : ndarray (runs, n)
        Its estimate, and lambda, the prediction of x_{k+1}.
    S, left : ndarray (..., n, n)
        The gain of the regression on x_{k+1}, and C = Cov(x_k | x_{k+1}).
    """

    z: Array
    expected: Array
    S: Array
    left: Array

    @classmethod
    def regress(cls, posterior: Gaussian, predicted: Gaussian, A: Array, Q: Array) -> Backward:
        """The regression of x_k ~ `posterior` on x_{k+1} ~ `predicted`, x_{k+1} = A x_k + noise,
        Cov(noise) = Q."""
        return cls(posterior.mean, predicted.mean, *regression(posterior.cov, A, predicted.cov, Q))

    def given(self, after: Gaussian, angles: Components = ()) -> Gaussian:
        """The law of x_k, from that of x_{k+1} given the same measurements."""
        mean = self.z + apply(self.S, difference(after.mean, self.expected, angles))
        cov = self.left + product(product(self.S, after.cov), transpose(self.S))
        return Gaussian(on_circle(mean, angles), symmetric(cov))


def look_back(
    back: Sequence[Backward],
    laws: Sequence[Gaussian],
    lag: int | None = None,
    angles: Components = (),
) -> list[Gaussian]:
    """The laws of the states, given all measurements of the record.

    Parameters
    ----------
    back : sequence of Backward
        Of all steps but the last.
    laws : sequence of Gaussian
        The filter's, of each step.
    lag : int, optional
        Only so many later measurements: the law of x_k given y_0, ..., y_{k + lag}.
    angles : tuple
        Numbers of the components of x that are.

    Raises
    ------
    ValueError
        A lag that is no whole number, or below 0.
    """
    check_lag(lag)
    if lag is None:
        smoothed = [laws[-1]]
        for step in reversed(back):
            smoothed.append(step.given(smoothed[-1], angles))
        return smoothed[::-1]
    laws = list(laws)
    # each round adds one measurement to what is known of every state
    for _ in range(min(lag, len(back))):
        laws = [
            *(step.given(after, angles) for step, after in zip(back, laws[1:], strict=True)),
            laws[-1],
        ]
    return laws


def check_lag(lag: int | None) -> None:
    """ValueError for a lag that is no whole number, or below 0."""
    if lag is not None and (
        isinstance(lag, bool) or not isinstance(lag, int | np.integer) or lag < 0
    ):
        raise ValueError(
            f"lag must be a whole number of steps, at least 0, or None for all that follow; got "
            f"{lag!r}"
        )


def smooth(system: LinearSystem, filtered: Run, lag: int | None = None) -> Gaussian:
    """The states of a linear system given all measurements, from the filter's `run` over them.

    Inputs are in its predictions already.  Means (steps, runs, n), covariances (steps, runs, n, n);
    `lag` and errors as of `look_back`.
    """
    posterior, predicted = (
        [Gaussian(*law) for law in zip(laws.mean, _once(laws.cov), strict=True)]
        for laws in filtered
    )
    back = [
        Backward.regress(here, ahead, system.A, system.Q)
        for here, ahead in zip(posterior[:-1], predicted[1:], strict=True)
    ]
    return stacked(look_back(back, posterior, lag))


def _once(cov: Array) -> Array:
    """Covariances (steps, runs, n, n) that are shown to all runs, but stored once: (steps, n,
    n)."""
    return cov[:, 0] if cov.strides[1] == 0 else cov
