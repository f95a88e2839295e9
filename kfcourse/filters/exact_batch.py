"""The Stratonovich equation for many trajectories at once: nodes x = c + s sinh t with equidistant t.

A posterior may be a million times narrower than the prediction it is cut from, and may have a second hump as far away as
the prediction reaches.  The substitution x = c + s sinh t sees both: near c the nodes lie a fraction of s apart, farther out
their distance grows with that from c, so that every scale between s and the whole support has as many nodes as any other.
As a function of t the posterior is smooth and vanishes at both ends; there the trapezoidal rule converges exponentially,

    Integral p(x) dx  =  h sum_i p(x_i) s cosh t_i,      error C exp(-a / h)

With twice the step the error is about the root of that.  So every second node, used alone, tells the error for nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kfcourse.filters.densities import ScalarDensities
from kfcourse.filters.exact_kernels import ROOT, Kernels
from kfcourse.laws import Array

TAIL = 1e-20  # mass at a node that is beyond the end of a posterior
SPACING = 0.4  # of nodes at the highest hump, in its width
ROUNDING = 10 * np.finfo(float).eps  # of a node and its density, relative to x
INTERPOLATED = 64.0  # interpolation of order 8 at twice the distance errs 2^8 times as much; a factor 4 is safety


class Place(NamedTuple):
    """Where nodes go, (T, 1) each: x = centre + scale sinh t, from low to high."""

    centre: Array
    scale: Array
    low: Array
    high: Array

    def nodes(self, count: int) -> tuple[Array, Array]:
        """Nodes, and the lengths dx/dt h they stand for, (T, count) each."""
        first, last = np.arcsinh((self.low - self.centre) / self.scale), np.arcsinh((self.high - self.centre) / self.scale)
        grown = np.exp(first + (last - first) * np.linspace(0, 1, count))
        x = self.centre + (0.5 * self.scale) * (grown - 1 / grown)
        return x, (0.5 * self.scale) * (grown + 1 / grown) * ((last - first) / (count - 1))

    def distance(self, x: Array, count: int) -> Array:
        """Distance of neighbouring nodes at x; infinite beyond the ends."""
        span = np.arcsinh((self.high - self.centre) / self.scale) + np.arcsinh((self.centre - self.low) / self.scale)
        inside = (x >= self.low) & (x <= self.high)
        return np.where(inside, np.hypot(self.scale, x - self.centre) * (span / (count - 1)), np.inf)

    def rows(self, chosen: Array | slice) -> Place:
        return Place(*(array[chosen] for array in self))


class Posteriors(NamedTuple):
    """Posteriors as point masses, one a row.

    Attributes
    ----------
    x, mass, density : ndarray (T, N)
        Nodes, their masses, and the density there.
    mean, variance : ndarray (T,)
    error : ndarray (T,)
        Estimated error of mean and deviation by these nodes, in posterior standard deviations; infinite if nothing is seen.
    inherited : ndarray (T,)
        The same by the sum of kernels, that is, by the nodes of the posterior before, and by rounding.
    """

    x: Array
    mass: Array
    density: Array
    mean: Array
    variance: Array
    error: Array
    inherited: Array


def settled(kernels: Kernels, y: Array, law: ScalarDensities, place: Place, looked: int, count: int) -> Place:
    """A better place for `count` nodes, from a look at the posterior with `looked` nodes.

    The centre is the highest point.  The scale is the largest with which the hump there is resolved: its width is that of a
    normal hump as high, or less if the posterior falls off faster.  The support ends where the posterior is negligible.
    """
    coarse = kernels.thinned()
    x, length = place.nodes(looked)
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.log(coarse.density(x, coarse.mass)[:, :, 0]) + law.log_likelihood(y, x)
    logs = np.where(np.isnan(logs), -np.inf, logs)
    top = logs.argmax(axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        mass = np.exp(logs - np.take_along_axis(logs, top, axis=1)) * length
    area = mass.sum(axis=1, keepdims=True)
    seen = np.isfinite(area)
    counts = mass > TAIL * area
    first = np.maximum(counts.argmax(axis=1) - 1, 0)[:, None]
    last = np.minimum(looked - counts[:, ::-1].argmax(axis=1), looked - 1)[:, None]
    low = np.where(seen, np.take_along_axis(x, first, axis=1), place.low)
    high = np.where(seen, np.take_along_axis(x, last, axis=1), place.high)
    centre = np.where(seen, np.take_along_axis(x, top, axis=1), place.centre)
    fallen = np.where(logs < np.take_along_axis(logs, top, axis=1) - 0.5, np.abs(x - centre), np.inf).min(axis=1, keepdims=True)
    width = np.where(seen, np.minimum(area / ROOT, 2 * fallen), place.scale)
    scale, wanted = width, SPACING * np.sqrt(32 * (count - 1)) * width
    for _ in range(6):  # of the equation: distance of the nodes at the centre = wanted
        with np.errstate(invalid="ignore"):  # a support that is a single point: its error will be infinite
            span = np.arcsinh((high - centre) / scale) + np.arcsinh((centre - low) / scale)
        scale = np.minimum(wanted / span, high - low)
    return Place(centre, scale, low, high)


def posteriors(kernels: Kernels, y: Array, law: ScalarDensities, place: Place, count: int) -> Posteriors:
    """Predict and correct with y (T, 1) on `count` nodes, an odd number: every second one has both ends."""
    x, length = place.nodes(count)
    predicted = kernels.density(x, kernels.mass, kernels.even)
    logs = law.log_likelihood(y, x)
    with np.errstate(divide="ignore", invalid="ignore"):  # where nothing is seen, the error is not a number
        highest = (logs + np.log(predicted[:, :, 0])).max(axis=1, keepdims=True)
        likelihood = np.exp(logs - highest) * length
        full, by_even = predicted[:, :, 0] * likelihood, predicted[:, :, 1] * likelihood
        total = full.sum(axis=1, keepdims=True)
        mass = full / total
        mean, variance = moments(x, mass)
        whole = Summary(mean, variance, total[:, 0])
        nested = whole.distance(Summary.of(x[:, ::2], 2 * full[:, ::2]))
        inherited = whole.distance(Summary.of(x, by_even))
        beyond = (mass[:, 0] + mass[:, -1]) * np.maximum(mean - x[:, 0], x[:, -1] - mean) / np.sqrt(variance)
        rounding = ROUNDING * np.abs(mean) / np.sqrt(variance)
        nested, inherited = (np.maximum(change - rounding, 0.0) for change in (nested, inherited))
        error = nested * nested + beyond
        inherited = rounding + np.where(kernels.spectral, inherited * inherited, inherited / INTERPOLATED)
        density = mass / length
    return Posteriors(x, mass, density, mean, variance, *(np.where(np.isfinite(e), e, np.inf) for e in (error, inherited)))


class Summary(NamedTuple):
    """Mean, variance and total (T,) of masses that are not normalised."""

    mean: Array
    variance: Array
    total: Array

    @classmethod
    def of(cls, x: Array, mass: Array) -> Summary:
        total = mass.sum(axis=1, keepdims=True)
        return cls(*moments(x, mass / total), total[:, 0])

    def distance(self, other: Summary) -> Array:
        """How far the other is from this: its mean in standard deviations, its variance and total relative to these."""
        mean = np.abs(other.mean - self.mean) / np.sqrt(self.variance)
        return mean + np.abs(other.variance / self.variance - 1) + np.abs(other.total / self.total - 1)


def moments(x: Array, mass: Array) -> tuple[Array, Array]:
    """Mean and variance (T,) of masses on nodes (T, N)."""
    mean = (mass * x).sum(axis=1)
    deviation = x - mean[:, None]
    return mean, (mass * deviation * deviation).sum(axis=1)
