"""Set j, answers as a student would type them: the right ones pass, the wrong ones are told apart or not named at all."""

import numpy as np
import sympy as sp
from answers import test_no_wrong_kind_of_mistake_is_named, test_right_answers_pass, test_what_cannot_be_compared_is_explained  # noqa: F401
from scipy.linalg import solve_discrete_are

cos, sin, tan = sp.cos, sp.sin, sp.tan


def j1_by_rotations(r, phi, eps):
    up = sp.Matrix([[cos(eps), 0, -sin(eps)], [0, 1, 0], [sin(eps), 0, cos(eps)]])
    about = sp.Matrix([[cos(phi), -sin(phi), 0], [sin(phi), cos(phi), 0], [0, 0, 1]])
    return tuple(about * up * sp.Matrix([r, 0, 0]))


def j1_degrees(r, phi, eps):
    return j1_by_rotations(r, phi * sp.pi / 180, eps * sp.pi / 180)


def j2(
    azimuth=lambda x, y, z: sp.atan(y / x),
    elevation=lambda x, y, z: sp.asin(z / sp.sqrt(x**2 + y**2 + z**2)),
    range_=None,
):
    def answer(x, y, z):
        r = range_(x, y, z) if range_ else sp.sqrt(x**2 + y**2 + z**2)
        measured = [r, azimuth(x, y, z), elevation(x, y, z)]
        return sp.Matrix([[sp.diff(measured[i], s) for s in (x, y, z)] for i in range(3)])

    return answer


def j2_by_hand(phi=lambda x, y, rho: (-y / rho**2, x / rho**2, 0), eps=None):
    def answer(x, y, z):
        rho = sp.sqrt(x * x + y * y)
        r = sp.sqrt(rho**2 + z * z)
        last = eps(x, y, z, rho, r) if eps else (-x * z / (r**2 * rho), -y * z / (r**2 * rho), rho / r**2)
        return sp.Matrix([[x / r, y / r, z / r], phi(x, y, rho), last])

    return answer


def j2_of_cartesian(x, y, z):
    r, phi, eps = sp.symbols("r phi eps")
    J = sp.Matrix(j1_by_rotations(r, phi, eps)).jacobian([r, phi, eps])
    rho = sp.sqrt(x**2 + y**2)
    return J.subs({r: sp.sqrt(rho**2 + z**2), phi: sp.atan2(y, x), eps: sp.atan2(z, rho)})


def j3(beta=lambda alpha: 2 * (1 - np.sqrt(1 - alpha)) ** 2, index=lambda alpha, beta: np.sqrt(beta**2 / (1 - alpha))):
    return lambda alpha: (beta(alpha), index(alpha, beta(alpha)))


def j3_by_the_filter(alpha):
    """The index at which the gain of a Kalman filter converges to alpha, by bisection; T and sigma are 1."""
    A, b, H = np.array([[1, 1], [0, 1]]), np.array([[0.5], [1]]), np.array([[1, 0]])
    low, high = 1e-4, 1e4
    while high / low > 1 + 1e-13:
        index = np.sqrt(low * high)
        Psi = solve_discrete_are(A.T, H.T, index**2 * b @ b.T, np.eye(1))
        K = Psi[:, 0] / (Psi[0, 0] + 1)
        low, high = (index, high) if K[0] < alpha else (low, index)
    return K[1], index


def j4(
    order="correct first",
    second=lambda beta, T: beta / T,
    sign=1,
    returned="estimate",
    gains=("alpha", "beta"),
):
    def answer(y, T, alpha, beta, r, v):
        gain = {"alpha": alpha, "beta": beta}
        a, b = gain[gains[0]], gain[gains[1]]
        rp, vp = np.broadcast_to(r, y[0].shape), np.broadcast_to(v, y[0].shape)
        if order == "predict first":
            rp = rp + T * vp
        out_r, out_v = np.empty_like(y), np.empty_like(y)
        for k, measured in enumerate(y):
            rk = rp + sign * a * (measured - rp)
            vk = vp + sign * second(b, T) * (measured - (rk if order == "r first" else rp))
            out_r[k], out_v[k] = (rk, vk) if returned == "estimate" else (rp, vp)
            rp, vp = rk + T * vk, vk
            if order == "never predicted":
                rp = rk
        return out_r, out_v

    return answer


def j4_velocity_kept(y, T, alpha, beta, r, v):
    return j4(second=lambda beta, T: 0)(y, T, alpha, beta, r, v)


def j4_matrices(y, T, alpha, beta, r, v):
    A, K, H = np.array([[1, T], [0, 1]]), np.array([[alpha], [beta / T]]), np.array([[1, 0]])
    s = np.array([r, v])[:, None, :] * np.ones((1, y.shape[1], 1))
    found = []
    for row in y:
        s = s + np.einsum("ij,jnc->inc", K, row[None] - np.einsum("ij,jnc->inc", H, s))
        found.append(s)
        s = np.einsum("ij,jnc->inc", A, s)
    return tuple(np.array(found).transpose(1, 0, 2, 3))


def j5(position=lambda a, T, al, be: a * T**2 * (1 - al) / be, velocity=lambda a, T, al, be: a * T * (2 * al - be) / (2 * be)):
    return lambda a, T, alpha, beta: (position(a, T, alpha, beta), velocity(a, T, alpha, beta))


def j5_solved(a, T, alpha, beta):
    e, d = sp.symbols("e d")
    before = e + T * d + a * T**2 / 2
    found = sp.solve([before * (1 - alpha) - e, d + a * T - beta / T * before - d], [e, d])
    return found[e], found[d]


def j5_velocity_jump_forgotten(a, T, alpha, beta):
    e, d = sp.symbols("e d")
    before = e + T * d
    found = sp.solve([before * (1 - alpha) - e, d + a * T - beta / T * before - d], [e, d])
    return found[e], found[d]


def j6(M=lambda K, A, H: (np.eye(2) - K @ H) @ A, noise=lambda K: K @ K.T, entry=(0, 0), last=lambda value: value, steps=3000):
    def answer(alpha, beta):
        K, A, H = np.array([[alpha], [beta]]), np.array([[1, 1], [0, 1]]), np.array([[1, 0]])
        P = np.zeros((2, 2))
        for _ in range(steps):
            P = M(K, A, H) @ P @ M(K, A, H).T + noise(K)
        return last(P[entry])

    return answer


def j6_closed(alpha, beta):
    return (2 * alpha**2 + beta * (2 - 3 * alpha)) / (alpha * (4 - 2 * alpha - beta))


RIGHT = [
    ("j1", j1_by_rotations),
    ("j2", j2()),
    ("j2", j2_by_hand()),
    ("j3", j3()),
    ("j3", j3_by_the_filter),
    ("j4", j4()),
    ("j4", j4_matrices),
    ("j5", j5()),
    ("j5", j5_solved),
    ("j6", j6()),
    ("j6", j6_closed),
]

WRONG = [
    ("j1", "from-the-zenith", lambda r, phi, eps: (r * sin(eps) * cos(phi), r * sin(eps) * sin(phi), r * cos(eps))),
    ("j1", "azimuth-from-y", lambda r, phi, eps: (r * cos(eps) * sin(phi), r * cos(eps) * cos(phi), r * sin(eps))),
    ("j1", "slant-range", lambda r, phi, eps: (r * cos(phi), r * sin(phi), r * sin(eps))),
    ("j1", "height-by-tangent slant-range", lambda r, phi, eps: (r * cos(phi), r * sin(phi), r * tan(eps))),
    ("j1", "height-by-tangent", lambda r, phi, eps: (r * cos(eps) * cos(phi), r * cos(eps) * sin(phi), r * tan(eps))),
    ("j1", "azimuth-sense", lambda r, phi, eps: (r * cos(eps) * cos(phi), -r * cos(eps) * sin(phi), r * sin(eps))),
    ("j1", "unused", lambda r, phi, eps: (r * cos(eps) * cos(phi), r * cos(eps) * sin(phi), r * sin(phi))),
    ("j1", "unused", lambda r, phi, eps: (r * cos(phi) * cos(eps), r * cos(phi) * sin(eps), r * sin(phi))),
    ("j1", "degrees", j1_degrees),
    ("j2", "transposed", lambda x, y, z: j2()(x, y, z).T),
    ("j2", "azimuth-reversed", j2(azimuth=lambda x, y, z: sp.atan(x / y))),
    ("j2", "ground-range", j2(range_=lambda x, y, z: sp.sqrt(x**2 + y**2))),
    ("j2", "ground-fixed", j2_by_hand(eps=lambda x, y, z, rho, r: (0, 0, rho / r**2))),
    ("j2", "inverse", j2_of_cartesian),
    ("j3", "other-root", j3(beta=lambda alpha: 2 * (2 - alpha) + 4 * np.sqrt(1 - alpha))),
    ("j3", "benedict-bordner", j3(beta=lambda alpha: alpha**2 / (2 - alpha))),
    ("j3", "small-alpha", j3(beta=lambda alpha: alpha**2 / 2)),
    ("j3", "small-alpha", j3(beta=lambda alpha: alpha**2 / 4)),
    ("j3", "coefficient-of-root", j3(beta=lambda alpha: 2 * (2 - alpha) - 2 * np.sqrt(1 - alpha))),
    ("j3", "root-forgotten", j3(beta=lambda alpha: 2 * (2 - alpha) - 4 * (1 - alpha))),
    ("j3", "factor-2", j3(beta=lambda alpha: 2 - alpha - 2 * np.sqrt(1 - alpha))),
    ("j3", "index-squared", j3(index=lambda alpha, beta: beta**2 / (1 - alpha))),
    ("j3", "index-without-root", j3(index=lambda alpha, beta: beta / (1 - alpha))),
    ("j3", "another-result", j3(index=lambda alpha, beta: beta)),
    ("j3", "alpha-for-beta", j3(index=lambda alpha, beta: alpha / np.sqrt(1 - alpha))),
    ("j3", "swapped", lambda alpha: j3()(alpha)[::-1]),
    ("j4", "predicted-first", j4(order="predict first")),
    ("j4", "position-first", j4(order="r first")),
    ("j4", "prediction-forgotten", j4(order="never predicted")),
    ("j4", "beta-not-divided", j4(second=lambda beta, T: beta)),
    ("j4", "beta-multiplied", j4(second=lambda beta, T: beta * T)),
    ("j4", "beta-over-T-squared", j4(second=lambda beta, T: beta / T**2)),
    ("j4", "innovation-sign", j4(sign=-1)),
    ("j4", "predictions-returned", j4(returned="prediction")),
    ("j4", "gains-swapped", j4(gains=("beta", "alpha"))),
    ("j4", "velocity-kept", j4_velocity_kept),
    ("j5", "prediction", j5(position=lambda a, T, al, be: a * T**2 / be)),
    (
        "j5",
        "prediction",
        j5(position=lambda a, T, al, be: a * T**2 / be, velocity=lambda a, T, al, be: a * T * (al / be + sp.Rational(1, 2))),
    ),
    (
        "j5",
        "sign",
        j5(
            position=lambda a, T, al, be: -a * T**2 * (1 - al) / be,
            velocity=lambda a, T, al, be: -a * T * (al / be - sp.Rational(1, 2)),
        ),
    ),
    ("j5", "position-not-accelerated", j5(velocity=lambda a, T, al, be: a * T * al / be)),
    ("j5", "prediction", j5(velocity=lambda a, T, al, be: a * T * (al / be + sp.Rational(1, 2)))),
    ("j5", "half-forgotten", j5(velocity=lambda a, T, al, be: a * T * (al / be - 1))),
    ("j5", "time-missing", j5(velocity=lambda a, T, al, be: a * (al / be - sp.Rational(1, 2)))),
    ("j5", "vanishing", j5(velocity=lambda a, T, al, be: 0)),
    ("j5", "unused", j5(velocity=lambda a, T, al, be: a * T)),
    ("j5", "half-interval", j5(position=lambda a, T, al, be: a * T**2 * (1 - al) / (2 * be))),
    ("j5", "alpha-for-rest", j5(position=lambda a, T, al, be: a * T**2 * al / be)),
    ("j5", "unused", j5(position=lambda a, T, al, be: a * T**2 / 2)),
    ("j5", "position-not-accelerated", j5_velocity_jump_forgotten),
    ("j6", "velocity", j6(entry=(1, 1))),
    ("j6", "covariance-with-velocity", j6(entry=(0, 1))),
    ("j6", "root", j6(last=np.sqrt)),
    (
        "j6",
        "prediction",
        j6(
            M=lambda K, A, H: A @ (np.eye(2) - K @ H),
            noise=lambda K: np.array([[1, 1], [0, 1]]) @ K @ K.T @ np.array([[1, 0], [1, 1]]),
        ),
    ),
    ("j6", "alpha-filter", j6(M=lambda K, A, H: np.eye(2) - K @ H)),
    ("j6", "correlation-forgotten", j6(noise=lambda K: np.diag(K[:, 0] ** 2))),
    ("j6", "one-step", j6(steps=1)),
    ("j6", "alpha-filter", lambda alpha, beta: alpha / (2 - alpha)),
    ("j6", "kalman-covariance", lambda alpha, beta: alpha),
    ("j6", "one-step", lambda alpha, beta: alpha**2),
]
UNUSABLE = [
    (
        "j1",
        "functions of symbols",
        lambda r, phi, eps: (r * np.cos(eps) * np.cos(phi), r * np.cos(eps) * np.sin(phi), r * np.sin(eps)),
    ),
    ("j4", "expected 2 results", lambda y, T, alpha, beta, r, v: j4()(y, T, alpha, beta, r, v)[0]),
]
