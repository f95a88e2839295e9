"""Set e, answers as a student would type them: the right ones pass, the wrong ones are named."""

import numpy as np
from answers import test_no_wrong_kind_of_mistake_is_named, test_right_answers_pass, test_what_cannot_be_compared_is_explained  # noqa: F401


def squares(x, z):
    return ((x - z) ** 2).sum(axis=2)


def error(values):
    return values.std(axis=1, ddof=1) / values.shape[1] ** 0.5


def e2(value=lambda s: s.mean(axis=1), of=error, size=squares):
    return lambda x, z: (value(squares(x, z)), of(size(x, z)))


def e3(value=lambda a, b: (a - b).mean(axis=1), of=lambda a, b: error(a - b), size=squares):
    return lambda x, z, o: (value(size(x, z), size(x, o)), of(size(x, z), size(x, o)))


def delta(a, b):
    r = a.mean(axis=1) / b.mean(axis=1)
    return error(a - r[:, None] * b) / b.mean(axis=1)


def e4(value=lambda a, b: a.mean(axis=1) / b.mean(axis=1), of=delta):
    return lambda x, z, o: (value(squares(x, z), squares(x, o)), of(squares(x, z), squares(x, o)))


def e5(
    form=lambda e, p: np.einsum("kni,knij,knj->kn", e, np.linalg.inv(p), e),
    mean=lambda q: q.mean(axis=1),
    divide=lambda n: n,
):
    return lambda x, z, p: mean(form(x - z, p)) / divide(x.shape[2])


RIGHT = [
    ("e1", lambda x, z: squares(x, z).mean(axis=1)),
    ("e2", e2()),
    ("e3", e3()),
    ("e4", e4()),
    ("e5", e5()),
]

WRONG = [
    ("e1", "root", lambda x, z: np.sqrt(squares(x, z).mean(axis=1))),
    ("e1", "sum-for-mean", lambda x, z: squares(x, z).sum(axis=1)),
    ("e1", "divided-by-N-1", lambda x, z: squares(x, z).sum(axis=1) / (x.shape[1] - 1)),
    ("e1", "median", lambda x, z: np.median(squares(x, z), axis=1)),
    ("e1", "mean-error", lambda x, z: (x - z).mean(axis=1).sum(axis=1)),
    ("e1", "square-of-mean", lambda x, z: ((x - z).mean(axis=1) ** 2).sum(axis=1)),
    ("e1", "difference-of-squares", lambda x, z: (x**2 - z**2).mean(axis=1).sum(axis=1)),
    ("e1", "largest", lambda x, z: squares(x, z).max(axis=1)),
    ("e1", "absolute", lambda x, z: np.abs(x - z).mean(axis=1).sum(axis=1)),
    ("e1", "unused", lambda x, z: x.var(axis=1).sum(axis=1)),
    ("e1", "about-the-mean", lambda x, z: (x - z).var(axis=1, ddof=1).sum(axis=1)),
    ("e2", "spread-for-error", e2(of=lambda s: s.std(axis=1, ddof=1))),
    ("e2", "not-root", e2(of=lambda s: s.var(axis=1, ddof=1) / s.shape[1])),
    ("e2", "divided-by-N", e2(of=lambda s: s.std(axis=1, ddof=1) / s.shape[1])),
    ("e2", "biased-spread", e2(of=lambda s: s.std(axis=1) / np.sqrt(s.shape[1]))),
    ("e2", "normal-theory", e2(of=lambda s: s.mean(axis=1) * np.sqrt(2 / s.shape[1]))),
    ("e2", "of-error", e2(size=lambda x, z: np.abs(x - z)[..., 0])),
    ("e2", "swapped", lambda x, z: e2()(x, z)[::-1]),
    ("e2", "factor", e2(of=lambda s: s.std(axis=1, ddof=1) / np.sqrt(s.shape[1] - 1))),
    ("e2", "from-value", e2(of=lambda s: np.sqrt(s.mean(axis=1) / s.shape[1]))),
    ("e2", "factor", e2(of=lambda s: 1.96 * error(s))),
    ("e2", "factor-half", e2(of=lambda s: 2 * error(s))),
    ("e2", "variance-of-squares", e2(of=lambda s: s.var(axis=1, ddof=1) / np.sqrt(s.shape[1]))),
    ("e2", "variance-of-squares", e2(of=lambda s: s.var(axis=1, ddof=1))),
    ("e2", "factor", e2(of=lambda s: s.std(axis=1, ddof=1) / np.sqrt(s.shape[0]))),
    ("e2", "from-value", e2(of=lambda s: s.mean(axis=1) / np.sqrt(s.shape[1]))),
    ("e2", "factor", e2(of=lambda s: s.std(axis=1, ddof=1) * np.sqrt(s.shape[1]))),
    ("e2", "of-error", e2(size=lambda x, z: (x - z).sum(axis=2))),
    ("e2", "root", e2(value=lambda s: np.sqrt(s.mean(axis=1)))),
    ("e2", "factor", e2(value=lambda s: s.sum(axis=1))),
    ("e2", "from-value", e2(of=lambda s: np.sqrt(s.mean(axis=1)))),
    ("e3", "unpaired", e3(of=lambda a, b: np.hypot(error(a), error(b)))),
    ("e3", "errors-subtracted", e3(of=lambda a, b: abs(error(a) - error(b)))),
    ("e3", "errors-added", e3(of=lambda a, b: error(a) + error(b))),
    ("e3", "distance-of-estimates", lambda x, z, o: e2()(z, o)),
    ("e3", "order", e3(value=lambda a, b: (b - a).mean(axis=1))),
    ("e3", "absolute-difference", e3(value=lambda a, b: np.abs(a - b).mean(axis=1))),
    ("e3", "order", e3(value=lambda a, b: np.abs((a - b).mean(axis=1)))),
    ("e3", "factor", e3(of=lambda a, b: (a - b).std(axis=1, ddof=1))),
    ("e3", "factor", e3(of=lambda a, b: (a - b).std(axis=1) / np.sqrt(a.shape[1]))),
    ("e3", "factor", e3(of=lambda a, b: (a - b).std(axis=1, ddof=1) / a.shape[1])),
    ("e3", "square", e3(of=lambda a, b: (a - b).var(axis=1, ddof=1) / a.shape[1])),
    ("e3", "absolute-difference", e3(of=lambda a, b: error(np.abs(a - b)))),
    ("e3", "unused", e3(of=lambda a, b: error(a))),
    ("e3", "factor", e3(of=lambda a, b: 1.96 * error(a - b))),
    ("e3", "pooled", e3(of=lambda a, b: np.sqrt(((a.var(axis=1, ddof=1) + b.var(axis=1, ddof=1)) / 2) / a.shape[1]))),
    ("e3", "absolute-errors", e3(size=lambda x, z: np.abs(x - z).sum(axis=2))),
    ("e3", "unused", e3(size=lambda x, z: (x - z).sum(axis=2))),
    ("e3", "swapped", lambda x, z, o: e3()(x, z, o)[::-1]),
    ("e3", "ratio", e3(value=lambda a, b: a.mean(axis=1) / b.mean(axis=1))),
    ("e3", "of-deviations", e3(value=lambda a, b: np.sqrt(a.mean(axis=1)) - np.sqrt(b.mean(axis=1)))),
    ("e4", "order", e4(value=lambda a, b: b.mean(axis=1) / a.mean(axis=1))),
    ("e4", "mean-of-ratios", e4(value=lambda a, b: (a / b).mean(axis=1))),
    ("e4", "root", e4(value=lambda a, b: np.sqrt(a.mean(axis=1) / b.mean(axis=1)))),
    ("e4", "term", e4(value=lambda a, b: (a - b).mean(axis=1) / b.mean(axis=1))),
    ("e4", "mean-of-ratios", e4(of=lambda a, b: error(a / b))),
    ("e4", "ratio-of-errors", e4(of=lambda a, b: error(a) / error(b))),
    ("e4", "base-exact", e4(of=lambda a, b: error(a) / b.mean(axis=1))),
    ("e4", "of-difference", e4(of=lambda a, b: error(a - b) / b.mean(axis=1))),
    ("e4", "not-divided", e4(of=lambda a, b: error(a - (a.mean(axis=1) / b.mean(axis=1))[:, None] * b))),
    ("e4", "factor", e4(of=lambda a, b: delta(a, b) * np.sqrt(a.shape[1]))),
    ("e4", "sign-of-denominator", e4(of=lambda a, b: error(a + (a.mean(axis=1) / b.mean(axis=1))[:, None] * b) / b.mean(axis=1))),
    ("e4", "order", lambda x, z, o: e4()(x, o, z)),
    ("e5", "by-deviation", e5(form=lambda e, p: e[..., 0] ** 2 / np.sqrt(p[..., 0, 0]))),
    ("e5", "ratio-of-means mean-covariance", lambda x, z, p: squares(x, z).mean(axis=1) / p[..., 0, 0].mean(axis=1)),
    ("e5", "inverted", e5(form=lambda e, p: p[..., 0, 0] / e[..., 0] ** 2)),
    ("e5", "root", lambda x, z, p: np.sqrt(e5()(x, z, p))),
    ("e5", "factor-half", lambda x, z, p: 2 * e5()(x, z, p)),
    ("e5", "sum-for-mean", e5(mean=lambda q: q.sum(axis=1))),
    ("e5", "median", e5(mean=lambda q: np.median(q, axis=1))),
    ("e5", "inverse-forgotten", e5(form=lambda e, p: np.einsum("kni,knij,knj->kn", e, p, e))),
    ("e5", "unused", e5(form=lambda e, p: (e**2).sum(axis=2))),
    ("e5", "mean-covariance", e5(form=lambda e, p: np.einsum("kni,kij,knj->kn", e, np.linalg.inv(p.mean(axis=1)), e))),
    ("e5", "covariance-squared", e5(form=lambda e, p: np.einsum("kni,knij,knj->kn", e, np.linalg.inv(p @ p), e))),
    ("e5", "root-before-mean absolute", e5(form=lambda e, p: np.sqrt(np.einsum("kni,knij,knj->kn", e, np.linalg.inv(p), e)))),
    ("e5", "error-once", e5(form=lambda e, p: np.einsum("kni,knij->kn", e, np.linalg.inv(p)))),
    ("e5", "root-before-mean absolute", e5(form=lambda e, p: (np.abs(e) / np.sqrt(np.einsum("knii->kni", p))).sum(axis=2))),
    ("e5", "precision", e5(mean=lambda q: q.mean(axis=1) - 1)),
    ("e5", "bias-removed", lambda x, z, p: e5()(x, z - (z - x).mean(axis=1, keepdims=True), p)),
    ("e5", "unused", lambda x, z, p: e5()(x, 0 * z, p)),
]
UNUSABLE = [
    ("e1", "expected an array of shape (5,), got the shape (5, 1)", lambda x, z: ((x - z) ** 2).mean(axis=1)),
    ("e1", "got the shape (40,)", lambda x, z: squares(x, z).mean(axis=0)),
    ("e2", "expected 2 results", lambda x, z: error(squares(x, z))),
    ("e3", "result 2 of 2", e3(of=lambda a, b: (a - b).std(ddof=1))),
    ("e5", "got the shape", e5(mean=lambda q: q)),
]
