"""How well filters know the mode of a model that jumps: the share of steps at which the likeliest
mode is the true one."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np

from kfcourse.errors import NotFinite, Refused
from kfcourse.filters.base import Filter
from kfcourse.filters.designed import Design
from kfcourse.laws import Array
from kfcourse.montecarlo.ensemble import simulate
from kfcourse.montecarlo.experiment import walk
from kfcourse.montecarlo.statistics import Estimate
from kfcourse.symbolic.jumping import JumpModel


class Recognised(NamedTuple):
    """What filters know of the modes.

    Attributes
    ----------
    share : dict
        Name of a filter to the share of steps with the right mode, the mean over all steps and
        trajectories.
    guess : float
        The same for who always names the mode that is likeliest before anything is measured; where
        transitions depend on the state, the most frequent one.
    mode : ndarray (steps,)
        The true modes of one trajectory: the first in which there are as many as in any.
    probability : dict
        Name of a filter to its probabilities of the modes there, (steps, J).
    """

    share: dict[str, Estimate]
    guess: float
    mode: Array
    probability: dict[str, Array]


def recognised(
    filters: Sequence[Filter | Design], model: JumpModel, runs: int, steps: int, seed: int
) -> Recognised:
    """Run those of the filters that carry probabilities of modes on common trajectories; without
    one that cannot go on.

    The standard errors are those of means over independent trajectories.
    """
    _, y, mode = simulate(model, runs, steps, seed)
    shown = int(np.argmax([len(np.unique(trajectory)) for trajectory in mode.T]))
    share, there = {}, {}
    for filter_ in filters:
        if not (isinstance(filter_, Filter) and hasattr(filter_.init(1).memory, "probability")):
            continue
        after = islice(walk(filter_, y), 1, None)
        try:
            chances = np.stack([state.memory.probability for state in after])  # (steps, runs, J)
        except (Refused, NotFinite):
            continue
        right = (chances.argmax(axis=2) == mode).mean(axis=0)
        share[filter_.name] = Estimate(right.mean(), right.std(ddof=1) / np.sqrt(runs), runs - 1)
        there[filter_.name] = chances[:, shown]
    likeliest = [
        (np.bincount(mode[k]) if model.by_state else model.law_at(k)).argmax() for k in range(steps)
    ]
    guess = np.mean([(mode[k] == likely).mean() for k, likely in enumerate(likeliest)])
    return Recognised(share, float(guess), mode[:, shown], there)
