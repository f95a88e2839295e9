"""An aircraft on a manoeuvring flight, the radar that follows it, and errors by part of the flight.

The flight has five parts, as in the paper that the radar chapters reproduce:

    1  straight, uniform, at a constant altitude
    2  on a circle
    3  uniformly decelerated
    4  on a circle of larger radius, descending
    5  descending, straight

The axes are x east, y north, z up, with the radar in the origin; the heading is counted from x towards y.  Speed V, turn rate
omega and vertical speed are given functions of time, and the rest follows:

    (x', y') = V (cos psi, sin psi),   psi' = omega

Between the parts these functions change along the step 3 u^2 - 2 u^3, so position, velocity and acceleration are continuous.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import sympy as sp

from kfcourse.laws import Array
from kfcourse.montecarlo.statistics import Estimate
from kfcourse.symbolic.codegen import compile_function
from kfcourse.symbolic.formula import symbol
from kfcourse.symbolic.model import Model

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
    start: Sequence[float] = (-15_000.0, 25_000.0, 8_500.0),
    heading: float = 0.0,
    speeds: tuple[float, float] = (200.0, 130.0),
    radii: tuple[float, float] = (6_000.0, 10_000.0),
    turns: tuple[float, float] = (1.5 * np.pi, np.pi),
    durations: tuple[float, float, float] = (120.0, 60.0, 100.0),
    descent: float = 10.0,
    ramp: float = 8.0,
) -> Track:
    """The five-part flight.

    Parameters
    ----------
    interval : float
        Time between samples, s.
    start : (x, y, z)
        First position, m.
    heading : float
        First heading, rad from the x axis towards y.
    speeds : (V1, V2)
        Horizontal speed before and after part 3, m/s.
    radii : (r1, r2)
        Radii of the circles of parts 2 and 4, m.
    turns : (angle, angle)
        By how much parts 2 and 4 turn the heading, rad; positive to the left.
    durations : (s, s, s)
        Of parts 1, 3 and 5.  Parts 2 and 4 last |angle| r / V + ramp.
    descent : float
        Speed of descent in parts 4 and 5, m/s.
    ramp : float
        Time in which a manoeuvre begins or ends, s.  It lies inside the part that manoeuvres.

    Returns
    -------
    Track
        Velocity, acceleration and altitude in closed form; the horizontal position by Gauss's rule, exact to rounding.

    Raises
    ------
    ValueError
        A number that is not finite or has the wrong sign, a manoeuvre shorter than its two ramps, a flight that ends below
        the ground.
    """
    _numbers("start", start, 3)
    _numbers("turns", turns, 2)
    for name, value in (("heading", heading), ("descent", descent)):
        if not np.isfinite(value):
            raise ValueError(f"{name} must be a finite number, got {value}")
    for name, given, size in (("speeds", speeds, 2), ("radii", radii, 2), ("durations", durations, 3)):
        if min(_numbers(name, given, size)) <= 0:
            raise ValueError(f"{name} must be positive, got {tuple(given)}")
    for name, value in (("interval", interval), ("ramp", ramp)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be a positive number of seconds, got {value}")

    circles = [abs(angle) * radius / speed for angle, radius, speed in zip(turns, radii, speeds, strict=True)]
    lengths = [durations[0], circles[0] + ramp, durations[1], circles[1] + ramp, durations[2]]
    for number, length in zip((2, 3, 4, 5), lengths[1:], strict=True):
        if length < 2 * ramp:
            raise ValueError(
                f"part {number} lasts {length:.4g} s, less than its two ramps of {ramp:g} s; make it longer or the ramp shorter"
            )
    ends = np.cumsum(lengths)
    time = interval * np.arange(int(ends[-1] / interval * (1 + 1e-12)) + 1)

    # Turn rates and the loss of speed: each rises, stays and falls inside its part.
    rates = [np.sign(angle) * speed / radius for angle, speed, radius in zip(turns, speeds, radii, strict=True)]
    deceleration = (speeds[0] - speeds[1]) / (lengths[2] - ramp)

    def speed_and_heading(t: Array) -> tuple[Array, Array]:
        first, second = (_plateau_integral(t, ends[i], ends[i + 1], ramp) for i in (0, 2))
        speed = speeds[0] - deceleration * _plateau_integral(t, ends[1], ends[2], ramp)
        return speed, heading + rates[0] * first + rates[1] * second

    speed, psi = speed_and_heading(time)
    turn_rate = rates[0] * _plateau(time, ends[0], ends[1], ramp) + rates[1] * _plateau(time, ends[2], ends[3], ramp)
    slowing = -deceleration * _plateau(time, ends[1], ends[2], ramp)
    since = (time - ends[2]) / ramp  # the descent begins with part 4 and goes on
    forward = np.stack([np.cos(psi), np.sin(psi)], axis=-1)
    left = np.stack([-np.sin(psi), np.cos(psi)], axis=-1)

    altitude = start[2] - descent * ramp * _step_integral(since)
    if altitude.min() <= 0:
        raise ValueError(
            f"the aircraft would end at the altitude {altitude[-1]:.4g} m; start higher, lower `descent` or shorten parts 4 and 5"
        )
    knots = np.concatenate([ends[:-1], ends[:-1] + ramp, ends[1:-1] - ramp])
    path = _path(time, knots, speed_and_heading)
    position = np.column_stack([np.add(start[:2], path), altitude])
    velocity = np.column_stack([speed[:, None] * forward, -descent * _step(since)])
    horizontal = slowing[:, None] * forward + (speed * turn_rate)[:, None] * left
    acceleration = np.column_stack([horizontal, -descent / ramp * _step_slope(since)])
    part = 1 + np.searchsorted(ends[:-1], time, side="right")
    return Track(time, position, velocity, acceleration, part)


def _numbers(name: str, values: Sequence[float], size: int) -> Array:
    array = np.asarray(values, dtype=float)
    if array.shape != (size,) or not np.isfinite(array).all():
        raise ValueError(f"{name} must be {size} finite numbers, got {values!r}")
    return array


def _step(u: Array) -> Array:
    """From 0 to 1 over 0 <= u <= 1, with zero slope at both ends."""
    u = np.clip(u, 0.0, 1.0)
    return u**2 * (3 - 2 * u)


def _step_slope(u: Array) -> Array:
    u = np.clip(u, 0.0, 1.0)
    return 6 * u * (1 - u)


def _step_integral(u: Array) -> Array:
    rising = np.clip(u, 0.0, 1.0)
    return rising**3 - rising**4 / 2 + np.maximum(u - 1.0, 0.0)


def _plateau(t: Array, start: float, end: float, ramp: float) -> Array:
    """From 0 up to 1 and down again between start and end."""
    return _step((t - start) / ramp) - _step((t - end) / ramp + 1)


def _plateau_integral(t: Array, start: float, end: float, ramp: float) -> Array:
    """Its integral, end - start - ramp in all."""
    return ramp * (_step_integral((t - start) / ramp) - _step_integral((t - end) / ramp + 1))


def _path(time: Array, knots: Array, speed_and_heading) -> Array:
    """The integral of V (cos psi, sin psi) from 0 to each moment, (steps, 2), by Gauss's rule on pieces that end at the knots."""
    inside = knots[knots < time[-1]]
    moments = np.unique(np.concatenate([time, inside, np.arange(0.0, time[-1], PIECE)]))
    middle, half = (moments[1:] + moments[:-1]) / 2, np.diff(moments) / 2
    speed, psi = speed_and_heading(middle[:, None] + half[:, None] * NODES)
    pieces = np.stack([speed * np.cos(psi), speed * np.sin(psi)]) @ WEIGHTS * half
    path = np.concatenate([np.zeros((1, 2)), np.cumsum(pieces.T, axis=0)])
    return path[np.searchsorted(moments, time)]


# --- what the radar measures

X, Y, Z = symbol("x"), symbol("y"), symbol("z")
RANGE, AZIMUTH, ELEVATION = symbol("r"), symbol("varphi"), symbol("epsilon")

# Range, azimuth from the x axis towards y in (-pi, pi], elevation above the horizon; and the way back.
SPHERICAL = sp.ImmutableMatrix(
    [sp.sqrt(X**2 + Y**2 + Z**2), sp.atan2(Y, X), sp.atan2(Z, sp.sqrt(X**2 + Y**2))],
)
CARTESIAN = sp.ImmutableMatrix(
    [
        RANGE * sp.cos(ELEVATION) * sp.cos(AZIMUTH),
        RANGE * sp.cos(ELEVATION) * sp.sin(AZIMUTH),
        RANGE * sp.sin(ELEVATION),
    ]
)

_to_spherical = compile_function(
    "spherical",
    {"position": sp.Matrix([X, Y, Z])},
    {"measured": SPHERICAL},
    ["position", "measured"],
    "range, azimuth, elevation",
).function
_to_cartesian = compile_function(
    "cartesian",
    {"measured": sp.Matrix([RANGE, AZIMUTH, ELEVATION])},
    {"position": CARTESIAN},
    ["measured", "position"],
    "x, y, z",
).function


def spherical(position: Array) -> Array:
    """Range (m), azimuth and elevation (rad) of positions (..., 3) in m: `SPHERICAL`."""
    return _to_spherical(position)[0]


def cartesian(measured: Array) -> Array:
    """Positions (..., 3) in m of range (m), azimuth and elevation (rad): `CARTESIAN`, the inverse of `spherical`."""
    return _to_cartesian(measured)[0]


def measure_cartesian(track: Track, sigmas: float | Sequence[float], runs: int, seed: int | np.random.Generator) -> Array:
    """The position with independent normal errors on the three axes.

    Parameters
    ----------
    track : Track
    sigmas : float or (x, y, z)
        Standard deviations, m.
    runs : int
        Independent sets of measurements of the same flight.
    seed : int or numpy.random.Generator

    Returns
    -------
    ndarray (steps, runs, 3)
    """
    return _noisy(track.position, sigmas, runs, seed)


def measure_spherical(track: Track, sigmas: Sequence[float], runs: int, seed: int | np.random.Generator) -> Array:
    """Range, azimuth and elevation with independent normal errors, (steps, runs, 3).

    Parameters
    ----------
    track : Track
    sigmas : (range, azimuth, elevation)
        Standard deviations in m, rad, rad.
    runs, seed
        As in `measure_cartesian`.

    Raises
    ------
    ValueError
        The flight comes so near to the azimuth pi that measurements jump by 2 pi there: a filter would take the jump for an
        innovation.
    """
    true = spherical(track.position)
    measured = _noisy(true, sigmas, runs, seed)
    if (np.abs(np.diff(np.unwrap(true[:, 1]) - true[:, 1])) > 1).any() or (np.abs(measured[..., 1]) > np.pi).any():
        raise ValueError(
            "the flight crosses the azimuth pi, where the angle jumps by 2 pi; move it with `start`, or turn it with `heading`"
        )
    return measured


def _noisy(true: Array, sigmas: float | Sequence[float], runs: int, seed: int | np.random.Generator) -> Array:
    try:
        deviations = np.broadcast_to(np.asarray(sigmas, dtype=float), (3,))
    except (TypeError, ValueError):
        raise ValueError(f"sigmas must be one number or three, got {sigmas!r}") from None
    if not (np.isfinite(deviations).all() and deviations.min() >= 0):
        raise ValueError(f"standard deviations must be finite and not negative, got {sigmas!r}")
    if isinstance(runs, bool) or not isinstance(runs, int | np.integer) or runs < 1:
        raise ValueError(f"runs must be a positive whole number, got {runs!r}")
    noise = np.random.default_rng(seed).standard_normal((len(true), int(runs), 3))
    return true[:, None, :] + deviations * noise


# --- models and errors


def kinematic(
    interval: float,
    *,
    dimensions: int = 3,
    order: int = 1,
    noise_sd: float = 1.0,
    measurement_sd: float = 1.0,
    prior: dict[str, Array] | None = None,
) -> Model:
    """Motion with a highest derivative that changes at random, its position measured.

    order 1: velocity nearly constant.  The acceleration v_k is constant over an interval T, and independent of the last:

        r' = r + T s + T^2/2 v,   s' = s + T v

    order 2: acceleration nearly constant.  v_k is its increment:

        r' = r + T s + T^2/2 (a + v),   s' = s + T (a + v),   a' = a + v

    Parameters
    ----------
    interval : float
        T, s.
    dimensions : int
        1, 2 or 3.  The state is (x, y, z, vx, vy, vz), then ax, ay, az.
    order : int
        1 or 2.
    noise_sd, measurement_sd : float
        Standard deviations of v_k, m/s^2, and of the measurements, m.
    prior : dict, optional
        Law of the first state, as in `Model.define`.
    """
    if dimensions not in (1, 2, 3) or order not in (1, 2):
        raise ValueError(f"dimensions must be 1, 2 or 3 and order 1 or 2, got {dimensions} and {order}")
    if not (np.isfinite(interval) and interval > 0):
        raise ValueError(f"interval must be a positive number of seconds, got {interval}")
    for name, value in (("noise_sd", noise_sd), ("measurement_sd", measurement_sd)):
        if not (np.isfinite(value) and value >= 0):
            raise ValueError(f"{name} must be finite and not negative, got {value}")
    axes = "xyz"[:dimensions]
    names = [prefix + axis for prefix in ("", "v", "a")[: order + 1] for axis in axes]
    T, state = symbol("T"), [symbol(name) for name in names]
    noises = [symbol(f"v{i + 1}") for i in range(dimensions)]
    r, s = state[:dimensions], state[dimensions : 2 * dimensions]
    acceleration = [a + v for a, v in zip(state[2 * dimensions :] or [0] * dimensions, noises, strict=True)]
    equations = [
        *(ri + T * si + T**2 / 2 * ai for ri, si, ai in zip(r, s, acceleration, strict=True)),
        *(si + T * ai for si, ai in zip(s, acceleration, strict=True)),
        *(acceleration if order == 2 else []),
    ]
    return Model.define(
        equations,
        [ri + symbol(f"w{i + 1}") for i, ri in enumerate(r)],
        {"T": interval},
        symbols={"x": names},
        prior=prior,
        state_noise={"variance": float(noise_sd) ** 2},
        meter_noise={"variance": float(measurement_sd) ** 2},
    )


def rms_by_part(error: Array, part: Array) -> Estimate:
    """Root mean square length of the error in each part, with standard errors.

    For a run, the mean over the steps of the part of |e|^2; then the root of its mean over the runs.  The runs are independent,
    the steps of a run are not: the standard error comes from the scatter of the runs.

    Parameters
    ----------
    error : ndarray (steps, runs, 3)
    part : ndarray (steps,)
        Labels, such as `track.part`; the results are in their sorted order.
    """
    squares = _by_part(error, part)
    return _root(squares, squares.mean(axis=1))


def rms_difference(error: Array, other: Array, part: Array) -> Estimate:
    """RMS of `error` less that of `other` by part, as `rms_by_part`, on common runs: the standard error is of the pair."""
    ours, theirs = _by_part(error, part), _by_part(other, part)
    first, second = (np.sqrt(squares.mean(axis=1)) for squares in (ours, theirs))
    # d sqrt(m) = dm / (2 sqrt(m)), for both from the same run
    influence = ours / (2 * first[:, None]) - theirs / (2 * second[:, None])
    return Estimate(first - second, _standard_error(influence), ours.shape[1] - 1)


def _by_part(error: Array, part: Array) -> Array:
    """Mean square length by part and run, (parts, runs)."""
    if error.ndim != 3 or len(error) != len(part):
        raise ValueError(f"errors must have the shape ({len(part)}, runs, components), got {error.shape}")
    if error.shape[1] < 2:
        raise ValueError("a standard error needs at least 2 runs")
    square = (error**2).sum(axis=-1)
    return np.stack([square[part == label].mean(axis=0) for label in np.unique(part)])


def _root(squares: Array, mean: Array) -> Estimate:
    root = np.sqrt(mean)
    return Estimate(root, _standard_error(squares / (2 * root[:, None])), squares.shape[1] - 1)


def _standard_error(values: Array) -> Array:
    return values.std(axis=1, ddof=1) / np.sqrt(values.shape[1])
