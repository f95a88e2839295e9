r"""Looking back: the backward pass of Rauch, Tung and Striebel (1965) along the laws that a filter left.

When x_{k+1} is known, what the filter knew of x_k, N(z, p), can be corrected once more.  The regression of x_k on it is

    S = Cov(x_k, x_{k+1}) Psi^+ = p A^T Psi^+,       A = dtau/dz,   lambda, Psi: prediction of x_{k+1}

and since x_{k+1} itself is known only as N(z', p'), from all measurements, what they tell of x_k is

    z_k^s = z + S (z' - lambda),      p_k^s = p + S (p' - Psi) S^T = (I - S A) p (I - S A)^T + S (Q + p') S^T

with Q = Psi - A p A^T.  The last form is a sum of non-negative terms: a wide prior cannot make it negative by rounding.  Of one
state it is p Q / Psi + S^2 p', of more L (I - S A)^T + S (Q + p') S^T with L = (I - S A) p = Cov(x_k | x_{k+1}).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kfcourse.angles import Components, difference, on_circle
from kfcourse.laws import Array, Gaussian, apply, gain, product, regression, stacked, symmetric, transpose
from kfcourse.linear.runs import Run
from kfcourse.linear.system import LinearSystem

AT_ONCE = 2048  # laws: so many that a call costs little beside them, so few that stacking them does, too


class Passages(NamedTuple):
    """A filter's ways from each step to the next.

    Attributes
    ----------
    posterior, predicted : Gaussian
        Laws of x_k after its measurement, and of x_{k+1} before its own: means (steps, runs, n), covariances
        (steps, runs, n, n), or (steps, 1, n, n) if all runs have the same.
    A, Q : ndarray (..., n, n)
        dtau/dz, and the part of the prediction's covariance that it does not explain: of each, or of all.
    """

    posterior: Gaussian
    predicted: Gaussian
    A: Array
    Q: Array


class Regression(NamedTuple):
    """What a filter knew of x_k, and how it changes with what becomes known of x_{k+1}.

    Attributes
    ----------
    z, expected : ndarray (runs, n)
        Its estimate, and lambda, the prediction of x_{k+1}.
    S, left : ndarray (..., n, n)
        Its gain, and Cov(x_k | x_{k+1}).
    Q, forth : ndarray (..., n, n), or None of one state
        The noise, and left A^T, which is S Q but for rounding.
    """

    z: Array
    expected: Array
    S: Array
    left: Array
    Q: Array | None = None
    forth: Array | None = None

    def given(self, after: Gaussian, angles: Components = ()) -> Gaussian:
        """The law of x_k, from that of x_{k+1}."""
        mean = self.z + apply(self.S, difference(after.mean, self.expected, angles))
        further = product(self.S, after.cov if self.Q is None else self.Q + after.cov)
        further = further if self.forth is None else further - self.forth
        return Gaussian(on_circle(mean, angles), symmetric(self.left + product(further, transpose(self.S))))


def regressions(passages: Passages) -> list[Regression]:
    """Of each step on the next.  They do not depend on what comes later: found for all steps together."""
    (z, p), (lam, Psi), A, Q = passages
    if z.shape[-1] == 1:
        return list(map(Regression, z, lam, *regression(p, A, Psi, Q)))
    Ap = product(A, p)
    S = gain(Ap.swapaxes(-1, -2), Psi, broken=True)
    left = p - product(S, Ap)
    noise = Q if Q.ndim == p.ndim else np.broadcast_to(Q, (len(z), *Q.shape))
    return list(map(Regression, z, lam, S, left, noise, product(left, transpose(A))))


def blocks(steps: int, runs: int) -> list[slice]:
    """Steps that are worth taking together."""
    size = max(1, AT_ONCE // runs)
    return [slice(start, start + size) for start in range(0, steps, size)]


def look_back(back: list[Regression], laws: Sequence[Gaussian], lag: int | None = None, angles: Components = ()) -> Gaussian:
    """The laws of the states, given all measurements of the record.

    Parameters
    ----------
    back : list of Regression
        Of all steps but the last.  Without a lag it is used up, so that what is found needs no memory beside it.
    laws : sequence of Gaussian
        The filter's, of each step; without a lag that of the last one is enough.
    lag : int, optional
        Only so many later measurements: the law of x_k given y_0, ..., y_{k + lag}.
    angles : tuple
        Numbers of the components of x that are.

    Returns
    -------
    Gaussian
        Means (steps, runs, n) and covariances (steps, runs, n, n).

    Raises
    ------
    ValueError
        A lag that is no whole number, or below 0.
    """
    check_lag(lag)
    if lag is None:
        found = [laws[-1]]
        while back:
            found.append(back.pop().given(found[-1], angles))
        return stacked(found[::-1])
    for _ in range(min(lag, len(back))):  # each round tells every state of one measurement more
        laws = [*(one.given(after, angles) for one, after in zip(back, laws[1:], strict=True)), laws[-1]]
    return stacked(laws)


def check_lag(lag: int | None) -> None:
    """ValueError for a lag that is no whole number, or below 0."""
    if lag is not None and (isinstance(lag, bool) or not isinstance(lag, int | np.integer) or lag < 0):
        raise ValueError(f"lag must be a whole number of steps, at least 0, or None for all that follow; got {lag!r}")


def smooth(system: LinearSystem, found: Run, lag: int | None = None) -> Gaussian:
    """The states of a linear system given all measurements, from the filter's `run` over them.

    Inputs are in its predictions already.  `lag`, result and errors as of `look_back`.
    """
    (mean, cov), (ahead, ahead_cov) = ((laws.mean, _once(laws.cov)) for laws in (found.posterior, found.predicted))
    each = [
        Passages(Gaussian(mean[:-1][part], cov[:-1][part]), Gaussian(ahead[1:][part], ahead_cov[1:][part]), system.A, system.Q)
        for part in blocks(len(mean) - 1, mean.shape[1])
    ]
    return look_back([one for part in each for one in regressions(part)], list(map(Gaussian, mean, cov)), lag)


def _once(cov: Array) -> Array:
    """Covariances (steps, runs, n, n) that are shown to all runs, but stored once: (steps, 1, n, n)."""
    return cov[:, :1] if cov.strides[1] == 0 else cov
