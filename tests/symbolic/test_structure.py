"""Structural functions: the page's table, quadrature, and what each kind is exact for."""

import numpy as np
import oracles
import pytest
import scipy
import sympy as sp
from numpy.testing import assert_allclose

from kfcourse import Model, ModelError, NoClosedForm, gauss_hermite, gaussian, linearised, unscented
from kfcourse.symbolic.equations import compile_model

KINDS = {
    "linearised": linearised,
    "gaussian": gaussian,
    "unscented": unscented,
    "gauss-hermite": gauss_hermite,
}


def vector_model():
    """Two components, more noises than equations, correlated noises with means, everything
    non-unit."""
    return Model.define(
        ["0.9*x1 + 0.2*x2*v1 + 0.1*v2", "0.8*x2 - 0.1*x1**2 + 0.3*v2*v3"],
        ["x1*x2 + 0.2*w1", "x2 + 0.5*x1*w2 + 0.1*w1**2"],
        prior={"mean": [0.5, -0.4], "variance": [[0.4, 0.1], [0.1, 0.3]]},
        state_noise={
            "mean": [0.1, -0.2, 0.3],
            "variance": [[0.5, 0.1, 0], [0.1, 0.4, 0.05], [0, 0.05, 0.3]],
        },
        meter_noise={"mean": [0.2, -0.1], "variance": [[0.3, 0.1], [0.1, 0.2]]},
    )


def van_der_pol():
    return Model.define(
        ["x1 + h*x2", "x2 + h*(mu*(1 - x1**2)*x2 - x1) + s*v"],
        ["x1 + r*w"],
        {"h": 0.1, "mu": 1.5, "s": 0.3, "r": 0.2},
        prior={"mean": [1, -0.5], "variance": [[0.3, 0.1], [0.1, 0.2]]},
    )


MODELS = {
    "variant 53": lambda: Model.define(
        "c*x + e*x*v",
        "g*x + f*x**2*w",
        {"c": 0.9, "e": 0.05, "g": 1, "f": 0.02},
        prior={"mean": 0.3},
    ),
    "sine": lambda: Model.define(
        "a*sin(x) + 0.2*v",
        "x*cos(x) + exp(0.3*x)*w",
        {"a": 0.7},
        prior={"mean": 0.4, "variance": 0.3},
    ),
    "noise in the exponent": lambda: Model.define(
        "0.9*x + exp(0.1*v)*sin(v)",
        "sinh(x/2) + exp(0.1*w)",
        prior={"mean": -0.2, "variance": 0.5},
        state_noise={"variance": 0.4},
    ),
    "irrational constants": lambda: Model.define(
        "sqrt(2)*exp(-c)*x + sin(c)*pi*v", "x*sqrt(3)*log(c) + cos(1)*w", {"c": 2}
    ),
    "vector": vector_model,
    "van der Pol": van_der_pol,
    "parameters named as the arguments": lambda: Model.define(
        "z*x + z_*v + p",
        "m*x + m_*w + d*x*w",
        {"z": 0.9, "z_": 0.5, "m": 2, "m_": 0.3, "d": 0.1, "p": 0.4},
    ),
    "state named z": lambda: Model.define(
        "a*z + v", "z**2 + w", {"a": 0.8}, symbols={"x": ["z"]}, prior={"mean": 1}
    ),
    "vector with names taken": lambda: Model.define(
        ["z1*x1 + p12*x2 + v1", "d11*x2 + p22*v1*x1"],
        ["x1 + m1*x2 + w"],
        {"z1": 0.9, "p12": 0.3, "d11": 0.8, "p22": 0.1, "m1": 0.5},
    ),
}


def quadrature(model, equation, law):
    """Mean, covariance, and sensitivity Cov(., x) P^-1 of an equation at the prior, with 10 points
    an axis."""
    n, mean = model.n, np.concatenate([model.prior.mean, law.mean])
    points, weights = oracles.gaussian_points(
        mean, scipy.linalg.block_diag(model.prior.cov, law.cov), 10 if len(mean) < 5 else 6
    )
    symbols = [*model.x, *(model.v if law is model.state_noise else model.w)]
    rows = [sp.lambdify(symbols, formula.subs(model.values)) for formula in equation]
    values = np.stack([row(*points.T) + 0 * weights for row in rows])
    centre = values @ weights
    away = (values - centre[:, None]) * weights
    cross = away @ (points - mean)[:, :n]
    return centre, away @ (values - centre[:, None]).T, cross @ np.linalg.inv(model.prior.cov)


def parts(structure, mean, cov):
    """Value, covariance, sensitivity, and what that leaves unexplained: of both equations."""
    h, G, F, R = structure.measure(mean, cov)
    return (
        (*structure.predict(mean, cov), *structure.transition(mean, cov)),
        (h, F, G, R),
    )


def sides(model):
    """Both equations: symbolic, and as a function; and the law of their noise."""
    state, meter = compile_model(model)
    return (
        (model.state_equation, state, model.state_noise),
        (model.meter_equation, meter, model.meter_noise),
    )


@pytest.mark.parametrize("name", MODELS)
def test_gaussian_functions_are_what_quadrature_finds(name):
    """Ten points an axis integrate exponentials and sines of these variances to 1e-9; Stein:
    dtau/dz = Cov(a, x) P^-1, dh/dm = Cov(b, x) P^-1."""
    model = MODELS[name]()
    computed = parts(gaussian(model), *model.prior)
    for (equation, _, noise), ours in zip(sides(model), computed, strict=True):
        for part, expected in zip(ours, quadrature(model, equation, noise), strict=False):
            assert_allclose(part, expected, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("name", MODELS)
def test_linearised_functions_are_values_and_difference_quotients(name):
    model = MODELS[name]()
    x, P = model.prior
    step = 1e-5  # central differences err by step^2 |f'''| + 1e-16 / step, below 1e-9 here

    def slopes(function, at):
        return np.stack(
            [
                (function(at + row) - function(at - row)) / (2 * step)
                for row in step * np.eye(len(at))
            ],
            axis=-1,
        )

    computed = parts(linearised(model), x, P)
    for (_, function, (m, D)), ours in zip(sides(model), computed, strict=True):
        value, spread, slope, unexplained = ours
        A = slopes(lambda at, of=function, m=m: of(at, m), x)
        B = slopes(lambda at, of=function: of(x, at), m)
        assert_allclose(value, function(x, m), rtol=1e-13)
        assert_allclose(slope, A, rtol=1e-7, atol=1e-8)
        assert_allclose(unexplained, B @ D @ B.T, rtol=1e-7, atol=1e-8)
        assert_allclose(spread, A @ P @ A.T + B @ D @ B.T, rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize("name", ["variant 53", "vector", "van der Pol"])
def test_gauss_hermite_is_exact_for_polynomials(name):
    model = MODELS[name]()
    law = (
        np.stack([model.prior.mean, model.prior.mean + 0.3]),
        np.stack([model.prior.cov, 2 * model.prior.cov]),
    )
    # degree 3 at most, so squares of degree 6 < 2 * 4; rounding of some hundred summands
    for computed, expected in zip(
        parts(gauss_hermite(model, 4), *law), parts(gaussian(model), *law), strict=True
    ):
        for ours, exact in zip(computed, expected, strict=True):
            assert_allclose(*np.broadcast_arrays(ours, exact), rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("kappa", [None, 0.5, 2.0])
def test_unscented_means_are_exact_for_quadratic_functions(kappa):
    model = vector_model()
    numerical, exact = unscented(model, kappa), gaussian(model)
    for computed, expected in zip(
        parts(numerical, *model.prior), parts(exact, *model.prior), strict=True
    ):
        assert_allclose(computed[0], expected[0], rtol=1e-12)
        assert_allclose(computed[2], expected[2], rtol=1e-12)


def test_large_means_lose_no_digits():
    """F of a meter without noise at the mean 1e6 and the variance 1e-10: closed forms, evaluated
    exactly."""
    m, d, q = sp.Integer(10) ** 6, sp.Rational(1, 10**10), sp.Rational(1, 10**6)
    u = sp.exp(-d)
    for meter, F, accuracy in (
        ("x**2", 4 * m**2 * d + 2 * d**2, 1e-14),
        # Cov(x, sin x) = d cos(m) e^(-d/2); the phase 1e6 is known to 1e-10
        (
            "x + sin(x)",
            d + 2 * d * sp.cos(m) * sp.sqrt(u) + (1 - u) * (1 + u * sp.cos(2 * m)) / 2,
            1e-9,
        ),
        ("exp(x/10**6)", sp.exp(2 * q * m + q**2 * d) * (sp.exp(q**2 * d) - 1), 1e-12),
    ):
        structure = gaussian(Model.define("x + v", meter))
        computed = structure.measure(np.array([[1e6]]), np.array([[[1e-10]]])).F.item()
        assert computed == pytest.approx(float(F.evalf(60)), rel=accuracy)


def test_numerical_structures_have_no_formulas(variant53):
    for kind in ("unscented", "gauss-hermite"):
        for ask in (lambda s: s["tau"], lambda s: s.latex()):
            with pytest.raises(NoClosedForm, match="quadrature"):
                ask(KINDS[kind](variant53))


def test_an_exponential_of_a_large_constant_is_not_torn_apart():
    """A density e^((R - r)/H) near r = R: e^(2R/H) is e^950, beyond all numbers, and must not be
    computed by itself."""
    model = Model.define(
        "x - T*b*exp((R - x)/H) + v", "x + w", {"T": 0.1, "b": 0.6, "R": 6374, "H": 13.406}
    )
    z, p, slope = 6400.0, 2.0, 1 + 0.1 * 0.6 / 13.406 * np.exp(-26 / 13.406)
    tau, Theta = linearised(model).predict(np.array([[z]]), np.array([[[p]]]))
    assert_allclose(tau, [[z - 0.1 * 0.6 * np.exp(-26 / 13.406)]], rtol=1e-13)
    assert_allclose(Theta, [[[slope**2 * p + 1]]], rtol=1e-12)


@pytest.mark.parametrize(
    ("build", "problem"),
    [
        (
            lambda _: gauss_hermite(
                Model.define("x*(" + "+".join(f"sin(v{i + 1})" for i in range(9)) + ")", "x + w")
            ),
            "too many",
        ),
        *((lambda model, k=k: unscented(model, k), "kappa") for k in (-2, np.nan, np.inf)),
        *(
            (lambda model, n=n: gauss_hermite(model, n), "an order of at least 2")
            for n in (1, -3, 5.0, True, "5")
        ),
    ],
)
def test_what_is_no_rule_of_points_is_refused(variant53, build, problem):
    with pytest.raises(ModelError, match=problem):
        build(variant53)
