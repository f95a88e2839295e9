"""Known mistakes in what the radar measures: coordinates (j1), their derivatives (j2)."""

from __future__ import annotations

import sympy as sp

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.j_radar.keys import MEASURED, POSITION, cartesian, derived, jacobian_of, meter_jacobian
from kfcourse.scenarios.radar import CARTESIAN, SPHERICAL, X, Y, Z

# -- j1, j2: what the radar measures

WRONG_CARTESIANS: tuple[tuple[str, str, Answer], ...] = (
    ("azimuth-from-y", messages.AZIMUTH_FROM_Y, lambda r, phi, eps: cartesian(r, sp.pi / 2 - phi, eps)),
    ("azimuth-sense", "The azimuth turns the other way: it grows from x towards y.", lambda r, phi, eps: cartesian(r, -phi, eps)),
    (
        "from-the-zenith",
        "The elevation is counted from the vertical; here it is the angle above the horizon.",
        lambda r, phi, eps: cartesian(r, phi, sp.pi / 2 - eps),
    ),
    (
        "slant-range",
        "The range is taken along the ground; it goes to the aircraft, and only its projection lies on the ground.",
        lambda r, phi, eps: (r * sp.cos(phi), r * sp.sin(phi), r * sp.sin(eps)),
    ),
    (
        "height-by-tangent",
        "The height is found as if the range were the distance along the ground.",
        lambda r, phi, eps: (*cartesian(r, phi, eps)[:2], r * sp.tan(eps)),
    ),
    (
        "degrees",
        "The angles are turned from degrees into radians; they are in radians already.",
        lambda r, phi, eps: cartesian(r, phi * sp.pi / 180, eps * sp.pi / 180),
    ),
)

SLANT, GROUND = sp.sqrt(X**2 + Y**2 + Z**2), sp.sqrt(X**2 + Y**2)


def _with_row(place: int, row: list[sp.Expr]) -> sp.Matrix:
    """The derivatives with another row."""
    matrix = sp.Matrix([[SLANT.diff(v) for v in POSITION]])
    rows = [*SPHERICAL[1:]]
    matrix = matrix.col_join(sp.Matrix(rows).jacobian(POSITION))
    matrix[place, :] = sp.Matrix([row])
    return matrix


WRONG_JACOBIANS: tuple[tuple[str, str, Answer], ...] = (
    (
        "transposed",
        "It looks transposed: row i holds the derivatives of measurement i.",
        lambda x, y, z: meter_jacobian(x, y, z).T,
    ),
    (
        "inverse",
        "These are the derivatives of the position by range and angles; the meter goes the other way.",
        derived(lambda: CARTESIAN.jacobian(MEASURED).subs(dict(zip(MEASURED, SPHERICAL, strict=True)), simultaneous=True)),
    ),
    (
        "azimuth-reversed",
        "All signs in the row of the azimuth are reversed: it is counted from x towards y.",
        jacobian_of([SPHERICAL[0], sp.atan2(X, Y), SPHERICAL[2]]),
    ),
    (
        "elevation-reversed",
        "All signs in the row of the elevation are reversed: it grows with the height.",
        jacobian_of([*SPHERICAL[:2], -SPHERICAL[2]]),
    ),
    (
        "height-over-slant",
        "The tangent of the elevation is the height over the distance along the ground.",
        jacobian_of([*SPHERICAL[:2], sp.atan(Z / SLANT)]),
    ),
    ("height-over-x", "The distance along the ground is made of x and y both.", jacobian_of([*SPHERICAL[:2], sp.atan(Z / X)])),
    ("range-squared", "The square of the range is differentiated, not the range.", jacobian_of([SLANT**2, *SPHERICAL[1:]])),
    (
        "degrees",
        "The angles are in degrees; radians are asked for.",
        jacobian_of([SPHERICAL[0], SPHERICAL[1] * 180 / sp.pi, SPHERICAL[2] * 180 / sp.pi]),
    ),
    (
        "root-forgotten",
        "A power of a distance is wrong in the row of the azimuth: an angle's derivative is one over a length.",
        derived(lambda: _with_row(1, [-Y / GROUND, X / GROUND, 0])),
    ),
    (
        "root-forgotten",
        "A power of a distance is wrong in the row of the elevation: an angle's derivative is one over a length.",
        derived(lambda: _with_row(2, [-X * Z / SLANT**2, -Y * Z / SLANT**2, GROUND / SLANT**2])),
    ),
    (
        "sine-and-cosine-swapped",
        "x and y are swapped in the row of the azimuth: the derivative by x has y above.",
        derived(lambda: _with_row(1, [X / GROUND**2, -Y / GROUND**2, 0])),
    ),
    *(
        (
            "order",
            "The rows are in another order: range, azimuth, elevation.",
            jacobian_of([SPHERICAL[i] for i in order]),
        )
        for order in ((0, 2, 1), (1, 2, 0), (1, 0, 2))
    ),
    (
        "tangent-for-angle",
        "The tangents of the angles are differentiated, not the angles.",
        jacobian_of([SPHERICAL[0], Y / X, Z / GROUND]),
    ),
    ("sine-for-angle", "The sine of the elevation is differentiated, not the angle.", jacobian_of([*SPHERICAL[:2], Z / SLANT])),
    (
        "ground-fixed",
        "In the elevation the distance along the ground depends on x and y too.",
        derived(
            lambda: (
                sp.Matrix([SPHERICAL[0], SPHERICAL[1], 0]).jacobian(POSITION)
                + sp.Matrix([[0] * 3, [0] * 3, [0, 0, GROUND / SLANT**2]])
            )
        ),
    ),
    (
        "range-for-ground",
        "In the azimuth the distance is that along the ground: the height does not turn it.",
        derived(
            lambda: (
                sp.Matrix([SPHERICAL[0], 0, SPHERICAL[2]]).jacobian(POSITION)
                + sp.Matrix([[0] * 3, [-Y / SLANT**2, X / SLANT**2, 0], [0] * 3])
            )
        ),
    ),
    (
        "ground-range",
        "The first measurement is the range to the aircraft, not the distance along the ground.",
        jacobian_of([GROUND, *SPHERICAL[1:]]),
    ),
)
