"""Set n, answers as a student would type them: the right ones pass, the wrong ones are told apart or not named at all."""

import numpy as np
from answers import test_no_wrong_kind_of_mistake_is_named, test_right_answers_pass, test_what_cannot_be_compared_is_explained  # noqa: F401
from scipy.stats import chi2, norm


def n1_by_loop(times):
    found = [times[k + 1] - times[k] for k in range(len(times) - 1)]
    return [*found, found[-1]]


def n2(entries=lambda t: [[t**3 / 3, t**2 / 2], [t**2 / 2, t]], factor=lambda q: q):
    return lambda dt, q: np.array([factor(q) * np.array(entries(t)) for t in dt])


def n2_in_two_halves(dt, q):
    """What the first half has added is carried over the second."""
    found = []
    for t in dt / 2:
        half, A = q * np.array([[t**3 / 3, t**2 / 2], [t**2 / 2, t]]), np.array([[1, t], [0, 1]])
        found.append(A @ half @ A.T + half)
    return np.stack(found)


def n3(
    dt=lambda t, k: t[k] - t[k - 1],
    Q=lambda t, q: q * np.array([[t**3 / 3, t**2 / 2], [t**2 / 2, t]]),
    empty=lambda m, P, r: (m, P),
    first=1,
):
    def answer(times, y, q, r, m, P):
        means, covs = [], []
        for k, seen in enumerate(y):
            if k >= first:
                t = dt(times, k)
                A = np.array([[1, t], [0, 1]])
                m, P = A @ m, A @ P @ A.T + Q(t, q)
            if np.isnan(seen):
                m, P = empty(m, P, r)
            else:
                K = P @ np.array([[1], [0]]) / (P[0, 0] + r)
                m, P = m + K[:, 0] * (seen - m[0]), (np.eye(2) - K @ np.array([[1, 0]])) @ P
            means.append(m)
            covs.append(P)
        return np.stack(means), np.stack(covs)

    return answer


def n3_all_at_once(times, y, q, r, m, P):
    """One normal law of all states, conditioned on the measurements up to each row."""
    n = len(times)
    cross = np.zeros((n, n, 2, 2))
    mean = [m]
    cross[0, 0] = P
    for k in range(1, n):
        t = times[k] - times[k - 1]
        A = np.array([[1, t], [0, 1]])
        mean.append(A @ mean[-1])
        for j in range(k):
            cross[k, j] = A @ cross[k - 1, j]
            cross[j, k] = cross[k, j].T
        cross[k, k] = A @ cross[k - 1, k - 1] @ A.T + q * np.array([[t**3 / 3, t**2 / 2], [t**2 / 2, t]])
    z, p = [], []
    for k in range(n):
        seen = [j for j in range(k + 1) if not np.isnan(y[j])]
        S = np.array([[cross[i, j][0, 0] for j in seen] for i in seen]) + r * np.eye(len(seen))
        C = np.array([cross[k, j][:, 0] for j in seen]).T
        G = C @ np.linalg.inv(S)
        z.append(mean[k] + G @ np.array([y[j] - mean[j][0] for j in seen]))
        p.append(cross[k, k] - G @ C.T)
    return np.array(z), np.array(p)


def zero(m, P, r):
    K = P[:, 0] / (P[0, 0] + r)
    return m - K * m[0], P - np.outer(K, P[0])


def expected(m, P, r):
    K = P[:, 0] / (P[0, 0] + r)
    return m, P - np.outer(K, P[0])


def n4(size=lambda nu, F: nu @ np.linalg.inv(F) @ nu, edge=lambda p, probability: chi2.ppf(probability, p)):
    return lambda nu, F, probability: (
        np.array([size(one, cov) for one, cov in zip(nu, F, strict=True)]),
        edge(nu.shape[1], probability),
    )


def n4_by_whitening(nu, F, probability):
    white = np.stack([np.linalg.solve(np.linalg.cholesky(cov), one) for one, cov in zip(nu, F, strict=True)])
    return np.linalg.norm(white, axis=1) ** 2, -chi2.isf(1 - probability, 3) * -1


def n5(
    rms=lambda e: np.sqrt(np.mean(e[:, 0] ** 2 + e[:, 1] ** 2)),
    claimed=lambda F: np.sqrt(np.mean(F[:, 0, 0] + F[:, 1, 1])),
    nis=lambda e, F: np.mean(np.einsum("ki,kij,kj->k", e, np.linalg.inv(F), e)),
):
    return lambda errors, F: (rms(errors), claimed(F), nis(errors, F))


def n6(
    keep=lambda s: s[~np.isnan(s)],
    scale=np.sqrt,
    product=lambda s: np.mean(s[:-1] * s[1:]),
    deviation=lambda s: (len(s) - 1) ** -0.5,
):
    def answer(nu, F):
        s = keep(nu / scale(F))
        return product(s), deviation(s)

    return answer


def n6_by_loop(nu, F):
    last, products = None, []
    for one, variance in zip(nu, F, strict=True):
        if np.isfinite(one):
            if last is not None:
                products.append(last * one / np.sqrt(variance))
            last = one / np.sqrt(variance)
    return sum(products) / len(products), 1 / np.sqrt(len(products))


RIGHT = [
    ("n1", n1_by_loop),
    ("n2", n2()),
    ("n2", n2_in_two_halves),
    ("n3", n3()),
    ("n3", n3_all_at_once),
    ("n4", n4()),
    ("n4", n4_by_whitening),
    ("n5", n5()),
    ("n6", n6()),
    ("n6", n6_by_loop),
]

WRONG = [
    ("n1", "zero-first", lambda t: [0, *(t[1:] - t[:-1])]),
    ("n1", "since-the-last", lambda t: np.append(t[1] - t[0], t[1:] - t[:-1])),
    ("n1", "zero-last", lambda t: [*(t[1:] - t[:-1]), 0]),
    ("n1", "mean", lambda t: np.ones(len(t)) * (t[-1] - t[0]) / (len(t) - 1)),
    ("n2", "constant-in-interval", n2(lambda t: [[t**4 / 4, t**3 / 2], [t**3 / 2, t**2]])),
    ("n2", "diagonal", n2(lambda t: [[t**3 / 3, 0], [0, t]])),
    ("n2", "velocity-only", n2(lambda t: [[0, 0], [0, t]])),
    ("n2", "swapped", n2(lambda t: [[t, t**2 / 2], [t**2 / 2, t**3 / 3]])),
    ("n2", "intensity-squared", n2(factor=lambda q: q * q)),
    ("n2", "correlation-sign", n2(lambda t: [[t**3 / 3, -(t**2) / 2], [-(t**2) / 2, t]])),
    ("n3", "missing-as-zero", n3(empty=zero)),
    ("n3", "missing-as-expected", n3(empty=expected)),
    ("n3", "predicted-first", n3(first=0, dt=lambda t, k: t[max(k, 1)] - t[max(k, 1) - 1])),
    ("n3", "mean-interval", n3(dt=lambda t, k: (t[-1] - t[0]) / (len(t) - 1))),
    ("n3", "unit-interval unused", n3(dt=lambda t, k: 1)),
    ("n3", "noise-forgotten unused", n3(Q=lambda t, q: 0)),
    ("n4", "not-normalised unused", n4(size=lambda nu, F: nu @ nu)),
    ("n4", "diagonal", n4(size=lambda nu, F: np.sum(nu**2 / np.diag(F)))),
    ("n4", "multiplied", n4(size=lambda nu, F: nu @ F @ nu)),
    ("n4", "one-degree", n4(edge=lambda p, probability: norm.ppf((1 + probability) / 2) ** 2)),
    ("n4", "refusal-probability", n4(edge=lambda p, probability: chi2.ppf(1 - probability, p))),
    ("n4", "root", n4(size=lambda nu, F: np.sqrt(nu @ np.linalg.inv(F) @ nu))),
    ("n5", "mean-distance", n5(rms=lambda e: np.mean(np.hypot(*e.T)))),
    ("n5", "per-component", n5(rms=lambda e: np.sqrt((e**2).mean()))),
    ("n5", "mean-of-deviations", n5(claimed=lambda F: np.mean(np.sqrt(F[:, 0, 0] + F[:, 1, 1])))),
    ("n5", "ratio-of-means", n5(nis=lambda e, F: (e**2).sum() / (F[:, 0, 0] + F[:, 1, 1]).sum())),
    ("n5", "diagonal", n5(nis=lambda e, F: np.mean(e[:, 0] ** 2 / F[:, 0, 0] + e[:, 1] ** 2 / F[:, 1, 1]))),
    ("n6", "gaps-as-zero", n6(keep=np.nan_to_num, deviation=lambda s: 1 / np.sqrt(np.sum(s != 0) - 1))),
    ("n6", "by-variance", n6(scale=lambda F: F)),
    ("n6", "sum", n6(product=lambda s: s[:-1] @ s[1:])),
    ("n6", "deviation-of-innovations", n6(deviation=lambda s: 1 / np.sqrt(len(s)))),
]
UNUSABLE = [
    ("n1", "expected an array of shape", np.diff),
    ("n6", "a missing measurement used", n6(keep=lambda s: s)),
]
