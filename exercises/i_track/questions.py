"""Questions of set i, a track in the plane and numerical care, and of set j, an alpha-beta filter on a radar track.

What is derived is answered with formulas in the symbols of the arguments, what runs with arrays.  Personal numbers are in
`track_numbers` and `radar_numbers`; hidden arguments are others, so an answer holds for any.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.checks.exercises import Exercise
from kfcourse.checks.question import Answer, Question, catalogue
from kfcourse.checks.registry import ExerciseSet
from kfcourse.exercises.shared import covariance, personal
from kfcourse.laws import Array, Gaussian, square_root
from kfcourse.linear.arithmetic import FORMS, Root, predict_law
from kfcourse.linear.system import LinearSystem
from kfcourse.scenarios.pointer import DT, INPUT, SENSITIVITY, START, TRANSITION


def track_numbers(exercise: Exercise) -> dict[str, float]:
    """dt (s), sigma (px), sigma_a (px/s^2), and the number of the hand's track."""
    found = personal(
        exercise,
        "i",
        {"dt": 0.01, "sigma": 8.0, "sigma_a": 7100.0, "track": 7},
        {"dt": (0.008, 0.02), "sigma": (5, 12), "sigma_a": (4000, 9000), "track": (10, 99)},
    )
    return found | {"track": int(found["track"])}


# -- i1, i2: the matrices of uniformly accelerated motion


def plane(on_axis: Any) -> sp.ImmutableMatrix:
    """The same matrix on both axes, state (x, y, vx, vy)."""
    return sp.ImmutableMatrix(sp.kronecker_product(sp.Matrix(on_axis), sp.eye(2)))


def interleaved(matrix: sp.MatrixBase) -> sp.ImmutableMatrix:
    """The rows, and the columns if there are four, in the order (x, vx, y, vy)."""
    order = [0, 2, 1, 3]
    rows = order if matrix.rows == 4 else range(matrix.rows)
    columns = order if matrix.cols == 4 else range(matrix.cols)
    return sp.ImmutableMatrix(matrix.extract(list(rows), list(columns)))


def matrices(dt: Any) -> tuple:
    return TRANSITION.subs(DT, dt), INPUT.subs(DT, dt), SENSITIVITY


def with_input(top: Callable[[Any], Any], bottom: Callable[[Any], Any] = lambda dt: dt) -> Answer:
    """The right A and H with another B: entries for position and velocity."""
    return lambda dt: (TRANSITION.subs(DT, dt), plane([top(dt), bottom(dt)]), SENSITIVITY)


WRONG_MATRICES: tuple[tuple[str, str, Answer], ...] = (
    (
        "time-missing",
        "The time between samples is missing: a velocity has to be multiplied by it before it is added to a position.",
        lambda dt: matrices(1),
    ),
    (
        "half-missing",
        "A factor is missing where the acceleration acts on the position: integrate twice.",
        with_input(lambda dt: dt**2),
    ),
    (
        "first-order",
        "The acceleration acts on the position too, within the same interval.",
        with_input(lambda dt: 0),
    ),
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
    (
        "order-of-components",
        "The order of the components is another: the state is (x, y, vx, vy), both positions first.",
        lambda dt: tuple(interleaved(matrix) for matrix in matrices(dt)),
    ),
    (
        "velocity-measured",
        "H takes the velocities out of the state; the meter gives the positions.",
        lambda dt: (*matrices(dt)[:2], SENSITIVITY.extract([0, 1], [2, 3, 0, 1])),
    ),
)


def process_noise(dt: Any, sigma_a: Any) -> sp.ImmutableMatrix:
    B = INPUT.subs(DT, dt)
    return sp.ImmutableMatrix(sigma_a**2 * B * B.T)


def noise_by(column: Callable[[Any], Any]) -> Answer:
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
        "That is for an acceleration that is white noise in continuous time; here it is constant between samples.",
        lambda dt, sigma_a: plane(sigma_a**2 * sp.Matrix([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])),
    ),
    ("half-missing", "A factor is missing where the acceleration acts on the position.", noise_by(lambda dt: [dt**2, dt])),
    ("position-forgotten", "The acceleration shakes the position too, not only the velocity.", noise_by(lambda dt: [0, dt])),
    ("power-of-dt", "A power of dt is missing: check the units of every entry.", noise_by(lambda dt: [dt / 2, 1])),
    (
        "input-once",
        "The effect of the acceleration enters once; a covariance has it on both sides, B ... B^T.",
        lambda dt, sigma_a: plane(sigma_a**2 * sp.diag(dt**2 / 2, dt)),
    ),
    (
        "order-of-components",
        "The order of the components is another: the state is (x, y, vx, vy), both positions first.",
        lambda dt, sigma_a: interleaved(process_noise(dt, sigma_a)),
    ),
)

# -- i3: start-up from three samples


def start_up(y0: Any, y1: Any, y2: Any, dt: Any) -> tuple:
    return tuple(START.subs(DT, dt) * sp.Matrix([y0, y1, y2]))


def second_difference(y0: Any, y1: Any, y2: Any) -> Any:
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
    (
        "samples-reversed",
        "The samples seem to be taken in the reverse order.",
        lambda y0, y1, y2, dt: start_up(y2, y1, y0, dt),
    ),
    (
        "moved-too-far",
        "The first difference is moved on by a whole interval; it belongs to the middle of one.",
        lambda y0, y1, y2, dt: (
            y2,
            (y2 - y1 + second_difference(y0, y1, y2)) / dt,
            second_difference(y0, y1, y2) / dt**2,
        ),
    ),
    (
        "coefficient-for-acceleration",
        "That is the coefficient of the parabola's square; an acceleration is a second derivative.",
        lambda y0, y1, y2, dt: (*start_up(y0, y1, y2, dt)[:2], second_difference(y0, y1, y2) / (2 * dt**2)),
    ),
    (
        "power-of-dt",
        "A power of dt is missing: check the units.",
        lambda y0, y1, y2, dt: (
            y2,
            start_up(y0, y1, y2, dt)[1] * dt,
            second_difference(y0, y1, y2) / dt,
        ),
    ),
    (
        "averaged",
        "The mean of the samples is no estimate of the last position: the object moves.",
        lambda y0, y1, y2, dt: ((y0 + y1 + y2) / 3, *start_up(y0, y1, y2, dt)[1:]),
    ),
)

# -- i4: one step of the filter with a known input


def step(z: Array, p: Array, u: Array, y: Array, A: Array, B: Array, H: Array, Q: Array, R: Array) -> tuple[Array, ...]:
    system = LinearSystem(A, H, Q, R, B)
    before = predict_law(system, Gaussian(z, p), system.input(u))
    return *before, *FORMS["covariance"].correct(system, before, y)


Part = Callable[..., Array]


def step_with(
    mean: Part = lambda z, u, A, B: A @ z + B @ u,
    predicted: Part = lambda p, A, Q: A @ p @ A.T + Q,
    gain: Part = lambda p, Psi, H, R: np.linalg.solve(H @ Psi @ H.T + R, H @ Psi).T,
    innovation: Part = lambda y, H, lam, z: y - H @ lam,
    corrected: Part = lambda p, Psi, K, H: Psi - K @ H @ Psi,
) -> Answer:
    """A step with one thing changed."""

    def answer(z: Array, p: Array, u: Array, y: Array, A: Array, B: Array, H: Array, Q: Array, R: Array) -> tuple[Array, ...]:
        lam, Psi = mean(z, u, A, B), predicted(p, A, Q)
        K = gain(p, Psi, H, R)
        return lam, Psi, lam + K @ innovation(y, H, lam, z), corrected(p, Psi, K, H)

    return answer


def step_arguments(exercise: Exercise) -> list[tuple]:
    rng = exercise.rng("i4")
    A, B, H = (np.array(m, dtype=float) for m in matrices(rng.uniform(0.2, 0.6)))
    A, B, H = (matrix + 0.2 * rng.normal(size=matrix.shape) for matrix in (A, B, H))  # no zeros, no ones
    z, u, y = rng.normal(size=4), rng.normal(size=2), rng.normal(size=2)
    return [(z, covariance(rng, 4), u, y, A, B, H, covariance(rng, 4), covariance(rng, 2))]


WRONG_STEPS: tuple[tuple[str, str, Answer], ...] = (
    ("input-forgotten", "The known input is missing in the prediction.", step_with(mean=lambda z, u, A, B: A @ z)),
    ("input-sign", "The known input has the wrong sign.", step_with(mean=lambda z, u, A, B: A @ z - B @ u)),
    (
        "input-before-transition",
        "The input's effect is carried on by A once more; B u is what it has done by the end of the interval.",
        step_with(mean=lambda z, u, A, B: A @ (z + B @ u)),
    ),
    (
        "noise-forgotten",
        "The noise of the object is missing: the prediction must be less sure than the estimate.",
        step_with(predicted=lambda p, A, Q: A @ p @ A.T),
    ),
    (
        "transition-forgotten",
        "The covariance of the estimate has to be carried on by A, on both sides.",
        step_with(predicted=lambda p, A, Q: p + Q),
    ),
    (
        "transition-transposed",
        "A is transposed: in A p A^T the transposed one stands on the right.",
        step_with(predicted=lambda p, A, Q: A.T @ p @ A + Q),
    ),
    (
        "gain-of-estimate",
        "The gain is made of the covariance p of the old estimate; at the measurement the filter is as sure as Psi says.",
        step_with(gain=lambda p, Psi, H, R: np.linalg.solve(H @ p @ H.T + R, H @ p).T),
    ),
    (
        "noise-of-meter-forgotten",
        "The noise R of the meter is missing in the gain.",
        step_with(gain=lambda p, Psi, H, R: np.linalg.solve(H @ Psi @ H.T, H @ Psi).T),
    ),
    (
        "innovation-of-estimate",
        "The innovation is made with the old estimate; compare the measurement with the prediction.",
        step_with(innovation=lambda y, H, lam, z: y - H @ z),
    ),
    (
        "innovation-sign",
        "The innovation has the wrong sign: it is what came minus what was expected.",
        step_with(innovation=lambda y, H, lam, z: H @ lam - y),
    ),
    (
        "innovation-missing",
        "The measurement itself is multiplied by the gain; subtract what was expected.",
        step_with(innovation=lambda y, H, lam, z: y),
    ),
    (
        "covariance-kept",
        "The covariance is that of the prediction: a measurement must make the filter surer.",
        step_with(corrected=lambda p, Psi, K, H: Psi),
    ),
    (
        "covariance-of-estimate",
        "The covariance p of the old estimate is corrected; correct that of the prediction.",
        step_with(corrected=lambda p, Psi, K, H: p - K @ H @ p),
    ),
)

# -- i5: a square root that never forms the covariance


def correct_root(lam: Array, S: Array, y: Array, H: Array, R: Array) -> tuple[Array, Array]:
    n = len(lam)
    system = LinearSystem(np.eye(n), H, np.zeros((n, n)), R)
    law = FORMS["square-root"].correct(system, Root(lam, S), y)
    return law.mean, law.root * np.sign(np.diag(law.root))


def triangular(wide: Array) -> Array:
    """Lower triangular L with L L^T = wide wide^T; the signs of its columns are as they come."""
    return np.asarray(np.linalg.qr(wide.T, mode="r")).T


def root_with(
    array: Callable[[Array, Array, Array], Array] | None = None,
    divided: bool = True,
    signs: bool = True,
    change: Callable[[Array], Array] = lambda root: root,
) -> Answer:
    """The correction by a QR decomposition of the pre-array, with one thing changed."""

    def pre_array(S: Array, H: Array, R: Array) -> Array:
        return np.block([[np.linalg.cholesky(R), H @ S], [np.zeros((len(S), len(R))), S]])

    def answer(lam: Array, S: Array, y: Array, H: Array, R: Array) -> tuple[Array, Array]:
        p = len(y)
        lower = triangular((array or pre_array)(S, H, R))
        top, cross, root = lower[:p, :p], lower[p:, :p], lower[p:, p:]
        e = y - H @ lam
        z = lam + cross @ (np.linalg.solve(top, e) if divided else e)
        return z, change(root * np.sign(np.diag(root)) if signs else root)

    return answer


def _through_covariance(lam: Array, S: Array, y: Array, H: Array, R: Array) -> tuple[Array, Array]:
    """The textbook's covariance and then a root of it; of a variance that came out negative, of 0."""
    Psi = S @ S.T
    K = np.linalg.solve(H @ Psi @ H.T + R, H @ Psi).T
    lower = triangular(square_root(Psi - K @ H @ Psi))
    return lam + K @ (y - H @ lam), lower * np.where(np.diag(lower) < 0, -1, 1)


def root_arguments(exercise: Exercise) -> list[tuple]:
    """A regular case; a meter so sharp that 1 - K H rounds to 0; components so nearly dependent that S S^T rounds to singular.

    An orthogonal transformation keeps 7 digits of the last two (rounding over 3e-9), a covariance none: hence the tolerance.
    """
    rng = exercise.rng("i5")
    S = np.tril(0.4 * rng.normal(size=(4, 4)), -1) + np.diag(rng.uniform(0.6, 1.6, 4))
    regular = (rng.normal(size=4), S, rng.normal(size=2), rng.normal(size=(2, 4)), covariance(rng, 2))
    size, share, small = rng.uniform(0.5, 1.5), rng.uniform(0.5, 2), 3e-9
    sharp = (np.array([0.3]), np.array([[size]]), np.array([0.4]), np.array([[2.0]]), np.array([[share * small**2]]))
    root = size * np.array([[1.0, 0.0], [1.0, small]])
    dependent = (np.array([0.3, -0.2]), root, np.array([1.7]), np.array([[1.0, -1.0]]), np.array([[share * (size * small) ** 2]]))
    return [regular, sharp, dependent]


WRONG_ROOTS: tuple[tuple[str, str, Answer], ...] = (
    (
        "through-the-covariance",
        "On paper it is right. But where the covariance is nearly singular it has lost its digits already, and no root of it "
        "brings them back: work with S alone.",
        _through_covariance,
    ),
    (
        "signs",
        "It is a root, but some columns have the other sign than asked for: the diagonal must be positive.",
        root_with(signs=False),
    ),
    ("upper", "The root is upper triangular; the lower one is asked for.", root_with(change=lambda root: root.T)),
    (
        "noise-not-rooted",
        "R itself stands in the array; all that is in it are square roots.",
        root_with(lambda S, H, R: np.block([[R, H @ S], [np.zeros((len(S), len(R))), S]])),
    ),
    (
        "root-transposed",
        "S is transposed in the array: its product with its transpose must give H Psi H^T.",
        root_with(lambda S, H, R: np.block([[np.linalg.cholesky(R), H @ S.T], [np.zeros((len(S), len(R))), S.T]])),
    ),
    (
        "gain-not-divided",
        "The block below is not yet the gain: it has still to be divided by the block above it.",
        root_with(divided=False),
    ),
    (
        "root-kept",
        "The root is that of the prediction: a measurement must make it smaller.",
        lambda lam, S, y, H, R: (
            correct_root(lam, S, y, H, R)[0],
            S,
        ),
    ),
)

QUESTIONS = (
    Question(
        "i1",
        "the matrices of the model",
        "warm-up",
        matrices,
        lambda e: [(sp.Symbol("dt", positive=True),)],
        catalogue(WRONG_MATRICES),
        ("A", "B", "H"),
    ),
    Question(
        "i2",
        "the noise of the object",
        "core",
        process_noise,
        lambda e: [sp.symbols("dt sigma_a", positive=True)],
        catalogue(WRONG_NOISES),
    ),
    Question(
        "i3",
        "start-up from three samples",
        "core",
        start_up,
        lambda e: [(*sp.symbols("y0 y1 y2", real=True), sp.Symbol("dt", positive=True))],
        catalogue(WRONG_STARTS),
        ("r", "v", "a"),
    ),
    Question(
        "i4",
        "one step with a known input",
        "core",
        step,
        step_arguments,
        catalogue(WRONG_STEPS),
        ("lam", "Psi", "z", "p"),
    ),
    Question(
        "i5",
        "a square root instead of the covariance",
        "stretch",
        correct_root,
        root_arguments,
        catalogue(WRONG_ROOTS),
        ("z", "S"),
        tolerance=1e-5,
    ),
)

SET = ExerciseSet(
    "i", "A track in the plane, and numerical care", Path(__file__).parent, QUESTIONS, track_numbers, about_variant=False
)
