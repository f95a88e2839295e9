"""The model: what is built is what was written, and what does not fit together is named."""

import numpy as np
import pytest
import sympy as sp

from kfcourse.symbolic.formula import FormulaError, symbol
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError

pytestmark = pytest.mark.quick


def test_a_model_keeps_its_formulas_symbolic_and_its_parameters_exact(variant53):
    x, v, w, c, e, g, f = (symbol(name) for name in "xvwcegf")
    assert variant53.state_equation[0] == c * x + e * x * v
    assert variant53.meter_equation[0] == g * x + f * x**2 * w
    assert variant53.parameters["e"] == sp.Rational(1, 20)
    assert (variant53.n, variant53.p) == (1, 1)


def test_strings_and_expressions_give_the_same_model():
    x, v, w = sp.symbols("x v w")  # without assumptions: recognised by name
    by_string = Model.define("x/2 + v*x", "x**3 + w")
    by_expression = Model.define(x / 2 + v * x, x**3 + w)
    assert by_string == by_expression


def test_laws_are_standard_normal_by_default():
    model = Model.define(["x1 + v1", "x2 + v2"], ["x1 + w1"])
    for law, size in ((model.prior, 2), (model.state_noise, 2), (model.meter_noise, 1)):
        assert np.array_equal(law.mean, np.zeros(size))
        assert np.array_equal(law.cov, np.eye(size))


def test_a_variance_is_a_number_a_list_or_a_matrix():
    for variance, expected in (
        (2, [[2, 0], [0, 2]]),
        ([2, 3], [[2, 0], [0, 3]]),
        ([[2, 1], [1, 3]], [[2, 1], [1, 3]]),
    ):
        model = Model.define(
            ["x1 + v", "x2"], "x1 + w", prior={"mean": [1, 2], "variance": variance}
        )
        assert np.array_equal(model.prior.cov, expected)
        assert np.array_equal(model.prior.mean, [1, 2])


def test_noises_are_counted_from_the_formulas():
    model = Model.define("x + v1 + v3", "x + w")
    assert [s.name for s in model.v] == ["v1", "v2", "v3"]
    assert [s.name for s in model.w] == ["w"]


def test_a_parameter_may_have_the_name_of_a_numbered_noise():
    model = Model.define("v1*x + v", "x + w", {"v1": 0.5})
    assert [s.name for s in model.v] == ["v"]


def test_replace_changes_only_the_named_parameters(variant53):
    changed = variant53.replace(f=0.2)
    assert changed.parameters["f"] == sp.Rational(1, 5)
    assert changed.parameters["c"] == variant53.parameters["c"]
    assert variant53.parameters["f"] == sp.Rational(1, 50)
    with pytest.raises(ModelError, match="no parameter q"):
        variant53.replace(q=1)


def test_replaced_parameters_are_checked_as_those_defined():
    """A variance below 0, which `linearised` took for one: its F was negative."""
    model = Model.define("x/c + v", "x + w", {"c": 1, "r": 1}, meter_noise={"variance": "r"})
    for equation, change in (("meter", {"r": -1}), ("state", {"c": 0})):
        with pytest.raises(
            ModelError,
            match=f"the {equation} equation, .* with these parameters: no finite real value",
        ):
            model.replace(**change)


@pytest.mark.parametrize(
    "value", [float("nan"), float("inf"), "0.9", None, True, 1j, 1e300, 1e-300]
)
def test_a_parameter_is_a_finite_number(value):
    with pytest.raises(ModelError, match="parameter c"):
        Model.define("c*x + v", "x + w", {"c": value})


@pytest.mark.parametrize("number", [np.float64(0.9), np.float32(0.9), sp.Rational(9, 10), 0.9])
@pytest.mark.filterwarnings("error")
def test_numbers_of_every_library_are_read_as_typed(number):
    assert Model.define("c*x + v", "x + w", {"c": number}).parameters["c"] == sp.Rational(9, 10)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"parameters": {"x": 1}}, "x named twice"),
        ({"parameters": {"v": 1}}, "v named twice"),
        ({"parameters": {"lambda": 1}}, "reserved word"),
        ({"parameters": {"sin": 1}}, "already means"),
        ({"parameters": {"__class__": 1}}, "cannot name"),
        ({"symbols": {"u": ["u"]}}, "keys x, v, w"),
        ({"symbols": {"x": ["x", "q"]}}, "1 state equation"),
        ({"symbols": {"x": []}}, "x must be a name or a list of names"),
        ({"prior": {"cov": 1}}, "keys mean and variance"),
        ({"prior": {"variance": -1}}, "negative variance"),
        ({"prior": {"variance": [1, 2]}}, "lists of 1 numbers"),
        ({"prior": {"variance": [[1, 0], [0, 1]]}}, "shape"),
        ({"prior": {"mean": "a"}}, "must be numbers"),
        ({"prior": {"mean": float("nan")}}, "finite"),
        ({"state_noise": {"variance": float("inf")}}, "finite"),
        ({"state_noise": {"mean": [0, 0]}}, "lists of 1 numbers"),
        ({"meter_noise": {"variance": [[[1]]]}}, "must be numbers"),
    ],
)
def test_parts_that_do_not_fit_are_named(arguments, message):
    with pytest.raises(ModelError, match=message):
        Model.define("x + v", "x + w", **arguments)


@pytest.mark.parametrize("variance", [[[1, 0.2], [0.3, 1]], [[1, 2], [2, 1]]])
def test_a_covariance_is_symmetric_and_not_negative(variance):
    with pytest.raises(ModelError, match=r"symmetric|negative"):
        Model.define(["x1 + v", "x2"], "x1 + w", prior={"variance": variance})


@pytest.mark.parametrize(
    ("state", "meter", "error"),
    [
        ("x + v + q", "x + w", FormulaError),
        ("x + w", "x + w", FormulaError),  # the meter's noise in the object
        ("x + v", "x + v", FormulaError),
        ("x + v", "w", ModelError),
        ("x + v", "0*x + w", ModelError),
        ("x + v", [], ModelError),
        ([], "x + w", ModelError),
        ([3], "x + w", ModelError),
        (1, "x + w", ModelError),
        (None, "x + w", ModelError),
        (sp.Symbol("x") + sp.Symbol("q"), "x + w", ModelError),
    ],
)
def test_equations_that_do_not_fit_are_refused(state, meter, error):
    with pytest.raises(error):
        Model.define(state, meter)


@pytest.mark.parametrize(
    "arguments", [{"parameters": [1]}, {"prior": 3}, {"symbols": [1]}, {"symbols": {"v": []}}]
)
def test_what_is_not_a_table_of_names_or_numbers_is_refused_as_a_model_error(arguments):
    with pytest.raises(ModelError):
        Model.define("x/2", "x + w", **arguments)


def test_parameter_values_that_leave_no_finite_formula_are_refused():
    with pytest.raises((ModelError, FormulaError)):
        Model.define("x/c + v", "x + w", {"c": 0})


def test_a_model_prints_its_equations_and_values(variant53):
    assert (
        repr(variant53)
        == "Model(x' = c*x + e*v*x, y = f*w*x**2 + g*x; c = 9/10, e = 1/20, g = 1, f = 1/50)"
    )


def test_a_vector_model_prints_every_component():
    model = Model.define(["a*x1 + x2", "x2 + v"], ["x1 + w1", "2*x2 + w2"], {"a": 0.5})
    assert (
        repr(model) == "Model(x1' = a*x1 + x2, x2' = v + x2, y1 = w1 + x1, y2 = w2 + 2*x2; a = 1/2)"
    )
    equations = [
        r"x_{1,k+1} &= a x_{1} + x_{2} \\",
        r"x_{2,k+1} &= x_{2} + v \\",
        r"y_{1,k} &= x_{1} + w_{1} \\",
        r"y_{2,k} &= 2 x_{2} + w_{2}",
    ]
    assert model.latex(values=False).splitlines()[1:-1] == equations
    assert model.latex().splitlines()[1:-1] == [*equations[:3], equations[3] + r" \\", "a &= 0.5"]


def test_the_latex_of_a_scalar_model_has_no_indices(variant53):
    lines = variant53.latex().splitlines()
    assert lines[1:3] == [r"{x}_{k+1} &= c x + e x v \\", r"{y}_{k} &= g x + f x^{2} w \\"]
    assert lines[-2] == "f &= 0.02"


def test_equations_may_be_an_immutable_matrix():
    x1, x2, v = sp.symbols("x1 x2 v")
    model = Model.define(
        sp.ImmutableMatrix([x1 + x2, x2 + v]), sp.ImmutableMatrix([x1 + sp.Symbol("w")])
    )
    assert (model.n, model.p) == (2, 1)
