"""The model: what is built is what was written, and what does not fit together is named."""

import numpy as np
import pytest
import sympy as sp

from kfcourse import FormulaError, Model, ModelError, NoClosedForm, gaussian, linearised
from kfcourse.symbolic import javascript
from kfcourse.symbolic.equations import compile_model
from kfcourse.symbolic.model import nothing_random


def test_strings_expressions_and_matrices_give_the_same_model():
    x, v, w = sp.symbols("x v w")  # without assumptions: recognised by name
    by_string = Model.define("x/2 + v*x", "x**3 + w")
    assert by_string == Model.define(x / 2 + v * x, x**3 + w)
    assert by_string == Model.define(sp.ImmutableMatrix([x / 2 + v * x]), [x**3 + w])


@pytest.mark.parametrize(
    ("state", "parameters", "names"),
    [("x + v1 + v3", {}, ["v1", "v2", "v3"]), ("v1*x + v", {"v1": 0.5}, ["v"])],
)
def test_noises_are_counted_from_the_formulas(state, parameters, names):
    model = Model.define(state, "x + w", parameters)
    assert [s.name for s in model.v] == names
    assert [s.name for s in model.w] == ["w"]


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


@pytest.mark.parametrize("number", [np.float64(0.9), np.float32(0.9), sp.Rational(9, 10), 0.9])
@pytest.mark.filterwarnings("error")
def test_numbers_of_every_library_are_read_as_typed(number):
    assert Model.define("c*x + v", "x + w", {"c": number}).parameters["c"] == sp.Rational(9, 10)


HUGE = sp.Integer(10) ** 400
PLAIN = ("x + v", "x + w")
TWO = (["x1 + v", "x2"], "x1 + w")
REFUSED = [
    *(("c*x + v", "x + w", {"parameters": {"c": value}}, "parameter c")
      for value in (np.nan, "0.9", True, 1e300, 1e-300)),
    ("c*x + v", "x + w", {"parameters": {"c": HUGE}}, "parameter c = 1000"),
    (*PLAIN, {"parameters": {"x": 1}}, "x named twice"),
    (*PLAIN, {"parameters": {"sin": 1}}, "already means"),
    (*PLAIN, {"parameters": [1]}, "must be a table"),
    (*PLAIN, {"symbols": {"u": ["u"]}}, "keys x, v, w"),
    (*PLAIN, {"symbols": {"x": ["x", "q"]}}, "1 state equation"),
    (*PLAIN, {"symbols": {"x": []}}, "x must be a name or a list of names"),
    (*PLAIN, {"prior": 3}, "must be a table"),
    (*PLAIN, {"prior": {"cov": 1}}, "keys mean, variance"),
    (*PLAIN, {"prior": {"variance": -1}}, "no negative variance; got variance = -1"),
    (*PLAIN, {"prior": {"variance": [1, 2]}}, "1 numbers or a"),
    (*PLAIN, {"prior": {"variance": [[1, 0], [0, 1]]}}, "symmetric 1 x 1"),
    (*PLAIN, {"prior": {"mean": "1"}}, "the mean must be 1 finite"),
    (*PLAIN, {"prior": {"mean": np.nan}}, "finite"),
    (*TWO, {"prior": {"variance": [[1, 0.2], [0.3, 1]]}}, "symmetric"),
    (*TWO, {"prior": {"variance": [[1, 2], [2, 1]]}}, "negative"),
    ("x + w", "x + w", {}, "unknown symbol 'w'"),  # the meter's noise in the object
    (sp.Symbol("x") + sp.Symbol("q"), "x + w", {}, "unknown symbols q"),
    ("x + v", "w", {}, "nothing to filter"),
    ("x + v", [], {}, "must be a formula"),
    *((state, "x + w", {}, "must be a formula") for state in ([3], None)),
    # numbers out of all sizes, with their place
    *((state, meter, {"parameters": {"a": a}}, f"the {place} equation, .* with these parameters: ")
      for state, meter, a, place in [
        ("a*a*a*a*x + v", "x + w", 1e90, "state"),
        ("x + v", "sqrt(a)*x + w", -1, "meter"),
        ("x + v/(a - 1)", "x + w", 1, "state"),
        ("x + v", "(1 if sqrt(a) > 0 else 2)*x + w", -1, "meter"),
        ("cosh(a**16) + v", "x + w", 1e99, "state"),
      ]),
    ("1e99*1e99*1e99*1e99*x + v", "x + w", {}, "the state equation"),
]  # fmt: skip


@pytest.mark.parametrize(("state", "meter", "arguments", "message"), REFUSED)
def test_what_does_not_fit_together_is_named_in_short(state, meter, arguments, message):
    with pytest.raises((ModelError, FormulaError), match=message) as caught:
        Model.define(state, meter, **arguments)
    assert len(str(caught.value)) < 300


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
    # the lines without and with values; more in tests/golden
    assert model.latex().splitlines()[1:-1] == [
        *model.latex(values=False).splitlines()[1:-2],
        r"y_{2,k} &= 2 x_{2} + w_{2} \\",
        "a &= 0.5",
    ]


def test_derived_numbers_beyond_the_floats_are_refused_not_printed_as_names():
    """Each number is within its limits, their product in the moments is not: generated code would
    hold the name `inf`."""
    with pytest.raises(ModelError, match=r"it holds the number .*e"):
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
    problems = nothing_random(Model.define(state, meter, {"e": 0} if "e*" in state else {}, **laws))
    assert problem in problems and bool(problem) == bool(problems)
