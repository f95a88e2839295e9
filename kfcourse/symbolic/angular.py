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


def read_angles(given: Names | Mapping[str, Names] | None, x: list[str], y: list[str]) -> Angles:
    """The components named, in a list or under the keys x and y."""
    components, places = {"x": x, "y": y}, dict[str, set[int]](x=set(), y=set())
    for key, names in (given if isinstance(given, Mapping) else {"": given or []}).items():
        for name in [names] if isinstance(names, str) or not isinstance(names, Sequence) else names:
            kinds = [kind for kind in components if name in components[kind] and key in ("", kind)]
            if len(kinds) != 1:
                raise ModelError(
                    f"`angles`: {shown(name)} is not the name of one component; name some of "
                    f"{', '.join(x)} and {', '.join(y)} in a list, or in lists under the keys x "
                    "and y where a state and a measurement have one name"
                )
            places[kinds[0]].add(components[kinds[0]].index(name))
    return Angles(*(tuple(sorted(places[kind])) for kind in components))


def warn_of_angles(
    given: Names | Mapping[str, Names] | None,
    angles: Angles,
    state: Mapping[str, sp.Expr],
    meter: Mapping[str, sp.Expr],
) -> None:
    """AngleWarning for components that are circular by atan2 and may pass from pi to -pi, where
    nothing is said of angles, and for measurements that contain an angle as it is, where nothing is
    said of them."""
    if given is None:
        for equations in (state, meter):
            # an atan2 of a point to the right jumps nowhere
            if circular := [
                name
                for name, equation in equations.items()
                if any(
                    isinstance(part, sp.atan2) and not part.args[1].is_nonnegative
                    for part in _outside_sines(equation)
                )
            ]:
                _warn(
                    f"{' and '.join(circular)}: atan2 jumps from pi to -pi, and a filter takes the "
                    f"jump for an innovation of a turn; say angles=[{_quoted(circular)}], or "
                    f"angles=[] if it is no angle or never comes near pi"
                )
    elif not (isinstance(given, Mapping) and "y" in given):
        turning = [[*state][i] for i in angles.x]
        for i, (name, equation) in enumerate(meter.items()):
            plain = [str(part) for part in _outside_sines(equation) if str(part) in turning]
            if plain and i not in angles.y:
                _warn(
                    f"{name} contains the angle {plain[0]}, which jumps from pi to -pi, outside "
                    f'sin and cos: say angles={{"x": [{_quoted(turning)}], "y": ["{name}"]}}, or '
                    f'"y": [] if it is no angle'
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


def _quoted(names: Sequence[str]) -> str:
    return ", ".join(f'"{name}"' for name in names)


def _outside_sines(formula: sp.Basic) -> Iterator[sp.Basic]:
    """Its parts that stand outside sine, cosine and tangent."""
    if not isinstance(formula, sp.sin | sp.cos | sp.tan):
        yield formula
        for argument in formula.args:
            yield from _outside_sines(argument)
