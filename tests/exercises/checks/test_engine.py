"""The engine: right answers pass in any form, formulas by value and numbers to rounding; wrong ones are
told apart, and a known mistake is named."""

import math

import numpy as np
import pytest
import sympy as sp
from tiny import FORMULA, SUM, about, asks, c, d, outcome, p, raises, x, y, z

from kfcourse.exercises.checks.engine import check
from kfcourse.exercises.checks.equality import Unusable, equal, equal_formulas, like
from kfcourse.exercises.checks.question import MIME, Mistake, Question

CUBE = asks(lambda a, b: a**3 + b, [(x, y)])
ROOTS = asks(lambda a, b: sp.sqrt(a * b), [(p, d)])


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        (SUM, lambda a, b: a + b + b),
        (SUM, lambda a, b: [float(u + 2 * v) for u, v in zip(a, b, strict=True)]),
        (SUM, lambda a, b: (a + 2 * b).astype(object)),
        (FORMULA, lambda a, b: (a + 1) ** 2 - 2 * a - 1 + sp.sin(b)),
        (FORMULA, lambda a, b: a**2 + sp.sqrt(1 - sp.cos(b) ** 2) * sp.sign(sp.sin(b))),
        (FORMULA, lambda a, b: sp.Matrix([a**2 + sp.sin(b)])),  # one by one
        (FORMULA, lambda a, b: sp.Derivative(a**3 / 3, a) + sp.Integral(sp.cos(b), b)),
        # variances may stand under roots: not equal where both are negative
        (ROOTS, lambda a, b: sp.sqrt(a) * sp.sqrt(b)),
    ],
)
def test_a_right_answer_passes_in_any_form(question, answer):
    assert outcome(question, answer).passed


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        # by little
        (SUM, lambda a, b: a + 2 * b + 1e-7),
        (FORMULA, lambda a, b: a**2 + sp.sin(b) + sp.Rational(1, 10**25)),
        # for one sign only
        (CUBE, lambda a, b: sp.Abs(a) ** 3 + sp.Abs(b)),
        (CUBE, lambda a, b: sp.sqrt(a**2) ** 3 + b),
        (CUBE, lambda a, b: a**3 + sp.Max(b, 0)),
        (CUBE, lambda a, b: sp.Piecewise((a**3, a > 0), (0, True)) + b),
        (CUBE, lambda a, b: sp.sign(a) * a**3 + b),
    ],
)
def test_a_wrong_answer_does_not_pass(question, answer):
    assert outcome(question, answer).status == "wrong"


def test_parameters_have_the_sign_of_their_values():
    question, exercise = asks(lambda a: c * a, [(x,)]), about({c: sp.Rational(-1, 2)})
    assert check(question, exercise, lambda a: -sp.Abs(c) * a).passed
    assert check(question, exercise, lambda a: sp.Abs(c) * a).status == "wrong"
    # a symbol of the student's own, by its name
    assert check(question, exercise, lambda a: sp.symbols("c") * a).passed


def test_parts_are_told_apart():
    mistakes = [Mistake("both", "squared", lambda a, b: (a**2, b**2))]
    question = asks(lambda a, b: (a, b), SUM.arguments(None), mistakes, ("first", "second"))
    result = outcome(question, lambda a, b: (a, b**2))
    assert (result.diagnosis, result.share) == (("both",), 0.5)
    assert result.message == "first right, the rest not. second: squared"
    assert outcome(question, lambda a, b: (a, -b)).diagnosis == ("wrong-sign",)
    for answer, share in ((lambda a, b: (a, b), 1), (lambda a, b: (b, a), 0), (lambda a, b: 1, 0)):
        assert outcome(question, answer).share == share


def test_right_for_some_inputs_only():
    result = outcome(SUM, lambda a, b: a + 2 * b if a[0] == 1.0 else a)
    assert result.diagnosis == ("right-for-some-inputs",)
    assert "1 of 2" in result.message


def test_result_shows_itself_and_carries_its_data():
    result = outcome(SUM, lambda a, b: a + 2 * b)
    assert repr(result) == "✓ t1 a test: right"
    data = {"question": "t1", "status": "passed", "diagnosis": [], "message": "right"}
    data |= {"share": 1.0, "follows": []}
    assert result._repr_mimebundle_() == {"text/plain": repr(result), MIME: data}
    assert repr(outcome(SUM, lambda a, b: a)).startswith("✗ t1")


def test_arguments_are_the_students_own_copies():
    def spoils(a, b):
        result = a + 2 * b
        a[:] = b[:] = math.nan
        return result

    given = [(np.ones(2), np.ones(2))] * 2
    assert outcome(Question("t1", "", "core", SUM.key, lambda _: given), spoils).passed
    assert np.isfinite(given[0]).all()


def test_not_implemented_is_the_students_own_word():
    for stub in (raises(NotImplementedError()), lambda *_: raises(NotImplementedError())()):
        assert outcome(SUM, stub).status == "not implemented"
    result = outcome(FORMULA, lambda a, b: sp.Matrix(np.zeros((2, 2, 2))))  # raised by SymPy
    assert (result.status, "NotImplementedError" in result.message) == ("unusable", True)


def test_numbers_in_the_place_of_parameters_are_told():
    question = asks(lambda a: (c * a, c**2 + a), [(x,)], parts=("first", "second"))
    exercise = about({c: sp.Rational(-1, 2)})
    for answer in (lambda a: (-a / 2, a + 0.25), lambda a: (c * a, a + 0.25)):
        result = check(question, exercise, answer)
        assert (result.status, result.diagnosis) == ("wrong", ("numbers-for-symbols",)), result
    assert check(question, exercise, lambda a: (c * a, (a * c + c**3) / c)).passed
    # right by chance
    assert check(question, exercise, lambda a: (c * a, a - c / 2)).diagnosis != (
        "numbers-for-symbols",
    )
    of_argument = asks(lambda a: 2 * a, [(c,)])  # an argument with the name of a parameter is none
    assert check(of_argument, exercise, lambda a: -1).diagnosis != ("numbers-for-symbols",)


def test_like_keeps_numbers_and_shapes():
    assert like([1, 2], np.zeros(2)).dtype == float
    assert like(3, np.asarray(0.0)).shape == ()
    with pytest.raises(Unusable, match=r"shape \(2,\).*got the shape \(3,\)"):
        like([1, 2, 3], np.zeros(2))
    assert like(0.9 * z, z) == sp.Rational(9, 10) * z  # a decimal means its digits
    assert like([[z], [1]], sp.Matrix([z, p])) == sp.Matrix([z, 1])
    assert like(5.0, z) == 5


LARGE = np.array([1e6, 1.0, 1e-8])


@pytest.mark.parametrize(
    ("first", "second", "same"),
    [
        (LARGE * (1 + 1e-12), LARGE, True),
        # ten times 1e-9 of the largest
        (LARGE + np.array([0.0, 1e-2, 0.0]), LARGE, False),
        (np.array([math.nan, 1.0]), np.array([math.nan, 1.0]), True),
        (np.array([1.0]), np.array([1.0, 1.0]), False),
        ((z, np.ones(2)), (z, np.ones(2)), True),
    ],
)
def test_equal_allows_rounding_relative_to_the_largest_entry(first, second, same):
    assert equal(first, second, 1e-9, {}) is same


NINE = {c: sp.Rational(9, 10)}


@pytest.mark.parametrize(
    ("first", "second", "values", "same"),
    [
        (sp.Symbol("other"), z, {}, False),
        (sp.Function("u")(z), z, {}, False),
        (c**2 * z, sp.Rational(81, 100) * z, NINE, True),
        (sp.Rational(8, 10) * z, c**2 * z, NINE, False),
        # Python's own 1/3 and pi are as good as their digits; a number that was typed shorter is not
        ((1 / 3) * z + 2 * np.pi * p**0.5, z / 3 + 2 * sp.pi * sp.sqrt(p), {}, True),
        (0.33333 * z, z / 3, {}, False),
        ((1 / 3 + 1e-11) * z, z / 3, {}, False),
        # as a difference of large numbers: 25 of 60 digits are lost
        ((z + 10**25) - 10**25 + sp.sin(z) ** 2 + sp.cos(z) ** 2, z + 1, {}, True),
    ],
)
def test_equal_formulas_by_value(first, second, values, same):
    assert equal_formulas([like(first, z)], [second], values) is same
