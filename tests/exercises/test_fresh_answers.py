"""Answers written from the statements alone: right ones in unusual forms pass, wrong ones are told something true.

A part of a larger collection, for the course's variant, two others of other kinds, and a generated one.
"""

from functools import cache

import numpy as np
import pytest
import sympy as sp
from numpy import matrix_transpose as T

from kfcourse.checks import exercise

GENERATED = {
    "name": "generated",
    "state": "c*x + r + e*cos(x)*v",
    "meter": "g*x + q*x**2 + f*w",
    "parameters": {"c": 0.83, "r": 0.86, "e": 0.24, "g": 0.9, "q": 0.39, "f": 0.33},
    "prior": {"mean": 0.0, "variance": 0.75},
}
c, e, g, f, r, q, s, mu, dt = sp.symbols("c e g f r q s mu T", real=True)


@cache
def opened(letter, variant):
    return exercise(letter, GENERATED if variant == "generated" else variant)


def told(name, answer, variant="53"):
    """As if nothing had been handed in before."""
    task = opened(name[0], variant)
    task.past.given.clear(), task.past.wrong.clear()
    return task.check(name, answer)


def gain(Psi, G, F):
    return Psi @ T(G) @ np.linalg.inv(F)


def times(matrix, vector):
    return (matrix @ vector[..., None])[..., 0]


def slope(z):
    return sp.Matrix([[1, dt], [dt * (-2 * mu * z[0] * z[1] - 1), 1 + dt * mu * (1 - z[0] ** 2)]])


def moved(z):
    return sp.Matrix([z[0] + dt * z[1], z[1] + dt * (mu * z[1] * (1 - z[0] ** 2) - z[0])])


def centred(target, regressor):
    r_, t = regressor - regressor.mean(axis=0), target - target.mean(axis=0)
    B = np.linalg.lstsq(r_, t, rcond=None)[0].T
    return B, target.mean(axis=0) - B @ regressor.mean(axis=0), (t - r_ @ B.T).T @ (t - r_ @ B.T) / len(t)


def with_ones(target, regressor):
    B = np.linalg.lstsq(np.column_stack([regressor, np.ones(len(regressor))]), target, rcond=None)[0]
    left = target - np.column_stack([regressor, np.ones(len(regressor))]) @ B
    return B[:-1].T, B[-1], left.T @ left / len(left)


def designed(own=lambda mean: mean, other=lambda mean: mean):
    def answer(x, y_design, y, mean, a, b):
        lam, mine = np.tile(own(mean), (x.shape[1], 1)), np.tile(other(mean), (y.shape[1], 1))
        found = []
        for k in range(len(x)):
            omega = y_design[k] - b(lam)
            H, shift, _ = centred(x[k] - lam, omega)
            z = lam + omega @ H.T + shift
            found.append(mine + (y[k] - b(mine)) @ H.T + shift)
            if k + 1 < len(x):
                F, shift, _ = centred(x[k + 1], a(z))
                lam, mine = a(z) @ F.T + shift, a(found[-1]) @ F.T + shift
        return np.array(found)

    return answer


def alpha_beta(y, step, alpha, beta, r, v):
    positions, velocities = [], []
    for one in y:
        nu = one - r
        r, v = r + alpha * nu, v + beta / step * nu
        positions.append(r)
        velocities.append(v)
        r = r + step * v
    return np.array(positions), np.array(velocities)


def nees(x, z, p):
    return np.einsum("kni,knij,knj->k", x - z, np.linalg.inv(p), x - z) / x.shape[1]


def rates(there):
    return lambda steps, ratio, first: 1 + there(np.arange(steps), ratio, first)


def joseph(Psi, G, F, R):
    K = gain(Psi, G, F)
    rest = np.eye(Psi.shape[-1]) - K @ G
    return rest @ Psi @ T(rest) + K @ R @ T(K)


RIGHT = [
    ("a1", "53", lambda z: sp.Matrix([c, e * z])),
    ("a2", "53", lambda z, p: [[c * z], [(c * sp.sqrt(p)) ** 2 + (e * z) ** 2]]),
    ("a3", "5", lambda m, d: (g * sp.sin(m), g * sp.cos(m), g**2 * (1 - sp.sin(m) ** 2) * d + f**2)),
    ("a3", "20", lambda m, d: ([m[0]], [1, 0], [[d[0, 0] + r**2]])),
    ("a5", "generated", lambda m, d: (g * m + q * (m**2 + d), g + 2 * q * m, (g + 2 * q * m) ** 2 * d + 2 * (q * d) ** 2 + f**2)),
    ("a6", "20", lambda m, d: sp.Matrix([[r**2]])),
    ("b1", "20", lambda Psi, G, F: [(P @ H.T @ np.linalg.pinv(V)).tolist() for P, H, V in zip(Psi, G, F, strict=True)]),
    (
        "b2",
        "53",
        lambda lam, Psi, h, G, F, y: (lam + times(gain(Psi, G, F), y - h), Psi - gain(Psi, G, F) @ F @ T(gain(Psi, G, F))),
    ),
    # the state's components differ by a factor of a thousand: an inverse keeps its digits all the same
    (
        "b2",
        "D3",
        lambda lam, Psi, h, G, F, y: (lam + times(gain(Psi, G, F), y - h), Psi - gain(Psi, G, F) @ G @ Psi),
    ),
    ("b5", "5", lambda Psi, G, F, R: np.linalg.inv(np.linalg.inv(Psi) + T(G) @ np.linalg.inv(R) @ G)),
    ("b5", "20", joseph),
    ("c2", "generated", centred),
    ("c4", "53", designed()),
    ("c4", "53", designed(lambda mean: 0 * mean, lambda mean: 0 * mean)),  # the offset makes it good, at every step
    ("e5", "53", lambda x, z, p: nees(x, z, p) / x.shape[2]),
    ("j3", "5", lambda a: (2 * (1 - np.sqrt(1 - a)) ** 2, 2 * (1 - np.sqrt(1 - a)) ** 2 / np.sqrt(1 - a))),
    ("j4", "53", alpha_beta),
    ("l1", "5", rates(lambda k, ratio, first: np.isin(k, np.arange(first, len(k), ratio)))),
]


@pytest.mark.parametrize(("name", "variant", "answer"), [pytest.param(*row, id=f"{row[0]}-{i}") for i, row in enumerate(RIGHT)])
def test_unusual_forms_of_right_answers_pass(name, variant, answer):
    result = told(name, answer, variant)
    assert result.passed, result


# Question, variant, names of which one must be said, answer.  "" stands for its own case only.
WRONG = [
    ("a1", "53", "numbers", lambda z: (0.9, 0.05 * z)),
    ("a2", "53", "numbers", lambda z, p: (0.9 * z, 0.81 * p + 0.0025 * z**2)),
    ("a2", "53", "limit powers", lambda z, p: (c * z, c * p + e * z)),
    ("a2", "20", "entry", lambda z, p: (moved(z), slope(z) * p * slope(z).T + s**2 * sp.eye(2))),
    ("a3", "20", "unused", lambda m, d: (m[0], sp.Matrix([[1, 0]]), d[0, 1] + r**2)),
    ("a3", "20", "swapped", lambda m, d: (d[0, 0] + r**2, sp.Matrix([[1, 0]]), m[0])),
    ("a5", "53", "limit", lambda m, d: (g * m, g, g**2 * d + f**2 * (m**4 + 6 * m**2 * d + 15 * d**2))),
    (
        "a5",
        "generated",
        "limit",
        lambda m, d: (g * m + q * (m**2 - d), g + 2 * q * m, (g + 2 * q * m) ** 2 * d + 2 * (q * d) ** 2 + f**2),
    ),
    ("b1", "53", "first-law", lambda Psi, G, F: Psi[:1] @ T(G) @ np.linalg.inv(F)),
    ("b1", "20", "one-for-all", lambda Psi, G, F: np.tile(gain(Psi, G, F)[:1], (len(Psi), 1, 1))),
    (
        "b2",
        "53",
        "innovation-of-state unused",
        lambda lam, Psi, h, G, F, y: (lam + times(gain(Psi, G, F), y - times(G, lam)), Psi - gain(Psi, G, F) @ G @ Psi),
    ),
    ("b5", "5", "whole-covariance", lambda Psi, G, F, R: joseph(Psi, G, F, F)),
    ("c2", "53", "another-minimiser", with_ones),
    ("c4", "53", "shifted limit term unused too-large too-small", designed(other=lambda mean: 0 * mean)),
    ("e5", "53", "not-per-component scalars-only", nees),
    ("e5", "20", "not-per-component", nees),
    ("j4", "53", "gains-swapped exchanged", lambda y, step, a, b, r, v: alpha_beta(y, step, b, a, r, v)),
    ("k2", "53", "exchanged", lambda x, n: told_steady(n, x)),
    ("k6", "53", "factor", lambda beta, K, j: K * beta * (1 - (1 + K) ** j)),
    ("l1", "5", "sum-for-difference", rates(lambda k, ratio, first: (k + first) % ratio == 0)),
    ("l1", "53", "counted-from-zero", rates(lambda k, ratio, first: (k >= first) & (k % ratio == 0))),
    ("l6", "53", "power factor", lambda V, a, tau: (-V * tau + a * tau**2 / 2, -a * tau**2)),
]


def told_steady(x, n):
    Psi = (x**2 + x * sp.sqrt(x**2 + 4 * n**2)) / 2
    return Psi, Psi - x**2, -Psi / (Psi + n**2)


@pytest.mark.parametrize(
    ("name", "variant", "kinds", "answer"), [pytest.param(*row, id=f"{row[0]}-{i}") for i, row in enumerate(WRONG)]
)
def test_wrong_answers_are_told_something_true(name, variant, kinds, answer):
    result = told(name, answer, variant)
    assert (result.status, result.trouble) == ("wrong", ""), result
    assert result.diagnosis and set(result.diagnosis) <= set(kinds.split()), result


def step_from(choose):
    def answer(lam, Psi, y, measure, predict):
        h, G, F = measure(lam, Psi)
        K = gain(Psi, G, F)
        z, p = lam + times(K, y - h), Psi - K @ G @ Psi
        return z, p, *predict(*choose(z, p, lam, Psi))

    return answer


def mean_square(x, z):
    return ((x - z) ** 2).sum(axis=2).mean(axis=1)


def deviation(error):
    return error[:, :, 0].std(axis=1, ddof=1) / np.sqrt(error.shape[1])


def bayes(predicted, y, x, see):
    mean, variance = see(x)
    product = predicted * np.exp(-((y - mean) ** 2) / (2 * variance)) / np.sqrt(2 * np.pi * variance)
    return product / product.sum() / (x[1] - x[0]), product.sum() * (x[1] - x[0])


def moments_of(density, x):
    weights = density / density.sum()
    return weights / (x[1] - x[0]), weights @ x, weights @ (x - weights @ x) ** 2


def first_moment_about_the_mean(density, x):
    weights = density / density.sum()
    return weights @ (x - weights @ x)


def central(function, x, h):
    return np.stack([(function(x + h * one) - function(x - h * one)) / (2 * h) for one in np.eye(x.shape[1])], axis=-1)


FALSE = [
    ("a2", "20", "symmetric", WRONG[3][3]),
    ("b1", "53", "first step", lambda Psi, G, F: gain(Psi, G, F) + 0.1 * np.arange(len(Psi))[:, None, None]),
    ("b5", "53", "depends on", lambda Psi, G, F, R: joseph(Psi, G, F, R) + 0.1 * G[..., :1, :1] ** 2),
    ("c4", "53", "depends on", lambda x, yd, y, mean, a, b: designed()(x, yd, y, mean, a, b) + mean**2),
    ("c2", "53", "transposed", with_ones),
    ("l1", "53", "does not depend", rates(lambda k, ratio, first: (k >= first) & (k % ratio == 0))),
    # a mistake that this variant does not allow, or that is another one
    ("a2", "5", "factor of the noise does not belong", lambda z, p: (c * z, c**2 * p)),
    ("a6", "generated", "variance of the noise's factor", lambda m, d: 2 * q**2 * d**2),
    ("b3", "5", "swapped", step_from(lambda z, p, lam, Psi: (lam, p))),
    ("e1", "53", "first component", lambda x, z: (x - z)[:, :, 0].mean(axis=1)),
    ("e2", "53", "first component", lambda x, z: (mean_square(x, z), deviation(x - z))),
    ("f2", "53", "comes back unchanged", lambda q_, y, x, see: (bayes(q_, y, x, see)[0], 1.0)),
    ("g1", "53", "higher order", lambda function, x, h: central(function, x, 1e-6)),
    ("h1", "53", "step is missing", lambda S, N, step: (2 * S * step, 2 * N * step)),
    ("k1", "53", "slow sensor is added", lambda S, y, eps: (S(y), sp.diff(S(y), y))),
    ("k1", "53", "reversed", lambda S, y, eps: (-S(y - eps), -sp.diff(S(y - eps), eps))),
    # what holds near the hidden arguments only
    ("f5", "53", "does not depend", lambda a, b, sd, error: np.ceil((b - a) * sd * np.log(2 / error)) + 1),
    ("f1", "5", "units", lambda density, x: (*moments_of(density, x)[:2], first_moment_about_the_mean(density, x))),
]


@pytest.mark.parametrize(
    ("name", "variant", "words", "answer"), [pytest.param(*row, id=f"{row[0]}-{i}") for i, row in enumerate(FALSE)]
)
def test_no_hint_is_false(name, variant, words, answer):
    result = told(name, answer, variant)
    assert result.status == "wrong" and words not in result.message, result
