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

Between the parts they change along the step 3 u^2 - 2 u^3, Hermite's cubic with level ends, so
position, velocity and acceleration are continuous.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from kfcourse.errors import expect_positive
from kfcourse.laws import Array

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
        A number that is not positive and finite, a manoeuvre no longer than its two ramps, a flight
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
        if length <= 2 * ramp:
            raise ValueError(
                f"part {number} lasts {length:.4g} s, no longer than its two ramps of {ramp:g} s; "
                f"make it longer or the ramp shorter"
            )
    ends = np.cumsum(lengths)
    time = interval * np.arange(int(ends[-1] / interval * (1 + 1e-12)) + 1)

    def stepped(*changes: tuple[float, float]) -> CubicHermiteSpline:
        """The function of time that is 0 at first and from each moment on goes to a level, in the
        time of a ramp."""
        moments, levels = [0.0], [0.0]
        for moment, level in changes:
            moments, levels = [*moments, moment, moment + ramp], [*levels, levels[-1], level]
        moments, levels = [*moments, ends[-1]], [*levels, levels[-1]]
        return CubicHermiteSpline(moments, levels, np.zeros(len(levels)))

    loss = (speeds[0] - speeds[1]) / (lengths[2] - ramp)
    turning = stepped(
        (ends[0], rates[0]), (ends[1] - ramp, 0), (ends[2], rates[1]), (ends[3] - ramp, 0)
    )
    slowing, sinking = stepped((ends[1], -loss), (ends[2] - ramp, 0)), stepped((ends[2], -descent))
    gained, heading, sunk = (rate.antiderivative() for rate in (slowing, turning, sinking))
    altitude = START[2] + sunk(time)
    if not altitude.min() > 0:
        raise ValueError(
            f"the aircraft would end at the altitude {altitude[-1]:.4g} m; lower `descent`, "
            f"or make the circle of part 4 smaller"
        )

    def horizontal(t: Array) -> Array:
        return (speeds[0] + gained(t)) * np.stack([np.cos(heading(t)), np.sin(heading(t))])

    course = horizontal(time)
    along = slowing(time) / (speeds[0] + gained(time)) * course
    across = turning(time) * np.stack([-course[1], course[0]])
    position = np.column_stack(
        [START[:2] + _path(time, np.union1d(turning.x, slowing.x), horizontal), altitude]
    )
    velocity = np.column_stack([course.T, sinking(time)])
    acceleration = np.column_stack([(along + across).T, sinking.derivative()(time)])
    part = 1 + np.searchsorted(ends[:-1], time, side="right")
    return Track(time, position, velocity, acceleration, part)


def _path(time: Array, knots: Array, velocity: Callable[[Array], Array]) -> Array:
    """The integral of a velocity in the plane from 0 to each moment, (steps, 2), by Gauss's rule on
    pieces that end at the knots."""
    inside = knots[knots < time[-1]]
    moments = np.unique(np.concatenate([time, inside, np.arange(0.0, time[-1], PIECE)]))
    middle, half = (moments[1:] + moments[:-1]) / 2, np.diff(moments) / 2
    pieces = velocity(middle[:, None] + half[:, None] * NODES) @ WEIGHTS * half
    path = np.concatenate([np.zeros((1, 2)), np.cumsum(pieces.T, axis=0)])
    return path[np.searchsorted(moments, time)]
