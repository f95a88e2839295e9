"""Known mistakes of set i, question by question: edits of the keys, and what is said of each."""

from __future__ import annotations

from kfcourse.exercises.checks.editing import edits
from kfcourse.exercises.sets import messages
from kfcourse.exercises.sets.i_track.keys import (
    correct_root,
    matrices,
    process_noise,
    start_up,
    step,
)

B, H = "INPUT.subs(DT, dt)", "SENSITIVITY\n"
PLANE = "sp.kronecker_product(sp.Matrix([{}]), sp.eye(2)).as_immutable()"
WRONG_MATRICES = edits(
    matrices,
    (
        "time-missing",
        "The time between samples is missing: a velocity has to be multiplied by it before it is "
        "added to a position.",
        "    A, B",
        "    dt = 1; A, B",
    ),
    ("half-missing", messages.HALF_MISSING, B, PLANE.format("dt**2, dt")),
    (
        "first-order",
        "The acceleration acts on the position too, within the same interval.",
        B,
        PLANE.format("0, dt"),
    ),
    (
        "power-of-dt",
        "A power of dt is wrong in B: the units of an acceleration times it are those of a "
        "position, or of a velocity.",
        B,
        PLANE.format("dt / 2, 1"),
    ),
    (
        "order-of-components",
        messages.ORDER_OF_COMPONENTS,
        "return A, B, H",
        "o = [0, 2, 1, 3]; return A.extract(o, o), B.extract(o, [0, 1]), H.extract([0, 1], o)",
    ),
    (
        "velocity-measured",
        "H takes the velocities out of the state; the meter gives the positions.",
        H,
        "SENSITIVITY.extract([0, 1], [2, 3, 0, 1])\n",
    ),
    (
        "identity-forgotten",
        "A state that is left alone stays: the identity is missing.",
        "TRANSITION.subs(DT, dt)",
        "TRANSITION.subs(DT, dt) - sp.eye(4)",
    ),
    (
        "axes-mixed",
        "An acceleration along one axis moves that axis only.",
        B,
        PLANE.format("dt**2 / 2, dt").replace("eye", "ones"),
    ),
)

NOISE, OWN = "sigma_a**2 * B * B.T", "matrices(dt)[1]"
WRONG_NOISES = edits(
    process_noise,
    (
        "deviation-for-variance",
        "The standard deviation of the acceleration stands where its variance belongs.",
        "sigma_a**2",
        "sigma_a",
    ),
    (
        "diagonal",
        "Only the diagonal is there. One and the same acceleration moves position and velocity, "
        "so their errors are correlated.",
        NOISE,
        "sp.diag(*(sigma_a**2 * B * B.T).diagonal())",
    ),
    (
        "axes-coupled",
        "The two axes are correlated. Each has an acceleration of its own, independent of the "
        "other's.",
        OWN,
        "sp.Matrix([dt**2 / 2, dt**2 / 2, dt, dt])",
    ),
    (
        "white-in-continuous-time",
        messages.WHITE_IN_CONTINUOUS_TIME,
        NOISE,
        "sigma_a**2 * " + PLANE.format("[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]"),
    ),
    ("half-missing", messages.HALF_MISSING, OWN, PLANE.format("dt**2, dt")),
    (
        "position-forgotten",
        "The acceleration shakes the position too, not only the velocity.",
        OWN,
        PLANE.format("0, dt"),
    ),
    ("power-of-dt", messages.POWER_OF_DT, OWN, PLANE.format("dt / 2, 1")),
    ("correlation-sign", messages.CORRELATION_SIGN, OWN, PLANE.format("dt**2 / 2, -dt")),
)

SECOND = "(y2 - 2 * y1 + y0)"
WRONG_STARTS = edits(
    start_up,
    (
        "first-difference",
        "The last difference is the velocity in the middle of the last interval; it changes until "
        "the last sample.",
        "return r, v",
        "return r, (y2 - y1) / dt",
    ),
    (
        "middle-sample",
        "These belong to the middle sample; the filter starts at the last one.",
        "return r, v",
        "return y1, (y2 - y0) / (2 * dt)",
    ),
    (
        "first-sample",
        "These belong to the first sample; the filter starts at the last one.",
        "return r, v",
        "return y0, (4 * y1 - 3 * y0 - y2) / (2 * dt)",
    ),
    (
        "samples-reversed",
        "The samples seem to be taken in the reverse order.",
        "[y0, y1, y2]",
        "[y2, y1, y0]",
    ),
    (
        "moved-too-far",
        "The first difference is moved on by a whole interval; it belongs to the middle of one.",
        "return r, v",
        f"return r, (y2 - y1 + {SECOND}) / dt",
    ),
    (
        "coefficient-for-acceleration",
        "That is the coefficient of the parabola's square; an acceleration is a second derivative.",
        "v, a\n",
        "v, a / 2\n",
    ),
    ("power-of-dt", messages.POWER_OF_DT, "v, a\n", "v * dt, a * dt\n"),
)

WRONG_STEPS = edits(
    step,
    ("input-forgotten", "The known input is missing in the prediction.", " + B @ u", ""),
    (
        "input-before-transition",
        "The input's effect is carried on by A once more; B u is what it has done by the end of "
        "the interval.",
        "A @ z + B @ u",
        "A @ (z + B @ u)",
    ),
    (
        "noise-forgotten",
        "The noise of the object is missing: the prediction must be less sure than the estimate.",
        " @ A.T + Q",
        " @ A.T",
    ),
    (
        "transition-forgotten",
        "The covariance of the estimate has to be carried on by A, on both sides.",
        "A @ p @ A.T",
        "p",
    ),
    (
        "transition-transposed",
        "A is transposed: in A p A^T the transposed one stands on the right.",
        "A @ p @ A.T",
        "A.T @ p @ A",
    ),
    (
        "gain-of-estimate",
        "The gain is made of the covariance p of the old estimate; at the measurement the filter "
        "is as sure as Psi says.",
        "H @ Psi @ H.T + R",
        "H @ p @ H.T + R",
        "F, H @ Psi)",
        "F, H @ p)",
    ),
    (
        "innovation-of-estimate",
        "The innovation is made with the old estimate; compare the measurement with the "
        "prediction.",
        "y - H @ lam",
        "y - H @ z",
    ),
    ("innovation-sign", messages.INNOVATION_SIGN, "y - H @ lam", "H @ lam - y"),
    ("covariance-kept", messages.COVARIANCE_KEPT, "Psi - K @ H @ Psi", "Psi"),
    (
        "correction-of-estimate",
        "The old estimate is corrected; correct the prediction.",
        "lam + K @ (",
        "z + K @ (",
    ),
)

WRONG_ROOTS = edits(
    correct_root,
    (
        "through-the-covariance",
        "On paper it is right. But where the covariance is nearly singular it has lost its digits "
        "already, and no root of it "
        "brings them back: work with S alone.",
        "    return z, root",
        "    Psi = S @ S.T\n    K = np.linalg.solve(H @ Psi @ H.T + R, H @ Psi).T\n    e, V = "
        "np.linalg.eigh(Psi - K @ H @ Psi)\n"
        "    z, root = lam + K @ (y - H @ lam), np.linalg.qr((V * np.sqrt(np.maximum(e, 0))).T, "
        "mode='r').T\n    return z, root",
    ),
    (
        "signs",
        "It is a root, but some columns have the other sign than asked for: the diagonal must be "
        "positive.",
        " * np.sign(np.diag(root))",
        "",
    ),
    (
        "noise-not-rooted",
        "R itself stands in the array; all that is in it are square roots.",
        "np.linalg.cholesky(R)",
        "R",
    ),
    (
        "root-transposed",
        "S is transposed in the array: its product with its transpose must give H Psi H^T.",
        "    p = len(y)",
        "    S, p = S.T, len(y)",
    ),
    (
        "gain-not-divided",
        "The block below is not yet the gain: it has still to be divided by the block above it.",
        "np.linalg.solve(top, y - H @ lam)",
        "(y - H @ lam)",
    ),
    (
        "root-kept",
        "The root is that of the prediction: a measurement must make it smaller.",
        "root * np.sign(np.diag(root))",
        "S",
    ),
    (
        "divided-twice",
        "The block below is divided by the covariance of the innovation; it holds one root of it "
        "already.",
        "solve(top,",
        "solve(top @ top.T,",
    ),
)
