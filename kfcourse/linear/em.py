r"""Noise covariances of a linear system by expectation and maximisation (Dempster, Laird, Rubin,
1977; Shumway, Stoffer, 1982).

If the states were seen, Q and R would be the mean squares of their noises.  They are not seen; but
the smoother knows these squares' means under the present Q and R, which are then replaced by them,

    Q <- 1/N sum_k M[v v^T | y],   v = x_{k+1} - A x_k,   R <- 1/N sum_k M[w w^T | y],
    w = y_k - H x_k

No round lowers the likelihood.  It takes Cov(x_k, x_{k+1} | y) = S p^s_{k+1}, S as of
`kfcourse.linear.smoothing`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kfcourse.laws import Array, Gaussian, apply, gain, product, symmetric, transpose
from kfcourse.linear.runs import run
from kfcourse.linear.smoothing import smooth
from kfcourse.linear.system import LinearSystem


def em_rounds(system: LinearSystem, prior: Gaussian, y: Array, rounds: int) -> list[LinearSystem]:
    """The system, and what each of so many rounds makes of it: Q and R change, A and H stay.

    Parameters
    ----------
    system : LinearSystem
        Where to begin: a Q or R of 0 would stay 0.
    prior : Gaussian
        Law of x_0, as of `run`.
    y : ndarray (steps, runs, p)
        Several runs are independent records of the same system.  NaN where a measurement is missing
        as a whole.
    rounds : int

    Raises
    ------
    ValueError
        Measurements of which components are missing, or none is there; less than two steps; and
        what `run` refuses.
    """
    missing = np.isnan(y)
    if (missing.any(axis=-1) != missing.all(axis=-1)).any() or missing.all() or len(y) < 2:
        raise ValueError(
            "expectation and maximisation needs two steps or more, and measurements that are "
            "there or missing as a whole"
        )
    measured = np.logical_and.reduce(~missing, axis=-1)
    systems = [system]
    for _ in range(rounds):
        systems.append(_round(systems[-1], prior, y, measured))
    return systems


def _round(system: LinearSystem, prior: Gaussian, y: Array, measured: Array) -> LinearSystem:
    """Q and R replaced by what is expected of their noises' squares."""
    A, H, filtered = system.A, system.H, run(system, prior, y)
    x, p = smooth(system, filtered)
    S = gain(product(filtered.posterior.cov[:-1], transpose(A)), filtered.predicted.cov[1:])
    together = product(A, product(S, p[1:]))  # A Cov(x_k, x_{k+1})
    v = x[1:] - apply(A, x[:-1])
    before = product(product(A, p[:-1]), transpose(A))
    squares = _square(v) + p[1:] - together - transpose(together) + before
    w = (y - apply(H, x))[measured]
    errors = _square(w) + product(product(H, p[measured]), transpose(H))
    return replace(system, Q=symmetric(squares.mean(axis=(0, 1))), R=symmetric(errors.mean(axis=0)))


def _square(vector: Array) -> Array:
    return vector[..., :, None] * vector[..., None, :]
