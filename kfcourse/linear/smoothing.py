r"""Looking back: the backward pass of Rauch, Tung and Striebel (1965) along the laws that a filter left.

When x_{k+1} is known, what the filter knew of x_k, N(z, p), can be corrected once more.  The regression of x_k on it is

    S = Cov(x_k, x_{k+1}) Psi^+ = p A^T Psi^+,       A = dtau/dz,   lambda, Psi: prediction of x_{k+1}

and since x_{k+1} itself is known only as N(z', p'), from all measurements, what they tell of x_k is

    z_k^s = z + S (z' - lambda),      p_k^s = p + S (p' - Psi) S^T = (I - S A) p (I - S A)^T + S (Q + p') S^T

with Q = Psi - A p A^T.  The last form is a sum of non-negative terms: a wide prior cannot make it negative by rounding.  Of one
state it is p Q / Psi + S^2 p', of more L (I - S A)^T + S (Q + p') S^T with L = (I - S A) p = Cov(x_k | x_{k+1}).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from kfcourse.angles import Components, difference, on_circle
from kfcourse.laws import (
    Array,
    Gaussian,
    apply,
    gain,
    product,
    regression,
    runs_first,
    runs_last,
    solve_by_entries,
    stacked,
    transpose,
)
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


class Layout(NamedTuple):
    """How many small matrices lie in memory, and what is done with them there; the formulas below are the same in each.

    A library's product costs as much for two rows as for eight.  Where each entry of all matrices is a row of numbers it costs as
    many sums as it has: a sixth for two states, the same for five.
    """

    put: Callable[[Array], Array]  # (..., n, n) -> there
    back: Callable[[Array], Array]
    steps: Callable[[Array], Array]  # the axis of steps, first of (steps, runs, n, n), to the front
    product: Callable[[Array, Array], Array]
    transpose: Callable[[Array], Array]
    apply: Callable[[Array, Array], Array]  # to vectors (..., n)
    gain: Callable[[Array, Array], Array]  # of cross^T and cov


def _gain_by_entries(backwards: Array, cov: Array) -> Array:
    found = np.broadcast_to(backwards, np.broadcast_shapes(backwards.shape, cov.shape)).copy()
    if solve_by_entries(found, cov.copy()):
        return found.swapaxes(0, 1)
    return runs_last(gain(runs_first(backwards.swapaxes(0, 1)), runs_first(cov), broken=True))


BY_MATRIX = Layout(
    lambda matrices: matrices,
    lambda matrices: matrices,
    lambda matrices: matrices,
    product,
    transpose,
    apply,
    lambda backwards, cov: gain(backwards.swapaxes(-1, -2), cov, broken=True),
)
BY_ENTRY = Layout(
    runs_last,
    runs_first,
    lambda matrices: np.moveaxis(matrices, 2, 0),
    partial(np.einsum, "ij...,jk...->ik..."),
    lambda matrices: matrices.swapaxes(0, 1),
    partial(np.einsum, "ij...,...j->...i"),
    _gain_by_entries,
)


def layout_of(n: int) -> Layout:
    """The one in which matrices (n, n) cost least."""
    return BY_ENTRY if 2 <= n <= 4 else BY_MATRIX


class Regression(NamedTuple):
    """What a filter knew of x_k, and how it changes with what becomes known of x_{k+1}.

    Attributes
    ----------
    z, expected : ndarray (runs, n)
        Its estimate, and lambda, the prediction of x_{k+1}.
    S, left : ndarray
        Its gain, and Cov(x_k | x_{k+1}): matrices (n, n) in their `Layout`, as those below.
    Q, forth : ndarray, or None of one state
        The noise, and left A^T, which is S Q but for rounding.
    """

    z: Array
    expected: Array
    S: Array
    left: Array
    Q: Array | None = None
    forth: Array | None = None

    def given(self, after: Gaussian, angles: Components = ()) -> Gaussian:
        """The law of x_k, from that of x_{k+1}; its covariance in the same layout."""
        lies = layout_of(self.z.shape[-1])
        mean = self.z + lies.apply(self.S, difference(after.mean, self.expected, angles))
        further = lies.product(self.S, after.cov if self.Q is None else self.Q + after.cov)
        if self.forth is not None:
            further -= self.forth
        further = lies.product(further, lies.transpose(self.S))
        further += self.left
        if self.forth is not None:  # rounding must not make it asymmetric
            further += lies.transpose(further)
            further *= 0.5
        return Gaussian(on_circle(mean, angles), further)


def regressions(passages: Passages) -> list[Regression]:
    """Of each step on the next.  They do not depend on what comes later: found for all steps together."""
    (z, p), (lam, Psi), A, Q = passages
    if z.shape[-1] == 1:
        return list(map(Regression, z, lam, *regression(p, A, Psi, Q)))
    lies = layout_of(z.shape[-1])
    p, Psi, A, Q = (lies.put(part if part.ndim == 4 else part[None, None]) for part in (p, Psi, A, Q))
    Ap = lies.product(A, p)
    S = lies.gain(Ap, Psi)
    left = lies.product(S, Ap)
    np.subtract(p, left, out=left)
    forth = lies.product(left, lies.transpose(A))
    return list(map(Regression, z, lam, *(lies.steps(part) for part in (S, left, np.broadcast_to(Q, forth.shape), forth))))


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
    lies = layout_of(laws[-1].mean.shape[-1])
    known = laws[-1:] if lag is None else laws
    laws = [Gaussian(mean, lies.put(cov if cov.ndim == 3 else cov[None])) for mean, cov in known]
    if lag is None:
        while back:
            laws.append(back.pop().given(laws[-1], angles))
        laws.reverse()
    for _ in range(min(lag or 0, len(back))):  # each round tells every state of one measurement more
        laws = [*(one.given(after, angles) for one, after in zip(back, laws[1:], strict=True)), laws[-1]]
    return stacked([Gaussian(mean, lies.back(cov)) for mean, cov in laws])


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
