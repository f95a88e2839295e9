"""Comparison: formulas by value, numbers to rounding."""

import math

import numpy as np
import pytest
import sympy as sp
from tiny import c, p, z

from kfcourse.checks.equality import Unusable, equal, equal_formulas, like

pytestmark = pytest.mark.quick


def test_like_keeps_numbers_and_shapes():
    assert like([1, 2], np.zeros(2)).dtype == float
    assert like(3, np.asarray(0.0)).shape == ()
    with pytest.raises(Unusable, match=r"shape \(2,\).*got the shape \(3,\)"):
        like([1, 2, 3], np.zeros(2))
    assert like(0.9 * z, z) == sp.Rational(9, 10) * z  # a decimal means its digits
    assert like([[z], [1]], sp.Matrix([z, p])) == sp.Matrix([z, 1])
    assert like(5.0, z) == 5


def test_equal_allows_rounding_relative_to_the_largest_entry():
    right = np.array([1e6, 1.0, 1e-8])
    assert equal(right * (1 + 1e-12), right, 1e-9, {})
    # ten times 1e-9 of the largest
    assert not equal(right + np.array([0.0, 1e-2, 0.0]), right, 1e-9, {})
    assert equal(np.array([math.nan, 1.0]), np.array([math.nan, 1.0]), 1e-9, {})
    assert not equal(np.array([1.0]), np.array([1.0, 1.0]), 1e-9, {})
    assert equal((z, np.ones(2)), (z, np.ones(2)), 1e-9, {})


def test_equal_formulas_by_value():
    assert equal_formulas([sp.cos(2 * z)], [1 - 2 * sp.sin(z) ** 2], {})
    assert not equal_formulas([sp.Symbol("other")], [z], {})
    assert not equal_formulas([sp.Function("u")(z)], [z], {})
    assert equal_formulas([c**2 * z], [sp.Rational(81, 100) * z], {c: sp.Rational(9, 10)})
    assert equal_formulas([c * z, z], [z * c, z], {c: 0.9})
    assert not equal_formulas([sp.Rational(8, 10) * z], [c**2 * z], {c: sp.Rational(9, 10)})
    # Python's own 1/3 and pi are as good as their digits, and a number that was typed shorter is
    # not.
    assert equal_formulas(
        [like((1 / 3) * z + 2 * np.pi * p**0.5, z)], [z / 3 + 2 * sp.pi * sp.sqrt(p)], {}
    )
    assert not equal_formulas([like(0.33333 * z, z)], [z / 3], {})
    assert not equal_formulas([like((1 / 3 + 1e-11) * z, z)], [z / 3], {})
    # As a difference of large numbers: 25 of 60 digits are lost.
    assert equal_formulas([(z + 10**25) - 10**25 + sp.sin(z) ** 2 + sp.cos(z) ** 2], [z + 1], {})
