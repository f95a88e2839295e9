"""A noise of unknown size, learnt on the way: against the filter that knows it, and against its own
equations."""

import numpy as np
import pytest

from kfcourse import Model, likelihood, linearised, run, simulate
from kfcourse.filters import adaptive, aof
from kfcourse.montecarlo.experiment import states


def model(r):
    return Model.define("0.95*x + 0.5*v", "x + sqrt(r)*w", {"r": r})


def scale(filter_, y):
    """What it has learnt at the end."""
    return states(filter_, y)[-1].memory.scale


def test_it_finds_the_size_of_the_noise_and_is_as_good_as_who_knows_it():
    x, y = simulate(model(4.0), 1000, 300, seed=1)
    learnt = scale(adaptive(linearised(model(1.0))), y)
    # M s: 4 to within a standard error of 4 / sqrt(50 1000), and a bias of second order in 1 /
    # window.
    assert abs(learnt.mean() - 4) < 4 * 4 / np.sqrt(50_000) + 4 / 50
    assert 0.5 < learnt.std() / (4 / np.sqrt(50)) < 1.5
    filters = (
        aof(linearised(model(4.0))),
        adaptive(linearised(model(1.0))),
        aof(linearised(model(1.0))),
    )
    knows, learns, wrong = (((run(filter_, y).mean - x)[200:] ** 2).mean() for filter_ in filters)
    assert learns < 1.02 * knows < wrong / 1.2


def test_a_step_by_hand_and_what_is_missing_teaches_nothing():
    """lambda = 0, Psi = 1, R = 1, y = 3, s = 1: K = 1/2, r = 1.5, p = 1/2, and s' = 1 + (2.25 + 0.5
    - 1) / 10."""
    filter_ = adaptive(linearised(model(1.0)), window=10)
    for y in (np.array([3.0]), np.array([3.0, np.nan])):
        expected = pytest.approx(1 + 1.75 / 10, rel=1e-14)
        assert scale(filter_, y[:, None, None]) == expected


def test_its_likelihood_is_that_of_the_noise_it_believes_in():
    _, y = simulate(model(9.0), 50, 400, seed=3)
    filters = adaptive(linearised(model(1.0)), 50), aof(linearised(model(9.0)))
    learns, knows = (likelihood(filter_, y)[300:].mean() for filter_ in filters)
    assert abs(learns - knows) < 0.02  # s errs by a seventh: a quarter of its square
    assert likelihood(aof(linearised(model(1.0))), y)[300:].mean() < learns - 0.5
