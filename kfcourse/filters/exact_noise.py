"""The prediction as an integral over the noise, for kernels of any narrowness.

With the next state x' = f(x, u) = m(x) + sigma(x) u and u ~ N(0, 1), where f(., u) is monotone,

    p(x') = Integral phi(u) p(psi(x', u)) |d psi / d x'| du,      psi(., u) the inverse of f(., u)

The narrower the kernel, the smoother the integrand; without noise it is constant.  The posterior is interpolated over the numbers
of its nodes, of which x is a smooth function: so psi is found by Newton's method as a number between two nodes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kfcourse.filters.densities import ScalarDensities
from kfcourse.filters.exact_kernels import ROOT, Grid, Kernels, Unresolved
from kfcourse.filters.exact_narrow import DEAD, interpolated
from kfcourse.laws import Array

STEP = 0.8  # of the trapezoidal rule in u: errs by 2 exp(-2 pi^2 / STEP^2) = 8e-14 where only phi varies
NOISE = STEP * np.arange(-10, 11) + 0.137  # shifted, that no u be one at which f(., u) is constant by design
SHARE = STEP * np.exp(-0.5 * NOISE**2) / ROOT
FINER = 8  # numbers between two nodes in the table that Newton's method starts from
NEWTON = 2  # steps, each of which squares the error of a start good to 1e-3
FOLDED = 1e-7  # mass of states and noises beyond a turning point of f(., u) that may be left out
LOWEST = 37.0  # states and noises that together have a density lower than exp(-LOWEST) are taken for nothing


@dataclass(frozen=True)
class Pushed:
    """A posterior that is pushed to the next step.

    Attributes
    ----------
    values : ndarray (3, N)
        At the nodes: x, log mass, and dx for a change of the node's number by one.
    law : ScalarDensities
    table : ndarray (M,)
        Numbers between the nodes.
    images : list of (first, last, ndarray)
        For each noise: where in the table f(., u) is monotone and state and noise together have a density that counts, and
        f(x, u) there.
    """

    values: Array
    law: ScalarDensities
    table: Array
    images: list[tuple[int, int, Array]]

    @classmethod
    def of(cls, x: Array, mass: Array, length: Array, law: ScalarDensities) -> Pushed:
        """Raises `Unresolved` if the state is folded."""
        with np.errstate(divide="ignore"):
            logs = np.maximum(np.log(mass / mass.sum()), -DEAD)
        values = np.stack([x, logs, length])
        table = np.linspace(0, len(x) - 1, FINER * (len(x) - 1) + 1)
        states, heights, _ = interpolated(values, table)
        mu, sigma = law.kernel(states)
        weight, top = np.exp(heights), int(heights.argmax())
        images, folded = [], 0.0
        for u, share in zip(NOISE, SHARE, strict=True):
            image = mu + sigma * u
            turns = np.flatnonzero(np.diff(np.sign(np.diff(image)))) + 1
            counts = np.flatnonzero(heights - 0.5 * u * u > -LOWEST)
            begin, end = (int(counts[0]), int(counts[-1]) + 1) if len(counts) else (0, 0)
            first = max(begin, int(turns[turns <= top].max(initial=begin)))
            last = min(end, int(turns[turns > top].min(initial=end)) + 1)
            folded += float(share * (weight[begin:first].sum() + weight[last:end].sum()) / weight.sum())
            images.append((first, last, image[first:last]))
        if folded > FOLDED:
            raise Unresolved("the transition kernel is far narrower than the posterior, and folds the state")
        return cls(values, law, table, images)

    def density(self, wanted: Array) -> Array:
        """p(x') at (N',)."""
        places, noises, starts = [], [], []
        for number, (first, end, image) in enumerate(self.images):
            if end - first > 1:
                order = slice(None) if image[-1] > image[0] else slice(None, None, -1)
                inside = np.flatnonzero((wanted >= image.min()) & (wanted <= image.max()))
                places.append(inside)
                noises.append(np.full(len(inside), number))
                starts.append(np.interp(wanted[inside], image[order], self.table[first:end][order]))
        i, k, at = np.concatenate(places), np.concatenate(noises), np.concatenate(starts)
        u, last = NOISE[k], self.values.shape[1] - 1
        for _ in range(NEWTON):
            x, _, length = interpolated(self.values, at)
            (mu, sigma), (mu_slope, sigma_slope) = self.law.kernel(x), self.law.kernel_slope(x)
            slope = (mu_slope + sigma_slope * u) * length
            at = np.clip(at - (mu + sigma * u - wanted[i]) / slope, 0, last)
        terms = SHARE[k] * np.exp(interpolated(self.values, at)[1]) / np.abs(slope)
        return np.bincount(i, terms, len(wanted))


def by_noise(grid: Grid, law: ScalarDensities, rough: Kernels) -> Kernels:
    """The prediction from one posterior with equidistant nodes.

    Raises
    ------
    Unresolved
        The state is folded: f(., u) is not monotone.
    """
    seen = grid.density > 0  # elsewhere there is no mass, and the length does not matter
    length = np.where(seen, grid.mass / np.where(seen, grid.density, 1.0), np.gradient(grid.x))
    full, even = Pushed.of(grid.x, grid.mass, length, law), Pushed.of(grid.x[::2], grid.mass[::2], 2 * length[::2], law)

    def both(x: Array) -> Array:
        return np.stack([full.density(x[0]), even.density(x[0])], axis=-1)[None]

    return rough._replace(pushed=both, spectral=np.array([False]))
