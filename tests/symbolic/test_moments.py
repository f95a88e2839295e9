"""Exact Gaussian moments: against closed forms, quadrature, and many-digit arithmetic."""

import numpy as np
import oracles
import pytest
import sympy as sp

from kfcourse import GaussianMoments, NoClosedForm

x, y, m, mu = sp.symbols("x y m mu", real=True)
d, q = sp.symbols("d q", positive=True)
scalar = GaussianMoments([x], [m], sp.Matrix([[d]]))

# A correlated pair, not close to singular; Gauss-Hermite with 40 points an axis integrates what
# follows to rounding.
MEAN, COV = [0.3, -0.7], [[0.5, 0.2], [0.2, 0.4]]
numeric = GaussianMoments(
    [x, y], [sp.Rational(3, 10), -sp.Rational(7, 10)], sp.Matrix(COV).applyfunc(sp.nsimplify)
)
ROUNDING = 1e-12  # thousands of float64 operations on numbers of order 1


def test_moments_follow_the_recursion_of_the_page():
    # q_0 = 1, q_1 = m, q_{n+1} = m q_n + n d q_{n-1}
    previous, current = sp.S.One, m
    for n in range(1, 12):
        assert sp.expand(scalar.mean_of(x**n) - current) == 0
        previous, current = current, sp.expand(m * current + n * d * previous)


FUNCTIONS = [
    x**4 * y**2 - 3 * x * y,
    sp.exp(x / 2 - y) * x**2,
    sp.sin(2 * x + y) * sp.cos(y) + y,
    x * sp.sin(x) ** 2 * sp.exp(-y / 3),
    sp.sinh(x) * sp.cosh(y / 2) + (x + y) ** 3,
    sp.exp(x) * (1 + sp.exp(y) * sp.cos(x)),
    sp.S(7),
]


def plain(function):
    return lambda points: np.broadcast_to(sp.lambdify([x, y], function)(*points), points[0].shape)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_the_mean_is_what_quadrature_finds(function):
    exact = float(numeric.mean_of(function))
    assert exact == pytest.approx(
        oracles.gaussian_mean(plain(function), MEAN, COV), rel=ROUNDING, abs=ROUNDING
    )


@pytest.mark.parametrize("left", FUNCTIONS[:4])
@pytest.mark.parametrize("right", FUNCTIONS[2:])
def test_the_covariance_is_what_quadrature_finds(left, right):
    f, g = plain(left), plain(right)
    mean_f, mean_g = (oracles.gaussian_mean(each, MEAN, COV) for each in (f, g))
    expected = oracles.gaussian_mean(
        lambda points: (f(points) - mean_f) * (g(points) - mean_g), MEAN, COV
    )
    # The variances bound the size of what was added up, and so the rounding.
    assert float(numeric.covariance(left, right)) == pytest.approx(expected, rel=1e-10, abs=1e-10)


def test_a_variable_without_variance_is_a_constant():
    fixed = GaussianMoments([x, y], [m, mu], sp.Matrix([[d, 0], [0, 0]]))
    assert sp.expand(fixed.mean_of(x**2 * y**3) - (m**2 + d) * mu**3) == 0
    assert fixed.covariance(y**2, sp.exp(x)) == 0


@pytest.mark.parametrize(
    ("function", "term"),
    [
        (x + sp.tan(x), r"tan\(x\)"),
        (x**2 * sp.log(x), r"log\(x\)"),
        (sp.sqrt(x) + x, r"sqrt\(x\)"),
        (1 / (1 + x**2), r"1/\(x\*\*2 \+ 1\)"),
        (sp.Abs(x), r"Abs\(x\)"),
        (sp.exp(-(x**2)), r"exp\(-x\*\*2\)"),
        (sp.sin(x**2), r"x\*\*2"),
        (sp.exp(sp.sin(x)), r"sin\(x\)|exp\("),
        (sp.cosh(sp.atan2(x, x)), "atan2"),
        (x**100, "degree"),
    ],
)
def test_no_closed_form_names_the_term_and_the_way_out(function, term):
    with pytest.raises(NoClosedForm, match=term) as caught:
        scalar.mean_of(function)
    assert "unscented(model)" in str(caught.value)


def test_variance_of_a_sine_is_finite_for_any_variance():
    """Var sin x -> 1/2 for a phase that is not known at all; exp(u) of the formula must not
    overflow on the way."""
    x, m, d = sp.symbols("x m d", real=True)
    variance = sp.lambdify(
        [m, d],
        GaussianMoments([x], [m], sp.Matrix([[d]])).covariance(sp.sin(x), sp.sin(x)),
        "numpy",
    )
    with np.errstate(all="raise", under="ignore"):
        assert variance(0.3, 5000.0) == pytest.approx(0.5, rel=1e-12)


def test_sums_of_parameters_in_a_denominator_stay_together():
    s, T = sp.symbols("s T", real=True)
    moment = GaussianMoments([x], [m], sp.Matrix([[d]])).mean_of(
        T * sp.sin(x) / (1 + s**2) + sp.exp(x / (1 + s)) / (1 + T)
    )
    by_hand = T * sp.exp(-d / 2) * sp.sin(m) / (1 + s**2) + sp.exp(
        m / (1 + s) + d / (1 + s) ** 2 / 2
    ) / (1 + T)
    at = {s: sp.Rational(3, 10), T: 2, m: sp.Rational(1, 2), d: sp.Rational(1, 4)}
    assert abs(sp.N((moment - by_hand).subs(at), 30)) < 1e-25


def test_what_is_no_law_or_another_s_symbol_is_refused():
    """An x that is not real is another symbol than a real one: its square would be a constant,
    M[x^2] = x^2."""
    x, y, m = sp.symbols("x y m", real=True)
    for means, cov in (([m, m], [[1]]), ([m], [[1, 0], [0, 1]]), ([], [[1]])):
        with pytest.raises(
            ValueError,
            match=r"1 variable\(s\) need as many means, and a symmetric covariance 1 x 1",
        ):
            GaussianMoments([x], means, sp.Matrix(cov))
    with pytest.raises(ValueError, match="symmetric covariance 2 x 2"):
        GaussianMoments([x, y], [m, m], sp.Matrix([[1, 0.5], [0, 1]]))
    law = GaussianMoments([x], [m], sp.Matrix([[1]]))
    for use in (law.mean_of, lambda f: law.covariance(x, f)):
        with pytest.raises(ValueError, match="is not the variable of that name"):
            use(sp.Symbol("x") ** 2)
