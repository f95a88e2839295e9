"""Set p, answers as a student would type them: the right ones pass, the wrong ones are named, the printed ones first of all."""

import numpy as np
import sympy as sp
from answers import test_no_wrong_kind_of_mistake_is_named, test_right_answers_pass, test_what_cannot_be_compared_is_explained  # noqa: F401


def p4(f11=lambda m1, d11: 4 * m1**2 * d11 + 2 * d11**2 + 1, f12=lambda m1, m2, d11, d12: 2 * m1 * d12, f22=lambda d22: d22 + 1):
    def answer(m1, m2, d11, d12, d22):
        between = f12(m1, m2, d11, d12)
        return [[f11(m1, d11), between], [between, f22(d22)]]

    return answer


def p6(lhs=lambda e, s: e, rhs=lambda e, s: s, centred=True):
    """By least squares of one array on another."""

    def answer(error, sigma):
        if centred:
            error, sigma = error - error.mean(axis=0), sigma - sigma.mean(axis=0)
        return np.linalg.lstsq(rhs(error, sigma), lhs(error, sigma), rcond=None)[0].T

    return answer


def p7(
    mean=lambda x_0, x: x.mean(axis=0), cov=lambda x_0, x: np.cov(x.T, ddof=0), offset=lambda gamma, z: gamma @ z.mean(axis=0)
):
    def answer(x_0, x, z):
        n = x.shape[1]
        both = np.cov(x.T, z.T, ddof=0)
        gamma = both[:n, n:] @ np.linalg.inv(both[n:, n:])
        return gamma, mean(x_0, x) - offset(gamma, z), np.reshape(cov(x_0, x), (n, n)) - gamma @ both[n:, :n]

    return answer


def p7_matrix_of_start(x_0, x, z):
    n = x.shape[1]
    both = np.cov(x_0.T, z.T, ddof=0)
    gamma = both[:n, n:] @ np.linalg.inv(both[n:, n:])
    return gamma, x.mean(axis=0) - gamma @ z.mean(axis=0), np.reshape(np.cov(x.T, ddof=0), (n, n)) - gamma @ both[n:, :n]


RIGHT = [
    ("p1", lambda a, q, z, p: (a * z) ** 2 + a**2 * p + q),
    ("p2", lambda gamma, G, d, r: (gamma * G) ** 2 * d + gamma**2 * r),
    ("p3", lambda z1, z2, p11, p12, p22: p11 + z1 * z1),
    ("p4", p4()),
    ("p4", p4(f12=lambda m1, m2, d11, d12: (m1**2 + d11) * m2 + 2 * m1 * d12 - (m1**2 + d11) * m2)),
    ("p5", lambda E, kappa, x2: (-E * sp.sin(x2) - E * kappa * sp.cos(x2), E * sp.cos(x2) - E * kappa * sp.sin(x2))),
    ("p6", p6()),
    ("p7", p7()),
    ("p8", lambda x, mode: (x.mean(), x.var())),
]

WRONG = [
    ("p1", "as-printed", lambda a, q, z, p: a * (p + z**2) + q),
    ("p1", "central", lambda a, q, z, p: a**2 * p + q),
    ("p1", "noise-squared", lambda a, q, z, p: a**2 * (p + z**2) + q**2),
    ("p2", "as-printed", lambda g, G, d, r: g**2 * G**2 * d + g * r),
    ("p2", "noise-not-scaled", lambda g, G, d, r: g**2 * G**2 * d + r),
    ("p2", "once", lambda g, G, d, r: g * (G**2 * d + r)),
    ("p2", "slope-once", lambda g, G, d, r: g**2 * (G * d + r)),
    ("p3", "as-printed", lambda z1, z2, p11, p12, p22: z1**2 + p22),
    ("p3", "tangent", lambda z1, z2, p11, p12, p22: z1**2),
    ("p3", "other-component", lambda z1, z2, p11, p12, p22: z2**2 + p22),
    ("p3", "product-of-components", lambda z1, z2, p11, p12, p22: z1 * z2 + p12),
    (
        "p4",
        "as-printed",
        p4(
            lambda m1, d11: 4 * m1**2 * d11 + 2 * d11**2,
            lambda m1, m2, d11, d12: m1 * m2 + d12 - (m1**2 + d11) * m2,
            lambda d22: d22,
        ),
    ),
    ("p4", "moment-of-product", p4(f12=lambda m1, m2, d11, d12: m1 * m2 + d12 - (m1**2 + d11) * m2)),
    ("p4", "tangent", p4(lambda m1, d11: 4 * m1**2 * d11 + 1)),
    ("p4", "product-rule", p4(f12=lambda m1, m2, d11, d12: m1 * d12)),
    ("p4", "correlation-forgotten", p4(f12=lambda *_: 0)),
    ("p5", "as-printed", lambda E, k, x2: (-E * sp.sin(x2), E * sp.cos(x2))),
    ("p5", "other-lift", lambda E, k, x2: (E * (k * sp.cos(x2) - sp.sin(x2)), E * (sp.cos(x2) + k * sp.sin(x2)))),
    ("p5", "function-for-derivative", lambda E, k, x2: (E * (sp.cos(x2) - k * sp.sin(x2)), E * (sp.sin(x2) + k * sp.cos(x2)))),
    ("p5", "swapped", lambda E, k, x2: (E * (sp.cos(x2) - k * sp.sin(x2)), -E * (sp.sin(x2) + k * sp.cos(x2)))),
    (
        "p6",
        "as-printed",
        lambda e, s: np.cov(e.T, s.T, ddof=0)[: e.shape[1], e.shape[1] :] @ np.linalg.inv(np.atleast_2d(np.cov(e.T, ddof=0))),
    ),
    ("p6", "other-way", p6(lambda e, s: s, lambda e, s: e)),
    ("p6", "about-zero", p6(centred=False)),
    ("p6", "about-zero", lambda e, s: e.T @ s @ np.linalg.inv(np.atleast_2d(len(s) * np.cov(s.T, ddof=0)))),
    ("p6", "transposed scalars-only", lambda e, s: p6()(e, s).T),
    ("p7", "as-printed", p7(lambda x_0, x: x_0.mean(axis=0), lambda x_0, x: np.cov(x_0.T, ddof=0))),
    ("p7", "mean-of-start", p7(lambda x_0, x: x_0.mean(axis=0))),
    ("p7", "covariance-of-start", p7(cov=lambda x_0, x: np.cov(x_0.T, ddof=0))),
    ("p7", "matrix-of-start", p7_matrix_of_start),
    ("p7", "square-about-zero", p7(cov=lambda x_0, x: x.T @ x / len(x))),
    ("p7", "divided-by-N-1", lambda x_0, x, z: (*p7()(x_0, x, z)[:2], p7()(x_0, x, z)[2] * len(x) / (len(x) - 1))),
    ("p7", "offset-forgotten", p7(offset=lambda gamma, z: 0)),
    ("p8", "not-weighted as-printed", lambda x, mode: (np.mean([x[mode == i].mean() for i in set(mode)]), x.var())),
    ("p8", "deviation", lambda x, mode: (x.mean(), x.std())),
    ("p8", "spread-forgotten", lambda x, mode: (x.mean(), sum(np.mean(mode == i) * x[mode == i].var() for i in set(mode)))),
]
UNUSABLE = [
    ("p4", "expected a matrix", lambda m1, m2, d11, d12, d22: 2 * m1 * d12),
    ("p5", "expected 2 results", lambda E, k, x2: -E * sp.sin(x2)),
    ("p8", "NaN or infinity", lambda x, mode: (np.mean([x[mode == i].sum() / np.sum(mode == i) for i in range(3)]), x.var())),
]
