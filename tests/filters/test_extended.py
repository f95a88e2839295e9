"""The extended Kalman filter against the slow loop of the page, and the angle of a point in
formulas."""

import math

import numpy as np
import pytest

from kfcourse.filters.approximations import aof
from kfcourse.montecarlo.ensemble import simulate
from kfcourse.montecarlo.experiment import run
from kfcourse.symbolic.formula import FormulaError, parse, symbol
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.moments import NoClosedForm
from kfcourse.symbolic.quadrature import unscented
from kfcourse.symbolic.structure import gaussian, linearised

# A falling body with drag, gusts that grow with the speed, and a radar: range and elevation with
# correlated errors.
T, DRAG, GRAVITY, GUST = 0.5, 5e-5, 9.81, 0.01
D_XI = np.array([[1.0, 0.3], [0.3, 2.0]])
D_N = np.array([[2500.0, 0.2], [0.2, 1e-4]])
MEAN = np.array([14_000.0, 3_000.0, -350.0, 120.0])
COV = np.array(
    [[9e4, 1e4, 500, 0], [1e4, 8e4, 0, 300], [500, 0, 900, 100], [0, 300, 100, 800]], dtype=float
)
STEPS = 40


@pytest.fixture(scope="module")
def radar() -> Model:
    speed = "sqrt(vx**2 + vy**2)"
    return Model.define(
        [
            "px + T*vx",
            "py + T*vy",
            f"vx - T*c*{speed}*vx + e*{speed}*xi1",
            f"vy - T*(c*{speed}*vy + g) + e*{speed}*xi2",
        ],
        ["sqrt(px**2 + py**2) + n1", "atan2(py, px) + n2"],
        {"T": T, "c": DRAG, "g": GRAVITY, "e": GUST},
        symbols={"x": ["px", "py", "vx", "vy"], "v": ["xi1", "xi2"], "w": ["n1", "n2"]},
        prior={"mean": MEAN, "variance": COV},
        state_noise={"variance": D_XI},
        meter_noise={"variance": D_N},
        angles=["y2"],
    )


@pytest.fixture(scope="module")
def y(radar):
    return simulate(radar, 3, STEPS, seed=4).y


# The same model once more, typed from the page in NumPy with derivatives found by hand.


def f(x):
    speed = np.hypot(x[2], x[3])
    return np.array(
        [
            x[0] + T * x[2],
            x[1] + T * x[3],
            x[2] - T * DRAG * speed * x[2],
            x[3] - T * (DRAG * speed * x[3] + GRAVITY),
        ]
    )


def f_jacobian(x):
    vx, vy = x[2:]
    speed = np.hypot(vx, vy)
    Phi = np.eye(4)
    Phi[0, 2] = Phi[1, 3] = T
    Phi[2, 2] -= T * DRAG * (speed + vx**2 / speed)
    Phi[3, 3] -= T * DRAG * (speed + vy**2 / speed)
    Phi[2, 3] = Phi[3, 2] = -T * DRAG * vx * vy / speed
    return Phi


def g(x):
    return GUST * np.hypot(x[2], x[3]) * np.array([[0, 0], [0, 0], [1, 0], [0, 1]])


def S(x):
    return np.array([math.hypot(x[0], x[1]), math.atan2(x[1], x[0])])


def S_jacobian(x):
    r = math.hypot(x[0], x[1])
    return np.array([[x[0] / r, x[1] / r, 0, 0], [-x[1] / r**2, x[0] / r**2, 0, 0]])


def gain_form(Psi, H):
    K = Psi @ H.T @ np.linalg.inv(H @ Psi @ H.T + D_N)
    return (np.eye(4) - K @ H) @ Psi, K


def information_form(Psi, H):
    p = np.linalg.inv(np.linalg.inv(Psi) + H.T @ np.linalg.inv(D_N) @ H)
    return p, p @ H.T @ np.linalg.inv(D_N)


def slow(measurements, form):
    lam, Psi = MEAN, COV
    for y_k in measurements:
        p, K = form(Psi, S_jacobian(lam))
        z = lam + K @ (y_k - S(lam))
        yield z, p
        Phi = f_jacobian(z)
        lam, Psi = f(z), Phi @ p @ Phi.T + g(z) @ D_XI @ g(z).T


def assert_equal_to_rounding(mean, cov, expected_mean, expected_cov):
    """Apart by rounding only, in units of the standard deviations of the components.

    eps = 2e-16, times the condition of the correlations (below 1e3 here), times the largest
    component in standard deviations (below 1e3), for each of 40 steps: 1e-8.  Textbook forms
    without symmetrisation are within it too.
    """
    sd = np.sqrt(np.diagonal(expected_cov))
    np.testing.assert_allclose(mean / sd, expected_mean / sd, rtol=0, atol=1e-8)
    np.testing.assert_allclose(
        cov / np.outer(sd, sd), expected_cov / np.outer(sd, sd), rtol=0, atol=1e-8
    )


@pytest.mark.parametrize("form", [gain_form, information_form])
def test_the_filter_is_the_slow_loop_of_the_page_in_both_forms(radar, y, form):
    found = run(aof(linearised(radar)), y)
    for i in range(y.shape[1]):
        for k, (z, p) in enumerate(slow(y[:, i], form)):
            assert_equal_to_rounding(found.mean[k, i], found.cov[k, i], z, p)


# ---------------------------------------------------------------- atan2 in formulas


@pytest.mark.parametrize(
    ("formula", "message", "column"),
    [
        ("x + atan2(x)", "atan2 takes exactly 2 arguments", 4),
        ("x + atan2(x, v, v)", "atan2 takes exactly 2 arguments", 4),
        ("atan2()", "atan2 takes exactly 2 arguments", 0),
        ("atan2(x, v=1)", "atan2 takes exactly 2 arguments", 0),
        ("atan(x, v)", "atan takes exactly one argument", 0),
        ("x + atan2", "atan2 is a function", 4),
        ("atan2(x, 10**3)", "the argument of atan2 is too large", 0),
        ("atan2(0, 0)", "no finite real value", 0),
        ("__import__('os').system('ls')", "is not a known function; a product needs *", 0),
        ("atan2(x, __import__('os'))", "'__import__' is not a known function", 9),
    ],
)
def test_what_is_no_angle_is_refused(formula, message, column):
    with pytest.raises(FormulaError, match=message) as caught:
        parse(formula, {"x": symbol("x"), "v": symbol("v")})
    assert caught.value.column == column


def test_an_angle_has_no_gaussian_moments_in_closed_form(radar, y):
    with pytest.raises(NoClosedForm, match="unscented"):
        gaussian(Model.define(["x1 + v1", "x2 + v2"], ["atan2(x2, x1) + w"], angles=["y"]))
    # and the quadrature that the message advises runs: within a tenth of a standard deviation here
    by_points, by_tangent = run(aof(unscented(radar)), y), run(aof(linearised(radar)), y)
    sd = np.sqrt(np.diagonal(by_tangent.cov, axis1=-2, axis2=-1))
    assert (abs(by_points.mean - by_tangent.mean) / sd)[-1].max() < 0.1


def test_calls_of_two_arguments_nest_no_deeper_than_others():
    with pytest.raises(FormulaError, match="nested more than 5 deep"):
        parse("atan2(x, " * 6 + "x" + ")" * 6, {"x": symbol("x")})
