"""Set i, answers as a student would type them: the right ones pass, the wrong ones are told apart or not named at all."""

import numpy as np
import sympy as sp
from answers import test_no_wrong_kind_of_mistake_is_named, test_right_answers_pass, test_what_cannot_be_compared_is_explained  # noqa: F401


def blocks(rows):
    """A matrix of axis by axis entries: every entry of `rows` times the unit matrix of the plane."""
    return sp.Matrix(sp.kronecker_product(sp.Matrix(rows), sp.eye(2)))


def i1(A=lambda dt: [[1, dt], [0, 1]], B=lambda dt: [[dt**2 / 2], [dt]], H=((1, 0),)):
    return lambda dt: (blocks(A(dt)), blocks(B(dt)), blocks(H))


def i1_axis_by_axis(dt):
    A, B = sp.Matrix([[1, dt], [0, 1]]), sp.Matrix([dt**2 / 2, dt])
    return sp.diag(A, A), sp.diag(B, B), sp.Matrix([[1, 0, 0, 0], [0, 0, 1, 0]])


def i1_transposed_A(dt):
    A, B, H = i1()(dt)
    return A.T, B, H


def i2(Q=lambda t: [[t**4 / 4, t**3 / 2], [t**3 / 2, t**2]], power=2):
    return lambda dt, sigma_a: sigma_a**power * blocks(Q(dt))


def i2_one_push(dt, sigma_a):
    b = sp.Matrix([dt**2 / 2, dt**2 / 2, dt, dt])
    return sigma_a**2 * b * b.T


def i2_axis_by_axis(dt, sigma_a):
    b = sp.Matrix([dt**2 / 2, dt])
    return sigma_a**2 * sp.diag(b * b.T, b * b.T)


def i3(v=lambda y0, y1, y2, t, a: (3 * y2 - 4 * y1 + y0) / (2 * t), a=lambda y0, y1, y2, t: (y2 - 2 * y1 + y0) / t**2, r=2):
    def answer(y0, y1, y2, dt):
        found = a(y0, y1, y2, dt)
        return (y0, y1, y2)[r], v(y0, y1, y2, dt, found), found

    return answer


def i3_solved(y0, y1, y2, dt):
    r, v, a = sp.symbols("r v a")
    equations = [r - v * k * dt + a * (k * dt) ** 2 / 2 - y for k, y in ((0, y2), (1, y1), (2, y0))]
    found = sp.solve(equations, [r, v, a])
    return found[r], found[v], found[a]


def i4(
    mean=lambda A, z, B, u: A @ z + B @ u,
    Psi_of=lambda A, p, B, u, Q: A @ p @ A.T + Q,
    expected=lambda H, lam, z: H @ lam,
    gain=lambda p, Psi, H, R: Psi @ H.T @ np.linalg.inv(H @ Psi @ H.T + R),
    cov=lambda p, Psi, K, H, R: Psi - K @ H @ Psi,
    sign=1,
):
    def answer(z, p, u, y, A, B, H, Q, R):
        lam, Psi = mean(A, z, B, u), Psi_of(A, p, B, u, Q)
        K = gain(p, Psi, H, R)
        return lam, Psi, lam + sign * K @ (y - expected(H, lam, z)), cov(p, Psi, K, H, R)

    return answer


def i4_by_information(z, p, u, y, A, B, H, Q, R):
    lam = B @ u + A @ z
    Psi = Q + A @ p @ A.T
    new = np.linalg.inv(np.linalg.inv(Psi) + H.T @ np.linalg.inv(R) @ H)
    return lam, Psi, lam + new @ H.T @ np.linalg.inv(R) @ (y - H @ lam), new


def i4_input_added_again(z, p, u, y, A, B, H, Q, R):
    lam, Psi, z, p = i4()(z, p, u, y, A, B, H, Q, R)
    return lam, Psi, z + B @ u, p


def i5(
    root_of_R=np.linalg.cholesky,
    by=lambda X, Y: Y @ np.linalg.inv(X),
    finish=lambda Z: Z @ np.diag(np.sign(np.diag(Z))),
):
    def answer(lam, S, y, H, R):
        p, n = H.shape
        wide = np.hstack([np.vstack([root_of_R(R), np.zeros((n, p))]), np.vstack([H @ S, S])])
        L = np.linalg.qr(wide.T)[1].T
        return lam + by(L[:p, :p], L[p:, :p]) @ (y - H @ lam), finish(L[p:, p:])

    return answer


def i5_column_by_column(lam, S, y, H, R):
    """Givens rotations instead of a ready factorisation."""
    p, n = H.shape
    M = np.block([[np.linalg.cholesky(R), H @ S], [np.zeros((n, p)), S]])
    for row in range(n + p):
        for column in range(row + 1, n + p):
            size = np.hypot(M[row, row], M[row, column])
            if size > 0:
                c, s = M[row, row] / size, M[row, column] / size
                M[:, [row, column]] = M[:, [row, column]] @ np.array([[c, -s], [s, c]])
    Z = M[p:, p:]
    return lam + M[p:, :p] @ np.linalg.solve(M[:p, :p], y - H @ lam), Z * np.where(np.diag(Z) < 0, -1, 1)


def i5_covariance_formed(lam, S, y, H, R):
    Psi = S @ S.T
    K = Psi @ H.T @ np.linalg.inv(H @ Psi @ H.T + R)
    return lam + K @ (y - H @ lam), np.linalg.cholesky(Psi - K @ H @ Psi)


def i5_joseph(lam, S, y, H, R):
    Psi = S @ S.T
    K = Psi @ H.T @ np.linalg.inv(H @ Psi @ H.T + R)
    left = np.eye(len(lam)) - K @ H
    return lam + K @ (y - H @ lam), np.linalg.cholesky(left @ Psi @ left.T + K @ R @ K.T)


def i5_root_of_the_share(lam, S, y, H, R):
    z, _ = i5()(lam, S, y, H, R)
    Psi = S @ S.T
    K = Psi @ H.T @ np.linalg.inv(H @ Psi @ H.T + R)
    return z, (np.eye(len(lam)) - K @ H) @ S


RIGHT = [
    ("i1", i1()),
    ("i2", i2()),
    ("i3", i3()),
    ("i3", i3_solved),
    ("i4", i4()),
    ("i4", i4_by_information),
    ("i5", i5()),
    ("i5", i5_column_by_column),
]

WRONG = [
    ("i1", "order-of-components", i1_axis_by_axis),
    ("i1", "transposed", i1_transposed_A),
    ("i1", "half-missing", i1(B=lambda dt: [[dt**2], [dt]])),
    ("i1", "first-order", i1(B=lambda dt: [[0], [dt]])),
    ("i1", "blocks-swapped", i1(B=lambda dt: [[dt], [dt**2 / 2]])),
    ("i1", "rows", i1(B=lambda dt: [[dt**2 / 2], [1]])),
    ("i1", "time-missing", i1(A=lambda dt: [[1, 1], [0, 1]])),
    ("i1", "rows", i1(A=lambda dt: [[1, dt], [0, 0]])),
    ("i1", "rows", i1(A=lambda dt: [[1, -dt], [0, 1]])),
    ("i1", "velocity-measured", i1(H=((0, 1),))),
    ("i1", "velocity-measured", i1(H=((1, 1),))),
    ("i2", "deviation-for-variance", i2(power=1)),
    ("i2", "unused", i2(power=0)),
    ("i2", "diagonal", i2(Q=lambda t: [[t**4 / 4, 0], [0, t**2]])),
    ("i2", "white-in-continuous-time", i2(Q=lambda t: [[t**3 / 3, t**2 / 2], [t**2 / 2, t]])),
    ("i2", "half-missing", i2(Q=lambda t: [[t**4, t**3], [t**3, t**2]])),
    ("i2", "input-once", i2(Q=lambda t: [[t**2 / 2, 0], [0, t]])),
    ("i2", "position-forgotten", i2(Q=lambda t: [[0, 0], [0, t**2]])),
    ("i2", "unused", i2(Q=lambda t: [[1, 0], [0, 1]])),
    ("i2", "correlation-sign", i2(Q=lambda t: [[t**4 / 4, -(t**3) / 2], [-(t**3) / 2, t**2]])),
    ("i2", "axes-coupled", i2_one_push),
    ("i2", "order-of-components", i2_axis_by_axis),
    ("i3", "first-difference", i3(v=lambda y0, y1, y2, t, a: (y2 - y1) / t)),
    ("i3", "middle-sample", i3(v=lambda y0, y1, y2, t, a: (y2 - y0) / (2 * t))),
    ("i3", "moved-too-far", i3(v=lambda y0, y1, y2, t, a: (y2 - y1) / t + a * t)),
    ("i3", "middle-sample", i3(v=lambda y0, y1, y2, t, a: (y2 - y1) / t - a * t / 2)),
    ("i3", "sign", i3(v=lambda y0, y1, y2, t, a: (y1 - y2) / t - a * t / 2)),
    (
        "i3",
        "power-of-dt",
        i3(a=lambda y0, y1, y2, t: (y2 - 2 * y1 + y0) / t, v=lambda y0, y1, y2, t, a: (3 * y2 - 4 * y1 + y0) / (2 * t)),
    ),
    (
        "i3",
        "coefficient-for-acceleration",
        i3(a=lambda y0, y1, y2, t: (y2 - 2 * y1 + y0) / (2 * t**2), v=lambda y0, y1, y2, t, a: (3 * y2 - 4 * y1 + y0) / (2 * t)),
    ),
    (
        "i3",
        "coefficient-for-acceleration",
        i3(a=lambda y0, y1, y2, t: (y2 - 2 * y1 + y0) / (2 * t**2), v=lambda y0, y1, y2, t, a: (y2 - y1) / t + a * t / 2),
    ),
    (
        "i3",
        "sign",
        i3(a=lambda y0, y1, y2, t: (2 * y1 - y2 - y0) / t**2, v=lambda y0, y1, y2, t, a: (3 * y2 - 4 * y1 + y0) / (2 * t)),
    ),
    ("i3", "first-sample samples-reversed", i3(r=0, v=lambda y0, y1, y2, t, a: (y1 - y0) / t - a * t / 2)),
    ("i3", "middle-sample", i3(r=1, v=lambda y0, y1, y2, t, a: (y2 - y0) / (2 * t))),
    ("i3", "first-sample samples-reversed", lambda y0, y1, y2, dt: i3()(y2, y1, y0, dt)),
    ("i4", "input-forgotten", i4(mean=lambda A, z, B, u: A @ z)),
    ("i4", "transition-transposed", i4(mean=lambda A, z, B, u: A.T @ z + B @ u)),
    ("i4", "input-sign", i4(mean=lambda A, z, B, u: A @ z - B @ u)),
    ("i4", "noise-forgotten", i4(Psi_of=lambda A, p, B, u, Q: A @ p @ A.T)),
    ("i4", "transition-transposed", i4(Psi_of=lambda A, p, B, u, Q: A.T @ p @ A + Q)),
    ("i4", "transition-forgotten", i4(Psi_of=lambda A, p, B, u, Q: p + Q)),
    ("i4", "noise-sign", i4(Psi_of=lambda A, p, B, u, Q: A @ p @ A.T - Q)),
    ("i4", "innovation-of-estimate", i4(expected=lambda H, lam, z: H @ z)),
    ("i4", "innovation-missing", i4(expected=lambda H, lam, z: 0)),
    ("i4", "gain-of-estimate", i4(gain=lambda p, Psi, H, R: p @ H.T @ np.linalg.inv(H @ p @ H.T + R))),
    ("i4", "noise-of-meter-forgotten", i4(gain=lambda p, Psi, H, R: Psi @ H.T @ np.linalg.inv(H @ Psi @ H.T))),
    ("i4", "covariance-kept", i4(cov=lambda p, Psi, K, H, R: Psi)),
    ("i4", "covariance-of-estimate", i4(cov=lambda p, Psi, K, H, R: p - K @ H @ p)),
    ("i4", "innovation-sign", i4(sign=-1)),
    ("i4", "input-twice", i4_input_added_again),
    ("i5", "noise-not-rooted", i5(root_of_R=lambda R: R)),
    ("i5", "signs", i5(finish=lambda Z: Z)),
    ("i5", "some-signs", i5(finish=np.abs)),
    ("i5", "upper", i5(finish=lambda Z: (Z * np.sign(np.diag(Z))).T)),
    ("i5", "some-signs", i5(finish=lambda Z: Z * np.sign(np.diag(Z))[:, None])),
    ("i5", "gain-not-divided", i5(by=lambda X, Y: Y)),
    ("i5", "gain-multiplied", i5(by=lambda X, Y: Y @ X)),
    ("i5", "sometimes", i5(by=lambda X, Y: Y @ np.linalg.inv(X.T))),
    ("i5", "divided-twice", i5(by=lambda X, Y: Y @ np.linalg.inv(X @ X.T))),
    ("i5", "gain-sign", i5(by=lambda X, Y: -Y @ np.linalg.inv(X))),
    ("i5", "share-of-root", i5_root_of_the_share),
]
UNUSABLE = [
    ("i1", "expected 3 results", lambda dt: i1()(dt)[:2]),
    ("i2", "expected a matrix with 4 rows", lambda dt, sigma_a: sigma_a**2 * i1()(dt)[1].T * i1()(dt)[1]),
    ("i4", "expected 4 results", lambda z, p, u, y, A, B, H, Q, R: i4()(z, p, u, y, A, B, H, Q, R)[2:]),
    ("i5", "not positive definite", i5_covariance_formed),
    ("i5", "not positive definite", i5_joseph),
    ("i5", "NaN or infinity", i5(root_of_R=np.sqrt)),
]
