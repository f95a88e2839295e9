r"""The UD form: a covariance as P = U D U^T, U upper triangular with ones on its diagonal, D
diagonal.

It has the digits of the square root (D holds the variances, no difference of covariances is formed)
and takes no square roots. Measurements are used one after the other; several at once are first made
independent by the factors of R.

    correct    Bierman's update by one scalar measurement
    predict    Thornton's: the rows of [A U, U_Q] made orthogonal with the weights (D, D_Q)

Bierman (1977), chapters V and VI.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kfcourse.laws import Array, Matrices, Vectors, apply, symmetric


class Factors(NamedTuple):
    """A normal law by the factors of its covariance: mean (..., n), unit (..., n, n), diagonal
    (..., n).

    `cov` = `unit` diag(`diagonal`) `unit`^T
    """

    mean: Vectors
    unit: Matrices
    diagonal: Vectors


def factors(cov: Matrices) -> tuple[Matrices, Vectors]:
    """U (..., n, n) and D (..., n) of a covariance, U D U^T = cov; a variance that rounding made
    negative is taken as 0."""
    rest, n = np.array(cov), cov.shape[-1]
    unit, diagonal = np.zeros_like(rest), np.zeros_like(rest[..., 0])
    for j in reversed(range(n)):
        diagonal[..., j] = np.maximum(rest[..., j, j], 0)
        unit[..., : j + 1, j] = _ratio(rest[..., : j + 1, j], diagonal[..., j, None])
        unit[..., j, j] = 1
        column = unit[..., :j, j]
        rest[..., :j, :j] -= (
            diagonal[..., j, None, None] * column[..., :, None] * column[..., None, :]
        )
    return unit, diagonal


def product(unit: Matrices, diagonal: Vectors) -> Matrices:
    """U D U^T, (..., n, n)."""
    return symmetric((unit * diagonal[..., None, :]) @ np.swapaxes(unit, -1, -2))


def predict_factors(A: Matrices, law: Factors, shift: Vectors | float, Q: Matrices) -> Factors:
    """A m + shift, and the factors of A P A^T + Q: Gram and Schmidt's orthogonal rows, in the
    modified order."""
    noise, strength = factors(Q)
    lead = law.unit.shape[:-2]
    rows = np.concatenate([A @ law.unit, np.broadcast_to(noise, lead + noise.shape)], axis=-1)
    weights = np.concatenate(
        [law.diagonal, np.broadcast_to(strength, lead + strength.shape)], axis=-1
    )
    unit, diagonal = np.zeros_like(law.unit), np.zeros_like(law.diagonal)
    for j in reversed(range(A.shape[0])):
        last = rows[..., j, :].copy()
        diagonal[..., j] = (weights * last**2).sum(axis=-1)
        unit[..., j, j] = 1
        along = (rows[..., :j, :] * (weights * last)[..., None, :]).sum(axis=-1)
        unit[..., :j, j] = _ratio(along, diagonal[..., j, None])
        rows[..., :j, :] -= unit[..., :j, j, None] * last[..., None, :]
    return Factors(apply(A, law.mean) + shift, unit, diagonal)


def correct_factors(law: Factors, innovation: Vectors, H: Matrices, R: Matrices) -> Factors:
    """Mean and factors after measurements y = H x + w, w ~ N(0, R), with innovation y - H m (...,
    p)."""
    mixing, noise = factors(R)
    # of a triangular matrix with ones on its diagonal
    apart = np.linalg.inv(mixing).astype(R.dtype)
    innovation, H = apply(apart, innovation), apart @ H
    change, unit, diagonal = np.zeros_like(law.mean), law.unit, law.diagonal
    for j in range(innovation.shape[-1]):
        h = H[..., j, :]
        unit, diagonal, K = bierman(unit, diagonal, h, noise[..., j])
        change = change + K * (innovation[..., j] - (h * change).sum(axis=-1))[..., None]
    return Factors(law.mean + change, unit, diagonal)


def bierman(
    unit: Matrices, diagonal: Vectors, h: Vectors, noise: Array
) -> tuple[Matrices, Vectors, Vectors]:
    """Factors after the measurement h^T x + w, w ~ N(0, noise), and the gain (..., n).

    f = U^T h,  v = D f;  alpha_j = noise + f_1 v_1 + ... + f_j v_j;  D_j <- D_j alpha_{j-1} /
    alpha_j, column j of U <- u_j - (f_j / alpha_{j-1}) (U v)_{1 ... j-1}.

    Parameters
    ----------
    unit, diagonal : ndarray (..., n, n), (..., n)
    h : ndarray (n,) or (..., n)
        Sensitivity of the meter.
    noise : ndarray (...)
        Variance of its noise, >= 0.
    """
    f = apply(np.swapaxes(unit, -1, -2), h)
    v = diagonal * f
    # a measurement may be missing in some runs only
    lead = np.broadcast_shapes(v.shape[:-1], noise.shape)
    unit = np.broadcast_to(unit, lead + unit.shape[-2:]).copy()
    diagonal = np.broadcast_to(diagonal, lead + diagonal.shape[-1:]).copy()
    before, K = np.broadcast_to(noise, lead), np.zeros_like(diagonal)
    for j in range(v.shape[-1]):
        after = before + f[..., j] * v[..., j]
        # nothing told, nothing changed
        diagonal[..., j] *= np.where(after > 0, _ratio(before, after), 1)
        column = unit[..., :, j].copy()
        unit[..., :j, j] -= _ratio(f[..., j], before)[..., None] * K[..., :j]
        K += column * v[..., j, None]
        before = after
    return unit, diagonal, _ratio(K, before[..., None])


def _ratio(above: Array, below: Array) -> Array:
    """above / below, and 0 where below is 0: there is nothing to divide."""
    return np.where(below > 0, above / np.where(below > 0, below, 1), 0).astype(above.dtype)
