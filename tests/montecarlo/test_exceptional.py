"""The slow part has the exceptional trajectories of all: without bias, whatever they are, and with the right standard error."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from kfcourse import Ensemble, Model, compare, gaussian
from kfcourse.filters import aof, pointmass
from kfcourse.filters.base import Filter
from kfcourse.lab.variants import find_variant
from kfcourse.laws import Gaussian
from kfcourse.montecarlo.batches import STRATA
from kfcourse.montecarlo.comparison import Comparison, SlowPart
from kfcourse.montecarlo.ensemble import Instant
from kfcourse.montecarlo.exceptional import Chosen, Scores, how_many
from kfcourse.montecarlo.slow_filters import _data, _slow_part
from kfcourse.montecarlo.statistics import Sums

STEPS = 3


def test_one_in_two_hundred_is_exceptional_but_not_more_than_an_eighth_of_the_usual_slow_part():
    assert [how_many(runs) for runs in (700, 3199, 3200, 20_000, 100_000, 1_000_000)] == [0, 0, 16, 96, 496, 512]


def test_wherever_time_ends_there_are_about_as_many_of_both_kinds():
    chosen = Chosen.of(2000, np.arange(500, 5300, 20))
    kinds = chosen.exceptional.reshape(-1, STRATA)
    assert (kinds == kinds[:, :1]).all()
    shares = np.cumsum(chosen.exceptional) / np.arange(1, 2001)
    assert (np.abs(shares[8 * STRATA :] - 1 / 8) < 0.08).all()  # at the worst after the second set, 32 of 160
    assert chosen.places[chosen.exceptional].tolist() == list(range(500, 5300, 20))
    assert chosen.places[~chosen.exceptional].tolist() == list(range(2000 - 240))
    fewer = Chosen.of(500, np.arange(500, 5300, 20))
    for name in ("places", "exceptional", "counted"):
        np.testing.assert_array_equal(getattr(fewer, name), getattr(chosen, name)[:500])
    again = chosen.places[~chosen.counted]
    assert again.tolist() == list(range(500, 2000 - 240, 20))  # exceptional ones among the first: they count once
    assert chosen.batches(0, 48).tolist() == [16] + 16 * [1] + [16]
    assert chosen.batches(16, 32).tolist() == 16 * [1] + [16]
    of_one_set = Chosen.of(16, np.arange(0, 3200, 200))
    assert of_one_set.counted.all() and of_one_set.wanted == 0  # nothing would stand for those that it leaves out


def test_scores_are_the_largest_share_that_a_trajectory_has_of_any_mean():
    """Two steps, three filters, of which two judge: distances from the first, 1 and 9 of mean 5; errors of it 4, 4 and 0, 16."""
    scores = Scores(2, 2)
    first, third = np.zeros((2, 1)), np.full((2, 1), 99.0)
    scores.add(np.array([[2.0], [2.0]]), [first, np.array([[1.0], [3.0]]), third], (), None)
    assert scores.values.tolist() == [1.0, 9 / 5]
    scores.add(np.array([[0.0], [4.0]]), [first, first, third], (), None)
    assert scores.values.tolist() == [1.0, 2.0]
    scores.add(np.array([[4.0], [2.0]]), [first, first, third], (), np.array([1.9, 0.1]))
    assert scores.values.tolist() == pytest.approx([2 * 1.9 * 16 / (1.9 * 16 + 0.1 * 4), 2.0])
    assert [found.tolist() for found in scores.highest(1)] == [[1], [2.0]]


def sums_over(values: np.ndarray) -> Sums:
    """Squares (filters, N) of a scalar, every trajectory a batch of its own."""
    found = Sums.empty(len(values), 1, 1, np.ones(values.shape[1]))
    found.square[:, 0, 0] = values
    return found


def test_exceptional_trajectories_count_once_and_the_first_ones_for_all_others(variant53):
    """Written out from the formula: twelve trajectories, 3 and 9 are exceptional, and 0 to 4 are the first."""
    rng = np.random.default_rng(1)
    fast, slow = rng.chisquare(1, (2, 12))
    slow[[3, 9]] += 50.0
    both = np.stack([fast, slow])
    first, exceptional = [0, 1, 2, 4], [3, 9]
    part = SlowPart(["slow"], sums_over(both[:, first]), sums_over(both[:, exceptional]).gathered(np.array(exceptional), 12))
    found = Comparison(variant53, ("fast", "slow"), ("fast",), 12, 1, 0, sums_over(both[:1]), part).error_variance("slow")

    y = slow - fast
    known = fast + np.where(np.isin(range(12), exceptional), y, 0.0)  # X'
    q = 10 / 12
    assert found.value.item() == pytest.approx(known.mean() + q * y[first].mean(), rel=1e-13)
    covariance = np.cov(fast[first], y[first])[0, 1]
    variance = known.var(ddof=1) / 12 + q**2 * y[first].var(ddof=1) / 4 + 2 * q * covariance / 12
    assert found.standard_error.item() == pytest.approx(np.sqrt(variance), rel=1e-12)
    assert part.runs == 6


def test_exceptional_ones_for_which_there_is_no_time_are_stood_for_by_the_others():
    """Two sets in time, of them one exceptional, of 240 exceptional trajectories in all: each stands for 15."""
    chosen = Chosen.of(2000, np.arange(0, 4800, 20))
    sums = Sums.empty(1, 1, 1, chosen.batches(0, 32))
    sums.square[0, 0, 0] = sum(range(1, 17)), *range(17, 33)
    sums.largest_square[0, 0, 1:] = range(17, 33)
    found = _slow_part(["slow"], sums, chosen, np.full(30, 160), {})
    assert found.first.square.ravel().tolist() == [sum(range(1, 17))]
    in_batches = range(17, 25), range(25, 33)  # the numbers 0 to 140, and 160, with which the second begins, to 300
    assert found.exceptional.square.ravel().tolist() == [*(15 * sum(some) for some in in_batches), *28 * [0]]
    assert found.exceptional.largest_square.ravel().tolist() == [*(15 * max(some) for some in in_batches), *28 * [0]]
    assert found.exceptional.weights.sum() == 240 and found.runs == 32
    assert found.part(4800) == 1 - 240 / 4800
    assert found.together(4800).weights.sum() == pytest.approx(4800, rel=1e-14)


def losing(model: Model, often: float) -> Filter:
    """The Gaussian AOF, but its estimate is off by 20 where |y| is so large as it is with probability `often`."""
    one, limit = aof(gaussian(model)), np.sqrt(7 / 3) * scipy.special.ndtri(1 - often / 2)

    def step(state, y):
        found = one.step(state, y)
        mean, cov = found.posterior
        return found._replace(posterior=Gaussian(mean + 20 * (np.abs(y) > limit), cov))

    return replace(one, name="losing", step=step)


def test_what_one_trajectory_in_four_thousand_makes_is_found():
    """Of a linear model the Gaussian AOF is exact: a distance of 400, where y ~ N(0, 4/3 + 1) is large, is all there is.

    The 800 of the slow part have 0.2 such trajectories at each step, and its first ones alone would nearly always tell 0.  All
    of them are found: the excess is 400 times their share of the 20,000, its standard error that of a Poisson number.
    """
    model, runs = Model.define("x/2 + v", "x + w", prior={"mean": 0, "variance": 4 / 3}), 20_000
    filters = [aof(gaussian(model)), losing(model, 1 / 4000), pointmass(model)]
    found = compare(filters, model, runs, STEPS, 1, slow_runs=800, wide=1.0, progress=False).excess("losing")
    same = Ensemble(model, runs, STEPS, np.random.SeedSequence(1).spawn(3)[0], wide=1.0)
    limit = np.sqrt(7 / 3) * scipy.special.ndtri(1 - 1 / 8000)
    rare = np.array([sum(np.count_nonzero(np.abs(block[k].y) > limit) for block in blocks_of(same)) for k in range(STEPS)])
    assert rare.min() >= 2 and rare.sum() < how_many(runs)
    np.testing.assert_allclose(found.value, 400 * rare / runs, rtol=1e-9)
    np.testing.assert_allclose(found.standard_error, 400 * np.sqrt(rare) / runs, rtol=0.05)  # fewer than one in a batch


def blocks_of(ensemble: Ensemble) -> list[list[Instant]]:
    return [list(ensemble.block(index)) for index in range(len(ensemble.sizes))]


@pytest.mark.parametrize("jumping", [False, True])
def test_the_slow_filters_see_the_very_trajectories_that_were_chosen(variant53, jumping):
    model = find_variant("J1").model if jumping else variant53
    ensemble = Ensemble(model, 50_000, STEPS, np.random.SeedSequence(1), wide=1.5)
    chosen = Chosen.of(400, np.sort(np.random.default_rng(1).choice(50_000, 48, replace=False)))
    data = _data(ensemble, chosen)
    blocks = blocks_of(ensemble)
    for k in range(STEPS):
        for name in ("x", "y", "x_next"):
            everywhere = np.concatenate([getattr(block[k], name) for block in blocks])
            np.testing.assert_array_equal(getattr(data, name)[k], everywhere[chosen.places])
    np.testing.assert_array_equal(data.weight, chosen.counted * ensemble.weight(data.x[0]))
