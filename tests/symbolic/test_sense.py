"""Numbers and laws that no computation could use are refused where a model is defined, with the
place and the cure."""

import numpy as np
import pytest
import sympy as sp

from kfcourse import Model, ModelError, NoClosedForm, gaussian, linearised
from kfcourse.symbolic import javascript
from kfcourse.symbolic.equations import compile_model
from kfcourse.symbolic.sense import is_covariance, nothing_random

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(
    ("cov", "right"),
    [
        ([[1.0, 0.5], [0.5, 1.0]], True),
        ([[1.0, 1.0], [1.0, 1.0]], True),  # singular
        ([[0.0, 0.0], [0.0, 1.0]], True),
        ([[1.0, 1.5], [1.5, 1.0]], False),
        ([[0.0, 0.1], [0.1, 1.0]], False),  # what does not vary is correlated with nothing
        ([[1e10, 0.0], [0.0, -1e-3]], False),  # not to be taken for rounding of the other component
        ([[1e10, 1.001], [1.001, 1e-10]], False),  # a correlation above 1, in very different units
        ([[1e10, 1.0], [1.0, 1e-10]], True),
    ],
)
def test_a_covariance_is_one_in_any_units(cov, right):
    assert is_covariance(np.array(cov)) is right


def test_products_of_a_random_root_are_covariances():
    rng = np.random.default_rng(1)
    for size in range(1, 8):
        root = rng.standard_normal((size, max(size - 1, 1))) * 10.0 ** rng.uniform(
            -20, 20, (size, 1)
        )
        assert is_covariance(root @ root.T)


@pytest.mark.parametrize(
    ("state", "meter", "parameters", "place"),
    [
        ("a*a*a*a*x + v", "x + w", {"a": 1e90}, "state"),
        ("x + v", "x + a*a*a*a*w", {"a": 1e-90}, "meter"),
        ("x + v*log(a)", "x + w", {"a": -1}, "state"),
        ("x + v", "sqrt(a)*x + w", {"a": -1}, "meter"),
        ("x + v/(a - 1)", "x + w", {"a": 1}, "state"),
        ("x + v", "(1 if sqrt(a) > 0 else 2)*x + w", {"a": -1}, "meter"),
    ],
)
def test_numbers_out_of_all_sizes_are_refused_with_their_place(state, meter, parameters, place):
    with pytest.raises(ModelError, match=f"the {place} equation, .* with these parameters: "):
        Model.define(state, meter, parameters)


def test_a_parameter_s_exact_value_has_a_size_too():
    with pytest.raises(ModelError, match="parameter a = 1000"):
        Model.define("a*x + v", "x + w", {"a": sp.Integer(10) ** 400})


@pytest.mark.parametrize(
    ("state", "parameters"), [("1e99*1e99*1e99*1e99*x + v", {}), ("cosh(a**16) + v", {"a": 1e99})]
)
def test_a_long_formula_or_number_is_shown_shortened(state, parameters):
    with pytest.raises(ModelError) as caught:
        Model.define(state, "x + w", parameters)
    assert len(str(caught.value)) < 300


def test_derived_numbers_beyond_the_floats_are_refused_not_printed_as_names():
    """Each number is within its limits, their product in the moments is not: generated code would
    hold the name `inf`."""
    with pytest.raises(ModelError, match=r"predict: it holds the number .*e"):
        gaussian(Model.define("(1e90*x + v)**4", "x + w"))


def test_no_number_is_taken_out_of_a_power_beyond_the_floats():
    """(x + 1e-99)**4 is not 1e-396*(1e99*x + 1)**4: the one is 1 at x = 1, the other no float."""
    state, _ = compile_model(Model.define("(x + 1e-99)**4 + v", "x + w"))
    assert state(np.array([1.0]), np.array([0.5])) == 1.5
    x, v = sp.symbols("x v", real=True)
    power = (x + sp.Rational(1, 10**99)) ** 4 + v
    assert "e-396" not in javascript.loop(
        "f", {"x": sp.Matrix([x]), "v": sp.Matrix([v])}, {"y": sp.Matrix([power])}
    )


@pytest.mark.parametrize("condition", ["v < Heaviside(x)", "v < Abs(v)"])
def test_where_nobody_finds_the_place_of_a_jump_there_may_be_one(condition):
    with pytest.raises(NoClosedForm, match="not differentiable"):
        linearised(Model.define(f"(x if {condition} else -x)", "x + w"))


@pytest.mark.parametrize(
    ("state", "meter", "laws", "problem"),
    [
        ("0.9*x + v", "x + w", {}, ""),
        ("0.9*x", "x + w", {}, ""),  # an unknown start
        ("0.9*x + v", "x", {}, ""),
        ("0.9*x + v", "x + w", {"prior": {"variance": 0}}, ""),
        ("0.9*x", "x", {}, "no noise enters"),
        (
            "0.9*x + v",
            "x + w",
            {"state_noise": {"variance": 0}, "meter_noise": {"variance": 0}},
            "no noise enters",
        ),
        ("0.9*x + e*v", "x", {}, "no noise enters"),  # e = 0
        ("0.9*x", "x + w", {"prior": {"variance": 0}}, "known exactly"),
    ],
)
def test_something_must_be_random(state, meter, laws, problem):
    found = nothing_random(Model.define(state, meter, {"e": 0} if "e*" in state else {}, **laws))
    assert problem in found and bool(problem) == bool(found)
