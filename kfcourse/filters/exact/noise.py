"""The prediction as an integral over the noise, for kernels of any narrowness.

With the next state x' = f(x, u) = m(x) + sigma(x) u and u ~ N(0, 1), where f(., u) is monotone,

    p(x') = Integral phi(u) p(psi(x', u)) |d psi / d x'| du,      psi(., u) the inverse of f(., u)

The narrower the kernel, the smoother the integrand; without noise it is constant.  The posterior is interpolated over the numbers
of its nodes, of which x is a smooth function: so psi is found by Newton's method as a number between two nodes.

Where f(., u) turns back, d psi / d x' has a pole; where the kernel is wide, the integrand is rough.  There the sum of kernels is
better, with more nodes if it needs them.  So the mass is shared by a smooth function chi of the node's number: chi p is summed,
(1 - chi) p integrated over the noise, on every branch of f(., u) that is left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from kfcourse.filters.densities import ScalarDensities
from kfcourse.filters.exact.constants import CACHED, FEW, LOWEST, ROOT
from kfcourse.filters.exact.kernels import OVERLAP, Grid, Kernels, TooNarrow, Unresolved, chunks
from kfcourse.filters.exact.narrow import interpolated, panels
from kfcourse.laws import Array

NOISE_STEP = 0.8  # of the trapezoidal rule in u: errs by 2 exp(-2 pi^2 / NOISE_STEP^2) = 8e-14 where only phi varies
SHARED_STEP = 0.5  # the same where the mass is shared, as the kernels there are not much narrower than the nodes' distance
SHIFT = 0.137  # of the rule, that no u be one at which f(., u) is constant by design
DENSE = np.linspace(-8, 8, 161)  # noises for which turning points are looked for
FINER = 8  # numbers between two nodes in the table that Newton's method starts from
NEWTON = 2  # steps, each of which squares the error of a start good to 1e-3
FAINT = 37.0  # states and noises that together have a density lower than exp(-FAINT) are taken for nothing
TURNS = 25.0  # the same for turning points: exp(-25) = 1e-11
SOFT = 1.4  # nodes over which chi rises, as an error function: summed over the nodes, it errs by exp(-(pi SOFT)^2) = 4e-9
EDGE = 6  # nodes from the middle of the rise to where chi is 0 or 1, up to 1e-9
POLES = 1e-7  # mass at turning points that may be left to the integral
ROUGH = 1e-4  # the same where the error is all that is wanted


@dataclass(frozen=True)
class Chi:
    """chi(i) of a node's number: 1 in the middle of some intervals, 0 outside of them."""

    begin: Array
    end: Array

    @classmethod
    def of(cls, mask: Array) -> Chi:
        """The intervals where the mask holds; at the ends of the nodes there is nothing to share."""
        edges = np.diff(np.concatenate([[0], mask.astype(int), [0]]))
        first, last = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0) - 1
        begin, end = np.where(first == 0, -np.inf, first + EDGE), np.where(last == len(mask) - 1, np.inf, last - EDGE)
        kept = end > begin
        return cls(begin[kept], end[kept])

    def __call__(self, number: Array) -> Array:
        rise, fall = (scipy.special.erf((number[..., None] - place) / SOFT) for place in (self.begin, self.end))
        return 0.5 * (rise - fall).sum(axis=-1)


@dataclass(frozen=True)
class Pushed:
    """A posterior that is pushed to the next step.

    Attributes
    ----------
    values : ndarray (3, N)
        At the nodes: x, log mass, and dx for a change of the node's number by one.
    law : ScalarDensities
    chi : Chi
    table : ndarray (M,)
        Numbers between the nodes.
    step : float
        Of the trapezoidal rule in u.
    images : list of (u, first, ndarray)
        Where in the table a monotone branch of f(., u) begins, on which state and noise together have a density that
        counts, and f(x, u) there.
    mu, sigma, mass : ndarray (K,)
        The sum of kernels.
    """

    values: Array
    law: ScalarDensities
    chi: Chi
    table: Array
    step: float
    images: list[tuple[float, int, Array]]
    mu: Array
    sigma: Array
    mass: Array

    @classmethod
    def of(cls, x: Array, mass: Array, length: Array, law: ScalarDensities, poles: float) -> Pushed:
        """Raises `Unresolved` if there is more mass than `poles` at turning points, or the sum needs too many nodes."""
        with np.errstate(divide="ignore"):
            logs = np.maximum(np.log(mass / mass.sum()), -LOWEST)
        values = np.stack([x, logs, length])
        table = np.linspace(0, len(x) - 1, FINER * (len(x) - 1) + 1)
        states, heights, _ = interpolated(values[:, None], table)
        mu, sigma = law.kernel(states)
        numbers = np.arange(len(x))
        turning, density = _turning(mu, sigma, heights)
        distance = np.abs(np.diff(mu[::FINER], prepend=np.nan, append=np.nan))
        wide = OVERLAP * np.fmax(distance[1:], distance[:-1]) <= sigma[::FINER]
        at_turns = np.zeros(len(x), dtype=bool)
        at_turns[np.unique(np.round(table[turning]).astype(int))] = True
        grown = scipy.ndimage.binary_dilation(at_turns, iterations=2 * EDGE) if at_turns.any() else at_turns
        chi = Chi.of(scipy.ndimage.binary_erosion(wide, iterations=1, border_value=1) | grown)
        rest = 1 - chi(table)
        if (rest[turning] * density).sum() / np.exp(heights).sum() > poles:
            raise Unresolved("the transition kernel is far narrower than the posterior, and folds the state")
        with np.errstate(divide="ignore"):
            left = heights + np.log(np.maximum(rest, 0.0))
        step = SHARED_STEP if len(chi.begin) else NOISE_STEP
        noise = step * np.arange(-round(8 / step), round(8 / step) + 1) + SHIFT
        images = []
        for u in noise.tolist():
            image = mu + sigma * u
            counts = left - 0.5 * u * u > -FAINT
            cuts = np.flatnonzero(np.diff(np.sign(np.diff(image)))) + 1
            for first, last in zip([0, *cuts.tolist()], [*(cuts + 1).tolist(), len(image)], strict=True):
                inside = np.flatnonzero(counts[first:last])
                if len(inside) > 1:
                    branch = slice(first + int(inside[0]), first + int(inside[-1]) + 1)
                    images.append((u, branch.start, image[branch]))
        return cls(values, law, chi, table, step, images, *_summed(values, chi, numbers, law))

    def bytes(self) -> int:
        """That it holds."""
        images = sum(image.nbytes for _, _, image in self.images)
        return images + sum(array.nbytes for array in (self.values, self.table, self.mu, self.sigma, self.mass))

    def density(self, wanted: Array) -> Array:
        """p(x') at (N',)."""
        result = np.zeros(len(wanted))
        for rows in chunks(len(wanted), max(len(self.mu), 1), CACHED):
            kernel = np.exp(-0.5 * ((wanted[rows, None] - self.mu) / self.sigma) ** 2)
            result[rows] = kernel @ (self.mass / (self.sigma * ROOT))
        places, noises, starts = [], [], []
        for noise, first, image in self.images:
            order = slice(None) if image[-1] > image[0] else slice(None, None, -1)
            inside = np.flatnonzero((wanted >= image.min()) & (wanted <= image.max()))
            places.append(inside)
            noises.append(np.full(len(inside), noise))
            starts.append(np.interp(wanted[inside], image[order], self.table[first : first + len(image)][order]))
        if not places:
            return result
        i, u, at = np.concatenate(places), np.concatenate(noises), np.concatenate(starts)
        last = self.values.shape[1] - 1
        for _ in range(NEWTON):
            x, _, length = interpolated(self.values[:, None], at)
            (mu, sigma), (mu_slope, sigma_slope) = self.law.kernel(x), self.law.kernel_slope(x)
            slope = (mu_slope + sigma_slope * u) * length
            with np.errstate(divide="ignore", invalid="ignore"):
                moved = at - (mu + sigma * u - wanted[i]) / slope
            at = np.where(np.abs(moved - at) < 1, np.clip(moved, 0, last), at)
        with np.errstate(divide="ignore", invalid="ignore"):
            terms = np.exp(interpolated(self.values[:, None], at)[1] - 0.5 * u * u) * (1 - self.chi(at)) / np.abs(slope)
        return result + self.step / ROOT * np.bincount(i, np.where(np.isfinite(terms), terms, 0.0), len(wanted))


def _turning(mu: Array, sigma: Array, heights: Array) -> tuple[Array, Array]:
    """Places in the table where f(., u) turns back, and the density there of the likeliest noise that makes it turn."""
    images = mu + sigma * DENSE[:, None]
    turns = np.diff(np.sign(np.diff(images, axis=1)), axis=1) != 0
    together = np.where(turns, heights[1:-1] - 0.5 * DENSE[:, None] ** 2, -np.inf).max(axis=0)
    places = np.flatnonzero(together > -TURNS)
    return places + 1, np.exp(together[places])


def _summed(values: Array, chi: Chi, numbers: Array, law: ScalarDensities) -> tuple[Array, Array, Array]:
    """The kernels of chi p."""
    if not len(chi.begin):
        return np.empty(0), np.empty(0), np.empty(0)
    _, at, weight, _ = panels(values[:1], (np.exp(values[1]) * chi(numbers))[None], law, FEW)
    if not len(at):
        raise TooNarrow("the transition kernel is far narrower than the posterior")
    x, logs, _ = interpolated(values[:, None], at)
    mass = weight * np.exp(logs) * chi(at)
    kept = mass > POLES**2
    return (*(array[kept] for array in law.kernel(x)), mass[kept])


def by_noise(grid: Grid, law: ScalarDensities, rough: Kernels) -> Kernels:
    """The prediction from one posterior with equidistant nodes.

    Raises
    ------
    Unresolved
        f(., u) turns back where there are too few nodes.
    """
    seen = grid.density > 0  # elsewhere there is no mass, and the length does not matter
    length = np.where(seen, grid.mass / np.where(seen, grid.density, 1.0), np.gradient(grid.x))
    full = Pushed.of(grid.x, grid.mass, length, law, POLES)
    even = Pushed.of(grid.x[::2], grid.mass[::2], 2 * length[::2], law, ROUGH)

    def both(x: Array) -> Array:
        return np.stack([full.density(x[0]), even.density(x[0])], axis=-1)[None]

    return rough._replace(pushed=both, spectral=np.array([False]), pushed_bytes=full.bytes() + even.bytes())
