"""Set o, answers as a student would type them: the right ones pass, the wrong ones are named."""

import numpy as np
from answers import test_no_wrong_kind_of_mistake_is_named, test_right_answers_pass, test_what_cannot_be_compared_is_explained  # noqa: F401
from scipy.stats import norm


def o1(c=lambda mu, pi: pi.T @ mu, w=lambda mu, pi: (mu[:, None] * pi) / (mu @ pi)):
    return lambda mu, pi: (c(mu, pi), w(mu, pi))


def o2(density=lambda y, h, F: norm.pdf(y, h, F**0.5), joint=lambda c, L: c * L, share=lambda q: q / q.sum()):
    return lambda c, y, h, F: share(joint(c, density(y, h, F)))


def o3(spread=1.0, chain=True, again=False, correct=True, known=True, noise=1.0, a_squared=True, q_added=True):
    """By sums over the modes i of step 0 and j of step 1."""

    def answer(y, m, d, a, q, C, pi, prior):
        J = range(len(C))
        mu = np.array([prior[i] * norm.pdf(y[0], m, np.sqrt(d + C[i] ** 2)) for i in J])
        mu = mu / mu.sum()
        z = [m + (d / (d + C[i] ** 2) * (y[0] - m) if correct else 0) for i in J]
        p = [1 / (1 / d + 1 / C[i] ** 2) for i in J]
        later = []
        before = prior if again else mu
        for j in J:
            ways = [before[i] * pi[i][j] if chain else before[i] * (i == j) for i in J]
            c = sum(ways)
            mean = sum(w * a * z[i] for i, w in enumerate(ways)) / c
            var = sum(
                w * ((a * a if a_squared else a) * p[i] + q * q_added + spread * (a * z[i] - mean) ** 2)
                for i, w in enumerate(ways)
            )
            later.append((c if known else 1) * norm.pdf(y[1], mean, np.sqrt(var / c + noise * C[j] ** 2)))
        return mu, np.array(later) / sum(later)

    return answer


def o3_by_rows(y, m, d, a, q, C, pi, first):
    """The weights' rows in the place of their columns; the variance by squares."""
    mu = first * norm.pdf(y[0], m, np.sqrt(d + C**2)) / (first @ norm.pdf(y[0], m, np.sqrt(d + C**2)))
    z, p = a * (m + d / (d + C**2) * (y[0] - m)), a**2 / (1 / d + 1 / C**2) + q
    c = mu @ pi
    w = mu[:, None] * pi / c
    later = c * norm.pdf(y[1], w @ z, np.sqrt(w @ (p + z**2) - (w @ z) ** 2 + C**2))
    return mu, later / later.sum()


def o4(cov):
    return lambda mu, z, p: (sum(w * m for w, m in zip(mu, z, strict=True)), cov(mu, z, p))


def deviations(mu, z, p, centre=lambda mu, z: mu @ z):
    return sum(w * (P + np.outer(m - centre(mu, z), m - centre(mu, z))) for w, m, P in zip(mu, z, p, strict=True))


def o5(*lines):
    return lambda: "\n = ".join(["W = mu*(p1 + z1^2) + (1 - mu)*(p2 + z2^2) - z^2", *lines])


def o6(weights=lambda mu, pi: mu[:, None] * pi / (mu @ pi), cov=deviations):
    def answer(mu, pi, z, p):
        w = weights(mu, pi)
        return mu @ pi, [w[:, j] @ z for j in range(len(mu))], [cov(w[:, j], z, p) for j in range(len(mu))]

    return answer


def o7(threshold=lambda missed, alarm: alarm / (alarm + missed), loss=np.minimum):
    return lambda f, missed, alarm: ((f > threshold(missed, alarm)) * 1, loss(f * missed, (1 - f) * alarm))


def o7_with_own_loss(threshold):
    """The loss is that of the call, whichever it is."""
    return lambda f, missed, alarm: (
        (f > threshold(missed, alarm)) * 1,
        np.where(f > threshold(missed, alarm), (1 - f) * alarm, f * missed),
    )


RIGHT = [
    ("o1", o1()),
    ("o2", o2()),
    ("o2", o2(lambda y, h, F: np.exp(-0.5 * ((y - h) ** 2 / F + np.log(F))))),
    ("o3", o3()),
    ("o4", o4(deviations)),
    ("o4", o4(lambda mu, z, p: np.tensordot(mu, p, 1) + np.cov(z.T, aweights=mu, ddof=0))),
    (
        "o5",
        o5(
            "mu*p1 + (1-mu)*p2 + mu*z1^2 + (1-mu)*z2^2 - z^2",
            "mu*p1 + (1-mu)*p2 + mu*(1-mu)*(z1^2 + z2^2) - 2*mu*(1-mu)*z1*z2",
            "mu*p1 + (1-mu)*p2 + mu*(1-mu)*(z2 - z1)**2",
        ),
    ),
    ("o6", o6()),
    ("o7", o7()),
]

WRONG = [
    ("o1", "transposed unused", o1(c=lambda mu, pi: pi @ mu)),
    ("o1", "row-for-column", o1(w=lambda mu, pi: pi)),
    ("o1", "not-divided", o1(w=lambda mu, pi: mu[:, None] * pi)),
    ("o1", "other-axis", o1(w=lambda mu, pi: mu[:, None] * pi / (mu @ pi)[:, None])),
    ("o1", "other-axis", o1(w=lambda mu, pi: mu * pi / (mu @ pi))),
    ("o1", "other-axis", lambda mu, pi: (mu * pi.sum(axis=0), mu * pi / (mu * pi.sum(axis=0)))),
    ("o1", "mode-kept unchanged", o1(c=lambda mu, pi: mu)),
    ("o2", "prior-forgotten unused", o2(joint=lambda c, L: L)),
    ("o2", "root-forgotten", o2(lambda y, h, F: np.exp(-((y - h) ** 2) / F / 2))),
    ("o2", "deviation-for-variance", o2(lambda y, h, F: norm.pdf(y, h, F))),
    ("o2", "half-forgotten", o2(lambda y, h, F: np.exp(-((y - h) ** 2) / F) / F**0.5)),
    ("o2", "not-divided", o2(share=lambda q: q)),
    ("o2", "exponent-grows", o2(lambda y, h, F: np.exp((y - h) ** 2 / F / 2) / F**0.5)),
    ("o2", "densities-added", o2(joint=lambda c, L: c + L)),
    ("o3", "spread-forgotten", o3(spread=0.0)),
    ("o3", "chain-forgotten", o3(chain=False)),
    ("o3", "first-law-again", o3(again=True)),
    ("o3", "limit", o3(correct=False)),
    ("o3", "meter-noise-forgotten", o3(noise=0.0)),
    ("o3", "chance-forgotten", o3(known=False)),
    ("o3", "unused", o3(q_added=False)),
    ("o3", "", o3(a_squared=False)),
    ("o3", "other-axis", o3_by_rows),
    ("o4", "spread-forgotten", o4(lambda mu, z, p: np.tensordot(mu, p, 1))),
    ("o4", "about-zero", o4(lambda mu, z, p: deviations(mu, z, p, lambda mu, z: 0 * z[0]))),
    ("o4", "sum-of-variables", o4(lambda mu, z, p: np.tensordot(mu**2, p, 1))),
    ("o4", "spread-unweighted unused", o4(lambda mu, z, p: np.tensordot(mu, p, 1) + (z - mu @ z).T @ (z - mu @ z))),
    ("o4", "", o4(lambda mu, z, p: deviations(mu, z, p, lambda mu, z: z.mean(axis=0)))),
    (
        "o5",
        "sign",
        o5("mu*(p1 + z1^2) + (1-mu)*(p2 + z2^2) + z^2", "mu*(p1 + z1^2) + (1-mu)*(p2 + z2^2) + (mu*z1 + (1-mu)*z2)^2"),
    ),
    ("o5", "open-end", o5("mu*p1 + (1-mu)*p2 + mu*z1^2 + (1-mu)*z2^2 - z^2")),
    ("o5", "steps-missing", o5("mu*p1 + (1-mu)*p2 + mu*(1-mu)*(z2 - z1)^2")),
    ("o6", "spread-forgotten", o6(cov=lambda mu, z, p: np.tensordot(mu, p, 1))),
    ("o6", "row-for-column", o6(weights=lambda mu, pi: mu[:, None] * pi / (mu[:, None] * pi).sum(axis=1, keepdims=True))),
    ("o6", "not-divided", o6(weights=lambda mu, pi: mu[:, None] * pi)),
    ("o6", "other-axis", o6(weights=lambda mu, pi: (mu[:, None] * pi / (mu @ pi)).T)),
    ("o6", "not-mixed", lambda mu, pi, z, p: (mu @ pi, z, p)),
    ("o7", "losses-ignored", o7(threshold=lambda missed, alarm: 0.5)),
    ("o7", "losses-swapped", o7(threshold=lambda missed, alarm: missed / (alarm + missed))),
    ("o7", "losses-swapped", o7_with_own_loss(lambda missed, alarm: missed / (alarm + missed))),
    ("o7", "odds", o7(threshold=lambda missed, alarm: alarm / missed)),
    ("o7", "other-way", o7(loss=np.maximum)),
]
UNUSABLE = [
    ("o1", "expected an array of shape", lambda mu, pi: mu @ pi),
    ("o2", "got the shape", lambda c, y, h, F: o2()(c, y, h, F)[0]),
    ("o2", "got an array of text of shape", lambda c, y, h, F: o2()(c, y, h, F).astype(str)),
    ("o4", "result 2 of 2", o4(lambda mu, z, p: np.diagonal(deviations(mu, z, p)))),
    ("o5", "has no `=`", lambda: "the spread"),
    ("o5", "known here: W, mu, p1, p2, z, z1, z2. Declare", lambda: "W = mu*d + (1 - mu)*p2"),  # nothing is random: no m, no d
    ("o5", "`z1 =`, which has a meaning already; derive `W`", lambda: "z1 = 0\n" + o5("p2")()),
]
