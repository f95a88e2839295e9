"""Set r, answers as a student would type them: the right ones pass, the wrong ones are named."""

import numpy as np
import sympy as sp
from answers import test_no_wrong_kind_of_mistake_is_named, test_right_answers_pass, test_what_cannot_be_compared_is_explained  # noqa: F401
from scipy.integrate import quad


def r1(slope=lambda a, A: -A * np.sin(a), expected=lambda a, A: A * np.cos(a), noise=lambda s: s**2):
    return lambda lam, y, theta, A, sigma: slope(theta + lam, A) * (y - expected(theta + lam, A)) / noise(sigma)


HALF = sp.Rational(1, 2)


def r2(U=sp.sin, factor=HALF, noise=lambda slope: 1 / slope):
    return lambda Delta, A, D: (factor * A**2 / D * U(Delta), factor * A**2 / D, noise(factor * A**2 / D))


def r3(after=lambda Psi, q, r: Psi * r / (Psi + r), root=lambda q, r: sp.sqrt(q**2 / 4 + q * r)):
    return lambda q, r: (q / 2 + root(q, r), after(q / 2 + root(q, r), q, r))


def one_time(variance, q):
    """Pontryagin's double integral, as the chapter has it before it is simplified."""

    def V(x):
        return (1 - np.cos(x)) / variance

    up, down = (quad(lambda x, sign=sign: np.exp(sign * V(x)), 0, 2 * np.pi)[0] for sign in (1, -1))
    return up * down / (2 * q)


def r6(cycles=lambda e: np.rint(e / 2 / np.pi), border=2 * np.pi, steps=lambda first, last: first):
    def answer(error):
        total = count = 0
        for run in error.T:
            over = [k for k, e in enumerate(run) if abs(e) >= border]
            total, count = total + (steps(over[0], len(run)) if over else len(run)), count + bool(over)
        return cycles(error[-1]), total / count

    return answer


RIGHT = [
    ("r1", r1()),
    ("r2", r2()),
    ("r3", r3()),
    ("r4", lambda p, A, D, T: p * A**2 / D / T / 4 / sp.pi),
    ("r4", lambda p, A, D, T: p * A**2 / (2 * D) / (2 * np.pi * T)),  # pi with the digits of a float
    ("r5", lambda variance, q: np.array([one_time(s, q) for s in variance])),
    ("r6", r6()),
]

WRONG = [
    ("r1", "innovation-sign sign", r1(slope=lambda a, A: A * np.sin(a))),
    ("r1", "signal-for-derivative", r1(slope=lambda a, A: A * np.cos(a))),
    ("r1", "by-deviation", r1(noise=lambda s: s)),
    ("r1", "measurement-for-innovation", r1(expected=lambda a, A: 0)),
    ("r2", "half-forgotten", r2(factor=1)),
    ("r2", "cosine", r2(U=sp.cos)),
    ("r2", "tangent", r2(U=lambda x: x)),
    ("r2", "noise-not-inverted another-result", r2(noise=lambda slope: slope)),
    ("r3", "before-and-after swapped", lambda q, r: r3()(q, r)[::-1]),
    ("r3", "discriminant", r3(root=lambda q, r: sp.sqrt(q**2 + q * r) / 2, after=lambda Psi, q, r: Psi - q)),
    ("r3", "correction-forgotten another-result", r3(after=lambda Psi, q, r: Psi)),
    ("r3", "small-noise", lambda q, r: (sp.sqrt(q * r), sp.sqrt(q * r) - q)),
    ("r4", "radians", lambda p, A, D, T: p * A**2 / (2 * D * T)),
    ("r4", "factor-of", lambda p, A, D, T: p * A**2 / (4 * 3.14159 * D * T)),
    ("r4", "half-forgotten factor-half", lambda p, A, D, T: p * A**2 / (2 * sp.pi * D * T)),
    ("r4", "gain-forgotten", lambda p, A, D, T: A**2 / (4 * sp.pi * D * T)),
    ("r4", "amplitude-once", lambda p, A, D, T: p * A / (4 * sp.pi * D * T)),
    ("r5", "half-a-cycle factor-2", lambda s, q: np.array([one_time(v, q) for v in s]) / 2),
    ("r5", "limit", lambda s, q: np.pi * s / q * np.exp(2 / s)),
    ("r5", "deviation-of-phase power", lambda s, q: np.array([one_time(v, q) for v in s]) * np.sqrt(q)),
    ("r5", "wander-forgotten unused", lambda s, q: np.array([one_time(v, 1) for v in s])),
    ("r6", "rounded-down", r6(cycles=lambda e: e // (2 * np.pi))),
    ("r6", "rounded-to-zero", r6(cycles=lambda e: (e / (2 * np.pi)).astype(int))),
    ("r6", "not-rounded", r6(cycles=lambda e: e / (2 * np.pi))),
    ("r6", "half-a-cycle", r6(border=np.pi)),
    ("r6", "all-steps", r6(steps=lambda first, last: last)),
]
UNUSABLE = [
    ("r2", "expected 3 results", lambda Delta, A, D: A**2 / (2 * D) * sp.sin(Delta)),
    ("r5", "got the shape ()", lambda s, q: one_time(s[0], q)),
    ("r6", "expected 2 results", lambda error: np.round(error[-1] / (2 * np.pi))),
]


def test_a_factor_has_more_causes_than_one(told):
    """Here pi is left out, and the tangent is not taken."""
    result = told("r4", lambda p, A, D, T: p * A**2 / (2 * D) / (2 * T))
    assert result.diagnosis == ("half-a-cycle",) and "or pi left out?" in result.message
