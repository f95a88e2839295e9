"""Which components of a model are angles, as people say it; and a warning where they should."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.angles import Angles, Components
from kfcourse.symbolic.reading import ModelError, Names, shown


class AngleWarning(UserWarning):
    """A formula finds or contains an angle, and the model does not say that it is one; or an angle
    seems to be in degrees."""


def read_angles(given: Names | None, x: list[str], y: list[str]) -> Angles:
    """The components named."""
    names = () if given is None else given
    if not isinstance(names, Sequence) or any([*x, *y].count(name) != 1 for name in names):
        raise ModelError(
            f"`angles` is a list of names of components, each of one only, such as those of "
            f"{', '.join([*x, *y])}; got {shown(given)}"
        )
    return Angles(*(tuple(i for i, name in enumerate(kind) if name in names) for kind in (x, y)))


def warn_of_angles(
    given: Names | None, turning: Sequence[sp.Symbol], equations: Mapping[str, sp.Expr]
) -> None:
    """AngleWarning for components that may pass from pi to -pi and of which nothing is said: those
    with an atan2, where nothing is said at all, and those that contain an angle as it is."""
    for name, equation in equations.items():
        jumping = [
            part
            for part in _outside_sines(equation)
            if part in turning
            # an atan2 of a point to the right jumps nowhere
            or (given is None and isinstance(part, sp.atan2) and not part.args[1].is_nonnegative)
        ]
        if jumping and name not in (given or ()):
            quoted = ", ".join(f'"{angle}"' for angle in [*(given or ()), name])
            _warn(
                f"{name} contains the angle {jumping[0]}, which jumps from pi to -pi, outside sin "
                "and cos, and a filter takes the jump for an innovation of a turn: say "
                f"angles=[{quoted}], or angles=[] if nothing comes near pi"
            )


def warn_of_degrees(what: str, values: Any, names: Sequence[str], angles: Components) -> None:
    """AngleWarning for angles (..., components) beyond a turn."""
    for i in angles:
        beyond = np.nanmax(np.abs(np.asarray(values, dtype=float)[..., i]), initial=0.0)
        if beyond > 2 * np.pi:
            _warn(
                f"{what} of the angle {names[i]} is {beyond:.6g}, beyond 2 pi: angles are in "
                f"radians; "
                "turn degrees into them by numpy.deg2rad"
            )


def _warn(text: str) -> None:
    warnings.warn(text, AngleWarning, stacklevel=4)  # where Model.define was called


def _outside_sines(formula: sp.Basic) -> Iterator[sp.Basic]:
    """Its parts that stand outside sine, cosine and tangent."""
    if not isinstance(formula, sp.sin | sp.cos | sp.tan):
        yield formula
        for argument in formula.args:
            yield from _outside_sines(argument)
