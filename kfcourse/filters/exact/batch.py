"""The Stratonovich equation for many trajectories at once: nodes x = c + s sinh t with equidistant t.

A posterior may be a million times narrower than the prediction it is cut from, and may have a second hump as far away as
the prediction reaches.  The substitution x = c + s sinh t sees both: near c the nodes lie a fraction of s apart, farther out
their distance grows with that from c, so that every scale between s and the whole support has as many nodes as any other.
As a function of t the posterior is smooth and vanishes at both ends; there the trapezoidal rule converges exponentially,

    Integral p(x) dx  =  h sum_i p(x_i) s cosh t_i,      error C exp(-a / h)

With twice the step the error is about the root of that.  So every second node, used alone, and every fourth tell the error for
nothing.  Where the density has a kink, a cusp or a spike, no error falls exponentially; that is seen from these three, or, where
by chance they agree, from how roughly the masses change from node to node.
"""

from __future__ import annotations

from functools import cache
from math import comb
from typing import NamedTuple

import numpy as np

from kfcourse.filters.densities import ScalarDensities
from kfcourse.filters.exact.kernels import Kernels
from kfcourse.laws import Array

ORDER = 32  # of the differences that tell a rough density: of a normal one, of nodes half a deviation apart, 1e-5 is left
COEFFICIENTS = np.array([(-1) ** i * comb(ORDER, i) for i in range(ORDER + 1)]) / comb(ORDER, ORDER // 2)
KINK = 32.0  # times what halving the distance of the nodes may bring at a kink, by chance, more than it should
ROUNDING = 10 * np.finfo(float).eps  # of a node and its density, relative to x
INTERPOLATED = 16.0  # interpolation of order 8 at twice the distance errs 2^8 times as much, but near a zero of the density less


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

    def distance(self, x: Array, count: int | Array) -> Array:
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


def posteriors(kernels: Kernels, y: Array, law: ScalarDensities, place: Place, count: int) -> Posteriors:
    """Predict and correct with y (T, 1) on `count` nodes, an odd number: every second one has both ends."""
    x, length = place.nodes(count)
    predicted = kernels.density(x, kernels.mass, kernels.even, kernels.quarter())
    logs = law.log_likelihood(y, x)
    with np.errstate(divide="ignore", invalid="ignore"):  # where nothing is seen, the error is not a number
        highest = (logs + np.log(predicted[:, :, 0])).max(axis=1, keepdims=True)
        likelihood = np.exp(logs - highest) * length
        mass, _, mean, variance, nested, inherited, beyond, rounding = summed(
            x, *(predicted[:, :, i] * likelihood for i in range(3))
        )
        fine, wide = (roughness(x[:, ::part], part * mass[:, ::part], mean, variance) for part in (1, 2))
        error = np.maximum(extrapolated(*nested), cautious(np.maximum(fine - rounding, 0.0), wide)) + beyond
        inherits = rounding + np.where(kernels.spectral, cautious(*inherited), inherited[0] / INTERPOLATED)
        density = mass / length
    return Posteriors(x, mass, density, mean, variance, *(np.where(np.isfinite(e), e, np.inf) for e in (error, inherits)))


class Summed(NamedTuple):
    """Masses on nodes, their moments, and by how much less effort would have moved these, as a `Summary` tells it.

    Attributes
    ----------
    mass : ndarray (T, N)
    total : ndarray (T, 1)
    mean, variance : ndarray (T,)
    nested, inherited : tuple of ndarray (T,)
        The distance with every second node, or kernel, beyond rounding; and that with every fourth.
    beyond, rounding : ndarray (T,)
        The parts of the error that lie outside the nodes, and in the numbers, in standard deviations.
    """

    mass: Array
    total: Array
    mean: Array
    variance: Array
    nested: tuple[Array, Array]
    inherited: tuple[Array, Array]
    beyond: Array
    rounding: Array


def summed(x: Array, full: Array, by_even: Array, by_quarter: Array) -> Summed:
    """From masses on nodes (T, N) that all, every second and every fourth of the kernels give; not yet normalised."""
    total = full.sum(axis=1, keepdims=True)
    mass = full / total
    mean, variance = moments(x, mass)
    whole = Summary(mean, variance, total[:, 0])
    nested, coarse = (whole.distance(Summary.of(x[:, ::part], part * full[:, ::part])) for part in (2, 4))
    inherited, by_few = (whole.distance(Summary.of(x, one)) for one in (by_even, by_quarter))
    beyond = (mass[:, 0] + mass[:, -1]) * np.maximum(mean - x[:, 0], x[:, -1] - mean) / np.sqrt(variance)
    rounding = ROUNDING * np.abs(mean) / np.sqrt(variance)
    nested, inherited = (np.maximum(change - rounding, 0.0) for change in (nested, inherited))
    return Summed(mass, total, mean, variance, (nested, coarse), (inherited, by_few), beyond, rounding)


def roughness(x: Array, mass: Array, mean: Array, variance: Array) -> Array:
    """The error that a kink, a jump or a spike of the density leaves, (T,), wherever between two nodes it is.

    A high difference of the masses, over its middle coefficient, is nothing where they change smoothly from node to node; next
    to a jump it is half of it, at a spike all of it.
    """
    away = (x - mean[:, None]) / np.sqrt(variance)[:, None]
    return (np.abs(mass @ _differences(x.shape[1])) * (1 + np.abs(away) + np.abs(away * away - 1))).max(axis=1)


@cache
def _differences(count: int) -> Array:
    """Masses (T, count) times this matrix are their central differences of order `ORDER`, over the middle coefficient."""
    offset = np.subtract.outer(np.arange(count), np.arange(count)) + ORDER // 2
    return np.where((offset >= 0) & (offset <= ORDER), COEFFICIENTS[np.clip(offset, 0, ORDER)], 0.0)


def extrapolated(change: Array, before: Array) -> Array:
    """The error that is left, from the last change by halving a step and the one before it.

    Errors that fall by the factor q at each halving leave about change * q; whether they fall as h^2, or exponentially and so
    ever faster, q is at most change / before; but not less than change^0.75, where that is by chance.
    """
    q = np.divide(change, before, out=np.ones_like(change), where=before > 0)
    return change * np.clip(q, np.minimum(change, 1.0) ** 0.75, 1.0)


def cautious(change: Array, before: Array) -> Array:
    """`extrapolated`, but where a kink or a spike would by chance be taken for what falls exponentially, far less of it."""
    return np.minimum(change, KINK * extrapolated(change, before))


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
