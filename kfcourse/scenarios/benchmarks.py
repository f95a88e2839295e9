"""Models on which the field compares its filters, and what was published of them.

pendulum()               Särkkä and Svensson (2023), with their data: `pendulum_data()`
growth_model(variance)   the univariate nonstationary growth model (Gordon, Salmond and Smith, 1993)
stochastic_volatility()  a state that shows only in the measurement's variance
passing_target(angles)   a target whose bearing jumps by a turn
"""

from __future__ import annotations

import json
from importlib import resources

import numpy as np

from kfcourse.laws import Array
from kfcourse.symbolic.model import Model

# Root mean square errors of the angle over the 500 steps of the data, as Särkkä and Svensson's notebooks print them.
PENDULUM_ERRORS = {"EKF": 0.16830859061153763, "UKF": 0.09524392125923083, "Gauss-Hermite 5": 0.0998062421916222}

# Mean square errors on the growth model with a state noise of variance one, 100 runs of 500 steps, computed with other programs.
GROWTH_ERRORS = {"EKF": 115.8, "Gauss-Hermite 5": 59.2, "Gauss-Hermite 10": 41.4}


def pendulum() -> Model:
    """The angle and angular velocity of a pendulum, x1' = x1 + dt x2, x2' = x2 - g dt sin(x1), y = sin(x1); noises added.

    The law N(0, I) is that before the first prediction: filters of this package, which correct first, need a missing
    measurement before the data.
    """
    dt = 0.01
    return Model.define(
        ["x1 + dt*x2 + v1", "x2 - g*dt*sin(x1) + v2"],
        "sin(x1) + w1",
        {"dt": dt, "g": 9.81},
        state_noise={"variance": 0.01 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])},
        meter_noise={"variance": 0.1},
    )


def pendulum_data() -> tuple[Array, Array]:
    """States (500, 2) and measurements (501, 1, 1) of the book's simulation; the first measurement is missing (NaN)."""
    text = (resources.files("kfcourse.scenarios") / "data" / "pendulum.json").read_text(encoding="utf-8")
    data = json.loads(text)
    y = np.concatenate([[np.nan], np.ravel(data["Y"])])
    return np.transpose(data["X"]), y[:, None, None]


def growth_model(variance: float = 1) -> Model:
    """x' = x/2 + 25 x/(1 + x^2) + 8 cos(1.2 k) + v,  y = x^2/20 + w;  x_0 ~ N(0, 5), w ~ N(0, 1), v of this variance."""
    return Model.define(
        "x/2 + 25*x/(1 + x**2) + 8*cos(1.2*k) + v",
        "x**2/20 + w",
        prior={"mean": 0, "variance": 5},
        state_noise={"variance": variance},
    )


def stochastic_volatility() -> Model:
    """x' = 0.95 x + 0.25 v,  y = exp(x/2) w: the measurement has mean zero whatever the state."""
    return Model.define("a*x + s*v", "exp(x/2)*w", {"a": 0.95, "s": 0.25}, prior={"mean": 0, "variance": 0.25**2 / (1 - 0.95**2)})


def passing_target(angles: list[str]) -> Model:
    """A target 10 km west of a radar, flying south: its bearing, y2, jumps from pi to -pi after about 20 s."""
    return Model.define(
        ["x + T*vx", "y + T*vy", "vx + s*v1", "vy + s*v2"],
        ["sqrt(x**2 + y**2) + s_r*w1", "atan2(y, x) + s_a*w2"],
        {"T": 1.0, "s": 1.0, "s_r": 50, "s_a": 0.01},
        symbols={"x": ["x", "y", "vx", "vy"]},
        angles=angles,
        prior={"mean": [-10_000, 3_000, 20, -150], "variance": np.square([100, 100, 15, 15])},
    )
