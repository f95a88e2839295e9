"""Questions of set i, a track in the plane and numerical care, and of set j, an alpha-beta filter on a radar track.

What is derived is answered with formulas in the symbols of the arguments, what runs with arrays.  Personal numbers are in
`track_numbers` and `radar_numbers`; hidden arguments are others, so an answer holds for any.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
import scipy.linalg
import sympy as sp

from kfcourse.arithmetic import FORMS, Root, predict_law
from kfcourse.checks.engine import Answer, Question, catalogue
from kfcourse.experiment import run
from kfcourse.filters.alphabeta import alpha_beta, steady_beta, tracking_index
from kfcourse.gaussian import Array, Gaussian, square_root
from kfcourse.pointer import DT, INPUT, SENSITIVITY, START, TRANSITION
from kfcourse.system import LinearSystem
from kfcourse.tracks import AZIMUTH, CARTESIAN, ELEVATION, RANGE, SPHERICAL, X, Y, Z, kinematic

COURSE = "53"  # the variant that the course itself works through
Ranges = Mapping[str, tuple[float, float]]


def personal(exercise: Any, name: str, course: Mapping[str, float], ranges: Ranges) -> dict[str, float]:
    """Numbers of two digits from the ranges, the same for a variant and name; the course's own for its variant."""
    if exercise.variant.name == COURSE:
        return dict(course)
    rng = exercise.rng(name)
    return {key: float(f"{rng.uniform(*limits):.2g}") for key, limits in ranges.items()}


def covariance(rng: np.random.Generator, size: int) -> Array:
    """A hidden covariance: correlated, and well away from singular."""
    root = np.eye(size) + 0.4 * rng.normal(size=(size, size))
    return root @ root.T


def track_numbers(exercise: Any) -> dict[str, float]:
    """dt (s), sigma (px), sigma_a (px/s^2), and the number of the hand's track."""
    found = personal(
        exercise,
        "i",
        {"dt": 0.01, "sigma": 8.0, "sigma_a": 7100.0, "track": 7},
        {"dt": (0.008, 0.02), "sigma": (5, 12), "sigma_a": (4000, 9000), "track": (10, 99)},
    )
    return found | {"track": int(found["track"])}


def radar_numbers(exercise: Any) -> dict[str, float]:
    """T (s), sigma (m), alpha, and the radius of the first circle (m)."""
    return personal(
        exercise,
        "j",
        {"T": 0.8, "sigma": 100.0, "alpha": 0.095, "radius": 6000.0},
        {"T": (0.5, 1.5), "sigma": (50, 150), "alpha": (0.07, 0.25), "radius": (4500, 7500)},
    )


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


def right_matrices(dt: Any) -> tuple:
    return TRANSITION.subs(DT, dt), INPUT.subs(DT, dt), SENSITIVITY


def with_input(top: Callable[[Any], Any], bottom: Callable[[Any], Any] = lambda dt: dt) -> Answer:
    """The right A and H with another B: entries for position and velocity."""
    return lambda dt: (TRANSITION.subs(DT, dt), plane([top(dt), bottom(dt)]), SENSITIVITY)


WRONG_MATRICES: tuple[tuple[str, str, Answer], ...] = (
    (
        "time-missing",
        "The time between samples is missing: a velocity has to be multiplied by it before it is added to a position.",
        lambda dt: right_matrices(1),
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
        lambda dt: tuple(matrix.T if matrix.rows == matrix.cols else matrix for matrix in right_matrices(dt)),
    ),
    (
        "order-of-components",
        "The order of the components is another: the state is (x, y, vx, vy), both positions first.",
        lambda dt: tuple(interleaved(matrix) for matrix in right_matrices(dt)),
    ),
    (
        "velocity-measured",
        "H takes the velocities out of the state; the meter gives the positions.",
        lambda dt: (*right_matrices(dt)[:2], SENSITIVITY.extract([0, 1], [2, 3, 0, 1])),
    ),
)


def right_noise(dt: Any, sigma_a: Any) -> sp.ImmutableMatrix:
    B = INPUT.subs(DT, dt)
    return sp.ImmutableMatrix(sigma_a**2 * B * B.T)


def noise_by(column: Callable[[Any], Any]) -> Answer:
    """sigma_a^2 b b^T on each axis, with another column b."""
    return lambda dt, sigma_a: plane(sigma_a**2 * sp.Matrix(column(dt)) * sp.Matrix(column(dt)).T)


WRONG_NOISES: tuple[tuple[str, str, Answer], ...] = (
    (
        "deviation-for-variance",
        "The standard deviation of the acceleration stands where its variance belongs.",
        lambda dt, sigma_a: right_noise(dt, sigma_a) / sigma_a,
    ),
    (
        "diagonal",
        "Only the diagonal is there. One and the same acceleration moves position and velocity, so their errors are correlated.",
        lambda dt, sigma_a: sp.diag(*[right_noise(dt, sigma_a)[i, i] for i in range(4)]),
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
        lambda dt, sigma_a: interleaved(right_noise(dt, sigma_a)),
    ),
)

# -- i3: start-up from three samples


def right_start(y0: Any, y1: Any, y2: Any, dt: Any) -> tuple:
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
        lambda y0, y1, y2, dt: right_start(y2, y1, y0, dt),
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
        lambda y0, y1, y2, dt: (*right_start(y0, y1, y2, dt)[:2], second_difference(y0, y1, y2) / (2 * dt**2)),
    ),
    (
        "power-of-dt",
        "A power of dt is missing: check the units.",
        lambda y0, y1, y2, dt: (
            y2,
            right_start(y0, y1, y2, dt)[1] * dt,
            second_difference(y0, y1, y2) / dt,
        ),
    ),
    (
        "averaged",
        "The mean of the samples is no estimate of the last position: the object moves.",
        lambda y0, y1, y2, dt: ((y0 + y1 + y2) / 3, *right_start(y0, y1, y2, dt)[1:]),
    ),
)

# -- i4: one step of the filter with a known input


def right_step(z: Array, p: Array, u: Array, y: Array, A: Array, B: Array, H: Array, Q: Array, R: Array) -> tuple[Array, ...]:
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


def step_arguments(exercise: Any) -> list[tuple]:
    rng = exercise.rng("i4")
    A, B, H = (np.array(m, dtype=float) for m in right_matrices(rng.uniform(0.2, 0.6)))
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


def right_root(lam: Array, S: Array, y: Array, H: Array, R: Array) -> tuple[Array, Array]:
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


def root_arguments(exercise: Any) -> list[tuple]:
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
            right_root(lam, S, y, H, R)[0],
            S,
        ),
    ),
)

TRACK = (
    Question(
        "i1",
        "the matrices of the model",
        "warm-up",
        lambda e: right_matrices,
        lambda e: [(sp.Symbol("dt", positive=True),)],
        catalogue(WRONG_MATRICES),
        ("A", "B", "H"),
    ),
    Question(
        "i2",
        "the noise of the object",
        "core",
        lambda e: right_noise,
        lambda e: [sp.symbols("dt sigma_a", positive=True)],
        catalogue(WRONG_NOISES),
    ),
    Question(
        "i3",
        "start-up from three samples",
        "core",
        lambda e: right_start,
        lambda e: [(*sp.symbols("y0 y1 y2", real=True), sp.Symbol("dt", positive=True))],
        catalogue(WRONG_STARTS),
        ("r", "v", "a"),
    ),
    Question(
        "i4",
        "one step with a known input",
        "core",
        lambda e: right_step,
        step_arguments,
        catalogue(WRONG_STEPS),
        ("lam", "Psi", "z", "p"),
    ),
    Question(
        "i5",
        "a square root instead of the covariance",
        "stretch",
        lambda e: right_root,
        root_arguments,
        catalogue(WRONG_ROOTS),
        ("z", "S"),
        tolerance=1e-5,
    ),
)

# -- j1, j2: what the radar measures


def substituted(formulas: sp.MatrixBase, names: tuple[sp.Symbol, ...]) -> Callable[..., sp.ImmutableMatrix]:
    """The formulas as a function of other symbols in the place of these."""
    return lambda *values: sp.ImmutableMatrix(formulas.subs(dict(zip(names, values, strict=True)), simultaneous=True))


MEASURED, POSITION = (RANGE, AZIMUTH, ELEVATION), (X, Y, Z)
_cartesian = substituted(CARTESIAN, MEASURED)


def right_cartesian(r: Any, phi: Any, eps: Any) -> tuple:
    return tuple(_cartesian(r, phi, eps))


WRONG_CARTESIANS: tuple[tuple[str, str, Answer], ...] = (
    (
        "azimuth-from-y",
        "The azimuth is counted from the y axis; here it goes from x towards y.",
        lambda r, phi, eps: right_cartesian(r, sp.pi / 2 - phi, eps),
    ),
    (
        "azimuth-sense",
        "The azimuth turns the other way: it grows from x towards y.",
        lambda r, phi, eps: right_cartesian(r, -phi, eps),
    ),
    (
        "from-the-zenith",
        "The elevation is counted from the vertical; here it is the angle above the horizon.",
        lambda r, phi, eps: right_cartesian(r, phi, sp.pi / 2 - eps),
    ),
    (
        "slant-range",
        "The range is taken along the ground; it goes to the aircraft, and only its projection lies on the ground.",
        lambda r, phi, eps: (r * sp.cos(phi), r * sp.sin(phi), r * sp.sin(eps)),
    ),
    (
        "height-by-tangent",
        "The height is found as if the range were the distance along the ground.",
        lambda r, phi, eps: (*right_cartesian(r, phi, eps)[:2], r * sp.tan(eps)),
    ),
    (
        "degrees",
        "The angles are turned from degrees into radians; they are in radians already.",
        lambda r, phi, eps: right_cartesian(r, phi * sp.pi / 180, eps * sp.pi / 180),
    ),
)


def jacobian_of(formulas: Any) -> Answer:
    return substituted(sp.Matrix(formulas).jacobian(POSITION), POSITION)


SLANT, GROUND = sp.sqrt(X**2 + Y**2 + Z**2), sp.sqrt(X**2 + Y**2)
right_jacobian = jacobian_of(SPHERICAL)
WRONG_JACOBIANS: tuple[tuple[str, str, Answer], ...] = (
    (
        "transposed",
        "It looks transposed: row i holds the derivatives of measurement i.",
        lambda x, y, z: right_jacobian(x, y, z).T,
    ),
    (
        "inverse",
        "These are the derivatives of the position by range and angles; the meter goes the other way.",
        substituted(CARTESIAN.jacobian(MEASURED).subs(dict(zip(MEASURED, SPHERICAL, strict=True)), simultaneous=True), POSITION),
    ),
    (
        "azimuth-from-y",
        "The azimuth is counted from the y axis; here it goes from x towards y.",
        jacobian_of([SPHERICAL[0], sp.atan2(X, Y), SPHERICAL[2]]),
    ),
    (
        "tangent-for-angle",
        "The tangents of the angles are differentiated, not the angles.",
        jacobian_of([SPHERICAL[0], Y / X, Z / GROUND]),
    ),
    (
        "sine-for-angle",
        "The sine of the elevation is differentiated, not the angle.",
        jacobian_of([*SPHERICAL[:2], Z / SLANT]),
    ),
    (
        "ground-fixed",
        "In the elevation the distance along the ground depends on x and y too.",
        substituted(
            sp.Matrix([SPHERICAL[0], SPHERICAL[1], 0]).jacobian(POSITION)
            + sp.Matrix([[0] * 3, [0] * 3, [0, 0, GROUND / SLANT**2]]),
            POSITION,
        ),
    ),
    (
        "range-for-ground",
        "In the azimuth the distance is that along the ground: the height does not turn it.",
        substituted(
            sp.Matrix([SPHERICAL[0], 0, SPHERICAL[2]]).jacobian(POSITION)
            + sp.Matrix([[0] * 3, [-Y / SLANT**2, X / SLANT**2, 0], [0] * 3]),
            POSITION,
        ),
    ),
    (
        "ground-range",
        "The first measurement is the range to the aircraft, not the distance along the ground.",
        jacobian_of([GROUND, *SPHERICAL[1:]]),
    ),
)


# -- j3: the constant gain


def right_gains(alpha: float) -> tuple[float, float]:
    return steady_beta(alpha), tracking_index(alpha)


WRONG_GAINS: tuple[tuple[str, str, Answer], ...] = (
    (
        "other-root",
        "The other root of the quadratic equation was taken: with it the filter is unstable.",
        lambda alpha: (2 * (2 - alpha) + 4 * np.sqrt(1 - alpha), 2 * (1 + np.sqrt(1 - alpha)) ** 2 / np.sqrt(1 - alpha)),
    ),
    (
        "benedict-bordner",
        "That is Benedict and Bordner's relation, from another criterion; take the stationary Kalman filter's.",
        lambda alpha: (alpha**2 / (2 - alpha), alpha**2 / (2 - alpha) / np.sqrt(1 - alpha)),
    ),
    (
        "small-alpha",
        "That holds for small alpha only.",
        lambda alpha: (alpha**2 / 2, alpha**2 / 2 / np.sqrt(1 - alpha)),
    ),
    (
        "white-in-continuous-time",
        "That is for an acceleration that is white noise in continuous time; here it is constant over an interval.",
        lambda alpha: (3 * (2 - alpha - np.sqrt((2 - alpha) ** 2 - 2 * alpha**2 / 3)), tracking_index(alpha)),
    ),
    (
        "root-forgotten",
        "A square root is missing in beta.",
        lambda alpha: (2 * (2 - alpha) - 4 * (1 - alpha), tracking_index(alpha)),
    ),
    (
        "index-squared",
        "That is the square of the tracking index, a ratio of variances; the index is a ratio of standard deviations.",
        lambda alpha: (steady_beta(alpha), tracking_index(alpha) ** 2),
    ),
    (
        "index-without-root",
        "A square root is missing in the tracking index: the noise of the meter enters by its standard deviation.",
        lambda alpha: (steady_beta(alpha), steady_beta(alpha) / (1 - alpha)),
    ),
    (
        "alpha-for-beta",
        "alpha stands in the tracking index where beta belongs.",
        lambda alpha: (steady_beta(alpha), alpha / np.sqrt(1 - alpha)),
    ),
    (
        "index-inverted",
        "The tracking index is upside down: the noise of the object stands above, that of the meter below.",
        lambda alpha: (steady_beta(alpha), 1 / tracking_index(alpha)),
    ),
)

# -- j4: the filter


@lru_cache(maxsize=8)
def _model(T: float, position: tuple[float, ...], velocity: tuple[float, ...]) -> Any:
    prior = {"mean": np.array(position + velocity), "variance": np.ones(2 * len(position))}
    return kinematic(T, dimensions=len(position), prior=prior)


def right_filter(y: Array, T: float, alpha: float, beta: float, r: Array, v: Array) -> tuple[Array, Array]:
    laws = run(alpha_beta(_model(T, tuple(r), tuple(v)), alpha, beta, start="prior"), y)
    return laws.mean[..., : len(r)], laws.mean[..., len(r) :]


Beat = Callable[..., tuple[Array, Array]]


def filter_with(
    beat: Beat | None = None,
    forward: Beat = lambda r, v, T: (r + T * v, v),
    swapped: bool = False,
    predictions: bool = False,
) -> Answer:
    """The filter as a loop, with one thing changed: beat(r, v, y, T, alpha, beta) -> the corrected r, v."""

    def corrected(r: Array, v: Array, y: Array, T: float, alpha: float, beta: float) -> tuple[Array, Array]:
        return r + alpha * (y - r), v + beta / T * (y - r)

    def answer(y: Array, T: float, alpha: float, beta: float, r: Array, v: Array) -> tuple[Array, Array]:
        alpha, beta = (beta, alpha) if swapped else (alpha, beta)
        r, v = (np.broadcast_to(value, y.shape[1:]) for value in (r, v))
        rows = []
        for one in y:
            before = r, v
            r, v = (beat or corrected)(r, v, one, T, alpha, beta)
            rows.append(before if predictions else (r, v))
            r, v = forward(r, v, T)
        return np.array([row[0] for row in rows]), np.array([row[1] for row in rows])

    return answer


def _position_first(r: Array, v: Array, y: Array, T: float, alpha: float, beta: float) -> tuple[Array, Array]:
    r = r + alpha * (y - r)
    return r, v + beta / T * (y - r)


def filter_arguments(exercise: Any) -> list[tuple]:
    rng = exercise.rng("j4")
    T, alpha, beta = rng.uniform(1.3, 2.2), rng.uniform(0.3, 0.6), rng.uniform(0.1, 0.25)
    r, v = 10 * rng.normal(size=3), rng.normal(size=3)
    time = T * np.arange(7)[:, None, None]
    y = r + v * time + 0.3 * time**2 + 2 * rng.normal(size=(7, 4, 3))
    return [(y, T, alpha, beta, r, v)]


WRONG_FILTERS: tuple[tuple[str, str, Answer], ...] = (
    (
        "beta-not-divided",
        "The gain of the velocity is not divided by T: check its units.",
        filter_with(lambda r, v, y, T, alpha, beta: (r + alpha * (y - r), v + beta * (y - r))),
    ),
    (
        "beta-multiplied",
        "The gain of the velocity is multiplied by T: check its units.",
        filter_with(lambda r, v, y, T, alpha, beta: (r + alpha * (y - r), v + beta * T * (y - r))),
    ),
    (
        "prediction-forgotten",
        "The position is never moved on by the velocity: predict before the next measurement.",
        filter_with(forward=lambda r, v, T: (r, v)),
    ),
    (
        "time-missing",
        "The prediction adds the velocity to the position without the time between measurements.",
        filter_with(forward=lambda r, v, T: (r + v, v)),
    ),
    ("gains-swapped", "alpha and beta are swapped: alpha corrects the position, beta/T the velocity.", filter_with(swapped=True)),
    (
        "gain-on-measurement",
        "The gains multiply the measurement itself; they belong to the innovation, what came minus what was expected.",
        filter_with(lambda r, v, y, T, alpha, beta: (r + alpha * y, v + beta / T * y)),
    ),
    (
        "innovation-sign",
        "The innovation has the wrong sign: it is what came minus what was expected.",
        filter_with(lambda r, v, y, T, alpha, beta: (r - alpha * (y - r), v - beta / T * (y - r))),
    ),
    (
        "position-first",
        "The velocity is corrected with what is left after the position was corrected: use one innovation for both.",
        filter_with(_position_first),
    ),
    (
        "predicted-first",
        "The start is moved on before the first measurement; r and v are the prediction for it already.",
        lambda y, T, alpha, beta, r, v: filter_with()(y, T, alpha, beta, r + T * v, v),
    ),
    (
        "predictions-returned",
        "These are the predictions, before each measurement; return the estimates, after it.",
        filter_with(predictions=True),
    ),
    (
        "velocity-kept",
        "The velocity is never corrected.",
        filter_with(lambda r, v, y, T, alpha, beta: (r + alpha * (y - r), v)),
    ),
)

# -- j5, j6: lag and noise


def closed_loop(T: Any, alpha: Any, beta: Any) -> tuple[sp.Matrix, sp.Matrix]:
    """(I - K H) and A on an axis."""
    return sp.eye(2) - sp.Matrix([alpha, beta / T]) * sp.Matrix([[1, 0]]), sp.Matrix([[1, T], [0, 1]])


@lru_cache(maxsize=1)
def _lag() -> tuple[tuple[sp.Symbol, ...], sp.Matrix, sp.Matrix]:
    """Lags of position and velocity, after and before a correction: fixed points of the error without noise.

    e <- (I - K H)(A e + (T^2/2, T) a), e the truth less the estimate.
    """
    a, T, alpha, beta = symbols = sp.symbols("a T alpha beta", positive=True)
    rest, A = closed_loop(T, alpha, beta)
    push = a * sp.Matrix([T**2 / 2, T])
    after = sp.simplify((sp.eye(2) - rest * A).LUsolve(rest * push))
    return symbols, after, sp.simplify(A * after + push)


def right_lag(*values: Any) -> tuple:
    symbols, after, _ = _lag()
    return tuple(substituted(after, symbols)(*values))


def _lag_of_prediction(*values: Any) -> tuple:
    symbols, _, before = _lag()
    return tuple(substituted(before, symbols)(*values))


WRONG_LAGS: tuple[tuple[str, str, Answer], ...] = (
    (
        "prediction",
        "That is the lag of the prediction; the correction takes part of it away.",
        _lag_of_prediction,
    ),
    (
        "gains-swapped",
        "alpha and beta are swapped.",
        lambda a, T, alpha, beta: right_lag(a, T, beta, alpha),
    ),
    (
        "time-missing",
        "The time between measurements is missing: check the units.",
        lambda a, T, alpha, beta: right_lag(a, 1, alpha, beta),
    ),
    (
        "half-interval",
        "The factor 1/2 of a parabola has no place here: the second difference of a t^2/2 is a T^2.",
        lambda *values: (right_lag(*values)[0] / 2, right_lag(*values)[1]),
    ),
    (
        "alpha-for-rest",
        "The share of the error that a correction leaves is 1 - alpha, not alpha.",
        lambda a, T, alpha, beta: (a * T**2 * alpha / beta, right_lag(a, T, alpha, beta)[1]),
    ),
    (
        "beta-forgotten",
        "The lag depends on beta too: it is what makes the velocity follow.",
        lambda a, T, alpha, beta: (a * T**2 * (1 - alpha), a * T * (alpha - sp.Rational(1, 2))),
    ),
    (
        "beta-not-divided",
        "A gain of the velocity of beta instead of beta/T was used.",
        lambda a, T, alpha, beta: right_lag(a, T, alpha, beta * T),
    ),
    (
        "position-not-accelerated",
        "Between measurements the acceleration moves the position too, by a T^2/2; that was left out.",
        lambda a, T, alpha, beta: tuple(
            (sp.eye(2) - closed_loop(T, alpha, beta)[0] * closed_loop(T, alpha, beta)[1]).LUsolve(
                closed_loop(T, alpha, beta)[0] * sp.Matrix([0, a * T])
            )
        ),
    ),
)


def _stationary(alpha: float, beta: float) -> tuple[Array, Array]:
    """Covariances of estimate and prediction, noise of the measurements alone, in units of sigma and T."""
    rest, A = (np.array(matrix, dtype=float) for matrix in closed_loop(1, alpha, beta))
    K = np.array([[alpha], [beta]])
    after = scipy.linalg.solve_discrete_lyapunov(rest @ A, K @ K.T)
    return after, A @ after @ A.T


def right_share(alpha: float, beta: float) -> float:
    return float(_stationary(alpha, beta)[0][0, 0])


WRONG_SHARES: tuple[tuple[str, str, Answer], ...] = (
    (
        "kalman-covariance",
        "alpha is the Kalman filter's own variance, in which the unknown acceleration is contained; ask for the noise alone.",
        lambda alpha, beta: alpha,
    ),
    (
        "alpha-filter",
        "That is a filter without velocity; beta lets noise through too.",
        lambda alpha, beta: alpha / (2 - alpha),
    ),
    (
        "one-step",
        "That is the noise of the last measurement alone; the earlier ones are still in the estimate.",
        lambda alpha, beta: alpha**2,
    ),
    (
        "prediction",
        "That is the variance of the prediction; take it after the correction.",
        lambda alpha, beta: float(_stationary(alpha, beta)[1][0, 0]),
    ),
    (
        "velocity",
        "That is the variance of the velocity (in units of sigma^2/T^2).",
        lambda alpha, beta: float(_stationary(alpha, beta)[0][1, 1]),
    ),
    (
        "gains-swapped",
        "alpha and beta are swapped.",
        lambda alpha, beta: right_share(beta, alpha),
    ),
)


def several(name: str, limits: tuple[tuple[float, float], ...]) -> Callable[[Any], list[tuple]]:
    """Three sets of hidden numbers."""

    def arguments(exercise: Any) -> list[tuple]:
        rng = exercise.rng(name)
        return [tuple(float(rng.uniform(*one)) for one in limits) for _ in range(3)]

    return arguments


def share_arguments(exercise: Any) -> list[tuple]:
    """Gains that are not those of a stationary Kalman filter: any stable pair is asked for."""
    numbers = several("j6", ((0.1, 0.6), (0.6, 1.6)))(exercise)
    return [(alpha, factor * steady_beta(alpha)) for alpha, factor in numbers]


RADAR = (
    Question(
        "j1",
        "from range and angles to Cartesian coordinates",
        "warm-up",
        lambda e: right_cartesian,
        lambda e: [sp.symbols("r phi eps", positive=True)],
        catalogue(WRONG_CARTESIANS),
        ("x", "y", "z"),
    ),
    Question(
        "j2",
        "the meter's derivatives",
        "core",
        lambda e: right_jacobian,
        lambda e: [sp.symbols("x y z", positive=True)],
        catalogue(WRONG_JACOBIANS),
    ),
    Question(
        "j3",
        "the constant gain",
        "core",
        lambda e: right_gains,
        several("j3", ((0.15, 0.7),)),
        catalogue(WRONG_GAINS),
        ("beta", "index"),
    ),
    Question("j4", "the filter", "core", lambda e: right_filter, filter_arguments, catalogue(WRONG_FILTERS), ("r", "v")),
    Question(
        "j5",
        "the lag in a turn",
        "core",
        lambda e: right_lag,
        lambda e: [sp.symbols("a T alpha beta", positive=True)],
        catalogue(WRONG_LAGS),
        ("position", "velocity"),
    ),
    Question("j6", "the noise that is left", "stretch", lambda e: right_share, share_arguments, catalogue(WRONG_SHARES)),
)
