"""Which trajectories the slow filters see besides the first ones: those on which the fast filters disagree or err the most.

What a filter is above the exact one is often made by few trajectories, on which it loses the state: one in ten thousand can be a
tenth of it.  Of the first few thousand none may be like it; then the mean of the distances is too small, and so is its standard
error.  Before the slow filters begin, the fast ones have run on all N trajectories, and where they are far apart one of them is
far from the exact one.  So the slow ones run on the exceptional trajectories of all N, which count once each, and on the first
ones, which stand for those that are not exceptional: a sample in two phases, stratified by what the first has shown (J. Neyman,
Contribution to the theory of sampling human populations, J. Am. Stat. Assoc. 33, 1938).  It has no bias, by whatever they are
chosen; a good choice makes the variance small.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kfcourse.angles import near
from kfcourse.laws import Array
from kfcourse.montecarlo.batches import STRATA

SHARE = 200  # one trajectory in so many; with half of them the distances of the rest vary 1.3 to 3.5 times as much (7, 53, 5)
MOST = 512  # but no more: of 4000, the usual size of a slow part, an eighth
EIGHTH = 8  # one set of so many is of exceptional trajectories, until all have come


def how_many(runs: int) -> int:
    """Exceptional trajectories among so many, in whole sets: however many the slow filters see, always the same ones."""
    return min(runs // SHARE, MOST) // STRATA * STRATA


class Scores:
    """How exceptional trajectories are: the largest term that one makes of a mean over all at any step, relative to the mean.

    Means of squared distances: of each of so many filters' estimates from the first one's, and of the state from this.
    """

    def __init__(self, runs: int, filters: int):
        self.values, self.filters = np.zeros(runs), filters

    def add(self, x: Array, means: Sequence[Array], angles: tuple[int, ...], weight: Array | None) -> None:
        """One step: states (N, n), the estimates (N, n) of the filters, which components are angles, weights (N,) if any."""
        first, *others = means[: self.filters]
        for one in (x, *others):
            terms = ((near(one, first, angles) - first) ** 2).sum(axis=1)
            terms = terms if weight is None else terms * weight
            if (mean := terms.mean()) > 0:
                np.maximum(self.values, terms / mean, out=self.values)

    def highest(self, count: int) -> tuple[Array, Array]:
        """Places of the so many highest, in their order, and their scores."""
        places = np.sort(np.argsort(-self.values, kind="stable")[:count])
        return places, self.values[places]


@dataclass(frozen=True)
class Chosen:
    """The trajectories of the slow part, in the order in which they are taken.

    Attributes
    ----------
    places : ndarray (size,) of int
        Their numbers among all.
    exceptional : ndarray (size,) of bool
    counted : ndarray (size,) of bool
        False for a first one that is exceptional.
    wanted : int
        All that are exceptional.
    """

    places: Array
    exceptional: Array
    counted: Array
    wanted: int

    @classmethod
    def of(cls, size: int, exceptional: Array) -> Chosen:
        """The second of eight sets is one of the exceptional: wherever time ends, there are about as many of both kinds.

        By their numbers, so those that time leaves are no more exceptional than others.  A part of one set has none.
        """
        exceptional = exceptional[: len(exceptional) if size > STRATA else 0]
        sets = np.arange(size) // STRATA
        special = (sets % EIGHTH == 1) & (sets < EIGHTH * (len(exceptional) // STRATA))
        places, seen = np.empty(size, dtype=int), np.count_nonzero(special)
        places[special], places[~special] = exceptional[:seen], np.arange(size - seen)
        return cls(places, special, special | ~np.isin(places, exceptional), len(exceptional))

    def batches(self, start: int, count: int) -> Array:
        """Sizes of the batches of some of them: whole sets of first ones, and each exceptional one by itself."""
        here = np.arange(start, start + count)
        begins = (here % STRATA == 0) | self.exceptional[here]
        return np.diff(np.append(np.flatnonzero(begins), count))
