"""Generated code computes its formulas, over any leading axes."""

import math

import numpy as np
import pytest
import sympy as sp
from numpy.testing import assert_allclose

from kfcourse import Model, ModelError, linearised
from kfcourse.symbolic.codegen import _compiled, _shared, compile_function
from kfcourse.symbolic.formula import symbol

x1, x2, p11, p12, p22 = sp.symbols("x1 x2 p11 p12 p22", real=True)
ARGUMENTS = [[x1, x2], sp.Matrix([[p11, p12], [p12, p22]])]

EXPRESSIONS = [
    (x1 + x2) ** 4 * x1**-3 - 3 * x2**7 / 5,
    sp.sqrt(p11) * sp.exp(-x1 * p12) + sp.sin(x2) ** 3,
    sp.Abs(x1 - x2) ** sp.Rational(3, 2) - x1 / (3 * x2),
    sp.tanh(x1) + sp.atan(x2) + sp.log(p22) + sp.cosh(x1) * sp.sinh(x2) * sp.tan(x1 / 4),
    2 / (x1 * x2**2) - x1,
    x1 / p11 ** sp.Rational(3, 2) - x2 / sp.pi**2,
    x1 * sp.exp(sp.Rational(1, 200)) * sp.sqrt(2) * sp.sin(1),  # constants that are not rational
    sp.sqrt(2 + sp.sqrt(3)) * x1 + sp.Rational(1, 3) * sp.pi,
    sp.cot(x1) + sp.sec(x2),
    sp.Max(x1, x2, 1, x1 * x2) - sp.Min(x1, x2, 1, x1 * x2),
    sp.sign(x1) * x2 + sp.Piecewise((x1, x2 > 0), (p11, True)),
    sp.Float(0.1) * x1 + sp.Float(1e-20) * x2,
]


@pytest.fixture
def ensemble():
    rng = np.random.default_rng(1)
    root = rng.normal(size=(50, 2, 2))
    return rng.normal(size=(50, 2)), root @ root.swapaxes(1, 2) + 0.1 * np.eye(2)


def reference(expression, x, p):
    return sp.lambdify([x1, x2, p11, p12, p22], expression)(
        x[:, 0], x[:, 1], p[:, 0, 0], p[:, 0, 1], p[:, 1, 1]
    )


def test_a_matrix_of_all_expressions_equals_them_one_by_one(ensemble):
    """By SymPy's own NumPy code for one expression; the conditioning of these at these points is
    below 1e3."""
    count = len(EXPRESSIONS) // 2
    together = sp.Matrix(count, 2, EXPRESSIONS)
    computed = compile_function(ARGUMENTS, [together, list(together[:, 0])])(*ensemble)
    assert computed[0].shape == (50, count, 2)
    for i in range(count):
        assert_allclose(computed[1][:, i], computed[0][:, i, 0], rtol=0, atol=0)
        for j in range(2):
            assert_allclose(
                computed[0][:, i, j], reference(together[i, j], *ensemble), rtol=1e-12, atol=1e-12
            )


def test_powers_are_products():
    """NumPy takes 50 times as long for x**3 as for x*x*x."""
    assert str(_shared([x1**3])[1][0]) == "x1*x1*x1"


def test_what_models_share_is_compiled_once():
    """Models that differ in a number of the object, as modes do and the steps of a search, have one
    meter."""
    compiled = []
    for c in (0.71, 0.72):
        linearised(Model.define("c*x + v", "x*exp(-x**2) + 0.017*w", {"c": c}))
        compiled.append(_compiled.cache_info().misses)
    assert compiled[1] - compiled[0] == 1  # the object's functions


def test_a_matrix_is_one_for_all_whom_its_arguments_are_one_for(ensemble):
    """A vector is one for each trajectory; what a matrix is made of may come by way of what is
    found once for several entries."""
    x, p = ensemble
    both = sp.sin(p11) * sp.exp(p12)
    outputs = [
        [x1, x2],
        sp.Matrix([[both, both + 1], [both**2, p11]]),
        sp.Matrix([[both, x1]]),
        sp.Matrix([[sp.sqrt(2)]]),
        [2 ** sp.Rational(1, 4)],
        [both],
    ]
    code = compile_function(ARGUMENTS, outputs)
    rest = [(1, 1), (50, 1), (50, 1)]
    assert [part.shape for part in code(x[0], p[0])] == [(2,), (2, 2), (1, 2), (1, 1), (1,), (1,)]
    assert [part.shape for part in code(x, p[0])] == [(50, 2), (2, 2), (50, 1, 2), *rest]
    assert [part.shape for part in code(x[0], p)] == [(50, 2), (50, 2, 2), (50, 1, 2), *rest]
    assert_allclose(code(x, p)[3], np.sqrt(2), rtol=1e-15)
    assert_allclose(code(x, p)[4], 2**0.25, rtol=1e-15)
    assert_allclose(code(x, p[0])[1], code(x, p)[1][0], rtol=1e-14)


@pytest.mark.parametrize("name", ["np", "x", "s0", "return_", "Dummy", "a0001", "a0002", "E", "I"])
def test_no_symbol_can_hide_another(name, ensemble):
    # Names in the formula never reach the code as they are.
    odd = sp.Symbol(name, real=True)
    value = odd**2 + sp.sin(odd) + x2
    computed = compile_function([[odd, x2]], [[value]])(ensemble[0])[0]
    first, second = ensemble[0].T
    assert_allclose(computed[:, 0], first**2 + np.sin(first) + second, rtol=1e-14, atol=1e-14)


def compiled(*expressions):
    return compile_function([[symbol("x"), symbol("y")]], [expressions])


def test_special_functions_are_scipys():
    computed = compiled(sp.erf(symbol("x")), sp.loggamma(symbol("x")))(
        np.array([[0.5, 0.0], [2.0, 0.0]])
    )[0]
    assert_allclose(computed, [[math.erf(x), math.lgamma(x)] for x in (0.5, 2.0)], rtol=1e-14)


@pytest.mark.parametrize(
    ("expression", "message"),
    [
        (symbol("x") * symbol("q"), "the symbol q is neither an argument nor defined"),
        (symbol("x") * sp.Float("1e400"), "beyond what a float can be"),
        (symbol("x") / 0, "no finite real value"),
    ],
)
def test_what_cannot_be_compiled_is_refused(expression, message):
    with pytest.raises(ModelError, match=message):
        compiled(expression, 1)
