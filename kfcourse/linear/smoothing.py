r"""Looking back: the backward pass of Rauch, Tung and Striebel (1965) along the laws that a filter left.

When x_{k+1} is known, what the filter knew of x_k, N(z, p), can be corrected once more.  The regression of x_k on it is

    S = Cov(x_k, x_{k+1}) Psi^+ = p A^T Psi^+,       A = dtau/dz,   lambda, Psi: prediction of x_{k+1}

and since x_{k+1} itself is known only as N(z', p'), from all measurements, what they tell of x_k is

    z_k^s = z + S (z' - lambda),      p_k^s = p + S (p' - Psi) S^T = (I - S A) p (I - S A)^T + S (Q + p') S^T

with Q = Psi - A p A^T.  The last form is a sum of non-negative terms: a wide prior cannot make it negative by rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from kfcourse.angles import Components, difference, on_circle
from kfcourse.laws import Array, Gaussian, apply, gain, identity, product, stacked, symmetric, transpose
from kfcourse.linear.runs import Run
from kfcourse.linear.system import LinearSystem

AT_ONCE = 512  # laws: so many that a call costs little beside them, so few that stacking them does, too


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


def blocks(steps: int, runs: int) -> list[slice]:
    """Steps that are worth taking together."""
    size = max(1, AT_ONCE // runs)
    return [slice(start, start + size) for start in range(0, steps, size)]


def look_back(passages: Sequence[Passages], last: Gaussian, lag: int | None = None, angles: Components = ()) -> Gaussian:
    """The laws of the states, given all measurements of the record.

    Parameters
    ----------
    passages : sequence of Passages
        One after the other, through the whole record.
    last : Gaussian
        The filter's law of the last state.
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
    back = [one for part in passages for one in _regressions(part, angles)]
    if lag is None:
        return stacked([*accumulate(reversed(back), lambda after, one: one(after), initial=last)][::-1])
    posteriors = [Gaussian(*law) for part in passages for law in zip(*part.posterior, strict=True)]
    laws = [*posteriors, last]
    for _ in range(min(lag, len(back))):  # each round tells every state of one measurement more
        laws = [*(one(after) for one, after in zip(back, laws[1:], strict=True)), last]
    return stacked(laws)


def check_lag(lag: int | None) -> None:
    """ValueError for a lag that is no whole number, or below 0."""
    if lag is not None and (isinstance(lag, bool) or not isinstance(lag, int | np.integer) or lag < 0):
        raise ValueError(f"lag must be a whole number of steps, at least 0, or None for all that follow; got {lag!r}")


def _regressions(passages: Passages, angles: Components) -> list[Callable[[Gaussian], Gaussian]]:
    """From the law of x_{k+1} to that of x_k, for each k.

    The gain does not depend on what comes later: found for all steps together.
    """
    (z, p), (lam, Psi), A, Q = passages
    S = gain(product(p, transpose(A)), Psi, broken=True)
    rest = identity(z.shape[-1], p.dtype) - product(S, A)
    own = product(product(rest, p), transpose(rest))
    each = np.broadcast_to(Q, (len(z), *Q.shape[-3:])) if Q.ndim < 4 else Q

    def of_step(z: Array, lam: Array, S: Array, own: Array, Q: Array) -> Callable[[Gaussian], Gaussian]:
        def back(after: Gaussian) -> Gaussian:
            mean = z + apply(S, difference(after.mean, lam, angles))
            return Gaussian(on_circle(mean, angles), symmetric(own + product(product(S, Q + after.cov), transpose(S))))

        return back

    return [of_step(*one) for one in zip(z, lam, S, own, each, strict=True)]


def smooth(system: LinearSystem, found: Run, lag: int | None = None) -> Gaussian:
    """The states of a linear system given all measurements, from the filter's `run` over them.

    Inputs are in its predictions already.  `lag`, result and errors as of `look_back`.
    """
    (mean, cov), (ahead, ahead_cov) = ((laws.mean, _once(laws.cov)) for laws in (found.posterior, found.predicted))
    passages = [
        Passages(Gaussian(mean[:-1][part], cov[:-1][part]), Gaussian(ahead[1:][part], ahead_cov[1:][part]), system.A, system.Q)
        for part in blocks(len(mean) - 1, mean.shape[1])
    ]
    return look_back(passages, Gaussian(mean[-1], cov[-1]), lag)


def _once(cov: Array) -> Array:
    """Covariances (steps, runs, n, n) that are shown to all runs, but stored once: (steps, 1, n, n)."""
    return cov[:, :1] if cov.strides[1] == 0 else cov
