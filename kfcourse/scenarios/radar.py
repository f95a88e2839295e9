"""What a radar measures of an aircraft: range and angles or Cartesian coordinates, with normal
errors; its tracking models."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import sympy as sp

from kfcourse.angles import on_circle
from kfcourse.errors import expect_not_negative, expect_positive, expect_sizes
from kfcourse.laws import Array
from kfcourse.scenarios.flight import Track
from kfcourse.symbolic.codegen import compile_function
from kfcourse.symbolic.formula import symbol
from kfcourse.symbolic.model import Model

X, Y, Z = symbol("x"), symbol("y"), symbol("z")
RANGE, AZIMUTH, ELEVATION = symbol("r"), symbol("varphi"), symbol("epsilon")

# Range, azimuth from the x axis towards y in (-pi, pi], elevation above the horizon; and the way
# back.
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

_to_spherical = compile_function([[X, Y, Z]], [list(SPHERICAL)])
_to_cartesian = compile_function([[RANGE, AZIMUTH, ELEVATION]], [list(CARTESIAN)])


def spherical(position: Array) -> Array:
    """Range (m), azimuth and elevation (rad) of positions (..., 3) in m: `SPHERICAL`."""
    return _to_spherical(np.asarray(position, dtype=float))[0]


def cartesian(measured: Array) -> Array:
    """Positions (..., 3) in m of range (m), azimuth and elevation (rad): `CARTESIAN`, the inverse
    of `spherical`."""
    return _to_cartesian(np.asarray(measured, dtype=float))[0]


def measure_cartesian(
    track: Track, sigmas: float | Sequence[float], runs: int, seed: int | np.random.Generator
) -> Array:
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


def measure_spherical(
    track: Track, sigmas: Sequence[float], runs: int, seed: int | np.random.Generator
) -> Array:
    """Range, azimuth and elevation with independent normal errors, (steps, runs, 3).

    Parameters
    ----------
    track : Track
    sigmas : (range, azimuth, elevation)
        Standard deviations in m, rad, rad.
    runs, seed
        As in `measure_cartesian`.

    The azimuth lies between -pi and pi, so it jumps where the flight crosses the negative x axis: a
    model of these measurements needs `angles=["y2"]`.
    """
    if np.ndim(sigmas) == 0:
        raise ValueError(
            f"a range is in m and angles in rad: sigmas must be three, (range, azimuth, "
            f"elevation), got {sigmas!r}"
        )
    return on_circle(_noisy(spherical(track.position), sigmas, runs, seed), (1,))


def _noisy(
    true: Array, sigmas: float | Sequence[float], runs: int, seed: int | np.random.Generator
) -> Array:
    deviations = np.asarray(sigmas, dtype=float)
    good = np.isfinite(deviations).all() and (deviations >= 0).all()
    if deviations.shape not in ((), (3,)) or not good:
        raise ValueError(
            f"sigmas must be one number or three, finite and not negative; got {sigmas!r}"
        )
    expect_sizes(runs=runs)
    noise = np.random.default_rng(seed).standard_normal((len(true), int(runs), 3))
    return true[:, None, :] + deviations * noise


def kinematic(
    interval: float, *, dimensions: int = 3, noise_sd: float = 1.0, measurement_sd: float = 1.0
) -> Model:
    """Motion with a velocity that is nearly constant, its position measured.

    The acceleration v_k is constant over an interval T, and independent of the last:

        r' = r + T s + T^2/2 v,   s' = s + T v

    Parameters
    ----------
    interval : float
        T, s.
    dimensions : int
        1, 2 or 3.  The state is (x, y, z, vx, vy, vz).
    noise_sd, measurement_sd : float
        Standard deviations of v_k, m/s^2, and of the measurements, m.
    """
    if dimensions not in (1, 2, 3):
        raise ValueError(f"dimensions must be 1, 2 or 3, got {dimensions}")
    expect_positive(interval=interval)
    expect_not_negative(noise_sd=noise_sd, measurement_sd=measurement_sd)
    axes = range(1, dimensions + 1)
    places, speeds = "xyz"[:dimensions], [f"v{axis}" for axis in "xyz"[:dimensions]]
    motion = zip(places, speeds, axes, strict=True)
    return Model.define(
        [f"{r} + T*{s} + T**2/2*v{i}" for r, s, i in motion]
        + [f"{s} + T*v{i}" for s, i in zip(speeds, axes, strict=True)],
        [f"{r} + w{i}" for r, i in zip(places, axes, strict=True)],
        {"T": interval},
        symbols={"x": [*places, *speeds]},
        state_noise={"variance": float(noise_sd) ** 2},
        meter_noise={"variance": float(measurement_sd) ** 2},
    )
