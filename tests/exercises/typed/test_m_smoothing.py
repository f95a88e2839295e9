"""Set m, answers as a student would type them: the right ones pass, the wrong ones are told apart or not named at all."""

import numpy as np
import sympy as sp
from answers import test_no_wrong_kind_of_mistake_is_named, test_right_answers_pass, test_what_cannot_be_compared_is_explained  # noqa: F401


def m2(nu, F, halves=1, log=lambda F: sp.log(2 * sp.pi * F)):
    return -halves * nu**2 / F / 2 - log(F) / 2


def m3(cross=lambda p, A: p @ A.T, ahead=lambda p, A, Q: A @ p @ A.T + Q):
    return lambda p, A, Q: (cross(p, A), cross(p, A) @ np.linalg.inv(ahead(p, A, Q)))


def m3_by_blocks(p, A, Q):
    """The joint covariance of both states, cut into blocks."""
    lift = np.vstack([np.eye(2), A])
    joint = lift @ p @ lift.T + np.block([[np.zeros((2, 4))], [np.zeros((2, 2)), Q]])
    return joint[:2, 2:], joint[:2, 2:] @ np.linalg.inv(joint[2:, 2:])


def m4(mean=lambda z, S, b, a: z + S @ (b - a), cov=lambda p, S, pb, Psi: p - S @ Psi @ S.T + S @ pb @ S.T):
    return lambda z, p, a, Psi, b, pb, S: (mean(z, S, b, a), cov(p, S, pb, Psi))


def m5(start=None, used="smoothed", predicted=1, reverse=False):
    def answer(z, p, ahead, Psi, A, Q):
        means, covs = [z[-1]], [p[-1]]
        if start == "prediction":
            means, covs = [ahead[-1]], [Psi[-1]]
        for k in range(len(z) - 2, -1, -1):
            S = m3()(p[k], A, Q)[1]
            later = (means[0], covs[0]) if used == "smoothed" else (z[k + 1], p[k + 1])
            mean, cov = m4()(z[k], p[k], ahead[k + predicted], Psi[k + predicted], *later, S)
            means.insert(0, mean)
            covs.insert(0, cov)
        order = slice(None, None, -1 if reverse else 1)
        return np.array(means)[order], np.array(covs)[order]

    return answer


def m5_by_psi(ahead_by):
    """With what the filter has predicted, and without Q."""

    def answer(z, p, ahead, Psi, A, Q):
        means, covs = z.copy(), p.copy()
        for k in range(len(z) - 2, -1, -1):
            S = p[k] @ A.T @ np.linalg.inv(Psi[k + ahead_by])
            means[k] += S @ (means[k + 1] - ahead[k + 1])
            covs[k] += S @ (covs[k + 1] - Psi[k + 1]) @ S.T
        return means, covs

    return answer


def m5_at_once(z, p, ahead, Psi, A, Q):
    """One dense law of the record: the information of the filter's corrections, and the motion."""
    steps, n = z.shape
    J, b = np.zeros((steps * n, steps * n)), np.zeros(steps * n)
    for k in range(steps):
        at = slice(k * n, k * n + n)
        own = np.linalg.inv(p[k]) - (np.linalg.inv(Psi[k]) if k else 0)
        J[at, at] += own
        b[at] += np.linalg.solve(p[k], z[k]) - (np.linalg.solve(Psi[k], ahead[k]) if k else 0)
        if k:
            both = slice((k - 1) * n, (k + 1) * n)
            D = np.hstack([-A, np.eye(n)])
            c = ahead[k] - A @ z[k - 1]
            J[both, both] += D.T @ np.linalg.solve(Q, D)
            b[both] += D.T @ np.linalg.solve(Q, c)
    P = np.linalg.inv(J)
    return (P @ b).reshape(steps, n), np.array([P[k * n : k * n + n, k * n : k * n + n] for k in range(steps)])


def m6_loop(y, z, p):
    total, count = 0.0, 0
    for value, mean, variance in zip(y, z, p, strict=True):
        if not np.isnan(value):
            total, count = total + value**2 - 2 * value * mean + mean**2 + variance, count + 1
    return total / count


def m7(r, R, G, p, s, trace=True, m=None):
    inverse = np.linalg.inv(R)
    return (s + (m or len(r))) / (s + r @ inverse @ r + (np.trace(inverse @ G @ p @ G.T) if trace else 0))


RIGHT = [
    ("m1", lambda beta: 2 * np.log(1 / (1 - beta))),
    ("m2", m2),
    ("m2", lambda nu, F: -sp.log(sp.sqrt(2 * sp.pi * F)) - (nu / sp.sqrt(F)) ** 2 / 2),
    ("m3", m3()),
    ("m3", m3_by_blocks),
    ("m4", m4()),
    ("m5", m5()),
    ("m5", m5_at_once),
    ("m5", m5_by_psi(1)),
    ("m6", m6_loop),
    ("m7", m7),
]

WRONG = [
    ("m1", "other-side", lambda beta: 2 * np.log(1 / beta)),
    ("m1", "radius", lambda beta: np.sqrt(2) * np.sqrt(-np.log(1 - beta))),
    ("m1", "half-forgotten factor-2", lambda beta: -np.log(1 - beta)),
    ("m1", "sign", lambda beta: np.log((1 - beta) ** 2)),
    ("m2", "volume-forgotten", lambda nu, F: -(nu**2) / (2 * F)),
    ("m2", "constant-forgotten", lambda nu, F: m2(nu, F, log=sp.log)),
    ("m2", "half-of-square", lambda nu, F: m2(nu, F, halves=2)),
    ("m2", "density", lambda nu, F: sp.exp(-(nu**2) / 2 / F) / sp.sqrt(2 * sp.pi * F)),
    ("m2", "sign", lambda nu, F: nu**2 / 2 / F + sp.log(2 * sp.pi * F) / 2),
    ("m3", "transposed", m3(cross=lambda p, A: A @ p)),
    ("m3", "A-not-transposed", m3(cross=lambda p, A: p @ A)),
    ("m3", "Q-forgotten", m3(ahead=lambda p, A, Q: A @ p @ A.T)),
    ("m3", "divided-by-p", m3(ahead=lambda p, A, Q: p)),
    ("m3", "carried-twice", m3(cross=lambda p, A: A @ p @ A.T)),
    ("m4", "innovation-sign", m4(mean=lambda z, S, b, a: z + S @ (a - b))),
    ("m4", "later-for-innovation", m4(mean=lambda z, S, b, a: z + S @ b)),
    ("m4", "as-if-known", m4(cov=lambda p, S, pb, Psi: p - S @ Psi @ S.T)),
    ("m4", "covariance-sign", m4(cov=lambda p, S, pb, Psi: p - S @ (pb - Psi) @ S.T)),
    ("m4", "gain-once", m4(cov=lambda p, S, pb, Psi: p - S @ (Psi - pb))),
    ("m5", "one-step-only", m5(used="filtered")),
    ("m5", "prediction-of-same-step", m5(predicted=0)),
    ("m5", "negative-variance", m5_by_psi(0)),  # Psi has Q in it: that Q itself is not used tells nothing
    ("m5", "reversed", m5(reverse=True)),
    ("m5", "from-the-prediction", m5(start="prediction")),
    ("m6", "variance-forgotten", lambda y, z, p: np.nanmean((y - z) ** 2)),
    ("m6", "missing-counted", lambda y, z, p: np.nansum((y - z) ** 2 + p) / len(y)),
    ("m6", "missing-as-zero", lambda y, z, p: np.mean((np.where(np.isnan(y), 0, y) - z) ** 2 + p)),
    ("m6", "about-the-mean", lambda y, z, p: np.nanvar(y - z) + np.mean(p[~np.isnan(y)])),
    ("m6", "about-the-mean", lambda y, z, p: np.nanvar(y - z) + np.mean(p)),
    ("m6", "variance-everywhere", lambda y, z, p: np.nanmean((y - z) ** 2) + np.mean(p)),
    ("m7", "trace-forgotten", lambda *a: m7(*a, trace=False)),
    ("m7", "one-component", lambda *a: m7(*a, m=1)),
    ("m7", "components-of-state", lambda r, R, G, p, s: m7(r, R, G, p, s, m=G.shape[1])),
]
UNUSABLE = [
    ("m6", "a missing measurement used", lambda y, z, p: np.mean((y - z) ** 2 + p)),
]
