"""A drive through Dresden, recorded by Paul Balzer on 26 March 2014: a satellite receiver at 10 Hz,
a yaw rate at 50 Hz.

The data are his, under CC BY-SA 2.0: data/LICENSE-car-2014-03-26.txt.  There is no truth beside
them.
"""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import NamedTuple

import numpy as np

from kfcourse.errors import expect_sizes
from kfcourse.laws import Array

MOVES = 6.0  # s, by when the car has pulled away: its course has a meaning
RADIUS = 6_371_000.0  # m, of a sphere as large as the Earth


class Drive(NamedTuple):
    """The record, a row for each reading of the gyroscope.

    Attributes
    ----------
    times : ndarray (rows,)
        s, ascending.
    place : ndarray (rows, 2)
        East and north of the first fix, m; NaN in rows without a new fix.
    yaw_rate : ndarray (rows,)
        rad/s, positive to the left.
    speed, course : ndarray (rows,)
        As the receiver finds them: m/s; rad, from the east to the left, as the heading.
    """

    times: Array
    place: Array
    yaw_rate: Array
    speed: Array
    course: Array


@cache
def recorded() -> Drive:
    """The whole record.

    x = r cos(phi_0) (lambda - lambda_0),   y = r (phi - phi_0)       latitude phi, longitude
    lambda, in rad
    """
    file = resources.files("kfcourse.scenarios") / "data" / "car-2014-03-26.csv"
    table = np.genfromtxt(file.read_text("utf-8").splitlines(), delimiter=",", names=True)
    latitude, longitude = np.radians(table["latitude_deg"]), np.radians(table["longitude_deg"])
    east = RADIUS * np.cos(latitude[0]) * (longitude - longitude[0])
    course = np.pi / 2 - np.radians(table["course_deg"])
    return Drive(
        table["time_s"],
        np.stack([east, RADIUS * (latitude - latitude[0])], axis=-1),
        np.radians(table["yaw_rate_deg_s"]),
        table["speed_km_h"] / 3.6,
        course,
    )


def fixes(every: int = 1) -> tuple[Array, Array]:
    """Times (steps,) and places (steps, 1, 2) of one fix in so many, from `MOVES` on."""
    expect_sizes(every=every)
    record = recorded()
    there = np.flatnonzero(~np.isnan(record.place[:, 0]) & (record.times >= MOVES))[::every]
    return record.times[there], record.place[there, None]


def turned(times: Array) -> Array:
    """The angle by which the car has turned since the record began, rad: the integral of the yaw
    rate, each reading held.

    Before the record it is 0, and after its end what it was there.
    """
    record = recorded()
    angle = np.concatenate([[0.0], np.cumsum(np.diff(record.times) * record.yaw_rate[:-1])])
    return np.interp(times, record.times, angle)
