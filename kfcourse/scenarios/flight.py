"""An aircraft on a manoeuvring flight.

The flight has five parts, as in the paper that the radar chapters reproduce:

    1  straight, uniform, at a constant altitude
    2  on a circle
    3  uniformly decelerated
    4  on a circle of larger radius, descending
    5  descending, straight

The axes are x east, y north, z up, with the radar in the origin; the heading is counted from x
towards y.  Speed V, turn rate omega and vertical speed are given functions of time, and the rest
follows:

    (x', y') = V (cos psi, sin psi),   psi' = omega

Between the parts these functions change along the step 3 u^2 - 2 u^3, so position, velocity and
acceleration are continuous.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from kfcourse.errors import expect_positive
from kfcourse.laws import Array

STEP = Polynomial([0, 0, 3, -2])  # from 0 to 1 over 0 <= u <= 1, with zero slope at both ends
START = np.array([-15_000.0, 25_000.0, 8_500.0])  # m; the first course is along x
TURNS = (1.5 * np.pi, np.pi)  # rad; of parts 2 and 4, to the left
DURATIONS = (120.0, 60.0, 100.0)  # s; of parts 1, 3 and 5
PIECE = 1.0  # s; the horizontal path is integrated over pieces not longer than this
NODES, WEIGHTS = np.polynomial.legendre.leggauss(6)


class Track(NamedTuple):
    """A flight at equal intervals.

    Attributes
    ----------
    time : ndarray (steps,)
        Seconds from the start.
    position, velocity, acceleration : ndarray (steps, 3)
        In m, m/s, m/s^2.
    part : ndarray (steps,)
        Number of the part, 1 to 5.
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    part: Array

    @property
    def state(self) -> Array:
        """Position and velocity, (steps, 6)."""
        return np.concatenate([self.position, self.velocity], axis=-1)


def aircraft(
    interval: float,
    *,
    speeds: tuple[float, float] = (200.0, 130.0),
    radii: tuple[float, float] = (6_000.0, 10_000.0),
    descent: float = 10.0,
    ramp: float = 8.0,
) -> Track:
    """The five-part flight.

    Parameters
    ----------
    interval : float
        Time between samples, s.
    speeds : (V1, V2)
        Horizontal speed before and after part 3, m/s.
    radii : (r1, r2)
        Radii of the circles of parts 2 and 4, m.  These last `TURNS` r / V + ramp.
    descent : float
        Speed of descent in parts 4 and 5, m/s.
    ramp : float
        Time in which a manoeuvre begins or ends, s.  It lies inside the part that manoeuvres.

    Returns
    -------
    Track
        Velocity, acceleration and altitude in closed form; the horizontal position by Gauss's rule,
        exact to rounding.

    Raises
    ------
    ValueError
        A number that is not positive and finite, a manoeuvre shorter than its two ramps, a flight
        that ends below the ground.
    """
    expect_positive(interval=interval, ramp=ramp)
    for pair in zip(speeds, radii, strict=True):
        expect_positive(**dict(zip(("speeds", "radii"), pair, strict=True)))

    # Turn rates and the loss of speed: each rises, stays and falls inside its part.
    rates = [speed / radius for speed, radius in zip(speeds, radii, strict=True)]
    circles = [angle / rate + ramp for angle, rate in zip(TURNS, rates, strict=True)]
    lengths = [DURATIONS[0], circles[0], DURATIONS[1], circles[1], DURATIONS[2]]
    for number, length in zip((2, 3, 4, 5), lengths[1:], strict=True):
        if length < 2 * ramp:
            raise ValueError(
                f"part {number} lasts {length:.4g} s, less than its two ramps of {ramp:g} s; make "
                f"it longer or the ramp shorter"
            )
    ends = np.cumsum(lengths)
    time = interval * np.arange(int(ends[-1] / interval * (1 + 1e-12)) + 1)

    deceleration = (speeds[0] - speeds[1]) / (lengths[2] - ramp)

    def speed_and_heading(t: Array) -> tuple[Array, Array]:
        first, second = (_plateau_integral(t, ends[i], ends[i + 1], ramp) for i in (0, 2))
        speed = speeds[0] - deceleration * _plateau_integral(t, ends[1], ends[2], ramp)
        return speed, rates[0] * first + rates[1] * second

    speed, psi = speed_and_heading(time)
    turn_rate = rates[0] * _plateau(time, ends[0], ends[1], ramp) + rates[1] * _plateau(
        time, ends[2], ends[3], ramp
    )
    slowing = -deceleration * _plateau(time, ends[1], ends[2], ramp)
    since = (time - ends[2]) / ramp  # the descent begins with part 4 and goes on
    forward = np.stack([np.cos(psi), np.sin(psi)], axis=-1)
    left = np.stack([-np.sin(psi), np.cos(psi)], axis=-1)

    altitude = START[2] - descent * ramp * _step_integral(since)
    if not altitude.min() > 0:
        raise ValueError(
            f"the aircraft would end at the altitude {altitude[-1]:.4g} m; lower `descent`, "
            f"or make the circle of part 4 smaller"
        )
    knots = np.concatenate([ends[:-1], ends[:-1] + ramp, ends[1:-1] - ramp])
    path = _path(time, knots, speed_and_heading)
    position = np.column_stack([START[:2] + path, altitude])
    velocity = np.column_stack([speed[:, None] * forward, -descent * _step(since)])
    horizontal = slowing[:, None] * forward + (speed * turn_rate)[:, None] * left
    acceleration = np.column_stack(
        [horizontal, -descent / ramp * STEP.deriv()(np.clip(since, 0.0, 1.0))]
    )
    part = 1 + np.searchsorted(ends[:-1], time, side="right")
    return Track(time, position, velocity, acceleration, part)


def _step(u: Array) -> Array:
    return STEP(np.clip(u, 0.0, 1.0))


def _step_integral(u: Array) -> Array:
    return STEP.integ()(np.clip(u, 0.0, 1.0)) + np.maximum(u - 1.0, 0.0)


def _plateau(t: Array, start: float, end: float, ramp: float) -> Array:
    """From 0 up to 1 and down again between start and end."""
    return _step((t - start) / ramp) - _step((t - end) / ramp + 1)


def _plateau_integral(t: Array, start: float, end: float, ramp: float) -> Array:
    """Its integral, end - start - ramp in all."""
    return ramp * (_step_integral((t - start) / ramp) - _step_integral((t - end) / ramp + 1))


def _path(time: Array, knots: Array, speed_and_heading) -> Array:
    """The integral of V (cos psi, sin psi) from 0 to each moment, (steps, 2), by Gauss's rule on
    pieces that end at the knots."""
    inside = knots[knots < time[-1]]
    moments = np.unique(np.concatenate([time, inside, np.arange(0.0, time[-1], PIECE)]))
    middle, half = (moments[1:] + moments[:-1]) / 2, np.diff(moments) / 2
    speed, psi = speed_and_heading(middle[:, None] + half[:, None] * NODES)
    pieces = np.stack([speed * np.cos(psi), speed * np.sin(psi)]) @ WEIGHTS * half
    path = np.concatenate([np.zeros((1, 2)), np.cumsum(pieces.T, axis=0)])
    return path[np.searchsorted(moments, time)]
