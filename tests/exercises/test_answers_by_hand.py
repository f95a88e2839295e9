"""Answers of sets a to e, typed by hand: right ones pass, wrong ones are recognised.

For variant 53: x' = c x + e x v, y = g x + f x^2 w.
"""

from functools import cache

import numpy as np
import pytest
import sympy as sp
from by_hand import (
    T,
    b2,
    b3,
    b4,
    c3,
    c4,
    condition,
    covariance,
    d2,
    d3,
    error,
    partial_regression,
    predicts_first,
    regression,
    square,
)

from kfcourse.checks import exercise, sets

pytestmark = pytest.mark.quick

FIRST = "abcde"
x, y, z, p, m, d = sp.symbols("x y z p m d", real=True)
c, e, g, f = sp.symbols("c e g f", real=True)


@cache
def opened(letter):
    return exercise(letter, "53")


def normalised(x, z, p):
    return np.einsum("kni,knij,knj->k", x - z, np.linalg.inv(p), x - z) / x[0].size


WRONG_BY_HAND = [
    ("a2", "numbers", lambda z, p: (0.9 * z, 0.81 * p + 0.0025 * z**2)),
    ("a2", "noise-forgotten", lambda z, p: (c * z, c**2 * p)),
    ("a2", "noise-forgotten", lambda z, p: (0.9 * z, 0.81 * p)),
    ("a2", "noise-power", lambda z, p: (0.9 * z, 0.81 * p + 0.05 * z)),
    ("a2", "noise-power", lambda z, p: (c * z, c**2 * p + e * z)),
    ("a2", "slope-power", lambda z, p: (0.9 * z, 0.9 * p + 0.0025 * z**2)),
    ("a2", "state-forgotten", lambda z, p: (c * z, (e * z) ** 2)),
    ("a2", "function-for-derivative", lambda z, p: (c * z, (c * z) ** 2 * p + (e * z) ** 2)),
    ("a2", "variance-squared", lambda z, p: (c * z, c**2 * p**2 + e**2 * z**2)),
    ("a2", "variance-root", lambda z, p: (c * z, c**2 * sp.sqrt(p) + e**2 * z**2)),
    ("a2", "sign", lambda z, p: (-c * z, c**2 * p + e**2 * z**2)),
    ("a3", "noise-forgotten", lambda m, d: (g * m, g, g**2 * d)),
    ("a3", "noise-power", lambda m, d: (m, 1, d + 0.02 * m**2)),
    ("a3", "slope-power", lambda m, d: (g * m, g, g * d + f**2 * m**4)),
    ("a3", "state-forgotten", lambda m, d: (g * m, g, f**2 * m**4)),
    ("a3", "variance-squared", lambda m, d: (g * m, g, g**2 * d**2 + f**2 * m**4)),
    ("a3", "variance-root", lambda m, d: (g * m, g, g**2 * sp.sqrt(d) + f**2 * m**4)),
    ("a3", "function-for-derivative", lambda m, d: (g * m, g, (g * m) ** 2 * d + f**2 * m**4)),
    ("a4", "noise-not-averaged", lambda z, p: (c * z, c**2 * p + e**2 * z**2)),
    ("a4", "linearised", lambda z, p: (0.9 * z, 0.81 * p + 0.0025 * z**2)),
    ("a4", "noise-forgotten", lambda z, p: (c * z, c**2 * p)),
    ("a4", "second-moment", lambda z, p: (c * z, (c**2 + e**2) * (z**2 + p))),
    ("a4", "variance-squared", lambda z, p: (c * z, c**2 * p**2 + e**2 * (z**2 + p**2))),
    ("a4", "variance-root", lambda z, p: (c * z, c**2 * sp.sqrt(p) + e**2 * (z**2 + sp.sqrt(p)))),
    ("a4", "factor-half", lambda z, p: (c * z, 2 * (c**2 * p + e**2 * (z**2 + p)))),
    ("a5", "noise-not-averaged", lambda m, d: (g * m, g, g**2 * d + f**2 * m**4)),
    ("a5", "noise-forgotten", lambda m, d: (g * m, g, g**2 * d)),
    ("a5", "second-moment", lambda m, d: (g * m, g, g**2 * (d + m**2) + f**2 * (m**4 + 6 * m**2 * d + 3 * d**2))),
    ("a5", "variance-squared", lambda m, d: (g * m, g, g**2 * d**2 + f**2 * (m**4 + 6 * m**2 * d**2 + 3 * d**4))),
    ("a5", "variance-root", lambda m, d: (g * m, g, g**2 * sp.sqrt(d) + f**2 * (m**4 + 6 * m**2 * sp.sqrt(d) + 3 * d))),
    ("a5", "sign", lambda m, d: (g * m, -g, g**2 * d + f**2 * (m**4 + 6 * m**2 * d + 3 * d**2))),
    ("a7", "moment", lambda: "F = M[(y - h)^2]\n = g^2*d + f^2*M[x^4]\n = g^2*d + 3*f^2*d^2"),
    ("a7", "factor", lambda: "F = M[(y - h)^2]\n = g^2*d + f^2*M[x^4]\n = g^2*d + f^2*(m^4 + 3*m^2*d + 3*d^2)"),
    ("a7", "power", lambda: "F = M[(y - h)^2]\n = g*d + f^2*M[x^4]\n = g*d + f^2*(m^4 + 6*m^2*d + 3*d^2)"),
    ("a7", "noise-forgotten", lambda: "F = M[(y - h)^2]\n = M[(g*(x - m) + f*x^2*w)^2]\n = g^2*M[(x - m)^2]\n = g^2*d"),
    ("a7", "open-end", lambda: "F = M[(y - h)^2]\n = g^2*d + f^2*M[x^4]"),
    ("b2", "innovation-sign", b2(innovation=lambda y, h: h - y)),
    ("b2", "innovation-without-h", b2(innovation=lambda y, h: y)),
    ("b2", "covariance-kept", b2(cov=lambda Psi, K, G: Psi)),
    ("b2", "covariance-added", b2(cov=lambda Psi, K, G: Psi + K @ G @ Psi)),
    ("b2", "covariance-once", b2(cov=lambda Psi, K, G: Psi - K @ G)),
    ("b2", "gain-not-divided", b2(gain=lambda Psi, G, F: Psi @ T(G))),
    ("b2", "gain-by-standard-deviation", b2(gain=lambda Psi, G, F: Psi @ T(G) / np.sqrt(F))),
    ("b2", "gain-without-G", b2(gain=lambda Psi, G, F: Psi / F)),
    ("b2", "gain-without-Psi", b2(gain=lambda Psi, G, F: T(G) / F)),
    ("b2", "gain-of-noise", b2(gain=lambda Psi, G, F: Psi @ T(G) / (F - G @ Psi @ T(G)))),
    ("b3", "beats-swapped", predicts_first),
    ("b3", "predicted-from-prediction", b3(lambda lam, Psi, z, p, predict: predict(lam, Psi))),
    ("b3", "covariance-not-predicted", b3(lambda lam, Psi, z, p, predict: (predict(z, p)[0], p))),
    ("b3", "mean-not-predicted", b3(lambda lam, Psi, z, p, predict: (z, predict(z, p)[1]))),
    ("b3", "variance-mixed", b3(lambda lam, Psi, z, p, predict: predict(z, Psi))),
    ("b4", "predicted-first", b4(first=True)),
    ("b4", "predictions-returned", b4(returns="lam")),
    ("b4", "covariance-frozen", b4(frozen=True)),
    ("b4", "missing-as-zero", b4(missing=0.0)),
    ("b4", "innovation-sign", b4(sign=-1)),
    ("b4", "covariance-kept", b4(shrink=False)),
    ("c2", "means-not-subtracted", partial_regression(centred=False)),
    ("c2", "offset-forgotten", partial_regression(offset=False)),
    ("c2", "regularised", partial_regression(ridge=1e-3)),
    ("c2", "biased", partial_regression(biased=60 / 59)),
    ("c2", "residual-is-variance", partial_regression(residual="whole")),
    ("c2", "unbiased-residual", partial_regression(residual="n-1")),
    ("c3", "state-for-error", c3(target=lambda x, lam: x)),
    ("c3", "prediction-not-added", c3(base=lambda lam: 0)),
    ("c3", "alpha-from-prediction", c3(alpha=lambda a, z, lam: a(lam))),
    ("c3", "means-not-subtracted", c3(fit=partial_regression(centred=False))),
    ("c3", "offset-forgotten", c3(fit=partial_regression(offset=False))),
    ("c4", "part-of-ensemble", c4(part=5)),
    ("c4", "one-gain", c4(one_gain=True)),
    ("c4", "predictions-returned", c4(returns="lam")),
    ("c4", "offset-not-used", c4(offset=False)),
    ("c4", "sign", c4(returns="-z")),
    ("d2", "predicted-as-aof", d2(choose=lambda u, T, z, p: (z, p))),
    ("d2", "mean-from-estimate", d2(choose=lambda u, T, z, p: (z, T))),
    ("d2", "variance-from-aof", d2(choose=lambda u, T, z, p: (u, p))),
    ("d2", "regressed-the-other-way", d2(condition=lambda x, z: condition(z, x))),
    ("d2", "residual-is-variance", d2(condition=lambda x, z: (condition(x, z)[0], covariance(x, x)))),
    ("d2", "deviation-for-variance", d2(condition=lambda x, z: (condition(x, z)[0], np.sqrt(condition(x, z)[1])))),
    ("d2", "offset-forgotten", d2(condition=lambda x, z: condition(x, z, partial_regression(offset=False)))),
    ("d3", "correction-not-fitted", d3(correct=False)),
    ("d3", "prediction-not-fitted", d3(predicted=False)),
    ("d3", "state-for-error", d3(target=lambda x, lam: x)),
    ("d3", "variance-from-aof", d3(own=True)),
    ("d3", "offset-forgotten", d3(fit=partial_regression(offset=False))),
    ("d3", "means-not-subtracted", d3(fit=partial_regression(centred=False))),
    ("e2", "spread-for-error", lambda x, z: (square(x, z).mean(axis=1), square(x, z).std(axis=1, ddof=1))),
    ("e2", "not-root", lambda x, z: (square(x, z).mean(axis=1), square(x, z).var(axis=1, ddof=1) / x.shape[1])),
    ("e2", "divided-by-N", lambda x, z: (square(x, z).mean(axis=1), square(x, z).std(axis=1, ddof=1) / x.shape[1])),
    ("e2", "of-error", lambda x, z: (square(x, z).mean(axis=1), error(np.abs(x - z)[:, :, 0]))),
    ("e2", "biased-spread", lambda x, z: (square(x, z).mean(axis=1), error(square(x, z), ddof=0))),
    ("e2", "normal-theory", lambda x, z: (square(x, z).mean(axis=1), square(x, z).mean(axis=1) * (2 / x.shape[1]) ** 0.5)),
    (
        "e3",
        "unpaired",
        lambda x, z, o: (
            square(x, z).mean(axis=1) - square(x, o).mean(axis=1),
            np.sqrt(error(square(x, z)) ** 2 + error(square(x, o)) ** 2),
        ),
    ),
    (
        "e3",
        "errors-subtracted",
        lambda x, z, o: ((square(x, z) - square(x, o)).mean(axis=1), abs(error(square(x, z)) - error(square(x, o)))),
    ),
    (
        "e3",
        "errors-added",
        lambda x, z, o: ((square(x, z) - square(x, o)).mean(axis=1), error(square(x, z)) + error(square(x, o))),
    ),
    ("e3", "distance-of-estimates", lambda x, z, o: (square(z, o).mean(axis=1), error(square(z, o)))),
    ("e3", "order", lambda x, z, o: ((square(x, o) - square(x, z)).mean(axis=1), error(square(x, o) - square(x, z)))),
    ("e5", "by-deviation", lambda x, z, p: ((x - z)[..., 0] ** 2 / np.sqrt(p[..., 0, 0])).mean(axis=1)),
    ("e5", "ratio-of-means", lambda x, z, p: ((x - z)[..., 0] ** 2).mean(axis=1) / p[..., 0, 0].mean(axis=1)),
    ("e5", "inverted", lambda x, z, p: (p[..., 0, 0] / (x - z)[..., 0] ** 2).mean(axis=1)),
    ("e5", "root", lambda x, z, p: np.sqrt(normalised(x, z, p))),
    ("e5", "factor-half", lambda x, z, p: 2 * normalised(x, z, p)),
]


@pytest.mark.parametrize(
    ("name", "diagnosis", "answer"), [pytest.param(*row, id=f"{row[0]}-{i}-{row[1]}") for i, row in enumerate(WRONG_BY_HAND)]
)
def test_wrong_answers_typed_by_hand(name, diagnosis, answer):
    result = opened(name[0]).check(name, answer)
    assert result.status == "wrong"
    assert diagnosis in result.diagnosis, result


def test_five_by_hand_for_every_core_question_of_the_first_sets():
    core = {question.name for letter in FIRST for question in sets()[letter].questions if question.level == "core"}
    by_hand = {name: {diagnosis for one, diagnosis, _ in WRONG_BY_HAND if one == name} for name in core}
    assert {name: sorted(found) for name, found in by_hand.items() if len(found) < 5} == {}


RIGHT_BY_HAND = [
    (
        "a7",
        lambda: "F = M[(y - h)^2]\n = M[(g*(x - m) + f*x^2*w)^2]\n = g^2*d + f^2*M[x^4]\n = g^2*d + f^2*(m^4 + 6*d*m^2 + 3*d^2)",
    ),
    ("a2", lambda z, p: (z * c, p * c**2 + (e * z) ** 2)),
    ("a3", lambda m, d: [g * m, g, g**2 * d + (f * m**2) ** 2]),
    ("a4", lambda z, p: (c * z, p * (c**2 + e**2) + e**2 * z**2)),
    ("a5", lambda m, d: (g * m, g, g**2 * d + f**2 * ((m**2 + 3 * d) ** 2 - 6 * d**2))),
    ("b2", b2()),
    ("b3", b3(lambda lam, Psi, z, p, predict: predict(z, p))),
    ("b4", b4()),
    ("c2", regression),
    ("c3", c3()),
    ("c4", c4()),
    ("d2", d2()),
    ("d3", d3()),
    ("e2", lambda x, z: (square(x, z).mean(axis=1), error(square(x, z)))),
    ("e3", lambda x, z, o: ((square(x, z) - square(x, o)).mean(axis=1), error(square(x, z) - square(x, o)))),
    ("e5", normalised),
]


@pytest.mark.parametrize(("name", "answer"), [pytest.param(*row, id=row[0]) for row in RIGHT_BY_HAND])
def test_right_answers_typed_by_hand(name, answer):
    """Without them the wrong ones could be wrong for another reason than the one they are there for."""
    assert opened(name[0]).check(name, answer).passed
