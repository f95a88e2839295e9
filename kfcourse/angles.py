"""Angles: 359 degrees and 1 degree are neighbours, and so are pi - 0.01 and -pi + 0.01.

A component that is an angle, in radians, is kept between -pi and pi.  A difference of two angles is
the short way round. Components are named by their numbers: `which` is (1,) if the second one is an
angle, () if none is, which costs nothing.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[Any]
Components: TypeAlias = tuple[int, ...]

TURN = 2 * np.pi


class Angles(NamedTuple):
    """The components of a model's state and of its measurement that are angles."""

    x: Components = ()
    y: Components = ()


def wrapped(angle: Array) -> Array:
    """The same angle between -pi and pi; one that lies there already is not changed by a bit."""
    return angle - TURN * np.round(angle / TURN)


def on_circle(vector: Array, which: Components) -> Array:
    """A vector (..., n) with its angles between -pi and pi."""
    if not which:
        return vector
    # whole numbers would cut the angles off
    result = np.array(vector, dtype=np.result_type(vector, 0.0))
    for i in which:  # views: of few trajectories in half the time of picking columns
        result[..., i] = wrapped(result[..., i])
    return result


def difference(left: Array, right: Array, which: Components) -> Array:
    """left - right, (..., n), for angles the short way round."""
    return on_circle(left - right, which)


def near(vector: Array, reference: Array, which: Components) -> Array:
    """The vector (..., n) with whole turns added to its angles, so that they lie within half a turn
    of the reference's."""
    if not which:
        return vector
    return reference + difference(vector, reference, which)


def moments_on_circle(angle: Array, mass: Array) -> tuple[Array, Array]:
    """Mean and variance of masses, in all 1, at angles: (..., M), (..., M) -> (...), (...), as seen
    from their circular mean.

    c = arg sum_j m_j exp(i x_j),   `mean` = c + sum_j m_j `wrapped`(x_j - c)
    """
    centre = np.angle((mass * np.exp(1j * angle)).sum(axis=-1))
    deviation = wrapped(angle - centre[..., None])
    shift = (mass * deviation).sum(axis=-1)
    return wrapped(centre + shift), (mass * (deviation - shift[..., None]) ** 2).sum(axis=-1)
