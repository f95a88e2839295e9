"""The track with gaps and gross errors: as many are missing and wrong as asked for."""

import numpy as np
import oracles
from numpy.testing import assert_array_equal

from kfcourse.scenarios.irregular import irregular_track


def test_shares_and_sizes_are_those_asked_for():
    track = irregular_track(2, runs=50)
    missing = np.isnan(track.y)
    assert_array_equal(missing[..., 0], missing[..., 1])
    assert not (track.outlier & missing[..., 0]).any()
    for happens, share in ((missing[..., 0], 0.15), (track.outlier, 0.05 * 0.85)):
        oracles.is_mean(share, happens)
    error = track.y - track.x[..., :2]
    sigma = float(track.model.parameters["sigma"])
    for chosen, deviation in (
        (track.outlier, 20 * sigma),
        (~track.outlier & ~missing[..., 0], sigma),
    ):
        oracles.is_mean(deviation**2, error[chosen] ** 2)
