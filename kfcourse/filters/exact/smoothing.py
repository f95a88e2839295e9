r"""Looking back exactly: the densities of a scalar model's states given all measurements, on nodes of their own.

    p(x_k | Y) = p(x_k | y_0..k-1) rho_k(x_k),
    rho_k(x)   = p(y_k | x) / p(y_k | y_0..k-1) * r_k(x),          r_k(x) = Integral N(x'; m(x), sigma^2(x)) rho_{k+1}(x') dx'

rho tells how the measurements from y_k on change the prediction; behind the last measurement r = 1.  The first factor is the
exact filter's sum of kernels, which can be had at any x.  So each state gets nodes x = c + s sinh t where *its* density is, which
may be far narrower than the filter's.  Where the kernel N is as wide as the distance of the nodes x', the integral is a sum over
them; where it is narrower (small noise, or one that vanishes at a state), rho is smooth at its scale, is interpolated, and taken
at Gauss-Hermite nodes of the noise.

Everything is normalised, so that the masses of each step must sum to 1 by themselves.  How far they do not, and what every second
and every fourth node would have given, tell the error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from kfcourse.angles import moments_on_circle
from kfcourse.filters.densities import ScalarDensities
from kfcourse.filters.exact.batch import Place, extrapolated, moments, summed
from kfcourse.filters.exact.constants import CACHED, ELEMENTS, LOOKED, LOWEST, MORE, ROOT, SHARP, TAIL, TOLERABLE
from kfcourse.filters.exact.evidence import log_evidence
from kfcourse.filters.exact.kernels import Grid, Kernels, Unresolved, bells, chunks
from kfcourse.filters.exact.narrow import interpolated
from kfcourse.laws import Array

LOOKS = 8  # that may be needed until the width of a hump is seen
SPACING = 0.45  # of the nodes at the highest hump, in its widths
FAR_SPACING = 0.8  # at the farthest place that counts, in the same widths: a curved meter's humps are about as wide
MATTERS = 1e-5  # share of a place in the variance from which on it counts
SMOOTHING_NODES = (49, 65, 97, 129, 193, 257, 385, 513, 769, 1025)  # that a density may have
ALL, NESTED = (1,), (1, 2, 4)  # which nodes are taken: all; and every second, every fourth, to tell the error
HERMITE = np.polynomial.hermite_e.hermegauss(16)


class Smoothed(NamedTuple):
    """The state of a step given the whole record: means and variances (runs,), and their error in standard deviations."""

    mean: Array
    variance: Array
    error: Array

    def discretisation_error(self) -> Array:
        """Estimated error of the means, (runs,), in the units of x."""
        return self.error * np.sqrt(self.variance)


class Ahead(NamedTuple):
    """rho of the next step for each trajectory: nodes, rho times the length of each, log rho, (T, N'); where nodes lie; how many.

    `point` tells trajectories whose state is one of a few points.
    """

    x: Array
    weight: Array
    logs: Array
    place: Place
    number: Array
    point: Array

    def rows(self, rows: Array) -> Ahead:
        x, weight, logs, place, number, point = self
        return Ahead(x[rows], weight[rows], logs[rows], place.rows(rows), number[rows], point[rows])


def smoothed(
    posteriors: Sequence[Sequence[Grid]],
    filter_error: Array,
    y: Array,
    before: Callable[[int], Iterable[tuple[Array, Kernels]]],
    densities: ScalarDensities,
    accuracy: float,
    angle: bool = False,
) -> Iterator[Smoothed]:
    """The backward recursion: what is known of each step, from the last to the first.

    Parameters
    ----------
    posteriors : sequence of sequences of Grid
        The filter's, of each step and trajectory.
    filter_error : ndarray (steps, runs)
        Its errors so far, in standard deviations.
    y : ndarray (steps, runs, 1)
    before : callable
        Step -> the filter's predictions of that step, as groups of trajectories.
    densities : ScalarDensities
    accuracy : float
        Of a step, in standard deviations.
    angle : bool
        Whether the state is one: means then go round the circle.

    Raises
    ------
    Unresolved
        A density that no number of nodes resolves, with the step.
    """
    steps, runs = len(posteriors), len(posteriors[0])
    ahead: Ahead | None = None
    inherited = np.zeros(runs)
    for k in reversed(range(steps)):
        law, groups = densities.at(k), list(before(k))
        evidence = log_evidence(groups, y[k], law, posteriors[k])
        found = Found(runs)
        for rows, kernels in groups:
            for chunk in chunks(len(rows), SMOOTHING_NODES[1] * kernels.mu.shape[1], ELEMENTS):
                some = rows[chunk]
                density = Density(kernels.rows(chunk), y[k][some], evidence[some], law, ahead and ahead.rows(some))
                try:
                    density.resolve([posteriors[k][i] for i in some.tolist()], some, found, accuracy)
                except Unresolved as problem:
                    raise Unresolved(f"looking back to step {k}: {problem}") from None
        ahead, inherited = found.ahead(), inherited + found.error
        yield Smoothed(*found.moments(angle), error=inherited + filter_error[k])


class Density:
    """The densities p(x_k | Y) of some trajectories, at any x."""

    def __init__(self, kernels: Kernels, y: Array, evidence: Array, law: ScalarDensities, ahead: Ahead | None):
        self.kernels, self.y, self.evidence, self.law, self.ahead = kernels, y, evidence[:, None], law, ahead

    def rows(self, rows: Array) -> Density:
        return Density(
            self.kernels.rows(rows), self.y[rows], self.evidence[rows, 0], self.law, self.ahead and self.ahead.rows(rows)
        )

    def later(self, x: Array, parts: Sequence[int] = NESTED) -> Array:
        """r at x (T, N) by all nodes of the next step, by every second and by every fourth: (T, N, parts)."""
        if self.ahead is None:
            return np.ones((*x.shape, len(parts)))
        nodes, weight, _, place, count, point = self.ahead
        mu, sigma = self.law.kernel(x)
        weights = np.repeat(weight[:, :, None], len(parts), axis=2)
        for i, part in enumerate(parts[1:], 1):
            weights[:, :, i] *= np.where(point[:, None], 1, part * (np.arange(weight.shape[1]) % part == 0))
        found = _summed(nodes, weights, mu, sigma)
        ends = np.stack([place.low[:, 0], place.high[:, 0]], axis=1)  # where the nodes are farthest apart
        if (~point & (np.min(sigma, axis=1) < place.distance(ends, count[:, None]).max(axis=1))).any():
            nearest = np.clip(mu, place.low, place.high)
            narrow = ~point[:, None] & (sigma < place.distance(nearest, count[:, None]))
            found[narrow] = self._between(mu[narrow], sigma[narrow], np.nonzero(narrow)[0], parts)
        return found

    def _between(self, mu: Array, sigma: Array, row: Array, parts: Sequence[int]) -> Array:
        """The same for kernels narrower than the distance of the nodes: rho between them, (Q, parts)."""
        assert self.ahead is not None
        nodes, _, logs, place, count, _ = self.ahead
        (c, s, low, high), last = (part[row, 0] for part in place), count[row] - 1
        found = np.zeros((len(row), len(parts)))
        first = np.arcsinh((low - c) / s)
        span = np.arcsinh((high - c) / s) - first
        for u, share in zip(HERMITE[0], HERMITE[1] / ROOT, strict=True):
            wanted = mu + sigma * u
            inside = np.flatnonzero((wanted >= low) & (wanted <= high))
            i = row[inside]
            at = np.clip((np.arcsinh((wanted - c) / s) - first) / span, 0, 1)[inside] * last[inside]
            for place_of, part in enumerate(parts):
                values = np.stack([nodes, logs])[:, :, ::part]
                found[inside, place_of] += share * np.exp(interpolated(values, at / part, i, last[inside] // part + 1)[1])
        return found

    def change(self, x: Array) -> Array:
        """log of p(y_k | x) / p(y_k | ...), (T, N)."""
        return self.law.log_likelihood(self.y, x) - self.evidence

    def logs(self, x: Array) -> Array:
        """log p(x | Y), (T, N)."""
        known, later = self.kernels.density(x, self.kernels.mass)[:, :, 0], self.later(x, ALL)[:, :, 0]
        with np.errstate(divide="ignore"):
            found = np.log(known) + self.change(x) + np.log(later)
        return np.where(np.isnan(found), -np.inf, found)

    def resolve(self, grids: Sequence[Grid], rows: Array, found: Found, accuracy: float) -> None:
        """Nodes for all, given the filter's posteriors: kept in `found`, in the places `rows`."""
        points = np.array([grid.density[0] >= SHARP for grid in grids])
        for i in np.flatnonzero(points).tolist():
            self.rows(np.array([i])).on_points(grids[i], int(rows[i]), found)
        left = np.flatnonzero(~points)
        if not len(left):
            return
        place, wanted = self.rows(left).look([grids[i] for i in left.tolist()])
        sizes = np.minimum(np.searchsorted(SMOOTHING_NODES, wanted), len(SMOOTHING_NODES) - 1)
        while len(left):
            again = np.zeros(len(left), dtype=bool)
            for size in np.unique(sizes).tolist():
                some = np.flatnonzero(sizes == size)
                last = size == len(SMOOTHING_NODES) - 1
                one = self.rows(left[some]).on_nodes(place.rows(some), SMOOTHING_NODES[size])
                good = one.error <= (TOLERABLE if last else accuracy)
                if last and not good.all():
                    raise Unresolved(
                        f"{SMOOTHING_NODES[-1]:,} nodes do not resolve the density of trajectory {rows[left[some[~good]]][0]} "
                        f"given the whole record, estimated error {one.error.max():.1g} standard deviations; it may contradict "
                        "the model, as with an outlier or too narrow a prior: allow for more noise, a wider prior, or a shorter "
                        "record; or take particles, smooth(particle(model), y)"
                    )
                found.keep(rows[left[some[good]]], one, good)
                again[some] = ~good
            left, sizes, place = left[again], sizes[again], place.rows(again)
            sizes = np.searchsorted(SMOOTHING_NODES[:-1], MORE * np.array(SMOOTHING_NODES)[sizes])

    def look(self, grids: Sequence[Grid]) -> tuple[Place, Array]:
        """Where the densities lie, and how many nodes they need: from the filter's nodes, and ever closer."""
        chosen = [np.arange(LOOKED) * (len(grid.x) - 1) // (LOOKED - 1) for grid in grids]
        x = np.array([grid.x[i] for grid, i in zip(grids, chosen, strict=True)])
        with np.errstate(divide="ignore"):
            logs = np.log(np.array([grid.density[i] for grid, i in zip(grids, chosen, strict=True)]))
            logs = logs + np.log(self.later(x, ALL)[:, :, 0])
        centre, width, far, low, high = _hump(x, logs)
        left = np.arange(len(grids))
        for _ in range(LOOKS):
            one = self.rows(left)
            x, _ = Place(centre[left], width[left], low[left], high[left]).nodes(LOOKED)
            seen = _hump(x, one.logs(x))
            narrower = seen[1] < 0.5 * width[left]
            seen = (*seen[:2], np.maximum(seen[2], far[left]), *seen[3:])  # between closer nodes far humps may be hidden
            for known, new in zip((centre, width, far, low, high), seen, strict=True):
                known[left] = new
            left = left[narrower[:, 0]]
            if not len(left):
                break
        scale = 2 * width
        span = np.arcsinh((high - centre) / scale) + np.arcsinh((centre - low) / scale)
        wanted = span * np.maximum(np.hypot(scale, 2 * width) / SPACING, np.hypot(scale, far) / FAR_SPACING) / width + 1
        return Place(centre, scale, low, high), wanted[:, 0]

    def on_nodes(self, place: Place, count: int) -> Nodes:
        """The densities on so many nodes, an odd number."""
        x, length = place.nodes(count)
        by_measurement, later = self.change(x), self.later(x)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            known = self.kernels.density(x, self.kernels.mass)[:, :, 0]
            seen = known * np.exp(by_measurement)
            mass, total, _, _, nested, inherited, beyond, rounding = summed(
                x, *(np.nan_to_num(seen * later[:, :, i] * length, posinf=np.inf) for i in range(3))
            )
            error = extrapolated(*nested) + beyond + rounding + extrapolated(*inherited)
            error = np.where(np.isfinite(error), np.maximum(error, np.abs(total[:, 0] - 1)), np.inf)
            logs = by_measurement + np.log(later[:, :, 0]) - np.log(total)
        return Nodes(x, length, mass, np.maximum(np.where(np.isnan(logs), -np.inf, logs), -LOWEST), place, error)

    def on_points(self, grid: Grid, row: int, found: Found) -> None:
        """Of one trajectory whose meter has no noise: the same points with other masses."""
        x = grid.x[None]
        later = self.later(x, ALL)[:, :, 0]
        mass = grid.mass * later
        total = mass.sum(axis=1, keepdims=True)
        if not 0 < total[0, 0] < np.inf:
            raise Unresolved("no state that explains this measurement leads to the next")
        with np.errstate(divide="ignore"):
            known = self.kernels.density(x, self.kernels.mass)[:, :, 0]
            weight = np.where(mass > 0, mass / total / known, 0.0)
        one = np.ones((1, 1))
        nodes = Nodes(x, weight, mass / total, np.zeros_like(x), Place(x[:, :1], one, x[:, :1], x[:, -1:]), np.zeros(1))
        found.keep(np.array([row]), nodes, np.array([True]), point=True)


class Nodes(NamedTuple):
    """Densities on nodes: nodes, lengths, masses and log rho (T, N); where they lie; errors (T,)."""

    x: Array
    length: Array
    mass: Array
    logs: Array
    place: Place
    error: Array


class Found:
    """What has been found of one step, trajectory by trajectory."""

    def __init__(self, runs: int):
        self.parts: list[tuple[Array, Nodes, bool]] = []
        self.error = np.zeros(runs)

    def keep(self, rows: Array, nodes: Nodes, good: Array, point: bool = False) -> None:
        if good.any():
            x, length, mass, logs, place, error = nodes
            self.parts.append((rows, Nodes(x[good], length[good], mass[good], logs[good], place.rows(good), error[good]), point))
            self.error[rows] = error[good]

    def ahead(self) -> Ahead:
        runs, most = len(self.error), max(part.x.shape[1] for _, part, _ in self.parts)
        x, weight = np.zeros((2, runs, most))
        logs = np.full((runs, most), -LOWEST)
        place = Place(*np.empty((4, runs, 1)))
        count, point = np.empty(runs, dtype=int), np.zeros(runs, dtype=bool)
        for rows, nodes, is_point in self.parts:
            size = nodes.x.shape[1]
            x[rows] = nodes.x[:, -1:]
            x[rows, :size], logs[rows, :size] = nodes.x, nodes.logs
            weight[rows, :size] = nodes.length * np.exp(nodes.logs)
            for whole, part in zip(place, nodes.place, strict=True):
                whole[rows] = part
            count[rows], point[rows] = size, is_point
        return Ahead(x, weight, logs, place, count, point)

    def moments(self, angle: bool) -> tuple[Array, Array]:
        found = np.empty((2, len(self.error)))
        for rows, nodes, _ in self.parts:
            if angle:
                found[:, rows] = np.array([moments_on_circle(*one) for one in zip(nodes.x, nodes.mass, strict=True)]).T
            else:
                found[:, rows] = moments(nodes.x, nodes.mass)
        return found[0], found[1]


def _hump(x: Array, logs: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Centre and width of the highest hump of densities known on a few nodes (T, N), how far from it something counts, and where
    they end; (T, 1) each.
    """
    top = logs.argmax(axis=1, keepdims=True)
    highest = np.take_along_axis(logs, top, axis=1)
    if not np.isfinite(highest).all():
        raise Unresolved(
            "the density given the whole record is so much narrower than the filter's that none of its nodes sees it"
        )
    length = np.gradient(x, axis=1)
    mass = np.exp(logs - highest) * length
    area = mass.sum(axis=1, keepdims=True)
    counts = mass > TAIL * area
    first = np.maximum(counts.argmax(axis=1) - 1, 0)[:, None]
    last = np.minimum(x.shape[1] - counts[:, ::-1].argmax(axis=1), x.shape[1] - 1)[:, None]
    centre = np.take_along_axis(x, top, axis=1)
    fallen = np.where(logs < highest - 0.5, np.abs(x - centre), np.inf).min(axis=1, keepdims=True)
    width = np.minimum(area / ROOT, 2 * fallen)
    away = np.abs(x - centre)
    far = np.where(mass * away**2 > MATTERS * area * width**2, away, 0.0).max(axis=1, keepdims=True)
    return centre, width, far, np.take_along_axis(x, first, axis=1), np.take_along_axis(x, last, axis=1)


def _summed(nodes: Array, weights: Array, mu: Array, sigma: Array) -> Array:
    """sum_i weight_i N(x'_i; mu, sigma^2) for kernels (T, N), nodes (T, N') and weights (T, N', W): (T, N, W)."""
    rate = np.sqrt(0.5) / sigma
    found = np.empty((*mu.shape, weights.shape[2]))
    for i in chunks(len(mu), mu.shape[1] * nodes.shape[1], CACHED):
        kernel = nodes[i, None, :] * rate[i, :, None]
        kernel -= (mu[i] * rate[i])[:, :, None]
        np.matmul(bells(kernel), weights[i], out=found[i])
    found[found <= 2 * np.exp(-LOWEST) * weights.sum(axis=1, keepdims=True)] = 0.0
    return found * (rate / np.sqrt(np.pi))[:, :, None]
