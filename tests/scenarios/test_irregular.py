"""The track with gaps and gross errors: its motion is that of the intervals, and as many are missing and wrong as asked for."""

import numpy as np
import pytest
from scipy.linalg import expm

from kfcourse.linear.system import linear_systems
from kfcourse.scenarios.irregular import irregular_track

pytestmark = pytest.mark.quick


def test_two_intervals_move_as_one():
    """Transition and noise of each step are those of white acceleration in continuous time (Van Loan)."""
    track = irregular_track(1, steps=5)
    at = linear_systems(track.model)
    q, sigma = (float(track.model.parameters[name]) for name in ("q", "sigma"))
    F = np.kron([[0, 1], [0, 0]], np.eye(2))
    block = np.block([[-F, np.diag([0, 0, q, q])], [np.zeros((4, 4)), F.T]])
    intervals = np.diff(track.time)
    assert 0.1 <= intervals.min() < intervals.max() <= 1.5
    for k, interval in enumerate(intervals):
        system, *_ = at(k)
        exponential = expm(block * interval)
        A = exponential[4:, 4:].T
        np.testing.assert_allclose(system.A, A, rtol=1e-12)
        np.testing.assert_allclose(system.Q, A @ exponential[:4, 4:], rtol=1e-9, atol=1e-15)
        np.testing.assert_array_equal(system.R, sigma**2 * np.eye(2))


def test_shares_and_sizes_are_those_asked_for():
    track = irregular_track(2, runs=200, steps=50, missing=0.3, outliers=0.1, times=10.0)
    count = 200 * 50
    missing = np.isnan(track.y)
    np.testing.assert_array_equal(missing[..., 0], missing[..., 1])
    assert not (track.outlier & missing[..., 0]).any()
    for found, share in ((missing[..., 0], 0.3), (track.outlier, 0.1 * 0.7)):
        assert abs(found.mean() - share) < 4 * np.sqrt(share * (1 - share) / count)
    error = track.y - track.x[..., :2]
    sigma = float(track.model.parameters["sigma"])
    for chosen, deviation in ((track.outlier, 10 * sigma), (~track.outlier & ~missing[..., 0], sigma)):
        square = np.mean(error[chosen] ** 2)
        assert abs(square / deviation**2 - 1) < 4 * np.sqrt(2 / error[chosen].size)


def test_a_seed_stands_for_one_track():
    first, again, other = irregular_track(3, steps=9), irregular_track(3, steps=9), irregular_track(4, steps=9)
    np.testing.assert_array_equal(first.y, again.y)
    assert not np.array_equal(first.time, other.time)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"missing": 15}, "missing is a share of the fixes"),
        ({"outliers": -0.1}, "outliers is a share of the fixes"),
        ({"missing": np.nan}, "missing is a share of the fixes"),
        ({"times": 0}, "times must be positive"),
        ({"steps": 0}, "steps must be a positive whole number"),
        ({"runs": 1.5}, "runs must be a positive whole number"),
    ],
)
def test_what_no_track_is_made_of(given, message):
    with pytest.raises(ValueError, match=message):
        irregular_track(1, **given)
