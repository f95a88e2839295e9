"""The track with gaps and gross errors: as many are missing and wrong as asked for."""

import numpy as np
import oracles
import pytest

from kfcourse.scenarios.irregular import irregular_track

pytestmark = pytest.mark.quick


def test_shares_and_sizes_are_those_asked_for():
    track = irregular_track(2, runs=200, steps=50, missing=0.3, outliers=0.1, times=10.0)
    missing = np.isnan(track.y)
    np.testing.assert_array_equal(missing[..., 0], missing[..., 1])
    assert not (track.outlier & missing[..., 0]).any()
    for found, share in ((missing[..., 0], 0.3), (track.outlier, 0.1 * 0.7)):
        oracles.is_mean(share, found)
    error = track.y - track.x[..., :2]
    sigma = float(track.model.parameters["sigma"])
    for chosen, deviation in (
        (track.outlier, 10 * sigma),
        (~track.outlier & ~missing[..., 0], sigma),
    ):
        oracles.is_mean(deviation**2, error[chosen] ** 2)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"missing": 15}, "missing is a share of the fixes"),
        ({"outliers": -0.1}, "outliers is a share of the fixes"),
        ({"times": 0}, "times must be positive"),
        ({"steps": 0}, "steps must be a positive whole number"),
    ],
)
def test_what_no_track_is_made_of(given, message):
    with pytest.raises(ValueError, match=message):
        irregular_track(1, **given)
