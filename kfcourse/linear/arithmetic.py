"""One Kalman filter in four arithmetic forms.

All four are the same filter on paper.  They differ in what rounding does to the covariance:

    `covariance`   P = (I - K H) P^-                          as in the textbook; may turn
                   asymmetric or negative
    `symmetrised`  the same, then (P + P^T) / 2               symmetric, may still be negative
    `joseph`       P = (I - K H) P^- (I - K H)^T + K R K^T    a sum of non-negative terms
    `square-root`  S with P = S S^T, by orthogonal transformations; P is never formed.  R must be
                   positive definite
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from kfcourse.laws import (
    Array,
    Gaussian,
    Matrices,
    Vectors,
    any_missing,
    apply,
    correct,
    gain,
    square_root,
    symmetric,
    transpose,
    without_missing,
)
from kfcourse.linear.system import LinearSystem


class Root(NamedTuple):
    """A normal law by a square root of its covariance: mean (..., n), root (..., n, n), cov = root
    root^T."""

    mean: Vectors
    root: Matrices


class Form(NamedTuple):
    """One arithmetic of the Kalman filter; S is a Gaussian or a Root.

    Attributes
    ----------
    start : callable
        Gaussian -> S.
    predict, correct : callable
        (LinearSystem, S, shift (..., n)) -> S and (LinearSystem, S, y (..., p)) -> S.
    law : callable
        S -> Gaussian.
    """

    start: Callable[[Gaussian], Any]
    predict: Callable[[LinearSystem, Any, Vectors | float], Any]
    correct: Callable[[LinearSystem, Any, Vectors], Any]
    law: Callable[[Any], Gaussian]


def predict_law(system: LinearSystem, law: Gaussian, shift: Vectors | float = 0.0) -> Gaussian:
    """A m + shift,  A P A^T + Q."""
    return Gaussian(apply(system.A, law.mean) + shift, system.A @ law.cov @ system.A.T + system.Q)


def _predict_symmetric(system: LinearSystem, law: Gaussian, shift: Vectors | float) -> Gaussian:
    mean, cov = predict_law(system, law, shift)
    return Gaussian(mean, symmetric(cov))


def _correct_textbook(system: LinearSystem, law: Gaussian, y: Vectors) -> Gaussian:
    """K = P H^T (H P H^T + R)^-1,  m + K (y - H m),  (I - K H) P."""
    innovation, H, R = _measured(system, y - apply(system.H, law.mean))
    cross = law.cov @ transpose(H)
    K = gain(cross, H @ cross + R, broken=True)
    return Gaussian(
        law.mean + apply(K, innovation),
        (np.eye(len(system.A), dtype=law.cov.dtype) - K @ H) @ law.cov,
    )


def _correct_symmetrised(system: LinearSystem, law: Gaussian, y: Vectors) -> Gaussian:
    mean, cov = _correct_textbook(system, law, y)
    return Gaussian(mean, symmetric(cov))


def _correct_joseph(system: LinearSystem, law: Gaussian, y: Vectors) -> Gaussian:
    """K as above, (I - K H) P (I - K H)^T + K R K^T."""
    return correct(law, system.measure(*law), y)


def _measured(system: LinearSystem, innovation: Vectors) -> tuple[Vectors, Matrices, Matrices]:
    """Innovation, H and R with the missing (NaN) components taken out."""
    if not any_missing(innovation):
        return innovation, system.H, system.R
    innovation, H, _, R = without_missing(innovation, system.H, system.R, system.R)
    return innovation, H, R


def _predict_root(system: LinearSystem, law: Root, shift: Vectors | float) -> Root:
    """[A S, Q^(1/2)] made triangular: its product with its transpose is A P A^T + Q."""
    return Root(
        apply(system.A, law.mean) + shift,
        _triangular(_beside(system.A @ law.root, square_root(system.Q))),
    )


def _correct_root(system: LinearSystem, law: Root, y: Vectors) -> Root:
    """Potter's idea with an orthogonal transformation U,

        [R^(1/2)  H S]       [F^(1/2)      0 ]
        [   0       S] U  =  [P H^T F^(-T/2)  S+]

    because both sides times their transposes are [[F, H P], [P H^T, P]].
    """
    innovation, H, R = _measured(system, y - apply(system.H, law.mean))
    p, noise = len(system.H), np.linalg.cholesky(R)
    top, bottom = _beside(noise, H @ law.root), _beside(np.zeros_like(transpose(H)), law.root)
    lower = _triangular(np.concatenate(_broadcast(top, bottom), axis=-2))
    whitened = _forward(lower[..., :p, :p], innovation)
    return Root(law.mean + apply(lower[..., p:, :p], whitened), lower[..., p:, p:])


def _beside(left: Matrices, right: Matrices) -> Matrices:
    return np.concatenate(_broadcast(left, right), axis=-1)


def _broadcast(left: Array, right: Array) -> list[Array]:
    """Both with the same leading axes."""
    lead = np.broadcast_shapes(left.shape[:-2], right.shape[:-2])
    return [np.broadcast_to(matrix, lead + matrix.shape[-2:]) for matrix in (left, right)]


def _triangular(wide: Matrices) -> Matrices:
    """Lower triangular L with L L^T = wide wide^T, by Householder's reflections of the columns.

    In the precision of `wide`: numpy.linalg.qr computes float32 in double, which would hide what
    short words do.
    """
    work, rows = np.array(wide), wide.shape[-2]
    for i in range(rows):
        size = np.abs(work[..., i, i:]).max(axis=-1, keepdims=True)
        # no square leaves the range of short words
        v = work[..., i, i:] / np.where(size > 0, size, 1)
        v[..., 0] += np.copysign(np.sqrt((v * v).sum(axis=-1)), v[..., 0])
        square = (v * v).sum(axis=-1)
        factor = 2 / np.where(square > 0, square, 1)
        work[..., i:, i:] -= (apply(work[..., i:, i:], v) * factor[..., None])[..., None] * v[
            ..., None, :
        ]
    return np.tril(work[..., :rows])


def _forward(lower: Array, right: Array) -> Array:
    """The solution x of lower x = right for a triangular matrix, in its precision: (..., p, p),
    (..., p) -> (..., p)."""
    x = np.zeros(np.broadcast_shapes(lower.shape[:-1], right.shape), dtype=lower.dtype)
    for i in range(right.shape[-1]):
        x[..., i] = (right[..., i] - (lower[..., i, :i] * x[..., :i]).sum(axis=-1)) / lower[
            ..., i, i
        ]
    return x


FORMS: dict[str, Form] = {
    "covariance": Form(lambda law: law, predict_law, _correct_textbook, lambda law: law),
    "symmetrised": Form(lambda law: law, _predict_symmetric, _correct_symmetrised, lambda law: law),
    "joseph": Form(lambda law: law, _predict_symmetric, _correct_joseph, lambda law: law),
    "square-root": Form(
        lambda law: Root(law.mean, square_root(law.cov)),
        _predict_root,
        _correct_root,
        lambda law: Gaussian(law.mean, law.root @ transpose(law.root)),
    ),
}


def form(name: str, system: LinearSystem) -> Form:
    """The arithmetic form of that name; ValueError if there is none, or the system does not allow
    it."""
    if name not in FORMS:
        raise ValueError(f"no form {name!r} of the Kalman filter; known: {', '.join(FORMS)}")
    if name == "square-root" and np.linalg.eigvalsh(system.R).min() <= 0:
        raise ValueError(
            "the square-root form divides by the noise of the meter: R must be positive definite; "
            "use joseph"
        )
    return FORMS[name]
