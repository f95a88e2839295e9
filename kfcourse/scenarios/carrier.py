"""A carrier of known frequency and unknown phase, for the loops that track it.

State (theta, phi, nu): the known phase of the carrier, the unknown phase in rad, which wanders, and
the frequency offset in rad/s, which wanders too and makes the phase drift.  With N samples a
period, T seconds apart:

    theta' = theta + 2 pi / N,   phi' = phi + T nu + s_phi v_1,   nu' = nu + s_nu v_2,
    y = A cos(theta + phi) + sigma w
"""

from __future__ import annotations

from collections.abc import Sequence

from kfcourse.symbolic.model import Model

# V, V, samples a period, s, rad, rad/s
PARAMETERS = {"A": 1, "sigma": 1, "N": 8, "T": 1 / 8000, "s_phi": 0.03, "s_nu": 8}


def phase_meter(
    order: int = 2,
    mean: Sequence[float] = (0, 0, 0),
    variance: Sequence[float] = (0, 0.1, 60**2),
    **changes: float,
) -> Model:
    """The model above; of order 1 it has no frequency offset.

    theta starts exactly at mean[0] and has no noise: its variance stays zero.

    Parameters
    ----------
    order : {1, 2}
    mean, variance : sequences of three numbers
        Of theta, phi and nu at the start; order 1 does without the last.
    **changes : float
        Other values of `PARAMETERS`.

    Raises
    ------
    ValueError
        Another order, or a name that is not one of the parameters.
    """
    if order not in (1, 2):
        raise ValueError(f"expected the order 1 or 2, got {order}")
    if unknown := sorted(changes.keys() - PARAMETERS.keys()):
        raise ValueError(f"no parameter {', '.join(unknown)}; there are {', '.join(PARAMETERS)}")
    drift = "T*nu + " if order == 2 else ""
    size = order + 1
    return Model.define(
        ["theta + 2*pi/N", f"phi + {drift}s_phi*v1", "nu + s_nu*v2"][:size],
        "A*cos(theta + phi) + sigma*w",
        PARAMETERS | changes,
        symbols={"x": ["theta", "phi", "nu"][:size], "v": ["v1", "v2"][:order], "w": ["w"]},
        prior={"mean": mean[:size], "variance": variance[:size]},
    )
