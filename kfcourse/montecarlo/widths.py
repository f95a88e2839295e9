"""How wide to draw initial states: a pilot on the fast filters.

Rare far starts may make most of an error variance, or of the distance between two filters.  Drawn more often, and weighted, they
leave less to chance.  How often is best depends on the model; where the start is soon forgotten, the weights only add noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kfcourse.filters.base import Filter
from kfcourse.montecarlo.ensemble import Ensemble

WIDTHS = (1.0, 1.5, 2.0, 3.0)  # that are tried
RUNS = 2048  # trajectories of the pilot
REACH = 5.0  # width with which so few reach as far as many do with the largest of them
RARE = 1e-6  # weight of a state that the prior hardly ever has: six deviations away
LOST = 0.5  # part of the mean square of the states that such may make


def best_width(filters: Sequence[Filter], ensemble: Ensemble) -> float:
    """The width with which the filters' errors on such an ensemble, and their distances from the first filter, vary least.

    A mean of w f over states drawn from q, with w = p / q, varies as M_q[(w f)^2] = M_p[w f^2] does.  So one sample, drawn with
    the largest width, tells it for all of them.  What is least is the mean of its logarithm over filters and steps.  A model
    whose far states lead out of the finite numbers, or to where they count for more than all others though the prior
    hardly ever has them, has them drawn from the prior.
    """
    if ensemble.model.angles.x or not np.any(ensemble.model.prior.cov):
        return 1.0
    if _astray(replace(ensemble, runs=RUNS, wide=REACH)):
        return 1.0
    *laws, widest = (replace(ensemble, runs=min(ensemble.runs, RUNS), wide=wide) for wide in WIDTHS)
    loss, weights = np.zeros(len(WIDTHS)), np.empty((len(WIDTHS), widest.sizes[0]))
    states = [one.init(widest.sizes[0]) for one in filters]
    with np.errstate(all="ignore"):  # what is not finite is seen below
        for k, (x, y, _) in enumerate(widest.block(0)):
            if k == 0:
                for weight, law in zip(weights, (*laws, widest), strict=True):
                    found = law.weight(x)
                    weight[:] = 1.0 if found is None else found
            try:
                states = [one.step(state, y) for one, state in zip(filters, states, strict=True)]
            except (ValueError, ArithmeticError, np.linalg.LinAlgError):
                return 1.0  # which filter it is is said where all of them run
            first, *others = (one.T for one in (*(state.posterior.mean for state in states), x))
            squares = ((first - np.stack(others)) ** 2).sum(axis=1)
            second = np.einsum("wi,fi->wf", weights, weights[-1] * squares**2) / len(x)
            if not np.isfinite(second).all():
                return 1.0
            loss += np.log(second[:, second.all(axis=0)]).sum(axis=1)  # without a filter that is the same as the first
    return WIDTHS[int(np.argmin(loss))]


def _astray(far: Ensemble) -> bool:
    """Whether far states that the prior hardly ever has count for more than all others, or leave the finite numbers."""
    with np.errstate(all="ignore"):
        for k, (x, _, _) in enumerate(far.block(0)):
            if k == 0:
                weight = np.ones(len(x)) if (found := far.weight(x)) is None else found
            square = weight * (x * x).sum(axis=1)
            if not square[weight < RARE].sum() <= LOST * square.sum() < np.inf:
                return True
    return False
