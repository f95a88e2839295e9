"""A body thrown into the air."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from kfcourse import simulate
from kfcourse.scenarios.ballistic import thrown_body


def test_without_drag_and_noise_it_flies_a_parabola():
    vague, steps, T, gravity = 1e-9, 20, 0.25, 9.0
    quiet = dict(kappa=0, sigma_v=0, sigma_r=0, sigma_e=0, T=T, gamma=gravity)
    flight = simulate(thrown_body(vague, **quiet), 1, steps, seed=1)
    k = np.arange(steps)
    # Euler's steps
    along, height = 14_000 - 350 * T * k, 3_000 + 120 * T * k - gravity * T**2 * k * (k - 1) / 2
    tolerance = 1e-4  # m: a prior known to 300 nm and 30 nm/s
    assert_allclose(flight.x[:, 0, :2], np.stack([along, height], axis=-1), atol=tolerance, rtol=0)
    seen = np.stack([np.hypot(along, height), np.arctan(height / along)], axis=-1)
    assert_allclose(flight.y[:, 0], seen, rtol=1e-7)


def test_drag_slows_the_body_along_its_velocity():
    still = dict(gamma=0, sigma_v=0)
    free, slowed = (
        simulate(thrown_body(kappa=kappa, **still), 50, 2, seed=3).x[..., 2:] for kappa in (0, 1e-4)
    )
    lost = np.linalg.norm(free[0], axis=-1, keepdims=True) * 0.5 * 1e-4  # T kappa |v|
    assert_allclose(slowed[1], free[0] * (1 - lost), rtol=1e-12)


def test_an_unknown_parameter_is_named():
    with pytest.raises(ValueError, match="no parameter sigma_x; there are T, kappa"):
        thrown_body(sigma_x=1)
