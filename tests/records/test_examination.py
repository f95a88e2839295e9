"""What is said of a record: the parts are those of the package, and the intervals cover."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from kfcourse import Model, likelihood, linearised, predictions, run, simulate, smooth
from kfcourse.filters import aof, gated
from kfcourse.linear.consistency import innovations
from kfcourse.records import examine, findings

MODEL = Model.define(["x + u", "u + 0.3*v"], ["x + w1", "u + w2"], symbols={"x": ["x", "u"]})
STRUCTURE = linearised(MODEL)


def holed(steps, runs, seed):
    _, y = simulate(MODEL, runs, steps, seed=seed)
    y[np.random.default_rng(seed).random(y.shape) < 0.2] = np.nan
    return y


def test_the_parts_are_those_of_the_package():
    y, filter_ = holed(40, 2, 1), aof(STRUCTURE)
    examined = examine(filter_, y)
    direct = innovations(STRUCTURE.measure, predictions(filter_, y), y)
    for ours, theirs in (
        (examined.estimate.mean, run(filter_, y).mean),
        (examined.smoothed.cov, smooth(filter_, y).cov),
        (examined.innovations.value, direct.value),
        (examined.innovations.cov, np.broadcast_to(direct.cov, examined.innovations.cov.shape)),
        (examined.log_likelihood, likelihood(filter_, y)),
    ):
        assert_array_equal(ours, theirs)
    assert_array_equal(np.isnan(examined.weight), np.isnan(y).all(axis=-1))
    assert set(examined.weight[~np.isnan(examined.weight)]) == {1.0}


@pytest.mark.parametrize("edge", [1.0, 0.999, 0.99])
def test_the_intervals_cover(edge):
    """300 records of 60 steps, a fifth of the cells empty: 95 % with a standard error of 1.3 %."""
    y, filter_ = holed(60, 300, 7), aof(STRUCTURE)
    # with a narrower gate what it refuses, large in truth, makes the prediction after it too sure
    if edge < 1:
        filter_ = gated(filter_, edge, patience=None)
    examined = examine(filter_, y)
    # not those whose track was lost
    kept = [run for run in range(300) if (examined.weight[:, run] > 0).sum() > 30]
    assert len(kept) > 295
    inside = np.mean(
        [[filter_.fits for filter_ in findings(examined, run=run)] for run in kept], axis=0
    )
    assert (np.abs(inside - 0.95) < 4 * np.sqrt(0.95 * 0.05 / len(kept))).all(), inside


def test_a_wrong_filter_is_found():
    rough = Model.define(
        ["x + u", "u + 0.3*v"], ["x + 0.5*w1", "u + 0.5*w2"], symbols={"x": ["x", "u"]}
    )
    stiff = Model.define(["x + u", "u + 0.01*v"], ["x + w1", "u + w2"], symbols={"x": ["x", "u"]})
    offset = simulate(MODEL, 1, 200, seed=5).y + np.array([0.0, 0.6])
    _, y = simulate(MODEL, 1, 200, seed=5)

    def failing(model, seen):
        return {
            filter_.name
            for filter_ in findings(examine(aof(linearised(model)), seen))
            if not filter_.fits
        }

    assert "size" in failing(rough, y)
    assert {"neighbours of y1", "neighbours of y2"} & failing(stiff, y)
    assert {"mean of y1", "mean of y2"} & failing(MODEL, offset)


def test_nothing_is_found_of_a_record_that_is_refused():
    y = np.full((5, 1, 2), 1e6)
    examined = examine(gated(aof(STRUCTURE), 0.99, patience=None), y)
    assert (examined.weight == 0).all() and findings(examined) == []
