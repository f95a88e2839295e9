"""A pointer moved by hand: its track, and the fourth-order filter that cleans it.

The state is (x, y, vx, vy) in pixels and pixels a second.  Between samples the motion is uniformly
accelerated, and the acceleration is the filter's known input u = (ax, ay):

    x_{k+1} = A x_k + B (u_k + xi_k),   xi ~ N(0, `acceleration_sd`^2 I)
    y_k     = H x_k + w_k,              w  ~ N(0, `measurement_sd`^2 I)

A hand moves in strokes.  One stroke from rest to rest that changes its acceleration as smoothly as
possible (Flash and Hogan, 1985) goes along s(tau) = 10 tau^3 - 15 tau^4 + 6 tau^5, and takes the
longer the farther it goes (Fitts' law).

::

    track = hand_track(seed=1)                                 the true motion, at any moment
    samples = sample(track, interval=0.01, measurement_sd=8, runs=200, seed=2)
    system = uniform_acceleration(0.01, acceleration_sd=3000, measurement_sd=8)
    laws = follow(system, samples.y, interval=0.01)
        start-up from three samples, then the Kalman filter
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import sympy as sp
from numpy.polynomial import Polynomial

from kfcourse.errors import expect_not_negative, expect_positive, expect_sizes
from kfcourse.laws import Array, Gaussian
from kfcourse.linear.arithmetic import predict_law
from kfcourse.linear.runs import Run, run
from kfcourse.linear.system import LinearSystem

DT = sp.Symbol("Delta", positive=True)
# r' = r + Delta v + Delta^2 a / 2,  v' = v + Delta a, y = r: A, B and H of one axis, and of two.
ONE_AXIS = sp.Matrix([[1, DT], [0, 1]]), sp.Matrix([DT**2 / 2, DT]), sp.Matrix([[1, 0]])
TRANSITION, INPUT, SENSITIVITY = (
    sp.ImmutableMatrix(sp.kronecker_product(matrix, sp.eye(2))) for matrix in ONE_AXIS
)

# Position, velocity and acceleration at the last of three samples (r0, r1, r2), by the parabola
# through them.
START = sp.ImmutableMatrix(
    [[0, 0, 1], sp.Matrix([[1, -4, 3]]) / (2 * DT), sp.Matrix([[1, -2, 1]]) / DT**2]
)

MINIMUM_JERK = Polynomial([0, 0, 0, 10, -15, 6])


def uniform_acceleration(
    interval: float, acceleration_sd: float, measurement_sd: float, axes: int = 2
) -> LinearSystem:
    """The filter's model for samples every `interval` seconds.

    A and B of uniformly accelerated motion, Q = acceleration_sd^2 B B^T, R = measurement_sd^2 I.

    Parameters
    ----------
    interval : float
        Seconds between samples.
    acceleration_sd : float
        Standard deviation of what the input does not say about the acceleration, constant between
        samples, px/s^2.
    measurement_sd : float
        Standard deviation of the noise of each coordinate, px.
    axes : int
        2, of `TRANSITION`, `INPUT` and `SENSITIVITY`; 3 in space.
    """
    expect_positive(interval=interval)
    expect_not_negative(acceleration_sd=acceleration_sd, measurement_sd=measurement_sd)
    A, B, H = (np.kron(_numeric(matrix, interval), np.eye(axes)) for matrix in ONE_AXIS)
    Q = acceleration_sd**2 * (B @ B.T)
    return LinearSystem(A, H, 0.5 * (Q + Q.T), measurement_sd**2 * np.eye(axes), B)


def start_up(y: Array, interval: float, R: Array) -> Gaussian:
    """Position, velocity and acceleration at the third of three samples, and the covariance of
    their errors.

    The parabola through the samples is a linear function of them, M = `START`: with noise of
    covariance R, independent from sample to sample, the covariance is (M M^T) (x) R, (x) the
    Kronecker product.

    Parameters
    ----------
    y : ndarray (3, runs, 2)
    interval : float
        Seconds between samples.
    R : ndarray (2, 2)
        Covariance of the measurements' noise.

    Returns
    -------
    Gaussian
        (x, y, vx, vy, ax, ay): mean (runs, 6), cov (6, 6).

    Raises
    ------
    ValueError
        Not three complete samples, or R of another shape.
    """
    expect_positive(interval=interval)
    if y.shape[::2] != (3, 2) or not np.isfinite(y).all():
        raise ValueError(
            f"the start-up takes three complete samples of two coordinates, (3, runs, 2); got "
            f"{y.shape}, missing {int(np.isnan(y).sum())}"
        )
    M = _numeric(START, interval)
    mean = np.einsum("ij,jra->ria", M, y).reshape(y.shape[1], 6)
    return Gaussian(mean, np.kron(M @ M.T, R))


def acceleration_from(y: Array, interval: float) -> Array:
    """Acceleration by the last three samples, (steps, runs, 2) -> (steps, runs, 2); NaN for the
    first two.

    (y_k - 2 y_{k-1} + y_{k-2}) / interval^2, the last row of `START`.  Its noise has the variance 6
    R / interval^4.
    """
    expect_positive(interval=interval)
    weights = _numeric(START, interval)[2]
    acceleration = np.full(y.shape, np.nan)
    acceleration[2:] = weights[0] * y[:-2] + weights[1] * y[1:-1] + weights[2] * y[2:]
    return acceleration


def follow(
    system: LinearSystem,
    y: Array,
    interval: float,
    u: Array | None = None,
    start: Gaussian | None = None,
) -> Run:
    """Start up from the first three samples, then filter.

    Parameters
    ----------
    system : LinearSystem
        From `uniform_acceleration`, with the same interval.
    y : ndarray (steps, runs, 2)
        At least four samples; NaN where missing, but not among the first three.
    interval : float
        Seconds between samples.
    u : ndarray (steps, runs, 2) or (steps, 1, 2), optional
        Acceleration between y[k] and y[k+1]; u[0] and u[1] are not used.  None: no input, the
        acceleration is all noise.
    start : Gaussian, optional
        Law of (x, y, vx, vy) at the third sample, in place of that from `start_up`.

    Returns
    -------
    Run
        Laws for samples 3, 4, ... (the first three are used up): posterior.mean is (steps - 3,
        runs, 4).
    """
    if len(y) < 4:
        raise ValueError(f"the filter needs more than three samples, got {len(y)}")
    if not np.isclose(system.A[0, 2], interval, rtol=1e-9, atol=0):
        raise ValueError(
            f"the system was made for an interval of {system.A[0, 2]:g} s, and the samples have "
            f"{interval:g} s"
        )
    if start is None:
        mean, cov = start_up(y[:3], interval, system.R)
        start = Gaussian(mean[:, :4], cov[:4, :4])
    shift = system.input(None if u is None else u[2])
    later = None if u is None else u[3:]
    return run(system, predict_law(system, start, shift), y[3:], later)


class Motion(NamedTuple):
    """True motion at given moments: each (..., 2), in px, px/s, px/s^2."""

    position: Array
    velocity: Array
    acceleration: Array


@dataclass(frozen=True)
class HandTrack:
    """A sum of strokes, position(t) = origin + sum_i displacement_i s((t - begin_i) / duration_i).

    Attributes
    ----------
    origin : ndarray (2,)
        px.
    begin, duration : ndarray (strokes,)
        s.  A stroke may begin before the one before it ends: the path is then curved.
    displacement : ndarray (strokes, 2)
        px.
    """

    origin: Array
    begin: Array
    duration: Array
    displacement: Array

    @property
    def end(self) -> float:
        """The moment the pointer comes to rest, s."""
        return float((self.begin + self.duration).max())

    def at(self, t: Array) -> Motion:
        """The motion at the moments t (...,), in seconds; at rest before 0 and after `end`."""
        tau = (np.asarray(t, dtype=float)[..., None] - self.begin) / self.duration
        moving = (tau >= 0) & (tau <= 1)
        tau = np.clip(tau, 0.0, 1.0)
        position = self.origin + MINIMUM_JERK(tau) @ self.displacement
        velocity, acceleration = (
            np.where(moving, MINIMUM_JERK.deriv(order)(tau) / self.duration**order, 0.0)
            @ self.displacement
            for order in (1, 2)
        )
        return Motion(position, velocity, acceleration)


# Strokes: at least SHORTEST px; FITTS[0] + FITTS[1] log2(distance / FITTS[2] + 1) seconds
# (MacKenzie, 1992, with a target of 20 px); the next begins up to OVERLAP of the stroke's duration
# before its end, or up to PAUSE seconds after it. An overlap of 0.4 keeps the strokes in order (0.4
# of a stroke of 3500 px is the duration of the shortest), and with it the path between its targets,
# on the screen.
SCREEN = (640.0, 400.0)  # width and height, px
SHORTEST, FITTS, OVERLAP, PAUSE = 100.0, (0.1, 0.15, 20.0), 0.4, 0.3


def hand_track(seed: int | np.random.Generator, strokes: int = 14) -> HandTrack:
    """A track like that of a hand: strokes between random targets on a screen of 640 x 400 px, with
    pauses and overlaps; a stroke takes about 0.7 s."""
    expect_sizes(strokes=strokes)
    rng = np.random.default_rng(seed)
    targets = [rng.uniform(0, SCREEN)]
    while len(targets) <= strokes:
        target = rng.uniform(0, SCREEN)
        if np.hypot(*(target - targets[-1])) >= SHORTEST:
            targets.append(target)
    displacement = np.diff(targets, axis=0)
    duration = FITTS[0] + FITTS[1] * np.log2(np.hypot(*displacement.T) / FITTS[2] + 1)
    gap = np.where(
        rng.random(strokes) < 0.5,
        -OVERLAP * duration * rng.random(strokes),
        PAUSE * rng.random(strokes),
    )
    begin = np.concatenate([[0.0], np.cumsum(duration + gap)[:-1]])
    return HandTrack(targets[0], begin, duration, displacement)


class Samples(NamedTuple):
    """A track sampled at a fixed rate.

    Attributes
    ----------
    time : ndarray (steps,)
        s.
    state : ndarray (steps, 1, 4)
        True (x, y, vx, vy).
    input : ndarray (steps, 1, 2)
        Mean acceleration until the next sample, (v_{k+1} - v_k) / interval, which an ideal
        accelerometer would give.
    y : ndarray (steps, runs, 2)
        Noisy positions.
    """

    time: Array
    state: Array
    input: Array
    y: Array


def sample(
    track: HandTrack,
    interval: float,
    measurement_sd: float,
    runs: int,
    seed: int | np.random.Generator,
) -> Samples:
    """The track every `interval` seconds from its start to its end, with `runs` realisations of
    white noise added."""
    expect_positive(interval=interval)
    expect_sizes(runs=runs)
    expect_not_negative(measurement_sd=measurement_sd)
    time = interval * np.arange(int(track.end / interval) + 1)
    now, following = track.at(time), track.at(time + interval)
    state = np.concatenate([now.position, now.velocity], axis=-1)[:, None]
    acceleration = ((following.velocity - now.velocity) / interval)[:, None]
    noise = np.random.default_rng(seed).standard_normal((len(time), runs, 2))
    return Samples(time, state, acceleration, now.position[:, None] + measurement_sd * noise)


def _numeric(matrix: sp.MatrixBase, interval: float) -> Array:
    return np.array(matrix.subs(DT, interval), dtype=float)
