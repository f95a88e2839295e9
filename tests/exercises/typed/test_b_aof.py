"""Set b, answers as a student would type them: the right ones pass, the wrong ones are named."""

from functools import cache

import numpy as np
from answers import test_no_wrong_kind_of_mistake_is_named, test_right_answers_pass, test_what_cannot_be_compared_is_explained  # noqa: F401
from numpy import matrix_transpose as T

from kfcourse.checks import exercise


@cache
def OWN(variant="53"):
    """What the notebook calls measure and predict."""
    return exercise("b", variant).functions("gaussian")


def times(matrix, vector):
    return (matrix @ vector[..., None])[..., 0]


def reduced(Psi, K, G):
    rest = np.eye(Psi.shape[-1]) - K @ G
    return rest @ Psi @ T(rest)


def b1(change=lambda Psi, G, F: Psi @ T(G) @ np.linalg.inv(F)):
    return change


gain = b1()


def b2(
    gain=gain,
    base=lambda lam, h: lam,
    innovation=lambda y, h, lam, G: y - h,
    cov=lambda Psi, K, G, F: Psi - K @ G @ Psi,
):
    def answer(lam, Psi, h, G, F, y):
        K = gain(Psi, G, F)
        return base(lam, h) + times(K, innovation(y, h, lam, G)), cov(Psi, K, G, F)

    return answer


correct = b2()


def b3(measured=lambda measure, lam, Psi: measure(lam, Psi), correct=correct, carried=lambda z, p, lam, Psi: (z, p)):
    def answer(lam, Psi, y, measure, predict):
        z, p = correct(lam, Psi, *measured(measure, lam, Psi), y)
        return z, p, *predict(*carried(z, p, lam, Psi))

    return answer


def b3_corrected_twice(lam, Psi, y, measure, predict):
    z, p = correct(lam, Psi, *measure(lam, Psi), y)
    z, p = correct(z, p, *measure(z, p), y)
    return z, p, *predict(z, p)


def b3_pairs_swapped(lam, Psi, y, measure, predict):
    z, p, lam, Psi = b3()(lam, Psi, y, measure, predict)
    return lam, Psi, z, p


def b3_not_corrected(lam, Psi, y, measure, predict):
    return lam, Psi, *predict(lam, Psi)


def b3_predicted_first(lam, Psi, y, measure, predict):
    lam, Psi = predict(lam, Psi)
    return *correct(lam, Psi, *measure(lam, Psi), y), lam, Psi


def b3_then(change):
    """A right step; `change` gets z, p, and lam, Psi of the next one."""

    def answer(*arguments):
        z, p, lam, Psi = b3()(*arguments)
        return z, p, *change(z, p, lam, Psi)

    return answer


def b4(
    correct=correct,
    start=lambda mean, cov: (mean, cov),
    gone=lambda missing: missing,
    estimate=lambda lam: lam,
    covariance=lambda Psi, p: Psi,
    carried=lambda z, p, lam, Psi, predict: predict(z, p),
    own=None,
    returned=lambda z, p, lam, y: z,
    shift=0,
):
    def answer(y, mean, cov, measure, predict):
        if own is not None:
            measure, predict = own
        N = y.shape[1]
        mean, cov = start(mean, cov)
        lam, Psi = np.tile(mean, (N, 1)), np.tile(cov, (N, 1, 1))
        found = []
        for y_k in y:
            missing = gone(np.isnan(y_k).any(axis=1))
            h, G, F = measure(lam, Psi)
            z, p = correct(lam, Psi, h, G, F, np.where(np.isnan(y_k), h, y_k))
            z = np.where(missing[:, None], estimate(lam), z)
            p = np.where(missing[:, None, None], covariance(Psi, p), p)
            found.append(returned(z, p, lam, y_k))
            lam, Psi = carried(z, p, lam, Psi, predict)
        return np.array(found)

    return answer


def b4_predicted_first(y, mean, cov, measure, predict):
    lam, Psi = predict(mean[None], cov[None])
    return b4()(y, lam[0], Psi[0], measure, predict)


def b4_first_not_used(y, mean, cov, measure, predict):
    y = y.copy()
    y[0] = np.nan
    return b4()(y, mean, cov, measure, predict)


def b4_missing_not_predicted(y, mean, cov, measure, predict):
    def carried(z, p, lam, Psi, predict):
        lam_next, Psi_next = predict(z, p)
        kept = (z == lam).all(axis=1)
        return np.where(kept[:, None], z, lam_next), np.where(kept[:, None, None], p, Psi_next)

    return b4(carried=carried)(y, mean, cov, measure, predict)


def b4_last_measurement_kept(y, mean, cov, measure, predict):
    y = y.copy()
    for k in range(1, len(y)):
        y[k] = np.where(np.isnan(y[k]), y[k - 1], y[k])
    return b4()(y, mean, cov, measure, predict)


def b5(
    rest=reduced,
    noise=lambda K, R, F: K @ R @ T(K),
):
    def answer(Psi, G, F, R):
        K = gain(Psi, G, F)
        return rest(Psi, K, G) + noise(K, R, F)

    return answer


RIGHT = [
    ("b1", b1()),
    ("b1", lambda Psi, G, F: T(np.linalg.solve(F, G @ Psi))),
    ("b2", b2()),
    ("b2", b2(cov=lambda Psi, K, G, F: Psi - K @ F @ T(K))),
    ("b3", b3()),
    ("b4", b4()),
    ("b5", b5()),
]

WRONG = [
    ("b1", "gain-not-divided", b1(lambda Psi, G, F: Psi @ T(G))),
    ("b1", "gain-multiplied", b1(lambda Psi, G, F: Psi @ T(G) @ F)),
    ("b1", "gain-without-Psi", b1(lambda Psi, G, F: T(G) @ np.linalg.inv(F))),
    ("b1", "gain-by-standard-deviation", b1(lambda Psi, G, F: Psi @ T(G) @ np.linalg.inv(np.sqrt(np.abs(F))))),
    ("b1", "state-twice", b1(lambda Psi, G, F: Psi @ T(G) @ np.linalg.inv(F + G @ Psi @ T(G)))),
    ("b1", "gain-of-noise", b1(lambda Psi, G, F: Psi @ T(G) @ np.linalg.inv(F - G @ Psi @ T(G)))),
    ("b1", "unused", b1(lambda Psi, G, F: Psi @ T(G) @ np.linalg.inv(G @ Psi @ T(G)))),
    ("b1", "sign", b1(lambda Psi, G, F: -gain(Psi, G, F))),
    ("b1", "inverse", b1(lambda Psi, G, F: np.linalg.inv(gain(Psi, G, F)))),
    ("b1", "one-for-all", b1(lambda Psi, G, F: np.tile(gain(Psi, G, F).mean(axis=0), (len(Psi), 1, 1)))),
    ("b1", "gain-without-G", b1(lambda Psi, G, F: Psi @ np.linalg.inv(F))),
    ("b2", "innovation-sign", b2(innovation=lambda y, h, lam, G: h - y)),
    ("b2", "innovation-without-h", b2(innovation=lambda y, h, lam, G: y)),
    ("b2", "covariance-kept", b2(cov=lambda Psi, K, G, F: Psi)),
    ("b2", "covariance-added", b2(cov=lambda Psi, K, G, F: Psi + K @ G @ Psi)),
    ("b2", "covariance-once", b2(cov=lambda Psi, K, G, F: Psi - K @ G)),
    ("b2", "gain-not-divided", b2(gain=lambda Psi, G, F: Psi @ T(G))),
    ("b2", "gain-by-standard-deviation", b2(gain=lambda Psi, G, F: Psi @ T(G) / np.sqrt(F))),
    ("b2", "gain-without-G", b2(gain=lambda Psi, G, F: Psi / F)),
    ("b2", "gain-without-Psi", b2(gain=lambda Psi, G, F: T(G) / F)),
    ("b2", "gain-of-noise", b2(gain=lambda Psi, G, F: Psi @ T(G) / (F - G @ Psi @ T(G)))),
    ("b2", "innovation-of-state", b2(innovation=lambda y, h, lam, G: y - lam)),
    ("b2", "innovation-plus", b2(innovation=lambda y, h, lam, G: y + h)),
    ("b2", "prediction-not-added", b2(base=lambda lam, h: 0)),
    ("b2", "unused", b2(base=lambda lam, h: h)),
    ("b2", "share-only", b2(cov=lambda Psi, K, G, F: np.eye(Psi.shape[-1]) - K @ G)),
    ("b2", "unused", b2(cov=lambda Psi, K, G, F: Psi - K @ F)),
    ("b2", "covariance-of-gain", b2(cov=lambda Psi, K, G, F: Psi - K @ Psi)),
    ("b2", "gain-not-divided", b2(cov=lambda Psi, K, G, F: Psi - Psi @ T(G) @ G @ Psi)),
    ("b2", "negative-variance", b2(cov=lambda Psi, K, G, F: Psi - K @ T(K))),
    (
        "b2",
        "noise-of-meter-missing",
        b2(cov=lambda Psi, K, G, F: reduced(Psi, K, G)),
    ),
    ("b2", "state-twice", b2(gain=lambda Psi, G, F: Psi @ T(G) @ np.linalg.inv(F + G @ Psi @ T(G)))),
    ("b2", "unused", b2(gain=lambda Psi, G, F: np.broadcast_to(np.eye(Psi.shape[-1]), Psi.shape))),
    ("b2", "root", b2(cov=lambda Psi, K, G, F: np.sqrt(np.abs(Psi - K @ G @ Psi)))),
    ("b2", "covariance-explained", b2(cov=lambda Psi, K, G, F: K @ G @ Psi)),
    ("b3", "unused", b3(measured=lambda measure, lam, Psi: measure(lam * 0, Psi))),
    ("b3", "superfluous", b3_corrected_twice),
    ("b3", "swapped", b3_pairs_swapped),
    ("b3", "unchanged covariance-kept beats-swapped predicted-from-prediction", b3_not_corrected),
    ("b3", "covariances-added", b3_then(lambda z, p, lam, Psi: (lam, Psi + p))),
    ("b3", "mean-not-predicted covariance-not-predicted", b3_then(lambda z, p, lam, Psi: (z, p))),
    ("b3", "mean-not-predicted", b3_then(lambda z, p, lam, Psi: (z, Psi))),
    ("b3", "covariance-not-predicted", b3_then(lambda z, p, lam, Psi: (lam, p))),
    ("b3", "beats-swapped", b3_predicted_first),
    ("b3", "predicted-from-prediction", b3(carried=lambda z, p, lam, Psi: (lam, Psi))),
    ("b3", "variance-mixed", b3(carried=lambda z, p, lam, Psi: (z, Psi))),
    ("b3", "beats-swapped predicted-from-prediction unused", b3(carried=lambda z, p, lam, Psi: (lam, p))),
    ("b3", "covariances-added", b3(carried=lambda z, p, lam, Psi: (z, Psi + p))),
    ("b3", "innovation-sign", b3(correct=b2(innovation=lambda y, h, lam, G: h - y))),
    ("b3", "covariance-kept", b3(correct=b2(cov=lambda Psi, K, G, F: Psi))),
    ("b3", "covariance-added", b3(correct=b2(cov=lambda Psi, K, G, F: Psi + K @ G @ Psi))),
    ("b3", "innovation-of-state", b3(correct=b2(innovation=lambda y, h, lam, G: y - lam))),
    ("b3", "unused", lambda lam, Psi, y, measure, predict: b3()(lam, Psi, y, *OWN())),
    ("b3", "unused", lambda lam, Psi, y, measure, predict: b3()(lam, Psi, y, measure, OWN()[1])),
    ("b3", "unused", lambda lam, Psi, y, measure, predict: b3()(lam, Psi, y, OWN()[0], predict)),
    ("b4", "predicted-first", b4_predicted_first),
    ("b4", "predictions-returned", b4(returned=lambda z, p, lam, y: lam)),
    ("b4", "covariance-frozen", b4(carried=lambda z, p, lam, Psi, predict: (predict(z, p)[0], Psi))),
    ("b4", "missing-as-zero", lambda y, *others: b4()(np.nan_to_num(y), *others)),
    ("b4", "innovation-sign", b4(correct=b2(innovation=lambda y, h, lam, G: h - y))),
    ("b4", "unused", lambda *arguments: b4(own=OWN())(*arguments)),
    ("b4", "unused", lambda y, mean, cov, measure, predict: b4()(y, mean, cov, OWN()[0], predict)),
    ("b4", "surer-of-missing", b4(covariance=lambda Psi, p: p)),
    ("b4", "sometimes", b4(estimate=lambda lam: 0 * lam)),
    ("b4", "sometimes", b4(gone=lambda missing: missing | missing.any())),
    ("b4", "unused", b4(start=lambda mean, cov: (0 * mean, cov))),
    ("b4", "unused", b4(start=lambda mean, cov: (mean, np.eye(len(cov))))),
    ("b4", "unused", b4(start=lambda mean, cov: (mean, 0 * cov))),
    ("b4", "unused", b4(carried=lambda z, p, lam, Psi, predict: (z, p))),
    ("b4", "estimate-not-handed-on", b4(carried=lambda z, p, lam, Psi, predict: predict(lam, Psi))),
    ("b4", "covariance-kept", b4(carried=lambda z, p, lam, Psi, predict: predict(z, Psi))),
    ("b4", "from-second-step", b4(carried=lambda z, p, lam, Psi, predict: (predict(z, p)[0], p))),
    ("b4", "covariance-added", b4(correct=b2(cov=lambda Psi, K, G, F: Psi + K @ G @ Psi))),
    ("b4", "innovation-of-state", b4(correct=b2(innovation=lambda y, h, lam, G: y - lam))),
    ("b4", "first-not-used", b4_first_not_used),
    ("b4", "sometimes", b4_missing_not_predicted),
    ("b4", "sometimes", b4_last_measurement_kept),
    ("b5", "noise-of-meter-missing", b5(noise=lambda K, R, F: 0)),
    ("b5", "whole-covariance", b5(noise=lambda K, R, F: K @ F @ T(K))),
    ("b5", "negative-variance", b5(noise=lambda K, R, F: -K @ R @ T(K))),
    ("b5", "unused", b5(noise=lambda K, R, F: K @ T(K))),
    ("b5", "one-side-only", b5(rest=lambda Psi, K, G: (np.eye(Psi.shape[-1]) - K @ G) @ Psi)),
    ("b5", "sometimes", b5(rest=lambda Psi, K, G: (np.eye(Psi.shape[-1]) - K @ G) @ Psi, noise=lambda K, R, F: 0)),
    ("b5", "sometimes", b5(rest=lambda Psi, K, G: np.maximum(Psi - K @ G @ Psi, 0), noise=lambda K, R, F: 0)),
    ("b5", "sometimes", b5(rest=lambda Psi, K, G: np.abs(Psi - K @ G @ Psi), noise=lambda K, R, F: 0)),
    ("b5", "share-added", b5(rest=lambda Psi, K, G: (np.eye(Psi.shape[-1]) + K @ G) @ Psi @ T(np.eye(Psi.shape[-1]) + K @ G))),
    ("b5", "prior-part-kept", b5(rest=lambda Psi, K, G: Psi)),
    ("b5", "noise-squared", b5(noise=lambda K, R, F: K @ R @ R @ T(K))),
]
UNUSABLE = [
    ("b1", "expected an array of shape (6, 1, 1)", lambda Psi, G, F: gain(Psi, G, F)[..., 0]),
    ("b1", "complex numbers", lambda Psi, G, F: gain(Psi, G, F) * 1j),
    ("b2", "expected 2 results", lambda *arguments: b2()(*arguments)[0]),
    ("b3", "expected 4 results", lambda *arguments: b3()(*arguments)[2:]),
    ("b4", "got the shape (5, 6, 1)", lambda *arguments: b4()(*arguments)[1:]),
    ("b4", "NaN or infinity", b4(gone=lambda missing: missing & False, returned=lambda z, p, lam, y: z + 0 * y)),
]


def test_a_small_unit_of_the_measurement_hides_no_mistake(told):
    """Accelerations of a landing on Mars: the gain divided by F, or multiplied by it, was nothing beside the state."""
    assert told("b2", b2(gain=lambda Psi, G, F: Psi @ T(G)), "D3").diagnosis == ("gain-not-divided",)
    assert told("b2", b2(gain=lambda Psi, G, F: Psi @ T(G) @ F), "D3").diagnosis == ("gain-multiplied",)
