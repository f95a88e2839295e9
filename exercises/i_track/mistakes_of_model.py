"""Known mistakes in the model: its matrices (i1), its noise (i2), start-up (i3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import sympy as sp

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.i_track.keys import matrices, process_noise, start_up
from kfcourse.scenarios.pointer import DT, SENSITIVITY, TRANSITION

Formula = Callable[[sp.Expr], sp.Expr]  # of dt

# -- i1, i2: the matrices of uniformly accelerated motion


def plane(on_axis: sp.Matrix | Sequence[sp.Expr]) -> sp.ImmutableMatrix:
    """The same matrix on both axes, state (x, y, vx, vy)."""
    return sp.ImmutableMatrix(sp.kronecker_product(sp.Matrix(on_axis), sp.eye(2)))


def interleaved(matrix: sp.MatrixBase) -> sp.ImmutableMatrix:
    """The rows, and the columns if there are four, in the order (x, vx, y, vy)."""
    order = [0, 2, 1, 3]
    rows = order if matrix.rows == 4 else range(matrix.rows)
    columns = order if matrix.cols == 4 else range(matrix.cols)
    return sp.ImmutableMatrix(matrix.extract(list(rows), list(columns)))


def with_input(top: Formula, bottom: Formula = lambda dt: dt) -> Answer:
    """The right A and H with another B: entries for position and velocity."""
    return lambda dt: (TRANSITION.subs(DT, dt), plane([top(dt), bottom(dt)]), SENSITIVITY)


WRONG_MATRICES: tuple[tuple[str, str, Answer], ...] = (
    (
        "time-missing",
        "The time between samples is missing: a velocity has to be multiplied by it before it is added to a position.",
        lambda dt: matrices(1),
    ),
    ("half-missing", messages.HALF_MISSING, with_input(lambda dt: dt**2)),
    ("first-order", "The acceleration acts on the position too, within the same interval.", with_input(lambda dt: 0)),
    (
        "power-of-dt",
        "A power of dt is wrong in B: the units of an acceleration times it are those of a position, or of a velocity.",
        with_input(lambda dt: dt / 2, lambda dt: 1),
    ),
    (
        "transposed",
        "It looks transposed: row i says how component i of the next state is made.",
        lambda dt: tuple(matrix.T if matrix.rows == matrix.cols else matrix for matrix in matrices(dt)),
    ),
    ("order-of-components", messages.ORDER_OF_COMPONENTS, lambda dt: tuple(interleaved(matrix) for matrix in matrices(dt))),
    (
        "velocity-measured",
        "H takes the velocities out of the state; the meter gives the positions.",
        lambda dt: (*matrices(dt)[:2], SENSITIVITY.extract([0, 1], [2, 3, 0, 1])),
    ),
    (
        "blocks-swapped",
        "The effects on position and velocity stand in each other's place.",
        with_input(lambda dt: dt, lambda dt: dt**2 / 2),
    ),
    (
        "velocity-measured",
        "H adds the velocities to the positions; the meter gives the positions alone.",
        lambda dt: (*matrices(dt)[:2], sp.ImmutableMatrix(SENSITIVITY + SENSITIVITY.extract([0, 1], [2, 3, 0, 1]))),
    ),
    (
        "identity-forgotten",
        "A state that is left alone stays: the identity is missing.",
        lambda dt: (matrices(dt)[0] - sp.eye(4), *matrices(dt)[1:]),
    ),
    (
        "once-more-integrated",
        "B is integrated once too often: check the units.",
        with_input(lambda dt: dt**3 / 6, lambda dt: dt**2 / 2),
    ),
    ("velocity-for-acceleration", "B is integrated once too little: check the units.", with_input(lambda dt: dt, lambda dt: 1)),
    (
        "axes-mixed",
        "An acceleration along one axis moves that axis only.",
        lambda dt: (
            matrices(dt)[0],
            sp.ImmutableMatrix(sp.kronecker_product(sp.Matrix([dt**2 / 2, dt]), sp.ones(2))),
            SENSITIVITY,
        ),
    ),
)


def noise_by(column: Callable[[sp.Expr], list[sp.Expr]]) -> Answer:
    """sigma_a^2 b b^T on each axis, with another column b."""
    return lambda dt, sigma_a: plane(sigma_a**2 * sp.Matrix(column(dt)) * sp.Matrix(column(dt)).T)


WRONG_NOISES: tuple[tuple[str, str, Answer], ...] = (
    (
        "deviation-for-variance",
        "The standard deviation of the acceleration stands where its variance belongs.",
        lambda dt, sigma_a: process_noise(dt, sigma_a) / sigma_a,
    ),
    (
        "diagonal",
        "Only the diagonal is there. One and the same acceleration moves position and velocity, so their errors are correlated.",
        lambda dt, sigma_a: sp.diag(*[process_noise(dt, sigma_a)[i, i] for i in range(4)]),
    ),
    (
        "axes-coupled",
        "The two axes are correlated. Each has an acceleration of its own, independent of the other's.",
        lambda dt, sigma_a: (
            sigma_a**2
            * sp.kronecker_product(sp.Matrix([dt**2 / 2, dt]) * sp.Matrix([[dt**2 / 2, dt]]), sp.ones(2)).as_immutable()
        ),
    ),
    (
        "white-in-continuous-time",
        messages.WHITE_IN_CONTINUOUS_TIME,
        lambda dt, sigma_a: plane(sigma_a**2 * sp.Matrix([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])),
    ),
    ("half-missing", messages.HALF_MISSING, noise_by(lambda dt: [dt**2, dt])),
    ("position-forgotten", "The acceleration shakes the position too, not only the velocity.", noise_by(lambda dt: [0, dt])),
    ("power-of-dt", messages.POWER_OF_DT, noise_by(lambda dt: [dt / 2, 1])),
    (
        "input-once",
        "The effect of the acceleration enters once; a covariance has it on both sides, B ... B^T.",
        lambda dt, sigma_a: plane(sigma_a**2 * sp.diag(dt**2 / 2, dt)),
    ),
    ("order-of-components", messages.ORDER_OF_COMPONENTS, lambda dt, sigma_a: interleaved(process_noise(dt, sigma_a))),
    (
        "correlation-sign",
        messages.CORRELATION_SIGN,
        noise_by(lambda dt: [dt**2 / 2, -dt]),
    ),
    (
        "half-missing",
        "A factor is wrong where the acceleration acts on the position: in its variance it is squared.",
        lambda dt, sigma_a: plane(sigma_a**2 * sp.Matrix([[dt**4 / 2, dt**3 / 2], [dt**3 / 2, dt**2]])),
    ),
    (
        "transition-for-input",
        "The transition stands where the input's matrix belongs.",
        lambda dt, sigma_a: sigma_a**2 * matrices(dt)[0] * matrices(dt)[0].T,
    ),
    ("power-missing", "The column is integrated once too little: check the units.", noise_by(lambda dt: [dt, 1])),
    *(
        (
            "covariance-of-two",
            "The covariance of position and velocity has a wrong factor: multiply the two entries of B.",
            lambda dt, sigma_a, factor=factor: plane(
                sigma_a**2 * sp.Matrix([[dt**4 / 4, factor * dt**3], [factor * dt**3, dt**2]])
            ),
        )
        for factor in (1, sp.Rational(1, 4), sp.Rational(1, 3))
    ),
)


# -- i3: start-up from three samples


def second_difference(y0: sp.Expr, y1: sp.Expr, y2: sp.Expr) -> sp.Expr:
    """y2 - 2 y1 + y0."""
    return y2 - 2 * y1 + y0


WRONG_STARTS: tuple[tuple[str, str, Answer], ...] = (
    (
        "first-difference",
        "The last difference is the velocity in the middle of the last interval; it changes until the last sample.",
        lambda y0, y1, y2, dt: (y2, (y2 - y1) / dt, second_difference(y0, y1, y2) / dt**2),
    ),
    (
        "middle-sample",
        "These belong to the middle sample; the filter starts at the last one.",
        lambda y0, y1, y2, dt: (y1, (y2 - y0) / (2 * dt), second_difference(y0, y1, y2) / dt**2),
    ),
    (
        "first-sample",
        "These belong to the first sample; the filter starts at the last one.",
        lambda y0, y1, y2, dt: (y0, (4 * y1 - 3 * y0 - y2) / (2 * dt), second_difference(y0, y1, y2) / dt**2),
    ),
    ("samples-reversed", "The samples seem to be taken in the reverse order.", lambda y0, y1, y2, dt: start_up(y2, y1, y0, dt)),
    (
        "moved-too-far",
        "The first difference is moved on by a whole interval; it belongs to the middle of one.",
        lambda y0, y1, y2, dt: (y2, (y2 - y1 + second_difference(y0, y1, y2)) / dt, second_difference(y0, y1, y2) / dt**2),
    ),
    (
        "coefficient-for-acceleration",
        "That is the coefficient of the parabola's square; an acceleration is a second derivative.",
        lambda y0, y1, y2, dt: (*start_up(y0, y1, y2, dt)[:2], second_difference(y0, y1, y2) / (2 * dt**2)),
    ),
    (
        "power-of-dt",
        messages.POWER_OF_DT,
        lambda y0, y1, y2, dt: (y2, start_up(y0, y1, y2, dt)[1] * dt, second_difference(y0, y1, y2) / dt),
    ),
    (
        "averaged",
        "The mean of the samples is no estimate of the last position: the object moves.",
        lambda y0, y1, y2, dt: ((y0 + y1 + y2) / 3, *start_up(y0, y1, y2, dt)[1:]),
    ),
    (
        "power-of-dt",
        messages.POWER_OF_DT,
        lambda y0, y1, y2, dt: (y2, y2 - y1 + second_difference(y0, y1, y2) / (2 * dt**2), second_difference(y0, y1, y2) / dt**2),
    ),
)
