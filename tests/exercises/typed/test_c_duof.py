"""Set c, answers as a student would type them: the right ones pass, the wrong ones are named."""

from functools import cache

import numpy as np
from answers import test_no_wrong_kind_of_mistake_is_named, test_right_answers_pass, test_what_cannot_be_compared_is_explained  # noqa: F401

from kfcourse.checks import exercise


@cache
def OWN(variant="53"):
    """What the notebook calls a and b."""
    return exercise("c", variant).noiseless


def cov(a, b, N=None):
    return (a - a.mean(axis=0)).T @ (b - b.mean(axis=0)) / (N or len(a))


def c2(
    cross=cov,
    own=cov,
    matrix=lambda C, R: C @ np.linalg.pinv(R),
    offset=lambda t, r, A: t.mean(axis=0) - A @ r.mean(axis=0),
    residual=lambda t, r, A, C, R: cov(t, t) - A @ C.T,
):
    def answer(target, regressor):
        C, R = cross(target, regressor), own(regressor, regressor)
        A = matrix(C, R)
        return A, offset(target, regressor, A), residual(target, regressor, A, C, R)

    return answer


def c2_by_least_squares(target, regressor):
    wide = np.column_stack([regressor, np.ones(len(regressor))])
    found = np.linalg.lstsq(wide, target, rcond=None)[0]
    return found[:-1].T, found[-1], cov(target, target) - found[:-1].T @ cov(target, regressor).T


fit = c2()
without_offset = c2(offset=lambda t, r, A: t.mean(axis=0))


def about_zero(a, b):
    return a.T @ b / len(a)


of_moments = c2(cross=about_zero, own=about_zero, residual=lambda t, r, A, C, R: cov(t, t) - A @ cov(t, r).T)


def c3(
    omega=lambda y, b, lam: y - b(lam),
    first=lambda x, lam: x - lam,
    estimate=lambda lam, omega, H, e: lam + omega @ H.T + e,
    alpha=lambda a, z, lam: a(z),
    second=lambda x_next, lam, z, alpha: x_next,
    prediction=lambda alpha, F, g: alpha @ F.T + g,
    own=None,
    returned=lambda z, lam: (z, lam),
    fit=fit,
):
    def answer(lam, x, y, x_next, a, b):
        if own is not None:
            a, b = own
        w = omega(y, b, lam)
        H, e, _ = fit(first(x, lam), w)
        z = estimate(lam, w, H, e)
        s = alpha(a, z, lam)
        F, g, _ = fit(second(x_next, lam, z, s), s)
        return returned(z, prediction(s, F, g))

    return answer


def c3_from_the_other_regressor(lam, x, y, x_next, a, b):
    H, e, _ = fit(x, y)
    z = y @ H.T + e
    F, g, _ = fit(x_next, a(z))
    return z, a(z) @ F.T + g


def c4(
    omega=lambda y, b, lam: y - b(lam),
    use=lambda other, omega, H, e: other + omega @ H.T + e,
    ahead=lambda a, z, F, g: a(z) @ F.T + g,
    own=None,
    data=lambda y_design, y: (y_design, y),
    start=lambda mean: mean,
    carried=lambda z, lam: z,
    first=lambda x, lam: x - lam,
    returned=lambda designed, used: used,
    kept=lambda estimate, other: estimate,
    one_gain=False,
):
    def answer(x, y_design, y, mean, a, b):
        if own is not None:
            a, b = own
        y_design, y = data(y_design, y)
        lam, other = np.tile(start(mean), (x.shape[1], 1)), np.tile(start(mean), (y.shape[1], 1))
        designed, used = [], []
        for k in range(len(x)):
            if k == 0 or not one_gain:
                H, e, _ = fit(first(x[k], lam), y_design[k] - b(lam))
            z = lam + (y_design[k] - b(lam)) @ H.T + e
            estimate = use(other, omega(y[k], b, other), H, e)
            designed.append(z)
            used.append(kept(estimate, other))
            if k + 1 < len(x):
                F, g, _ = fit(x[k + 1], a(carried(z, lam)))
                lam, other = a(carried(z, lam)) @ F.T + g, ahead(a, carried(estimate, other), F, g)
        return np.array(returned(designed, used))

    return answer


def c4_not_predicted_by_fit(x, y_design, y, mean, a, b):
    lam, other = np.tile(mean, (x.shape[1], 1)), np.tile(mean, (y.shape[1], 1))
    found = []
    for k in range(len(x)):
        H, e, _ = fit(x[k] - lam, y_design[k] - b(lam))
        z = lam + (y_design[k] - b(lam)) @ H.T + e
        found.append(other + (y[k] - b(other)) @ H.T + e)
        lam, other = a(z), a(found[-1])
    return np.array(found)


RIGHT = [
    ("c1", lambda lam, z, y, a, b: (y - b(lam), a(z))),
    ("c2", c2()),
    ("c3", c3()),
    ("c4", c4()),
]

WRONG = [
    ("c1", "omega-of-state", lambda lam, z, y, a, b: (y - lam, a(z))),
    ("c1", "omega-from-estimate", lambda lam, z, y, a, b: (y - b(z), a(z))),
    ("c1", "omega-sign", lambda lam, z, y, a, b: (b(lam) - y, a(z))),
    ("c1", "omega-is-y", lambda lam, z, y, a, b: (y, a(z))),
    ("c1", "alpha-from-prediction", lambda lam, z, y, a, b: (y - b(lam), a(lam))),
    ("c1", "alpha-is-z", lambda lam, z, y, a, b: (y - b(lam), z)),
    ("c1", "swapped", lambda lam, z, y, a, b: (a(z), y - b(lam))),
    ("c1", "omega-of-state unused", lambda lam, z, y, a, b: (y - OWN()[1](lam), OWN()[0](z))),
    ("c1", "unused", lambda lam, z, y, a, b: (y - b(a(z)), a(z))),
    ("c1", "superfluous", lambda lam, z, y, a, b: (y - b(lam), a(z) - lam)),
    ("c1", "equations-swapped", lambda lam, z, y, a, b: (y - a(lam), b(z))),
    ("c2", "biased", c2(cross=lambda a, b: cov(a, b, len(a) - 1))),
    ("c2", "sometimes", c2(own=about_zero)),
    ("c2", "factor negative-variance", c2(cross=about_zero)),
    ("c2", "means-not-subtracted", of_moments),
    ("c2", "offset-forgotten", without_offset),
    ("c2", "regularised", c2(own=lambda a, b: cov(a, b) + 1e-3 * np.eye(a.shape[1]))),
    ("c2", "biased", c2(own=lambda a, b: cov(a, b, len(a) - 1))),
    ("c2", "residual-is-variance", c2(residual=lambda t, r, A, C, R: cov(t, t))),
    ("c2", "unbiased-residual", c2(residual=lambda t, r, A, C, R: (cov(t, t) - A @ C.T) * len(t) / (len(t) - 1))),
    ("c2", "another-minimiser", c2_by_least_squares),
    ("c2", "offset-sign", c2(offset=lambda t, r, A: t.mean(axis=0) + A @ r.mean(axis=0))),
    ("c2", "vanishing", c2(offset=lambda t, r, A: 0 * t.mean(axis=0))),
    ("c2", "target-mean-forgotten", c2(offset=lambda t, r, A: A @ r.mean(axis=0))),
    ("c2", "explained-added", c2(residual=lambda t, r, A, C, R: cov(t, t) + A @ C.T)),
    ("c2", "explained-only", c2(residual=lambda t, r, A, C, R: A @ C.T)),
    ("c2", "offset-not-removed", c2(residual=lambda t, r, A, C, R: (t - r @ A.T).T @ (t - r @ A.T) / len(t))),
    ("c2", "about-zero", c2(residual=lambda t, r, A, C, R: t.T @ t / len(t) - A @ C.T)),
    ("c2", "unbiased-residual", c2(residual=lambda t, r, A, C, R: cov(t, t, len(t) - 1) - A @ C.T)),
    ("c2", "not-divided", c2(matrix=lambda C, R: C)),
    ("c2", "factor unused", c2(matrix=lambda C, R: np.linalg.pinv(C.T))),
    ("c2", "multiplied", c2(matrix=lambda C, R: C @ R)),
    ("c2", "factor", c2(matrix=lambda C, R: C @ np.linalg.pinv(np.sqrt(np.abs(R))))),
    (
        "c3",
        "correction-subtracted",
        c3(omega=lambda y, b, lam: b(lam) - y, estimate=lambda lam, omega, H, e: lam - omega @ H.T + e),
    ),
    ("c3", "state-for-error", c3(first=lambda x, lam: x)),
    ("c3", "prediction-not-added", c3(estimate=lambda lam, omega, H, e: omega @ H.T + e)),
    ("c3", "alpha-from-prediction", c3(alpha=lambda a, z, lam: a(lam))),
    ("c3", "alpha-is-z", c3(alpha=lambda a, z, lam: z)),
    ("c3", "means-not-subtracted", c3(fit=of_moments)),
    ("c3", "offset-forgotten", c3(fit=without_offset)),
    ("c3", "unused", c3(omega=lambda y, b, lam: y - lam)),
    ("c3", "unused", c3(omega=lambda y, b, lam: y)),
    ("c3", "term", c3(estimate=lambda lam, omega, H, e: lam + omega @ H.T)),
    ("c3", "correction-subtracted", c3(estimate=lambda lam, omega, H, e: lam - omega @ H.T + e)),
    ("c3", "error-sign", c3(first=lambda x, lam: lam - x)),
    ("c3", "term", c3(prediction=lambda alpha, F, g: alpha @ F.T)),
    ("c3", "unused", c3(prediction=lambda alpha, F, g: alpha)),
    ("c3", "prediction-of-error", c3(second=lambda x_next, lam, z, alpha: x_next - lam)),
    ("c3", "limit", c3(second=lambda x_next, lam, z, alpha: x_next - alpha)),
    ("c3", "", c3(second=lambda x_next, lam, z, alpha: x_next - alpha, prediction=lambda s, F, g: s - s @ F.T - g)),
    ("c3", "swapped", c3(returned=lambda z, lam: (lam, z))),
    ("c3", "unused", lambda *arguments: c3(own=OWN())(*arguments)),
    ("c3", "unused", c3_from_the_other_regressor),
    ("c3", "unused", lambda lam, x, y, x_next, a, b: (c3()(lam, x, y, x_next, a, b)[0], a(c3()(lam, x, y, x_next, a, b)[0]))),
    ("c4", "part-of-ensemble", lambda x, y, *others: c4()(x[:, :5], y[:, :5], *others)),
    ("c4", "one-gain", c4(one_gain=True)),
    ("c4", "predictions-returned", c4(kept=lambda estimate, other: other)),
    ("c4", "offset-not-used", c4(use=lambda other, omega, H, e: other + omega @ H.T)),
    ("c4", "sign", c4(kept=lambda estimate, other: -estimate)),
    ("c4", "limit", c4(omega=lambda y, b, lam: y - lam)),
    ("c4", "innovation-sign", c4(omega=lambda y, b, lam: b(lam) - y)),
    ("c4", "limit", c4(omega=lambda y, b, lam: y)),
    ("c4", "prediction-not-added", c4(use=lambda other, omega, H, e: omega @ H.T + e)),
    ("c4", "prediction-not-fitted", c4(ahead=lambda a, z, F, g: a(z))),
    ("c4", "prediction-offset-not-used", c4(ahead=lambda a, z, F, g: a(z) @ F.T)),
    ("c4", "from-second-step", c4(ahead=lambda a, z, F, g: z @ F.T + g)),
    ("c4", "unused", lambda *arguments: c4(own=OWN())(*arguments)),
    ("c4", "unused", c4(carried=lambda z, lam: lam)),
    ("c4", "state-for-error", c4(first=lambda x, lam: x)),
    ("c4", "from-second-step", c4(first=lambda x, lam: x, use=lambda other, omega, H, e: omega @ H.T + e)),
    ("c4", "from-second-step", c4_not_predicted_by_fit),
    ("c4", "prediction-offset-not-used", c4(ahead=lambda a, z, F, g: a(z) @ F.T + g - g)),
]
UNUSABLE = [
    ("c1", "expected 2 results", lambda lam, z, y, a, b: y - b(lam)),
    ("c2", "got the shape", c2(residual=lambda t, r, A, C, R: np.trace(cov(t, t) - A @ C.T))),
    ("c2", "expected 3 results", lambda t, r: c2()(t, r)[:2]),
    ("c2", "Singular matrix", c2(matrix=lambda C, R: C @ np.linalg.inv(R))),
    ("c4", "expected an array of shape", c4(returned=lambda designed, used: designed)),
    ("c4", "expected an array of shape", c4(returned=lambda designed, used: used[-1])),
]
