"""A body thrown into the air, and the radar that sees its range and its elevation.

State (s, a, v_s, v_a): distance along the ground and height in m, and their velocities in m/s.
Gravity and a drag that grows with the square of the speed act on it, xi is white noise:

    v_s' = v_s - T kappa |v| v_s + sigma_v xi_1,
    v_a' = v_a - T (kappa |v| v_a + gamma) + sigma_v xi_2
"""

from __future__ import annotations

import numpy as np

from kfcourse.symbolic.model import Model

# s, 1/m, m/s^2; standard deviations in m/s, m, rad
PARAMETERS = {
    "T": 0.5,
    "kappa": 5e-5,
    "gamma": 9.81,
    "sigma_v": 1.5,
    "sigma_r": 50,
    "sigma_e": 0.01,
}


def thrown_body(vague: float = 1, **changes: float) -> Model:
    """The model s' = s + T v_s, a' = a + T v_a, with the velocities above, y = (sqrt(s^2 + a^2),
    atan2(a, s)) and noises.

    Parameters
    ----------
    vague : float
        Multiplies the standard deviations of the initial law, (300 m, 300 m, 30 m/s, 30 m/s).
    **changes : float
        Other values of `PARAMETERS`: interval T in s, drag kappa in 1/m, gravity gamma in m/s^2,
        standard deviations sigma_v of the velocity's noise in m/s, sigma_r of the range in m,
        sigma_e of the elevation in rad.

    Raises
    ------
    ValueError
        A name that is not one of the parameters.
    """
    if unknown := sorted(changes.keys() - PARAMETERS.keys()):
        raise ValueError(f"no parameter {', '.join(unknown)}; there are {', '.join(PARAMETERS)}")
    speed = "sqrt(v_s**2 + v_a**2)"
    return Model.define(
        [
            "s + T*v_s",
            "a + T*v_a",
            f"v_s - T*kappa*{speed}*v_s + sigma_v*xi1",
            f"v_a - T*(kappa*{speed}*v_a + gamma) + sigma_v*xi2",
        ],
        ["sqrt(s**2 + a**2) + sigma_r*n1", "atan2(a, s) + sigma_e*n2"],
        PARAMETERS | changes,
        symbols={"x": ["s", "a", "v_s", "v_a"], "v": ["xi1", "xi2"], "w": ["n1", "n2"]},
        prior={
            "mean": [14_000, 3_000, -350, 120],
            "variance": (vague * np.array([300, 300, 30, 30])) ** 2,
        },
        angles=["y2"],
    )
