r"""Looking back with particles: backward sampling.

The particles of step k are where they were before later measurements came; what these tell is in weights.  Of a state x~ drawn
from p(x_{k+1} | Y), the particle x^j of step k is the ancestor with probability

    w_j ∝ p(x~ | x^j)          (the particles of step k, resampled, count alike)

So trajectories are drawn from the end to the start (Godsill, Doucet and West, 2004), not along the few ancestors that the
filter's own resampling has left.  The mean of step k is taken over all particles by these weights, before one of them is drawn.
Both clouds look back for themselves: half the distance of their means is the standard error of the mean of both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from kfcourse.angles import Components, difference, moments_on_circle
from kfcourse.laws import Array, Gaussian
from kfcourse.symbolic.reading import ModelError

ELEMENTS = 2**21  # of the largest array, 16 MB
Law = Callable[[Array, int], Gaussian]


def backwards(
    clouds: Sequence[Array], law: Law, angles: Components, paths: int, rng: np.random.Generator
) -> Iterator[tuple[Gaussian, Array]]:
    """From the last step to the first: means (runs, 2, n) and covariances of both clouds, and how many particles count (runs,).

    Parameters
    ----------
    clouds : sequence of ndarray (runs, 2, M, n)
        Equally weighted particles of each step, after its measurement.
    law : callable
        x (..., n), step -> law of the next state.
    angles : tuple
        Components of x that are angles.
    paths : int
        Trajectories drawn in each cloud.
    rng : numpy.random.Generator

    Raises
    ------
    ModelError
        An object whose next state has no density, as fewer noises than states enter.
    """
    runs, _, size, n = clouds[-1].shape
    even = np.full(clouds[-1].shape[:3], 1.0 / size)
    yield _moments(clouds[-1], even, angles)
    after = clouds[-1][:, :, np.arange(paths) * size // paths]
    for k in reversed(range(len(clouds) - 1)):
        x, weights, before = clouds[k], np.empty(even.shape), np.empty(after.shape)
        at_once = max(1, ELEMENTS // (2 * paths * size * n))
        for some in (slice(start, start + at_once) for start in range(0, runs, at_once)):
            shares = _ancestors(after[some], *law(x[some], k), angles)
            weights[some] = shares.mean(axis=2)
            cumulative = np.cumsum(shares, axis=-1)
            drawn = (cumulative < rng.random((*shares.shape[:3], 1)) * cumulative[..., -1:]).sum(axis=-1)
            before[some] = np.take_along_axis(x[some], drawn[..., None], axis=2)
        yield _moments(x, weights, angles)
        after = before


def _ancestors(after: Array, mean: Array, cov: Array, angles: Components) -> Array:
    """Probabilities (runs, 2, paths, M) that particles, whose next states have these laws, are ancestors of `after`."""
    try:
        root = np.linalg.cholesky(cov)
    except np.linalg.LinAlgError:
        raise ModelError(
            "particles look back by the density of the next state, and it has none: fewer noises than states enter the object; "
            "give each state a noise, however small, or smooth with a filter of normal laws"
        ) from None
    inverse, logs = np.linalg.inv(root), np.zeros((*after.shape[:3], mean.shape[2]))
    if cov.ndim > 2:  # each particle's own
        logs -= np.log(np.diagonal(root, axis1=-2, axis2=-1)).sum(axis=-1)[:, :, None]
        inverse = inverse[:, :, None]
    apart = [
        difference(after[..., None, i : i + 1], mean[:, :, None, :, i : i + 1], (0,) if i in angles else ())[..., 0]
        for i in range(mean.shape[-1])
    ]
    for i in range(len(apart)):
        scaled = sum(inverse[..., i, j] * apart[j] for j in range(i + 1))
        logs -= 0.5 * scaled * scaled
    with np.errstate(invalid="ignore"):
        share = np.exp(logs - logs.max(axis=-1, keepdims=True))
    share = np.where(np.isfinite(share), share, 0.0)
    total = share.sum(axis=-1, keepdims=True)
    return np.where(total > 0, share / np.where(total > 0, total, 1.0), 1.0 / share.shape[-1])


def weighted(x: Array, weights: Array, angles: Components) -> Gaussian:
    """Mean (..., n) and covariance (..., n, n) of weighted particles (..., M, n)."""
    mean = np.einsum("...m,...mi->...i", weights, x)
    for i in angles:
        mean[..., i], _ = moments_on_circle(x[..., i], weights)
    deviation = difference(x, mean[..., None, :], angles)
    return Gaussian(mean, np.einsum("...m,...mi,...mj->...ij", weights, deviation, deviation))


def _moments(x: Array, weights: Array, angles: Components) -> tuple[Gaussian, Array]:
    """Mean and covariance of each cloud, and the effective number of both together."""
    return weighted(x, weights, angles), (1 / (weights**2).sum(axis=-1)).sum(axis=1)
