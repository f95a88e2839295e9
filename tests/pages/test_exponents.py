"""Squares are completed as in the integrals that they replace."""

import pytest
import sympy as sp

from kfcourse.pages.exponents import complete_square, log_integral, log_normal

x, m, a, d = sp.symbols("x m a d", real=True)
D = sp.Symbol("D", positive=True)

pytestmark = pytest.mark.quick


def test_a_completed_square_is_the_exponent_again():
    exponent = -(x**2) / (2 * D) + a * x + d
    mean, variance, rest = complete_square(exponent, x)
    assert sp.expand(-((x - mean) ** 2) / (2 * variance) + rest - exponent) == 0


def test_a_normal_law_gives_back_its_mean_and_variance():
    assert complete_square(log_normal(x, m, D), x)[:2] == (m, D)


def test_the_integral_is_the_one_sympy_takes():
    exponent = -(x**2) / (2 * D) + a * x + d
    assert (
        sp.simplify(
            sp.integrate(sp.exp(exponent), (x, -sp.oo, sp.oo)) / sp.exp(log_integral(exponent, x))
        )
        == 1
    )


@pytest.mark.parametrize("exponent", [a * x + d, -(x**4), sp.sin(x)])
def test_another_exponent_is_refused(exponent):
    with pytest.raises(ValueError, match="not quadratic in x"):
        complete_square(exponent, x)
