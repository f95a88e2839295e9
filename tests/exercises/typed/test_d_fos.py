"""Set d, answers as a student would type them: the right ones pass, the wrong ones are named."""

from functools import cache

import numpy as np
from answers import test_no_wrong_kind_of_mistake_is_named, test_right_answers_pass, test_what_cannot_be_compared_is_explained  # noqa: F401
from numpy import matrix_transpose as T

from kfcourse.checks import exercise


@cache
def OWN(variant="53"):
    """What the notebook calls measure and predict."""
    return exercise("d", variant).functions("gaussian")


def cov(a, b, N=None):
    return (a - a.mean(axis=0)).T @ (b - b.mean(axis=0)) / (N or len(a))


def regression(t, r):
    A = cov(t, r) @ np.linalg.pinv(cov(r, r))
    return A, t.mean(axis=0) - A @ r.mean(axis=0), cov(t, t) - A @ cov(t, r).T


def correct(lam, Psi, y, measure, sign=1):
    h, G, F = measure(lam, Psi)
    K = T(np.linalg.solve(F, G @ Psi))
    return lam + sign * (K @ (y - h)[..., None])[..., 0], Psi - K @ G @ Psi


def d1(u=lambda x, z, Gamma, chi: z @ Gamma.T + chi, left=lambda x, z, Gamma, rest: rest):
    def answer(x, z):
        Gamma, chi, rest = regression(x, z)
        return u(x, z, Gamma, chi), left(x, z, Gamma, rest)

    return answer


condition = d1()


def d2(
    condition=condition,
    correct=correct,
    what=lambda x, lam, z, y: (x, z),
    law=lambda u, left, lam, Psi, z, p: (u, left),
    own=None,
    returned=lambda z, lam, Psi, u: (z, lam, Psi),
):
    def answer(lam, Psi, x, y, measure, predict):
        if own is not None:
            measure, predict = own
        z, p = correct(lam, Psi, y, measure)
        u, left = condition(*what(x, lam, z, y))
        mean, cov = law(u, left, lam, Psi, z, p)
        return returned(z, *predict(mean, np.broadcast_to(cov, Psi.shape)), u)

    return answer


def without_offset(t, r):
    return regression(t, r)[0], t.mean(axis=0), None


def of_moments(t, r):
    A = t.T @ r @ np.linalg.pinv(r.T @ r)
    return A, t.mean(axis=0) - A @ r.mean(axis=0), None


def d3(
    fitted=lambda lam, sigma, H, e: lam + sigma @ H.T + e,
    first=lambda x, lam, sigma: (x - lam, sigma),
    of=lambda z, raw: z,
    predicted=lambda s, F, g: s @ F.T + g,
    second=lambda x_next, s, u: (x_next, s),
    law=lambda u, left, z, p, Psi: (u, left),
    own=None,
    returned=lambda z, raw, lam, Psi, u: (z, lam, Psi),
    fit=regression,
):
    def answer(lam, Psi, x, y, x_next, measure, predict):
        if own is not None:
            measure, predict = own
        raw, p = correct(lam, Psi, y, measure)
        sigma = raw - lam
        H, e, _ = fit(*first(x, lam, sigma))
        z = fitted(lam, sigma, H, e)
        u, left = condition(x, of(z, raw))
        mean, cov = law(u, left, z, p, Psi)
        s, Psi_next = predict(mean, np.broadcast_to(cov, Psi.shape))
        F, g, _ = fit(*second(x_next, s, u))
        return returned(z, raw, predicted(s, F, g), Psi_next, u)

    return answer


def d4(
    both=lambda y, z: np.column_stack([y, z]),
    u=lambda both, Gamma, chi: both @ Gamma.T + chi,
    left=lambda x, y, z, rest: rest,
):
    def answer(x, y, z):
        Gamma, chi, rest = regression(x, both(y, z))
        return u(both(y, z), Gamma, chi), left(x, y, z, rest)

    return answer


def d4_one_after_the_other(x, y, z):
    first, _ = condition(x, z)
    second, rest = condition(x - first, y)
    return first + second, rest


RIGHT = [
    ("d1", d1()),
    ("d2", d2()),
    ("d3", d3()),
    ("d4", d4()),
    ("d4", d4(both=lambda y, z: np.column_stack([z, y]))),
]

WRONG = [
    ("d1", "estimate-itself", d1(u=lambda x, z, Gamma, chi: z)),
    ("d1", "term", d1(u=lambda x, z, Gamma, chi: z @ Gamma.T)),
    ("d1", "scale-forgotten", d1(u=lambda x, z, Gamma, chi: z + chi)),
    ("d1", "term", d1(u=lambda x, z, Gamma, chi: z @ Gamma.T - chi)),
    ("d1", "unused", d1(u=lambda x, z, Gamma, chi: np.broadcast_to(x.mean(axis=0), x.shape))),
    ("d1", "residual-is-variance", d1(left=lambda x, z, Gamma, rest: cov(x, x))),
    ("d1", "error-for-residual", d1(left=lambda x, z, Gamma, rest: cov(x - z, x - z))),
    ("d1", "error-for-residual", d1(left=lambda x, z, Gamma, rest: (x - z).T @ (x - z) / len(x))),
    ("d1", "negative-variance", d1(left=lambda x, z, Gamma, rest: cov(x, x) - Gamma @ cov(z, z))),
    ("d1", "negative-variance", d1(left=lambda x, z, Gamma, rest: cov(x, x) - cov(z, z))),
    ("d1", "unbiased-residual", d1(left=lambda x, z, Gamma, rest: rest * len(x) / (len(x) - 1))),
    ("d1", "explained-added", d1(left=lambda x, z, Gamma, rest: cov(x, x) + Gamma @ cov(x, z).T)),
    ("d1", "deviation-for-variance", d1(left=lambda x, z, Gamma, rest: np.sqrt(np.abs(rest)))),
    ("d1", "regressed-the-other-way", lambda x, z: condition(z, x)),
    ("d2", "predicted-as-aof", d2(law=lambda u, left, lam, Psi, z, p: (z, p))),
    ("d2", "mean-from-estimate estimate-itself", d2(law=lambda u, left, lam, Psi, z, p: (z, left))),
    ("d2", "variance-from-aof", d2(law=lambda u, left, lam, Psi, z, p: (u, p))),
    ("d2", "regressed-the-other-way", d2(condition=lambda x, z: condition(z, x))),
    ("d2", "residual-is-variance", d2(condition=d1(left=lambda x, z, Gamma, rest: cov(x, x)))),
    ("d2", "deviation-for-variance", d2(condition=d1(left=lambda x, z, Gamma, rest: np.sqrt(rest)))),
    ("d2", "offset-forgotten", d2(condition=d1(u=lambda x, z, Gamma, chi: z @ Gamma.T + x.mean(axis=0)))),
    ("d2", "unused", d2(what=lambda x, lam, z, y: (x, lam))),
    ("d2", "unused", d2(what=lambda x, lam, z, y: (x, y))),
    ("d2", "variance-from-prediction", d2(law=lambda u, left, lam, Psi, z, p: (u, Psi))),
    ("d2", "unused", d2(law=lambda u, left, lam, Psi, z, p: (lam, left))),
    ("d2", "unused", d2(law=lambda u, left, lam, Psi, z, p: (lam, Psi))),
    ("d2", "u-returned", d2(returned=lambda z, lam, Psi, u: (u, lam, Psi))),
    ("d2", "swapped", d2(returned=lambda z, lam, Psi, u: (lam, z, Psi))),
    ("d2", "innovation-sign", d2(correct=lambda lam, Psi, y, measure: correct(lam, Psi, y, measure, -1))),
    ("d2", "unused", lambda *arguments: d2(own=OWN())(*arguments)),
    ("d2", "unused", lambda lam, Psi, x, y, measure, predict: d2(own=(measure, OWN()[1]))(lam, Psi, x, y, measure, predict)),
    ("d2", "error-for-residual", d2(condition=d1(left=lambda x, z, Gamma, rest: cov(x - z, x - z)))),
    ("d2", "unbiased-residual", d2(condition=d1(left=lambda x, z, Gamma, rest: rest * len(x) / (len(x) - 1)))),
    ("d2", "covariances-added", d2(law=lambda u, left, lam, Psi, z, p: (u, p + left))),
    ("d2", "scale-forgotten", d2(condition=d1(u=lambda x, z, Gamma, chi: z + chi))),
    ("d2", "unchanged unused", d2(correct=lambda lam, Psi, y, measure: (lam, Psi))),
    ("d3", "prediction-not-fitted", d3(predicted=lambda s, F, g: s)),
    ("d3", "state-for-error", d3(first=lambda x, lam, sigma: (x, sigma))),
    ("d3", "variance-from-aof", d3(law=lambda u, left, z, p, Psi: (u, p))),
    ("d3", "offset-forgotten", d3(fit=without_offset)),
    ("d3", "means-not-subtracted", d3(fit=of_moments)),
    ("d3", "correction-not-fitted", d3(fitted=lambda lam, sigma, H, e: lam + sigma)),
    ("d3", "correction-not-fitted", d3(of=lambda z, raw: raw)),
    ("d3", "correction-not-fitted", d3(returned=lambda z, raw, lam, Psi, u: (raw, lam, Psi))),
    ("d3", "estimate-conditioned", d3(returned=lambda z, raw, lam, Psi, u: (u, lam, Psi))),
    ("d3", "term", d3(fitted=lambda lam, sigma, H, e: lam + sigma @ H.T)),
    ("d3", "term", d3(fitted=lambda lam, sigma, H, e: sigma @ H.T + e)),
    ("d3", "correction-not-fitted", d3(fitted=lambda lam, sigma, H, e: lam + sigma + e)),
    ("d3", "term", d3(predicted=lambda s, F, g: s @ F.T)),
    ("d3", "limit", d3(predicted=lambda s, F, g: s + g)),
    ("d3", "limit", d3(second=lambda x_next, s, u: (x_next - s, s))),
    ("d3", "estimate-itself mean-from-estimate", d3(law=lambda u, left, z, p, Psi: (z, left))),
    ("d3", "predicted-as-aof", d3(law=lambda u, left, z, p, Psi: (z, p))),
    ("d3", "variance-from-prediction", d3(law=lambda u, left, z, p, Psi: (u, Psi))),
    ("d3", "state-for-correction", d3(first=lambda x, lam, sigma: (x - lam, sigma + lam))),
    (
        "d3",
        "correction-not-fitted",
        d3(first=lambda x, lam, sigma: (x, sigma + lam), fitted=lambda lam, sigma, H, e: (lam + sigma) @ H.T + e),
    ),
    ("d3", "unused", lambda *arguments: d3(own=OWN())(*arguments)),
    ("d3", "swapped", d3(returned=lambda z, raw, lam, Psi, u: (lam, z, Psi))),
    ("d4", "measurement-unused", lambda x, y, z: condition(x, z)),
    ("d4", "estimate-unused", lambda x, y, z: condition(x, y)),
    ("d4", "term", d4(u=lambda both, Gamma, chi: both @ Gamma.T)),
    ("d4", "residual-of-one", d4(left=lambda x, y, z, rest: condition(x, z)[1])),
    ("d4", "residual-is-variance", d4(left=lambda x, y, z, rest: cov(x, x))),
    ("d4", "unbiased-residual", d4(left=lambda x, y, z, rest: rest * len(x) / (len(x) - 1))),
    ("d4", "one-after-the-other", d4_one_after_the_other),
    ("d4", "measurement-unused residual-of-one", lambda x, y, z: (condition(x, y)[0] + condition(x, z)[0], condition(x, z)[1])),
    ("d4", "", lambda x, y, z: d4()(x, y - z, z * 0)),
]
UNUSABLE = [
    ("d1", "result 2 of 2", d1(left=lambda x, z, Gamma, rest: np.tile(rest, (len(x), 1, 1)))),
    ("d2", "expected 3 results", lambda *arguments: d2()(*arguments)[1:]),
    ("d3", "expected 3 results", lambda *arguments: d3()(*arguments)[:2]),
    ("d4", "result 1 of 2", d4(u=lambda both, Gamma, chi: Gamma @ both.T + chi[:, None])),
]
