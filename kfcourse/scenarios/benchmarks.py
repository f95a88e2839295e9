"""Models on which the field compares its filters, and what was published of them.

pendulum()               Särkkä and Svensson (2023), with their data: `pendulum_data()`
car()                    from the same book, linear: `car_data()`
growth_model(variance)   the univariate nonstationary growth model (Gordon, Salmond and Smith, 1993)
cubic_sensor()           the conditionally minimax line (Pankov, Bosov and Borisov), with
                         logistic(), inverse_cube_root()
lorenz(noise)            the attractor of Lorenz (1963), and measurements of it: `lorenz_data(...)`
stochastic_volatility()  a state that shows only in the measurement's variance
bearings()               two bearings of a target (Hartikainen, Solin and Särkkä, 2011), with its
                         course: `bearings_data(...)`
reentry(known)           a vehicle that enters the atmosphere (Julier and Uhlmann, 2004), seen by a
                         radar
passing_target(angles)   a target whose bearing jumps by a turn
exact_mul(a, b)          with double_well(a, b, s) two of Jimenez's objects in continuous time, with
                         his data: `jimenez_data(name)`
benes(interval, r)       the object in continuous time whose filter is known exactly (Benes, 1981)
local_level(q, r)        a level that wanders, as the flow of the Nile 1871-1970 (Cobb, 1978):
                         `nile()`
"""

from __future__ import annotations

import json
import tomllib
from importlib import resources
from typing import Any

import numpy as np

from kfcourse.continuous.sampling import sampled
from kfcourse.errors import expect_sizes
from kfcourse.laws import Array
from kfcourse.montecarlo.ensemble import simulate
from kfcourse.symbolic.model import Model

DATA = resources.files("kfcourse.scenarios") / "data"
MODELS = tomllib.loads((DATA / "benchmarks.toml").read_text(encoding="utf-8"))

# What was published, by name; of whom and of what data/benchmarks.toml says.
PUBLISHED: dict[str, Any] = MODELS["published"]
LORENZ_EVERY = 25  # steps between measurements


def _model(name: str, **changes: Any) -> Model:
    table = MODELS[name] | changes
    return (sampled if "drift" in table else Model.define)(**table)


def _wander(dt: float) -> Array:
    """Covariance of position and velocity that a white acceleration of intensity one makes in
    dt."""
    return np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])


def pendulum() -> Model:
    """The angle and angular velocity of a pendulum, x1' = x1 + dt x2, x2' = x2 - g dt sin(x1), y =
    sin(x1); noises added.

    The law N(0, I) is that before the first prediction: filters of this package, which correct
    first, need a missing measurement before the data.
    """
    return _model("pendulum", state_noise={"variance": 0.01 * _wander(0.01)})


def pendulum_data() -> tuple[Array, Array]:
    """States (500, 2) and measurements (501, 1, 1) of the book's simulation; the first measurement
    is missing (NaN)."""
    return _simulation("pendulum")


def car() -> Model:
    """A car in the plane with nearly constant velocity, its position measured.

    As of `pendulum`, the law is that before the first prediction.
    """
    return _model("car", state_noise={"variance": np.kron(_wander(0.1), np.eye(2))})


def car_data() -> tuple[Array, Array]:
    """States (100, 4) and measurements (101, 1, 2) of the book's simulation; the first measurement
    is missing (NaN)."""
    return _simulation("car_track")


def _simulation(name: str) -> tuple[Array, Array]:
    """States and measurements of a simulation of the book, a missing measurement before them."""
    data = json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))
    x, y = (np.atleast_2d(data[letter]).T for letter in "XY")
    return x, np.concatenate([np.full((1, y.shape[1]), np.nan), y])[:, None]


def growth_model(variance: float = 1) -> Model:
    """x' = x/2 + 25 x/(1 + x^2) + 8 cos(1.2 k) + v,  y = x^2/20 + w;  x_0 ~ N(0, 5), w ~ N(0, 1), v
    of this variance."""
    return _model("growth_model", state_noise={"variance": variance})


def cubic_sensor() -> Model:
    """x' = x/(1 + x^2) + v,  y = x^3 + x + w;  x_0 ~ N(0.1, 1)."""
    return _model("cubic_sensor")


def logistic() -> Model:
    """x' = max(-10^4, x(1 - x)) + v,  y = x + w;  x_0 ~ N(0.1, 0.01).  Above, x(1 - x) <= 1/4."""
    return _model("logistic")


def inverse_cube_root() -> Model:
    """x' = min(100, x^(-1/3)) + v with the odd root,  y = x + w;  x_0 ~ N(3.01, 1)."""
    return _model("inverse_cube_root")


def lorenz(noise: float) -> Model:
    """x1' = 10(x2 - x1), x2' = 28 x1 - x2 - x1 x3, x3' = x1 x2 - 8/3 x3 over .01 by Heun's rule, +
    noise v; y = x + sqrt(2) w.

    The attractor has no noise; a filter needs some, or it becomes sure of itself and loses what
    runs apart.
    """

    def slope(x: str, y: str, z: str) -> tuple[str, str, str]:
        return f"10*(({y}) - ({x}))", f"28*({x}) - ({y}) - ({x})*({z})", f"({x})*({y}) - 8*({z})/3"

    state = ("x1", "x2", "x3")
    first = slope(*state)
    second = slope(*(f"{x} + T*({k})" for x, k in zip(state, first, strict=True)))
    return Model.define(
        [
            f"{x} + T/2*({k} + {m}) + s*v{i}"
            for i, x, k, m in zip((1, 2, 3), state, first, second, strict=True)
        ],
        [f"{x} + sqrt(2)*w{i}" for i, x in zip((1, 2, 3), state, strict=True)],
        {"T": 0.01, "s": noise},
        prior={"mean": [1.509, -1.531, 25.46], "variance": [2, 2, 2]},
    )


def lorenz_data(runs: int, measured: int, seed: int) -> tuple[Array, Array]:
    """Trajectories of the attractor, x (25 measured + 1, runs, 3), and y, which is NaN but at every
    25th step from the 25th."""
    x, y = simulate(lorenz(0), runs, LORENZ_EVERY * measured + 1, seed)
    seen = np.zeros((len(y), 1, 1), dtype=bool)
    seen[LORENZ_EVERY::LORENZ_EVERY] = True
    return x, np.where(seen, y, np.nan)


def stochastic_volatility() -> Model:
    """x' = 0.95 x + 0.25 v,  y = exp(x/2) w: the measurement has mean zero whatever the state."""
    return _model("stochastic_volatility")


def bearings() -> Model:
    """A target with nearly constant velocity, seen under two angles from (-1, -2) and (1, 1).

    As of `pendulum`, the law is that before the first prediction.
    """
    noise = 0.1 * np.kron(_wander(0.01), np.eye(2))
    return _model("bearings", state_noise={"variance": noise}, meter_noise={"variance": 0.05**2})


def bearings_data(runs: int, seed: int | np.random.Generator) -> tuple[Array, Array]:
    """Courses (500, runs, 2) with three turns of 90 degrees, and measurements (501, runs, 2), the
    first of them missing.

    The courses do not come from the model: speed 1, and a turn rate of pi/2 in 0.51 s, with an
    error of 0.01 a step.
    """
    expect_sizes(runs=runs)
    rng, dt = np.random.default_rng(seed), 0.01
    rate = np.zeros((500, runs))
    for start in (49, 199, 349):
        rate[start : start + 51] = np.pi / 2 / (51 * dt) + 0.01 * rng.standard_normal((51, runs))
    # On an arc the chord of a step points into the mean direction, and is shorter than the arc.
    turned = -rate * dt
    direction = np.cumsum(turned, axis=0) - turned / 2
    chord = dt * np.sinc(turned / (2 * np.pi))
    x = np.cumsum(
        chord[..., None] * np.stack([np.cos(direction), np.sin(direction)], axis=-1), axis=0
    )
    seen = [np.arctan2(x[..., 1] - y, x[..., 0] - x0) for x0, y in ((-1, -2), (1, 1))]
    noisy = np.stack(seen, axis=-1) + 0.05 * rng.standard_normal((500, runs, 2))
    return x, np.concatenate([np.full((1, runs, 2), np.nan), noisy])


def reentry(known: bool) -> Model:
    """A vehicle under drag and gravity (km, s), its range and bearing measured; Euler's scheme with
    0.1 s.

    x5 is the logarithm of the ballistic coefficient over b0.  It is 0.6932; known, as the
    trajectories are simulated, or for the filters N(0, 1).  As of `pendulum`, the law is that
    before the first prediction.
    """
    mean = [6500.4, 349.14, -1.8093, -6.7967, 0.6932 * known]
    prior = {"mean": mean, "variance": [1e-6] * 4 + [0 if known else 1]}
    noise = {"variance": [2.4064e-5, 2.4064e-5, 0 if known else 1e-6]}
    return _model("reentry", prior=prior, state_noise=noise)


def passing_target(angles: list[str]) -> Model:
    """A target 10 km west of a radar, flying south: its bearing, y2, jumps from pi to -pi after
    about 20 s."""
    return _model("passing_target", angles=angles)


def local_level(q: float = 1468.5, r: float = 15099.7) -> Model:
    """x' = x + v, y = x + w with variances q and r; N(0, 10^7) before the first measurement."""
    return _model("local_level", parameters={"q": q, "r": r})


def nile() -> Array:
    """Annual flow of the Nile at Aswan from 1871 to 1970, 10^8 m^3, (100, 1, 1)."""
    return _columns("nile.csv")[1][:, None, None]


def jimenez_data(name: str) -> tuple[Array, Array]:
    """Instants (steps,) and measurements (steps, 1, 1) of "exact-mul" or "double-well"; licence:
    data/LICENSE-jimenez.txt."""
    t, y = _columns(f"jimenez-{name}.csv")
    return t, y[:, None, None]


def _columns(name: str) -> Array:
    lines = (DATA / name).read_text(encoding="utf-8").splitlines()
    return np.loadtxt(lines, delimiter=",", skiprows=1).T


def exact_mul(a: float, b: float, **options: Any) -> Model:
    """dx = a t x dt + b sqrt(t) x dw, x(0.5) = 1, y = x + w with variance 1e-4 at his instants: its
    moments are known exactly."""
    instants = jimenez_data("exact-mul")[0].tolist()
    return _model("exact_mul", parameters={"a": a, "b": b}, instants=instants, **options)


def double_well(a: float, b: float, s: float, **options: Any) -> Model:
    """dx = -(a x + b x^3) dt + s dw, x(0) = 0, seen without error every second."""
    return _model("double_well", parameters={"a": a, "b": b, "s": s}, **options)


def benes(interval: float = 0.2, **options: Any) -> Model:
    """dx = tanh(x) dt + dw, x(0) = 0.1, y = x + w with variance 0.1: as Sarkka and Solin (2019)
    have it, but for a known start."""
    return _model("benes", interval=interval, **options)
