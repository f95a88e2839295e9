"""Squares are completed as in the integrals that they replace."""

import pytest
import sympy as sp

from kfcourse.pages.exponents import complete_square

x, m, a, d = sp.symbols("x m a d", real=True)
D = sp.Symbol("D", positive=True)

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("exponent", [a * x + d, -(x**4), sp.sin(x)])
def test_another_exponent_is_refused(exponent):
    with pytest.raises(ValueError, match="not quadratic in x"):
        complete_square(exponent, x)
