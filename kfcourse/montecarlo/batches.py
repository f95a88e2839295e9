"""How an ensemble is cut: into batches of trajectories, whose means tell the standard errors, of whole sets of initial states."""

from __future__ import annotations

import numpy as np

from kfcourse.laws import Array

BATCHES = 128  # standard errors from 128 batches are themselves good to 6 %
FEWEST = 2 * BATCHES  # trajectories that have standard errors
STRATA = 16  # initial states of a set that share the law out among them: a batch of the slow filters


def batch_sizes(runs: int, batches: int) -> Array:
    """Sizes of about so many batches, nearly equal; of whole sets of `STRATA` trajectories if there are many."""
    whole = STRATA if runs >= 8 * STRATA else 1
    inner = np.linspace(0, runs, min(batches, max(runs // whole, 1)) + 1)[1:-1].astype(int) // whole * whole
    return np.diff(np.concatenate([[0], np.unique(inner[inner > 0]), [runs]]))
