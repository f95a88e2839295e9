"""The recorded drive: the file's own numbers, its licence beside it, and what its sensors have in
common."""

import csv
from importlib import resources

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from kfcourse.scenarios.drive import RADIUS, fixes, recorded, turned

DATA = resources.files("kfcourse.scenarios") / "data"


def test_the_record_is_the_file_s():
    rows = list(csv.DictReader((DATA / "car-2014-03-26.csv").read_text().splitlines()))
    record = recorded()
    assert len(rows) == len(record.times) == 10800 and record.times[-1] == 215.993
    filled = [i for i, row in enumerate(rows) if row["latitude_deg"]]
    assert np.flatnonzero(~np.isnan(record.place[:, 0])).tolist() == filled and len(filled) == 2117
    # A kilometre east on this parallel, and north, by the arc that a degree is
    degree = np.pi * RADIUS / 180
    first, last = rows[filled[0]], rows[filled[-1]]
    lat, lon = (
        [float(row[f"{name}_deg"]) for row in (first, last)] for name in ("latitude", "longitude")
    )
    step = [degree * np.cos(np.radians(lat[0])) * (lon[1] - lon[0]), degree * (lat[1] - lat[0])]
    assert_allclose(record.place[filled[-1]], step, rtol=1e-9)
    assert record.yaw_rate[0] == pytest.approx(np.radians(-18.713)) and record.speed[
        0
    ] == pytest.approx(2.42 / 3.6)


def test_the_notice_stands_beside_it():
    notice = (DATA / "LICENSE-car-2014-03-26.txt").read_text(encoding="utf-8")
    for word in ("Paul Balzer", "CC BY-SA 2.0", "github.com/balzer82/Kalman", "Changed:"):
        assert word in notice


def test_fixes_are_thinned_and_begin_when_the_car_moves():
    times, place = fixes()
    assert place.shape == (len(times), 1, 2) and times[0] >= 6 and not np.isnan(place).any()
    assert_array_equal(fixes(every=5)[1], place[::5])
    with pytest.raises(ValueError, match="every must be a positive whole number"):
        fixes(0)


def test_the_angle_turned_is_the_course_s_difference():
    """Course and gyroscope agree while the car moves, to a tenth of a radian, the receiver's lag
    taken into account."""
    record = recorded()
    apart = np.exp(1j * (record.course - turned(record.times - 1.05)))[record.speed > 3]
    assert abs(apart.mean()) > 1 - 0.2**2 / 2
    mirrored = np.exp(1j * (record.course + turned(record.times - 1.05)))[record.speed > 3]
    assert abs(mirrored.mean()) < 0.8  # the sign of the yaw rate is no convention of ours
    before, after, end = turned(np.array([-1.0, 217.0, record.times[-1]]))
    assert before == 0 and after == end  # beyond the record
    assert np.diff(turned(np.array([10.0, 10.02]))) == pytest.approx(
        0.02 * record.yaw_rate[np.searchsorted(record.times, 10.0) - 1], rel=0.5
    )
