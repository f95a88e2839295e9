"""Keys of set e: error variances over an ensemble with their standard errors, alone and paired."""

from __future__ import annotations

import numpy as np

from kfcourse.laws import Array


def squared_error(x: Array, z: Array) -> Array:
    """|x - z|^2, (steps, N)."""
    return np.sum((x - z) ** 2, axis=2)


def spread_of_mean(values: Array) -> Array:
    """Standard error of the mean over trajectories, of values (steps, N)."""
    return values.std(axis=1, ddof=1) / np.sqrt(values.shape[1])


def error_variance(x: Array, z: Array) -> Array:
    """D_k, the mean over trajectories of |x - z|^2."""
    return squared_error(x, z).mean(axis=1)


def with_standard_error(x: Array, z: Array) -> tuple[Array, Array]:
    """D_k and its standard error."""
    return error_variance(x, z), spread_of_mean(squared_error(x, z))


def difference(x: Array, z_first: Array, z_second: Array) -> tuple[Array, Array]:
    """D_k of the first less that of the second, with the standard error of paired differences."""
    paired = squared_error(x, z_first) - squared_error(x, z_second)
    return paired.mean(axis=1), spread_of_mean(paired)


def ratio(x: Array, z_first: Array, z_second: Array) -> tuple[Array, Array]:
    """D_k of the first over that of the second, with the standard error of a ratio of paired
    means."""
    D, base = error_variance(x, z_first), error_variance(x, z_second)
    r = D / base
    first, second = squared_error(x, z_first), squared_error(x, z_second)
    return r, spread_of_mean(first - r[:, None] * second) / base


def normalised_error(x: Array, z: Array, p: Array) -> Array:
    """Mean of (x - z)^T p^-1 (x - z), over the number of components."""
    error = x - z
    size = np.sum(error * np.linalg.solve(p, error[..., None])[..., 0], axis=2)
    return np.mean(size, axis=1) / x.shape[2]
