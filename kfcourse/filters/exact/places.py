"""Where a posterior lies: the states that explain the measurement, and the middle of the prediction.

Where the meter is sharp, the posterior is found near a root of b(x, m_w) = y.  Its width there is that of the meter's noise
over the slope of b.  Where the meter is poor, it is found where the prediction was.  Both are tried.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kfcourse.filters.densities import ScalarDensities
from kfcourse.filters.exact.batch import Place
from kfcourse.filters.exact.constants import LOOKED, NODES, ROOT, TAIL
from kfcourse.filters.exact.kernels import Kernels, overlap
from kfcourse.filters.exact.roots import halved
from kfcourse.laws import Array

HIDDEN = np.log(1e-12)  # mass of a hump that does not count
HUMP = 2.0  # widths of the highest hump, to both sides of its top, on which it is resolved
FRACTIONS = np.linspace(0.1, 1, 5)  # scales that are tried: powers of the support's width in the hump's
SEARCHED = 33  # points of the support that are looked at for a change of sign
COARSELY = 8  # times a bracket is halved before Newton takes over; compiled, four at a time
EXPLANATIONS = 3  # roots that are followed: those nearest to the middle of the prediction


class Candidates(NamedTuple):
    """Where humps may be: centres, widths, and logarithms of the masses before normalising, roughly; (T, 4) each."""

    centre: Array
    width: Array
    log_mass: Array

    def matter(self) -> Array:
        """Which of them have so much mass that they may count."""
        return self.log_mass > self.log_mass.max(axis=1, keepdims=True) + HIDDEN

    def rows(self, chosen: Array | slice) -> Candidates:
        return Candidates(*(array[chosen] for array in self))

    def beside(self, others: Candidates) -> Candidates:
        """These and others."""
        return Candidates(*(np.concatenate(arrays, axis=1) for arrays in zip(self, others, strict=True)))


def likeliest(kernels: Kernels, y: Array, law: ScalarDensities) -> tuple[Place, Candidates]:
    """The place of the likeliest hump, and all candidates."""
    low, high = kernels.support()
    x = explanations(kernels, y, law, low, high)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        scale = np.fmin(law.meter_width(x), kernels.width)
    middle = np.clip(kernels.centre, low, high)
    of_middle = np.fmin(kernels.width, np.fmin.reduce(np.hypot(x - middle, scale), axis=1, keepdims=True))  # a root is beside it
    centres = np.concatenate([x, middle], axis=1)
    scales = np.concatenate([scale, of_middle], axis=1)
    known = np.where(np.isnan(centres), kernels.centre, centres)
    coarse = kernels.thinned()
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.log(coarse.density(known, coarse.mass)[:, :, 0] * scales * ROOT) + law.log_likelihood(y, known)
    logs = np.where(np.isnan(centres) | np.isnan(logs) | ~(scales > 0), -np.inf, logs)
    best = np.where(np.isfinite(logs).any(axis=1), logs.argmax(axis=1), x.shape[1])[:, None]
    chosen = Place(np.take_along_axis(known, best, axis=1), np.take_along_axis(scales, best, axis=1), low, high)
    return chosen, Candidates(known, scales, logs)


def of_kernels(kernels: Kernels, y: Array, law: ScalarDensities) -> Candidates:
    """Each kernel of a prediction as a hump: where they are narrow, all roots of a measurement may lie far out in the tails."""
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        logs = np.log(kernels.mass) + law.log_likelihood(y, kernels.mu)
    return Candidates(kernels.mu, kernels.sigma, np.where(np.isnan(logs), -np.inf, logs))


class Look(NamedTuple):
    """A rough view of posteriors: masses on a few nodes (T, LOOKED), the highest point, the width of the hump there, the ends."""

    x: Array
    mass: Array
    centre: Array
    width: Array
    low: Array
    high: Array

    def rows(self, chosen: Array | slice) -> Look:
        return Look(*(array[chosen] for array in self))


def looked(kernels: Kernels, y: Array, law: ScalarDensities, place: Place) -> Look:
    """A look at the posterior with few nodes.

    The width is that of a normal hump as high, or less if the posterior falls off faster.  It ends where it is negligible.
    """
    coarse = kernels.thinned()
    x, length = place.nodes(LOOKED)
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.log(coarse.density(x, coarse.mass)[:, :, 0]) + law.log_likelihood(y, x)
    logs = np.where(np.isnan(logs), -np.inf, logs)
    top = logs.argmax(axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        mass = np.exp(logs - np.take_along_axis(logs, top, axis=1)) * length
    seen = np.isfinite(mass.sum(axis=1, keepdims=True))
    mass = np.where(seen, mass, length)
    area = mass.sum(axis=1, keepdims=True)
    counts = mass > TAIL * area
    first = np.maximum(counts.argmax(axis=1) - 1, 0)[:, None]
    last = np.minimum(LOOKED - counts[:, ::-1].argmax(axis=1), LOOKED - 1)[:, None]
    low = np.where(seen, np.take_along_axis(x, first, axis=1), place.low)
    high = np.where(seen, np.take_along_axis(x, last, axis=1), place.high)
    centre = np.where(seen, np.take_along_axis(x, top, axis=1), place.centre)
    fallen = np.where(logs < np.take_along_axis(logs, top, axis=1) - 0.5, np.abs(x - centre), np.inf).min(axis=1, keepdims=True)
    width = np.where(seen, np.minimum(area / ROOT, 2 * fallen), place.scale)
    with np.errstate(invalid="ignore"):  # a support that is a single point
        mass = mass / area
    return Look(x, mass, centre, width, low, high)


def spaced(look: Look, candidates: Candidates, law: ScalarDensities, spacing: float) -> tuple[Place, Array]:
    """The place with which the fewest nodes do, and how many (T,).

    They do if the nodes of the highest hump, to both sides of its top, are no farther apart than `spacing` of its width, those at
    other humps than theirs, and if the kernels of all nodes overlap.  Where that takes more than NODES[-1], kernels do not count.
    """
    x, mass, centre, width, low, high = look
    with np.errstate(divide="ignore", invalid="ignore"):  # a support that is a single point: its error will be infinite
        scale = width * ((high - low) / width) ** FRACTIONS
        span = np.arcsinh((high - centre) / scale) + np.arcsinh((centre - low) / scale)
        dense = overlap(mass) * np.abs(law.kernel_slope(x)[0]) / law.kernel(x)[1]
        by_kernels = _densest(dense, x - centre, scale)
        by_humps = _densest(np.where(candidates.matter(), 1 / candidates.width, 0.0), candidates.centre - centre, scale)
        by_humps = np.maximum(by_humps, np.hypot(scale, HUMP * width) / (spacing * width))
        wanted = span * np.maximum(by_humps, by_kernels)
        wanted = np.where(wanted.min(axis=1, keepdims=True) < NODES[-1], wanted, span * by_humps)
    best = np.where(np.isnan(wanted), np.inf, wanted).argmin(axis=1)[:, None]
    number = np.take_along_axis(wanted, best, axis=1)[:, 0] + 1
    return Place(centre, np.take_along_axis(scale, best, axis=1), low, high), np.where(np.isnan(number), NODES[-1], number)


def _densest(dense: Array, distance: Array, scale: Array) -> Array:
    """Largest of dense sqrt(scale^2 + distance^2), (T, S), for densities of nodes at distances from the centre (T, N)."""
    square = dense * dense
    return np.sqrt((square[:, None] * (scale * scale)[:, :, None] + (square * distance * distance)[:, None]).max(axis=2))


def hidden(candidates: Candidates, place: Place, count: int) -> Array:
    """Rows (T,) in which a hump that may count could fall between two nodes."""
    far = place.distance(candidates.centre, count) > 2 * candidates.width
    return np.any(candidates.matter() & far, axis=1)


def explanations(
    kernels: Kernels, y: Array, law: ScalarDensities, low: Array, high: Array, most: int = EXPLANATIONS, points: int = SEARCHED
) -> Array:
    """Roots (T, most) of b(x, m_w) = y in the support, those nearest to the middle; NaN where there are fewer."""
    x, _ = Place(kernels.centre, kernels.width, low, high).nodes(points)
    residual = law.residual(y, x)
    negative = residual > 0
    change = (negative[:, 1:] != negative[:, :-1]) & (np.abs(residual[:, 1:] - residual[:, :-1]) < law.jump)
    if np.isnan(y).any():
        change &= ~np.isnan(y)
    middle = np.abs(0.5 * (x[:, 1:] + x[:, :-1]) - kernels.centre)
    places = np.argsort(np.where(change, middle, np.inf), axis=1, kind="stable")[:, :most]
    found = np.take_along_axis(change, places, axis=1)
    left, right = np.take_along_axis(x, places, axis=1), np.take_along_axis(x, places + 1, axis=1)
    left, right = halved(lambda at: law.residual(y, at) > 0, left, right, COARSELY)
    root = 0.5 * (left + right)
    for _ in range(2):
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = root + law.residual(y, root) / law.slope(root)
        root = np.where((newton > left) & (newton < right), newton, root)
    return np.where(found, root, np.nan)
