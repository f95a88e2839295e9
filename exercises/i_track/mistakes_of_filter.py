"""Known mistakes in the filter: a step with a known input (i4), a square root instead of the covariance (i5)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.i_track.keys import correct_root
from kfcourse.laws import Array, square_root

# -- i4: one step of the filter with a known input

Part = Callable[..., Array]


def step_with(
    mean: Part = lambda z, u, A, B: A @ z + B @ u,
    predicted: Part = lambda p, A, Q: A @ p @ A.T + Q,
    gain: Part = lambda p, Psi, H, R: np.linalg.solve(H @ Psi @ H.T + R, H @ Psi).T,
    innovation: Part = lambda y, H, lam, z: y - H @ lam,
    corrected: Part = lambda p, Psi, K, H: Psi - K @ H @ Psi,
    base: Part = lambda lam, z, B, u: lam,
) -> Answer:
    """A step with one thing changed."""

    def answer(z: Array, p: Array, u: Array, y: Array, A: Array, B: Array, H: Array, Q: Array, R: Array) -> tuple[Array, ...]:
        lam, Psi = mean(z, u, A, B), predicted(p, A, Q)
        K = gain(p, Psi, H, R)
        return lam, Psi, base(lam, z, B, u) + K @ innovation(y, H, lam, z), corrected(p, Psi, K, H)

    return answer


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
    ("innovation-sign", messages.INNOVATION_SIGN, step_with(innovation=lambda y, H, lam, z: H @ lam - y)),
    ("innovation-missing", messages.MEASUREMENT_FOR_INNOVATION, step_with(innovation=lambda y, H, lam, z: y)),
    ("covariance-kept", messages.COVARIANCE_KEPT, step_with(corrected=lambda p, Psi, K, H: Psi)),
    (
        "covariance-of-estimate",
        "The covariance p of the old estimate is corrected; correct that of the prediction.",
        step_with(corrected=lambda p, Psi, K, H: p - K @ H @ p),
    ),
    (
        "transition-transposed",
        "A is transposed in the prediction of the mean.",
        step_with(mean=lambda z, u, A, B: A.T @ z + B @ u),
    ),
    ("correction-of-estimate", "The old estimate is corrected; correct the prediction.", step_with(base=lambda lam, z, B, u: z)),
    (
        "input-twice",
        "The known input is added once more; the prediction has it already.",
        step_with(base=lambda lam, z, B, u: lam + B @ u),
    ),
    ("covariance-added", messages.COVARIANCE_ADDED, step_with(corrected=lambda p, Psi, K, H: Psi + K @ H @ Psi)),
    (
        "noise-by-deviation",
        messages.NOISE_BY_DEVIATION,
        step_with(gain=lambda p, Psi, H, R: np.linalg.solve(H @ Psi @ H.T + np.sqrt(np.abs(R)), H @ Psi).T),
    ),
    (
        "noise-squared",
        messages.NOISE_SQUARED,
        step_with(gain=lambda p, Psi, H, R: np.linalg.solve(H @ Psi @ H.T + R @ R, H @ Psi).T),
    ),
    (
        "divided-by-one-entry",
        "The gain is divided by one entry of the innovation's covariance; multiply by the inverse of the whole matrix.",
        step_with(gain=lambda p, Psi, H, R: Psi @ H.T / (H @ Psi @ H.T + R)[0, 0]),
    ),
    (
        "gain-not-divided",
        "The gain is not divided by the covariance of the innovation, or not by all of it.",
        step_with(gain=lambda p, Psi, H, R: Psi @ H.T),
    ),
    (
        "gain-not-divided",
        messages.GAIN_BY_NOISE_ALONE,
        step_with(gain=lambda p, Psi, H, R: np.linalg.solve(R, H @ Psi).T),
    ),
    ("noise-sign", messages.NOISE_SIGN, step_with(predicted=lambda p, A, Q: A @ p @ A.T - Q)),
    ("share-only", messages.SHARE_ONLY, step_with(corrected=lambda p, Psi, K, H: np.eye(len(Psi)) - K @ H)),
)


# -- i5: a square root that never forms the covariance


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


def _other_gain(step: Callable[[Array, Array, Array], Array]) -> Answer:
    """The right root, and another correction made of the array."""

    def answer(lam: Array, S: Array, y: Array, H: Array, R: Array) -> tuple[Array, Array]:
        p = len(y)
        lower = triangular(np.block([[np.linalg.cholesky(R), H @ S], [np.zeros((len(S), p)), S]]))
        return lam + step(lower[:p, :p], lower[p:, :p], y - H @ lam), correct_root(lam, S, y, H, R)[1]

    return answer


def _share_of_root(lam: Array, S: Array, y: Array, H: Array, R: Array) -> tuple[Array, Array]:
    K = np.linalg.solve(H @ S @ S.T @ H.T + R, H @ S @ S.T).T
    return correct_root(lam, S, y, H, R)[0], (np.eye(len(S)) - K @ H) @ S


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
        lambda lam, S, y, H, R: (correct_root(lam, S, y, H, R)[0], S),
    ),
    ("covariance-returned", "That is the covariance; its root is asked for.", root_with(change=lambda root: root @ root.T)),
    (
        "gain-multiplied",
        "The block below is multiplied by the block above it; it has to be divided.",
        _other_gain(lambda top, cross, e: cross @ (top @ e)),
    ),
    (
        "divided-twice",
        "The block below is divided by the covariance of the innovation; it holds one root of it already.",
        _other_gain(lambda top, cross, e: cross @ np.linalg.solve(top @ top.T, e)),
    ),
    ("gain-sign", messages.CORRECTION_SUBTRACTED, _other_gain(lambda top, cross, e: -cross @ np.linalg.solve(top, e))),
    (
        "share-of-root",
        "I - K H times the root is no root of the new covariance: the noise that comes through the gain is missing.",
        _share_of_root,
    ),
)
