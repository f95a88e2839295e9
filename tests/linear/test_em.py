"""Expectation and maximisation: every round climbs; refusals."""

import numpy as np
import oracles
import pytest

from kfcourse import Gaussian
from kfcourse.linear import LinearSystem, em_rounds, simulate


def log_density(system, prior, y):
    """ln p(y) of all runs, each by one dense regression."""
    steps = [
        (system.A, np.zeros(len(system.A)), system.Q, system.H, np.zeros(len(system.H)), system.R)
    ] * len(y)
    return sum(oracles.joint_posterior(steps, prior, y[:, i])[2] for i in range(y.shape[1]))


def two_states():
    system = LinearSystem(
        np.array([[0.9, 0.4], [-0.2, 0.8]]),
        np.array([[1.0, 0.5]]),
        np.array([[0.5, 0.1], [0.1, 0.3]]),
        np.array([[0.4]]),
    )
    prior = Gaussian(np.array([1.0, -1.0]), np.array([[1.0, 0.2], [0.2, 0.5]]))
    y = simulate(system, prior, 25, 3, seed=1).y.copy()
    y[4, 1] = y[0, 2] = y[-1, 0] = np.nan
    return LinearSystem(system.A, system.H, np.diag([2.0, 1.0]), np.array([[3.0]])), prior, y


def test_each_round_climbs_in_the_direction_of_the_gradient():
    """The first round's change and the likelihood's slope along it have a known relation: M[ln p(x,
    y)] has the same slope."""
    start, prior, y = two_states()
    first, second = em_rounds(start, prior, y, 1)
    e, ahead, behind = 1e-4, [], []
    for name in "QR":
        change = getattr(second, name) - getattr(first, name)
        for sign, slopes in ((1, ahead), (-1, behind)):
            moved = {**vars(first), name: getattr(first, name) + sign * e * change}
            slopes.append(log_density(LinearSystem(**moved), prior, y))
    slope = (np.array(ahead) - behind) / (2 * e)
    counts = {"Q": 24 * 3, "R": 75 - 3}
    for value, name in zip(slope, "QR", strict=True):
        old, new = getattr(first, name), getattr(second, name)
        # d/dQ of -N/2 (ln det Q + tr Q^-1 Q_new) along Q_new - Q
        whitened = np.linalg.solve(old, new - old)
        assert value == pytest.approx(0.5 * counts[name] * np.trace(whitened @ whitened), rel=1e-5)


def test_what_it_cannot_use_is_refused():
    start, prior, y = two_states()
    both = LinearSystem(start.A, np.eye(2), start.Q, np.eye(2))
    half = np.zeros((3, 1, 2))
    half[1, 0, 0] = np.nan
    for system, bad in ((both, half), (start, np.full((3, 1, 1), np.nan)), (start, y[:1])):
        with pytest.raises(
            ValueError,
            match="needs two steps or more, and measurements that are there or missing as a whole",
        ):
            em_rounds(system, prior, bad, 1)
