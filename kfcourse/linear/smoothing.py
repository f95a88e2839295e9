r"""Looking back: the backward pass of Rauch, Tung and Striebel (1965) along the laws that a filter left.

When x_{k+1} is known, what the filter knew of x_k, N(z, p), can be corrected once more.  The regression of x_k on it is

    S = Cov(x_k, x_{k+1}) Psi^+ = p A^T Psi^+,       A = dtau/dz,   lambda, Psi: prediction of x_{k+1}

and since x_{k+1} itself is known only as N(z', p'), from all measurements, what they tell of x_k is

    z_k^s = z + S (z' - lambda),      p_k^s = p + S (p' - Psi) S^T = (I - S A) p (I - S A)^T + S (Q + p') S^T

with Q = Psi - A p A^T.  The last form is a sum of non-negative terms: a wide prior cannot make it negative by rounding.  All of
it that waits for no later measurement is the covariance that is left when x_{k+1} is known,

    C = Cov(x_k | x_{k+1}) = (I - S A) p (I - S A)^T + S Q S^T,      p_k^s = C + S p' S^T

Of one state C = p Q / Psi, of more L - S (A L - Q S^T) with L = (I - S A) p, where only rounding is in the brackets.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import accumulate
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
    transpose,
)
from kfcourse.linear.runs import Run
from kfcourse.linear.system import LinearSystem

AT_ONCE = 2048  # laws: so many that a call costs little beside them, so few that stacking them does, too

ON_ONE_CORE = 200_000  # products in one of matrices; with more a library sets all cores to it, which wait longer than they work


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
        Its gain, and C = Cov(x_k | x_{k+1}): matrices (n, n) in their `Layout`.
    """

    z: Array
    expected: Array
    S: Array
    left: Array

    def given(self, after: Gaussian, angles: Components = ()) -> Gaussian:
        """The law of x_k, from that of x_{k+1}; its covariance in the same layout."""
        n = self.z.shape[-1]
        lies = layout_of(n)
        news = difference(after.mean, self.expected, angles)
        at_once = self.S.size == n * n and news.size * n <= ON_ONE_CORE  # three times as fast
        mean = news @ self.S.reshape(n, n).T if at_once else lies.apply(self.S, news)
        mean += self.z
        cov = lies.product(lies.product(self.S, after.cov), lies.transpose(self.S))
        cov = np.add(cov, self.left, out=cov if cov.size >= self.left.size else None)
        if n > 1:  # rounding must not make it asymmetric
            cov += lies.transpose(cov)
            cov *= 0.5
        return Gaussian(on_circle(mean, angles), cov)


def regressions(passages: Passages, room: Array | None = None) -> list[Regression]:
    """Of each step on the next.  They do not depend on what comes later: found for all steps together.

    Their matrices are put into the room, of as many steps and as many runs or more, if it is given; see `room_for`.
    """
    (z, p), (lam, Psi), A, Q = passages
    if z.shape[-1] == 1:
        return list(map(Regression, z, lam, *regression(p, A, Psi, Q)))
    lies = layout_of(z.shape[-1])
    p, Psi, A, Q = (lies.put(part if part.ndim == 4 else part[None, None]) for part in (p, Psi, A, Q))
    Ap = lies.product(A, p)
    S = lies.gain(Ap, Psi)
    left = lies.product(S, Ap)
    np.subtract(p, left, out=left)
    rounded = lies.product(A, left)
    rounded -= lies.product(Q, lies.transpose(S))
    left -= lies.product(S, rounded)
    S, left = lies.steps(S), lies.steps(left)
    if room is not None:
        room = room[:, *map(slice, S.shape)]
        room[:] = S, left
        S, left = room
    return list(map(Regression, z, lam, S, left))


def room_for(steps: int, runs: int, n: int) -> Array:
    """Where matrices of so many steps and runs stay until they are used, both of a `Regression`.

    It may be used again: memory that is asked for anew costs as much as the products that it is to hold.
    """
    return np.empty((2, steps, runs, n, n) if layout_of(n) is BY_MATRIX else (2, steps, n, n, runs))


def blocks(steps: int, runs: int) -> list[slice]:
    """Steps that are worth taking together."""
    size = max(1, AT_ONCE // runs)
    return [slice(start, start + size) for start in range(0, steps, size)]


def look_back(
    back: Sequence[Regression],
    laws: Sequence[Gaussian],
    lag: int | None = None,
    angles: Components = (),
    into: Gaussian | None = None,
) -> Gaussian:
    """The laws of the states, given all measurements of the record.

    Parameters
    ----------
    back : list of Regression
        Of all steps but the last.
    laws : sequence of Gaussian
        The filter's, of each step; without a lag that of the last one is enough.
    lag : int, optional
        Only so many later measurements: the law of x_k given y_0, ..., y_{k + lag}.
    angles : tuple
        Numbers of the components of x that are.
    into : Gaussian, optional
        Where the result is put.

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
    found: Iterable[Gaussian]  # the last step first
    if lag is None:
        found = accumulate(reversed(back), lambda after, one: one.given(after, angles), initial=laws[-1])
    else:
        for _ in range(min(lag, len(back))):  # each round tells every state of one measurement more
            laws = [*(one.given(after, angles) for one, after in zip(back, laws[1:], strict=True)), laws[-1]]
        found = reversed(laws)
    return _put_together((Gaussian(mean, lies.back(cov)) for mean, cov in found), len(back) + 1, into)


def _put_together(found: Iterable[Gaussian], steps: int, into: Gaussian | None) -> Gaussian:
    """Laws of successive steps, of the last one first, as one; covariances that are the same for all runs are stored once."""
    if into is not None:
        for k, law in zip(reversed(range(steps)), found, strict=True):
            into.mean[k], into.cov[k] = law
        return into
    mean: Array
    cov: Array
    for k, law in zip(reversed(range(steps)), found, strict=True):
        if k == steps - 1:
            mean, cov = (np.empty((steps, *part.shape)) for part in law)
        if len(law.cov) > cov.shape[1]:
            cov = np.repeat(cov, len(law.cov), axis=1)
        mean[k], cov[k] = law
    return Gaussian(mean, np.broadcast_to(cov, (*mean.shape, mean.shape[-1])))


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
