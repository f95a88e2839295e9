"""From a posterior to the next prediction: a sum of normal kernels, one for each node.

    p(x') = Integral p(x) N(x'; m(x), sigma^2(x)) dx  =  sum_j m_j N(x'; m(x_j), sigma^2(x_j))

The sum is as good as the integral where the kernels of neighbouring nodes overlap.  Where they do not, `narrow` puts more
nodes between them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from kfcourse.filters.densities import ScalarDensities
from kfcourse.filters.exact.constants import CACHED, LOWEST, NEGLIGIBLE, ROOT, WIDTH
from kfcourse.laws import Array, Gaussian
from kfcourse.symbolic.reading import ModelError

# Sigmas of a kernel, in distances of the centres: a sum over every second node errs by exp(-pi^2 / 2 OVERLAP^2) = 6e-5.
OVERLAP = 1.4
SEEN = 1e-10  # mass of a node whose kernel need not overlap with its neighbours'


def chunks(rows: int, elements: int, most: int) -> Iterator[slice]:
    """Slices of so many rows, of so many elements each, that no array has more than `most` elements, but at least one row."""
    size = max(1, most // elements)
    return (slice(start, start + size) for start in range(0, rows, size))


def bells(u: Array, lowest: float = LOWEST) -> Array:
    """exp(-u^2), in place of u; nothing below exp(-lowest)."""
    u *= u
    np.minimum(u, lowest, out=u)
    np.negative(u, out=u)
    return np.exp(u, out=u)


def add_bells(x: Array, rate: Array, centre: Array, weights: Array, lowest: float, result: Array) -> None:
    """Adds sum_j w_j exp(-(r_j x - c_j)^2), of x (T, N), r and c (T, M), and w (T, M, P), to result (T, P, N)."""
    for i in chunks(len(x), x.shape[1] * rate.shape[1], CACHED):
        u = x[i, :, None] * rate[i, None, :]
        u -= centre[i, None, :]
        result[i] += np.matmul(bells(u, lowest), weights[i]).transpose(0, 2, 1)


class Unresolved(ModelError):
    """A posterior or a prediction needs more nodes than the budget has; the message says where."""


class TooNarrow(Unresolved):
    """The transition kernel is far narrower than the distance of a posterior's nodes."""


class Grid(NamedTuple):
    """A posterior as point masses: nodes x (M,), ascending, their masses (M,), and the density there (M,).

    `uniform` is true if the nodes are equidistant in a smooth variable, and every second one is a rule of its own;
    `rough` if they are those of panels, and only so accurate that their kernels may be `merged`.
    """

    x: Array
    mass: Array
    density: Array
    uniform: bool = False
    rough: bool = False

    def mean(self) -> float:
        return float(self.mass @ self.x)

    def variance(self) -> float:
        return float(self.mass @ (self.x - self.mean()) ** 2)


class Kernels(NamedTuple):
    """Predicted densities, one a row: sums of M normal kernels.

    Attributes
    ----------
    mu, sigma, mass : ndarray (T, M)
    even : ndarray (T, M)
        Masses by half the information, every second node of the posterior before: they tell the error of the sum.
    centre, width : ndarray (T, 1)
        Roughly where the mass is.
    spectral : ndarray (T,)
        True where the error falls exponentially with the nodes, false where the posterior was interpolated.
    pushed : callable, optional
        For T = 1: x (1, N) -> the density and that of `even`, (1, N, 2), if the sum of kernels is too rough for it.  Of further
        masses it knows no more than of `even`.
    pushed_bytes : int
        That `pushed` holds.
    panels : bool
        Whether the posterior before needed panels.
    bells : callable
        Adds them up: `add_bells`, or the same compiled.
    """

    mu: Array
    sigma: Array
    mass: Array
    even: Array
    centre: Array
    width: Array
    spectral: Array
    pushed: Callable[[Array], Array] | None = None
    pushed_bytes: int = 0
    panels: bool = False
    bells: Callable[..., None] = add_bells

    def bytes(self) -> int:
        """That it holds."""
        return sum(array.nbytes for array in self[:7]) + self.pushed_bytes

    def support(self, sigmas: float = WIDTH) -> tuple[Array, Array]:
        """Lower and upper limit, (T, 1) each: so many sigmas around every kernel that counts."""
        counts = self.mass > NEGLIGIBLE
        low = np.where(counts, self.mu - sigmas * self.sigma, np.inf).min(axis=1, keepdims=True)
        high = np.where(counts, self.mu + sigmas * self.sigma, -np.inf).max(axis=1, keepdims=True)
        return low, high

    def quarter(self) -> Array:
        """Masses by half the information of `even`, every fourth node of the posterior before; `even` itself of others."""
        if self.mu.shape[1] < 8 or not self.spectral.all():
            return self.even
        masses = np.zeros_like(self.even)
        masses[:, ::4] = self.even[:, ::4]
        return masses / masses.sum(axis=1, keepdims=True)

    def thinned(self) -> Kernels:
        """Every second kernel, if they are many: a rough prediction for half the cost."""
        if self.mu.shape[1] < 8 or not self.spectral.all():
            return self
        mu, sigma, _, even = (array[:, ::2] for array in self[:4])
        return self._replace(mu=mu, sigma=sigma, mass=even, even=even)

    def density(self, x: Array, *masses: Array) -> Array:
        """sum_j m_j N(x; mu_j, sigma_j^2) at x (T, N) for each of the masses (T, M): (T, N, number of them)."""
        if self.pushed is not None:
            return self.pushed(x)[:, :, np.minimum(range(len(masses)), 1)]
        rate = np.sqrt(0.5) / self.sigma
        centre, weights = self.mu * rate, np.stack([mass * rate for mass in masses], axis=2)
        result = np.zeros((len(x), len(masses), x.shape[1]))
        self.bells(x, rate, centre, weights, LOWEST, result)
        result[result <= 2 * np.exp(-LOWEST) * weights.sum(axis=1)[:, :, None]] = 0.0
        return result.transpose(0, 2, 1) / np.sqrt(np.pi)

    def moments(self) -> tuple[Array, Array]:
        """Mean and variance (T,) of the predictions: those of mixtures."""
        mean = (self.mass * self.mu).sum(axis=1)
        deviation = self.mu - mean[:, None]
        return mean, (self.mass * (self.sigma * self.sigma + deviation * deviation)).sum(axis=1)

    def rows(self, chosen: Array | slice) -> Kernels:
        mu, sigma, mass, even, centre, width, spectral = (array[chosen] for array in self[:7])
        return Kernels(mu, sigma, mass, even, centre, width, spectral, *self[7:])


def of_prior(prior: Gaussian) -> Kernels:
    """The prior of one trajectory as a single kernel."""
    mean, sigma = prior.mean[0], max(float(np.sqrt(prior.cov[0, 0])), 1e-150)
    one = np.ones((1, 1))
    return Kernels(mean * one, sigma * one, one, one, mean * one, sigma * one, np.array([True]))


def overlap(mass: Array) -> Array:
    """Sigmas of a node's kernel, in distances of the centres, that do: the sum errs by mass exp(-2 pi^2 overlap^2) there."""
    return OVERLAP * np.sqrt(np.clip(1 - np.log(np.maximum(mass, SEEN)) / np.log(SEEN), 0, 1))


def apart(mu: Array, sigma: Array, mass: Array) -> Array:
    """How far apart the kernels (T, M) of neighbouring nodes lie, (T,): up to 1, their sum is as good as the integral."""
    distance = np.abs(np.diff(mu, axis=1))
    gap = np.maximum(distance[:, 1:], distance[:, :-1]) / sigma[:, 1:-1]
    return (gap * overlap(mass[:, 1:-1])).max(axis=1)


def overlapping(x: Array, mass: Array, density: Array, uniform: bool, law: ScalarDensities) -> Kernels:
    """A kernel for each node (T, M)."""
    mu, sigma = law.kernel(x)
    even = mass
    if uniform:
        even = np.zeros_like(mass)
        even[:, ::2] = mass[:, ::2]
        even /= even.sum(axis=1, keepdims=True)
    top = np.clip(density.argmax(axis=1), 1, x.shape[1] - 2)[:, None]

    def at_top(array: Array, offset: int = 0) -> Array:
        return np.take_along_axis(array, top + offset, axis=1)

    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (at_top(mu, 1) - at_top(mu, -1)) / (at_top(x, 1) - at_top(x, -1))
        width = np.hypot(np.where(np.isfinite(slope), slope, 0.0) / (ROOT * at_top(density)), at_top(sigma))
    return Kernels(mu, sigma, mass, even, at_top(mu), width, np.full(len(x), uniform), panels=not uniform)
