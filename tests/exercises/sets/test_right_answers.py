"""Right answers in unusual forms pass: written from the statements alone, in none of the ways of
the worked solutions."""

import numpy as np
import pytest
import sympy as sp
from numpy import matrix_transpose as T
from scipy.integrate import quad

from kfcourse.exercises.checks import exercise

GENERATED = {
    "name": "generated",
    "state": "c*x + r + e*cos(x)*v",
    "meter": "g*x + q*x**2 + f*w",
    "parameters": {"c": 0.83, "r": 0.86, "e": 0.24, "g": 0.9, "q": 0.39, "f": 0.33},
    "prior": {"mean": 0.0, "variance": 0.75},
}
c, e, g, f, r, q = sp.symbols("c e g f r q", real=True)


def without_joseph(lam, Psi, h, G, F, y):
    K = Psi @ T(G) @ np.linalg.inv(F)
    return lam + (K @ (y - h)[..., None])[..., 0], Psi - K @ G @ Psi


def one_time(variance, q):
    """Pontryagin's double integral, as the chapter has it before it is simplified."""

    def V(x):
        return (1 - np.cos(x)) / variance

    up, down = (quad(lambda x, sign=sign: np.exp(sign * V(x)), 0, 2 * np.pi)[0] for sign in (1, -1))
    return up * down / (2 * q)


RIGHT = [
    ("a2", "53", lambda z, p: [[c * z], [(c * sp.sqrt(p)) ** 2 + (e * z) ** 2]]),
    ("a3", "20", lambda m, d: ([m[0]], [1, 0], [[d[0, 0] + r**2]])),
    (
        "a5",
        "generated",
        lambda m, d: (
            g * m + q * (m**2 + d),
            g + 2 * q * m,
            (g + 2 * q * m) ** 2 * d + 2 * (q * d) ** 2 + f**2,
        ),
    ),
    ("a6", "53", lambda m, d: f**2 * ((m**2 + 3 * d) ** 2 - 6 * d**2)),
    (
        "a7",
        "53",
        lambda: (
            "F = M[(g*(x - m) + f*x^2*w)^2]\n= g^2*d + f^2*M[x^4]\n= g^2*d + f^2*(m^4 + 6*m^2*d + "
            "3*d^2)"
        ),
    ),
    (
        "a7",
        "53",
        lambda: (
            "F = M[y^2] - h^2\n= g^2*(m^2 + d) + f^2*M[x**4] - (g*m)^2\n= d*g^2 + f^2*((m^2 + "
            "3*d)^2 - 6*d^2)  # done"
        ),
    ),
    (
        "b1",
        "20",
        lambda Psi, G, F: [
            (P @ H.T @ np.linalg.pinv(V)).tolist() for P, H, V in zip(Psi, G, F, strict=True)
        ],
    ),
    # the state's components differ by a factor of a thousand: an inverse keeps its digits all the
    # same
    ("b2", "D3", without_joseph),
    (
        "b5",
        "5",
        lambda Psi, G, F, R: np.linalg.inv(np.linalg.inv(Psi) + T(G) @ np.linalg.inv(R) @ G),
    ),
    ("m2", "53", lambda nu, F: -sp.log(sp.sqrt(2 * sp.pi * F)) - (nu / sp.sqrt(F)) ** 2 / 2),
    ("r5", "53", lambda variance, q: np.array([one_time(s, q) for s in variance])),
]


@pytest.mark.parametrize(
    ("name", "variant", "answer"),
    [pytest.param(*row, id=f"{row[0]}-{i}") for i, row in enumerate(RIGHT)],
)
def test_right_answers_in_unusual_forms_pass(name, variant, answer):
    result = exercise(name[0], GENERATED if variant == "generated" else variant).check(name, answer)
    assert result.passed, result
