"""Set g, answers as a student would type them: the right ones pass, the wrong ones are told apart or not named at all."""

import numpy as np
from answers import test_no_wrong_kind_of_mistake_is_named, test_right_answers_pass, test_what_cannot_be_compared_is_explained  # noqa: F401
from numpy import matrix_transpose as T
from scipy import stats

from kfcourse.checks import exercise
from kfcourse.exercises.g_extended.companion import linearisation

OWN = dict(zip(("f", "Phi", "g", "D_xi", "S", "H", "D_n"), linearisation(exercise("g", "53").model), strict=True))


def times(matrix, vector):
    return np.einsum("...ij,...j->...i", matrix, vector)


def g1_by_loops(function, x, h):
    result = np.empty((len(x), function(x).shape[1], x.shape[1]))
    for j in range(x.shape[1]):
        right, left = x.copy(), x.copy()
        right[:, j] += h
        left[:, j] -= h
        result[:, :, j] = (function(right) - function(left)) / 2 / h
    return result


def g1(back=True, width=lambda h: 2 * h, axis=-1, all_at_once=False):
    def answer(function, x, h):
        columns = []
        for e in np.eye(x.shape[1]):
            shift = h if all_at_once else h * e
            columns.append((function(x + shift) - function(x - shift if back else x)) / width(h))
        return np.stack(columns, axis=axis)

    return answer


def g1_not_divided(function, x, h):
    return g1()(function, x, h) * 2 * h


def g2(freedom=lambda d, n: d * n, tails=lambda c: ((1 - c) / 2, (1 + c) / 2), divisor=lambda d, n: n):
    def answer(degrees, runs, confidence):
        law = stats.chi2(freedom(degrees, runs))
        return tuple(law.ppf(tail) / divisor(degrees, runs) for tail in tails(confidence))

    return answer


def g2_normal(degrees, runs, confidence):
    return stats.norm(degrees, np.sqrt(2 * degrees / runs)).interval(confidence)


def g3(point=None, A_times=lambda A, p: A @ p @ T(A), noise=lambda B, D: B @ D @ T(B), mean=None, own=()):
    def answer(z, p, f, Phi, g, D_xi):
        f, Phi, g, D_xi = (
            OWN[name] if name in own else value for name, value in zip(("f", "Phi", "g", "D_xi"), (f, Phi, g, D_xi), strict=True)
        )
        at = point(z, f) if point else z
        return mean(z, f, Phi) if mean else f(z), A_times(Phi(at), p) + noise(g(at), D_xi)

    return answer


def g4(
    innovation=lambda y, S, C, lam: y - S(lam),
    F=lambda C, Psi, R: C @ Psi @ T(C) + R,
    gain=lambda Psi, C, F, R: Psi @ T(C) @ np.linalg.inv(F),
    cov=lambda Psi, K, C, F, R: (np.eye(Psi.shape[-1]) - K @ C) @ Psi,
    own=(),
):
    def answer(lam, Psi, y, S, H, D_n):
        S, H, D_n = (OWN[name] if name in own else value for name, value in zip(("S", "H", "D_n"), (S, H, D_n), strict=True))
        C, R = H(lam), D_n(lam)
        F_k = F(C, Psi, R)
        K = gain(Psi, C, F_k, R)
        return lam + times(K, innovation(y, S, C, lam)), cov(Psi, K, C, F_k, R)

    return answer


def joseph(Psi, K, C, F, R):
    left = np.eye(Psi.shape[-1]) - K @ C
    return left @ Psi @ T(left) + K @ R @ T(K)


def g4_elementwise(lam, Psi, y, S, H, D_n):
    C = H(lam)
    K = Psi @ T(C) / (C @ Psi @ T(C) + D_n(lam))
    return lam + times(K, y - S(lam)), Psi - K @ C @ Psi


def g4_numpy_T(lam, Psi, y, S, H, D_n):
    C = H(lam)
    K = Psi @ C.T @ np.linalg.inv(C @ Psi @ C.T + D_n(lam))
    return lam + K @ (y - S(lam)), Psi - K @ C @ Psi


def g4_gain_not_turned(lam, Psi, y, S, H, D_n):
    C = H(lam)
    K = np.linalg.solve(C @ Psi @ T(C) + D_n(lam), C @ Psi)
    return lam + times(K, y - S(lam)), Psi - K @ C @ Psi


def g5(first=False, stored=lambda z, p, lam, Psi, after: (z, p, lam, Psi), frozen=False, fed="z", start_cov=None, correct=None):
    correct = correct or g4()

    def answer(y, mean, cov, f, Phi, g, D_xi, S, H, D_n):
        N, n = y.shape[1], len(mean)
        lam = np.ones((N, 1)) * mean
        Psi = np.ones((N, 1, 1)) * (cov if start_cov is None else start_cov * np.eye(n))
        if first:
            lam, Psi = g3()(lam, Psi, f, Phi, g, D_xi)
        columns = [[], [], [], []]
        for k in range(len(y)):
            z, p = correct(lam, Psi, y[k], S, H, D_n)
            after = g3()(*{"z": (z, p), "lam": (lam, Psi), "z, Psi": (z, Psi), "lam, p": (lam, p)}[fed], f, Phi, g, D_xi)
            for column, value in zip(columns, stored(z, p, lam, Psi, after), strict=True):
                column.append(value)
            lam, Psi = after[0], Psi if frozen else after[1]
        return tuple(np.stack(column) for column in columns)

    return answer


def g6(
    error=lambda x, z, lam: x - z,
    own=lambda p, Psi: p,
    innovation=lambda y, S, z, lam: y - S(lam),
    F=lambda C, Psi, p, R: C @ Psi @ T(C) + R,
    weigh=np.linalg.inv,
    over=lambda values, x, y: values.mean(axis=1),
    parts=lambda nees, nis, n, m: (nees, nis),
):
    def answer(x, z, p, y, lam, Psi, S, H, D_n):
        def squared(e, cov):
            return np.einsum("kni,knij,knj->kn", e, weigh(cov), e)

        nees = over(squared(error(x, z, lam), own(p, Psi)), x, y)
        nis = over(squared(innovation(y, S, z, lam), F(H(lam), Psi, p, D_n(lam))), x, y)
        return parts(nees, nis, x.shape[-1], y.shape[-1])

    return answer


def only_diagonal(cov):
    return np.eye(cov.shape[-1]) / np.diagonal(cov, axis1=-2, axis2=-1)[..., None]


def g7(
    information=lambda W, H, R: W + T(H) @ np.linalg.inv(R) @ H,
    gain=lambda p, H, R: p @ T(H) @ np.linalg.inv(R),
    invert=np.linalg.inv,
):
    def answer(W, H, D_n):
        p = invert(information(W, H, D_n))
        return p, gain(p, H, D_n)

    return answer


def g7_by_the_gain_form(W, H, D_n):
    Psi = np.linalg.inv(W)
    K = Psi @ T(H) @ np.linalg.inv(H @ Psi @ T(H) + D_n)
    return Psi - K @ H @ Psi, K


RIGHT = [
    ("g1", g1_by_loops),
    ("g2", g2()),
    ("g3", g3()),
    ("g4", g4()),
    ("g4", g4(cov=joseph)),
    ("g4", g4(cov=lambda Psi, K, C, F, R: Psi - K @ F @ T(K))),
    ("g5", g5()),
    ("g6", g6()),
    ("g7", g7()),
]

WRONG = [
    ("g1", "one-sided", g1(back=False, width=lambda h: h)),
    ("g1", "divided-by-one-step", g1(width=lambda h: h)),
    ("g1", "multiplied-by-step", g1(width=lambda h: 2 / h)),
    ("g1", "sign", g1(width=lambda h: -2 * h)),
    ("g1", "transposed", g1(axis=-2)),
    ("g1", "all-at-once", g1(all_at_once=True)),
    ("g1", "step-forgotten", g1_not_divided),
    ("g2", "one-value", g2(freedom=lambda d, n: d, divisor=lambda d, n: 1)),
    ("g2", "not-divided", g2(divisor=lambda d, n: 1)),
    ("g2", "per-component", g2(divisor=lambda d, n: d * n)),
    ("g2", "one-value-divided", g2(freedom=lambda d, n: d)),
    ("g2", "runs-only", g2(freedom=lambda d, n: n)),
    ("g2", "one-less", g2(freedom=lambda d, n: d * n - 1)),
    ("g2", "one-sided", g2(tails=lambda c: (1 - c, c))),
    ("g2", "half-confidence", g2(tails=lambda c: (c / 2, 1 - c / 2))),
    ("g2", "divided-by-root", g2(divisor=lambda d, n: n**0.5)),
    ("g2", "normal", g2_normal),
    ("g3", "noise-forgotten", g3(noise=lambda B, D: 0)),
    ("g3", "factor-forgotten", g3(noise=lambda B, D: D)),
    ("g3", "noise-covariance-forgotten", g3(noise=lambda B, D: B @ T(B))),
    ("g3", "covariance-squared", g3(noise=lambda B, D: B @ D @ D @ T(B))),
    ("g3", "noise-sign", g3(noise=lambda B, D: -B @ D @ T(B))),
    ("g3", "jacobian-transposed", g3(A_times=lambda A, p: T(A) @ p @ A)),
    ("g3", "slope-power", g3(A_times=lambda A, p: A @ p)),
    ("g3", "scalars-only", g3(A_times=lambda A, p: A @ p @ A)),
    ("g3", "unused", g3(A_times=lambda A, p: A @ T(A))),
    ("g3", "scalars-only", g3(A_times=lambda A, p: A**2 * p)),
    ("g3", "mean-by-jacobian", g3(mean=lambda z, f, Phi: times(Phi(z), z))),
    ("g3", "mean-kept", g3(mean=lambda z, f, Phi: z)),
    ("g4", "expected-by-jacobian", g4(innovation=lambda y, S, C, lam: y - times(C, lam))),
    ("g4", "innovation-sign", g4(innovation=lambda y, S, C, lam: S(lam) - y)),
    ("g4", "innovation-without-S", g4(innovation=lambda y, S, C, lam: y)),
    ("g4", "noise-of-meter-forgotten unused", g4(F=lambda C, Psi, R: C @ Psi @ T(C))),
    ("g4", "forms-mixed", g4(F=lambda C, Psi, R: R)),
    ("g4", "negative-variance", g4(F=lambda C, Psi, R: C @ Psi @ T(C) - R)),
    ("g4", "gain-without-Psi", g4(gain=lambda Psi, C, F, R: T(C) @ np.linalg.inv(F))),
    ("g4", "gain-multiplied", g4(gain=lambda Psi, C, F, R: Psi @ T(C) @ F)),
    ("g4", "gain-not-divided", g4(gain=lambda Psi, C, F, R: Psi @ T(C))),
    ("g4", "forms-mixed", g4(gain=lambda Psi, C, F, R: Psi @ T(C) @ np.linalg.inv(R))),
    ("g4", "covariance-kept", g4(cov=lambda Psi, K, C, F, R: Psi)),
    ("g4", "covariance-added", g4(cov=lambda Psi, K, C, F, R: Psi + K @ C @ Psi)),
    ("g4", "share-only", g4(cov=lambda Psi, K, C, F, R: np.eye(Psi.shape[-1]) - K @ C)),
    ("g4", "covariance-once", g4(cov=lambda Psi, K, C, F, R: Psi - K @ C)),
    ("g4", "scalars-only", g4(cov=lambda Psi, K, C, F, R: (1 - K @ C) @ Psi)),
    ("g4", "unchanged covariance-kept", lambda lam, Psi, y, S, H, D_n: (lam, Psi)),
    ("g5", "predicted-first", g5(first=True)),
    ("g5", "predictions-shifted", g5(stored=lambda z, p, lam, Psi, after: (z, p, *after))),
    ("g5", "swapped", g5(stored=lambda z, p, lam, Psi, after: (lam, Psi, z, p))),
    ("g5", "swapped", g5(stored=lambda z, p, lam, Psi, after: (z, Psi, lam, p))),
    ("g5", "covariance-frozen", g5(frozen=True)),
    ("g5", "covariance-kept from-second-step", g5(fed="z, Psi")),
    ("g5", "from-second-step unused", g5(fed="lam, p")),
    ("g5", "innovation-sign", g5(correct=g4(innovation=lambda y, S, C, lam: S(lam) - y))),
    ("g5", "covariance-kept", g5(correct=g4(cov=lambda Psi, K, C, F, R: Psi))),
    ("g6", "covariance-of-prediction", g6(own=lambda p, Psi: Psi)),
    ("g6", "prediction-for-estimate", g6(error=lambda x, z, lam: x - lam, own=lambda p, Psi: Psi)),
    ("g6", "noise-forgotten", g6(F=lambda C, Psi, p, R: C @ Psi @ T(C))),
    ("g6", "noise-for-innovation", g6(F=lambda C, Psi, p, R: R)),
    ("g6", "residual-for-innovation", g6(innovation=lambda y, S, z, lam: y - S(z))),
    ("g6", "inverse-forgotten", g6(weigh=lambda cov: cov)),
    ("g6", "correlations-ignored", g6(weigh=only_diagonal)),
    ("g6", "root", g6(over=lambda values, x, y: np.sqrt(values.mean(axis=1)))),
    ("g6", "median", g6(over=lambda values, x, y: np.median(values, axis=1))),
    ("g6", "spread", g6(over=lambda values, x, y: values.var(axis=1))),
    ("g6", "per-component", g6(parts=lambda nees, nis, n, m: (nees / n, nis / m))),
    ("g7", "prior-inverted", g7(information=lambda W, H, R: np.linalg.pinv(W) + T(H) @ np.linalg.inv(R) @ H)),
    ("g7", "noise-not-inverted", g7(information=lambda W, H, R: W + T(H) @ R @ H)),
    ("g7", "unused", g7(information=lambda W, H, R: W + T(H) @ H)),
    ("g7", "information-subtracted", g7(information=lambda W, H, R: W - T(H) @ np.linalg.inv(R) @ H)),
    ("g7", "prior-ignored", g7(information=lambda W, H, R: T(H) @ np.linalg.inv(R) @ H)),
    ("g7", "gain-not-divided", g7(gain=lambda p, H, R: p @ T(H))),
    ("g7", "gain-by-information inverse-forgotten inverse-forgotten-in-p", g7(invert=lambda information: information)),
]
UNUSABLE = [
    ("g2", "expected 2 results", lambda degrees, runs, confidence: stats.chi2.ppf(confidence, degrees * runs) / runs),
    ("g3", "could not be broadcast", lambda z, p, f, Phi, g, D_xi: (f(z), Phi(z) @ p @ Phi(z).T + g(z) @ D_xi @ g(z).T)),
    ("g3", "mismatch in its core dimension", g3(own=("f", "Phi"))),
    ("g4", "could not be broadcast", g4_elementwise),
    ("g4", "mismatch in its core dimension", g4_numpy_T),
    ("g4", "could not be broadcast", g4_gain_not_turned),
    ("g4", "mismatch in its core dimension", g4(own=("H",))),
    ("g6", "expected an array of shape", g6(over=lambda values, x, y: values.mean(axis=0))),
    ("g6", "expected an array of shape", g6(over=lambda values, x, y: values)),
    ("g7", "Singular matrix", g7_by_the_gain_form),
]
