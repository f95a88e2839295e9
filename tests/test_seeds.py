"""Whatever simulates takes a number or a generator, and nothing else: no seed gives no numbers that come but once."""

import numpy as np
import pytest

from kfcourse import continuous
from kfcourse.laws import Gaussian
from kfcourse.linear.runs import simulate
from kfcourse.linear.system import linear_system
from kfcourse.scenarios import benchmarks, flight, irregular, navigation, pointer, radar, tracking

pytestmark = pytest.mark.quick

TRACK, HAND, NORMAL = flight.aircraft(100.0), pointer.hand_track(1), Gaussian(np.zeros(1), np.eye(1))
LEVEL = linear_system(benchmarks.local_level())[0]
RADAR = linear_system(radar.kinematic(1.0))[0]
SENSOR = navigation.Sensor.define("r", ["x"], "x + w", 1.0, period=1.0)
WIENER = continuous.ContinuousModel.define("-x", "1", "x")

MADE = {
    "linear": lambda seed: simulate(LEVEL, NORMAL, 3, 2, seed).y,
    "continuous": lambda seed: continuous.simulate(WIENER, 0.1, 3, 2, seed).y,
    "cartesian": lambda seed: radar.measure_cartesian(TRACK, 1.0, 2, seed),
    "spherical": lambda seed: radar.measure_spherical(TRACK, (9.0, 0.1, 0.1), 2, seed),
    "roughly_known": lambda seed: tracking.roughly_known(RADAR, 0.9, np.zeros(6), 2, seed).mean,
    "hand_track": lambda seed: pointer.hand_track(seed).duration,
    "hand": lambda seed: pointer.sample(HAND, 0.1, 1.0, 2, seed).y,
    "irregular": lambda seed: irregular.irregular_track(seed, steps=5).x,
    "bearings": lambda seed: benchmarks.bearings_data(2, seed)[0],
    "navigation": lambda seed: navigation.sample(navigation.Dynamics([[0.0]], [[1.0]]), NORMAL, [0.0, 1.0], 2, seed).states,
    "sensors": lambda seed: navigation.observe([SENSOR], lambda t: np.zeros((len(t), 2, 1)), 3.0, seed)[1].value,
}


@pytest.mark.parametrize("make", MADE.values(), ids=MADE)
def test_a_seed_is_a_number_or_a_generator(make):
    np.testing.assert_array_equal(make(7), make(np.random.default_rng(7)))
    assert not np.array_equal(make(7), make(8))
    for none in (None, True, -1, 1.0):
        with pytest.raises(ValueError, match=r"non-negative whole number or a numpy\.random\.Generator"):
            make(none)
