"""The carrier and its unknown phase."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from kfcourse import simulate
from kfcourse.scenarios.carrier import PARAMETERS, phase_meter


@pytest.mark.parametrize(("order", "offset"), [(1, 0.0), (2, 40.0)])
def test_without_noise_it_is_a_cosine(order, offset):
    start = (0, 0.4, offset)
    quiet = phase_meter(
        order, start, (0, 0, 0), A=3, sigma=0, s_phi=0, **({"s_nu": 0} if order == 2 else {})
    )
    seen = simulate(quiet, 1, 50, seed=1).y[:, 0, 0]
    k = np.arange(50)
    expected = 3 * np.cos(2 * np.pi * k / PARAMETERS["N"] + 0.4 + offset * PARAMETERS["T"] * k)
    assert_allclose(seen, expected, atol=1e-12)  # rounding of 50 added steps


def test_bad_orders_and_names_are_named():
    with pytest.raises(ValueError, match="order 1 or 2, got 3"):
        phase_meter(3)
    with pytest.raises(ValueError, match="no parameter omega; there are A, sigma"):
        phase_meter(omega=1)
