"""The engine: right answers pass in any form, wrong ones are told apart, and a known mistake is
named."""

import math

import numpy as np
import pytest
import sympy as sp
from tiny import FORMULA, SUM, about, asks, c, d, outcome, p, raises, x, y

from kfcourse.checks.engine import check
from kfcourse.checks.question import MIME, ForVariant, Mistake, Question, catalogue

pytestmark = pytest.mark.quick


def test_a_right_answer_passes_in_any_form():
    assert outcome(SUM, lambda a, b: a + b + b).passed
    # a list of numbers
    assert outcome(SUM, lambda a, b: [float(u + 2 * v) for u, v in zip(a, b, strict=True)]).passed
    assert outcome(SUM, lambda a, b: (a + 2 * b).astype(object)).passed
    assert outcome(FORMULA, lambda a, b: (a + 1) ** 2 - 2 * a - 1 + sp.sin(b)).passed
    assert outcome(
        FORMULA, lambda a, b: a**2 + sp.sqrt(1 - sp.cos(b) ** 2) * sp.sign(sp.sin(b))
    ).passed
    assert outcome(FORMULA, lambda a, b: sp.Matrix([a**2 + sp.sin(b)])).passed  # one by one
    assert outcome(
        FORMULA, lambda a, b: sp.Derivative(a**3 / 3, a) + sp.Integral(sp.cos(b), b)
    ).passed


def test_a_wrong_answer_does_not_pass_by_little():
    assert outcome(SUM, lambda a, b: a + 2 * b + 1e-7).status == "wrong"
    assert (
        outcome(FORMULA, lambda a, b: a**2 + sp.sin(b) + sp.Rational(1, 10**25)).status == "wrong"
    )


@pytest.mark.parametrize(
    "wrong",
    [
        lambda a, b: sp.Abs(a) ** 3 + sp.Abs(b),
        lambda a, b: sp.sqrt(a**2) ** 3 + b,
        lambda a, b: a**3 + sp.Max(b, 0),
        lambda a, b: sp.Piecewise((a**3, a > 0), (0, True)) + b,
        lambda a, b: sp.sign(a) * a**3 + b,
    ],
)
def test_a_formula_must_hold_for_both_signs(wrong):
    assert outcome(asks(lambda a, b: a**3 + b, [(x, y)]), wrong).status == "wrong"


def test_parameters_have_the_sign_of_their_values():
    question = asks(lambda a: c * a, [(x,)])
    exercise = about({c: sp.Rational(-1, 2)})
    assert check(question, exercise, lambda a: -sp.Abs(c) * a).passed
    assert check(question, exercise, lambda a: sp.Abs(c) * a).status == "wrong"
    # a symbol of the student's own, by its name
    assert check(question, exercise, lambda a: sp.symbols("c") * a).passed


def test_variances_may_stand_under_roots():
    question = asks(lambda a, b: sp.sqrt(a * b), [(p, d)])
    # not equal where both are negative
    assert outcome(question, lambda a, b: sp.sqrt(a) * sp.sqrt(b)).passed


def test_a_known_mistake_is_named_and_its_message_shown():
    mistakes = catalogue(
        (
            ("once", "b enters twice", lambda a, b: a + b),
            ("minus", "the sign of b", lambda a, b: a - 2 * b),
        )
    )
    question = asks(SUM.key, SUM.arguments(None), mistakes)
    result = outcome(question, lambda a, b: b + a)
    assert (result.status, result.diagnosis) == ("wrong", ("once",))
    assert "b enters twice" in result.message
    assert outcome(question, lambda a, b: a - b - b).diagnosis == ("minus",)
    assert "does not look like" in outcome(question, lambda a, b: a * b).message


def test_parts_are_told_apart():
    mistakes = catalogue((("both", "squared", lambda a, b: (a**2, b**2)),))
    question = asks(lambda a, b: (a, b), SUM.arguments(None), mistakes, ("first", "second"))
    result = outcome(question, lambda a, b: (a, b**2))
    assert result.message == "first right, the rest not. second: squared"
    assert result.diagnosis == ("both",)
    assert outcome(question, lambda a, b: (a, -b)).diagnosis == ("sign",)
    assert outcome(question, lambda a, b: (a, b)).passed


def test_right_for_some_inputs_only():
    result = outcome(SUM, lambda a, b: a + 2 * b if a[0] == 1.0 else a)
    assert result.diagnosis == ("sometimes",)
    assert "1 of 2" in result.message


def test_a_mistake_that_the_variant_does_not_allow_is_left_out():
    def impossible(exercise):
        raise IndexError

    question = asks(SUM.key, SUM.arguments(None), [Mistake("no", "no", ForVariant(impossible))])
    assert outcome(question, lambda a, b: a - b).status == "wrong"


def test_result_shows_itself_and_carries_its_data():
    result = outcome(SUM, lambda a, b: a + 2 * b)
    assert repr(result) == "✓ t1 a test: right"
    data = result._repr_mimebundle_()
    assert data["text/plain"] == repr(result)
    told = {
        "question": "t1",
        "status": "passed",
        "diagnosis": [],
        "message": "right",
        "share": 1.0,
        "follows": [],
    }
    assert data[MIME] == told
    assert repr(outcome(SUM, lambda a, b: a)).startswith("✗ t1")


def test_arguments_are_the_students_own_copies():
    def spoils(a, b):
        result = a + 2 * b
        a[:] = b[:] = math.nan
        return result

    question = asks(SUM.key, SUM.arguments(None))
    given = [(np.ones(2), np.ones(2))] * 2
    kept = Question("t1", "", "core", question.key, lambda _: given)
    assert outcome(kept, spoils).passed
    assert np.isfinite(given[0]).all()


def test_not_implemented_is_the_students_own_word():
    assert outcome(SUM, raises(NotImplementedError())).status == "not implemented"
    # of a helper of theirs
    assert outcome(SUM, lambda *_: raises(NotImplementedError())()).status == "not implemented"
    result = outcome(FORMULA, lambda a, b: sp.Matrix(np.zeros((2, 2, 2))))  # raised by SymPy
    assert (result.status, "NotImplementedError" in result.message) == ("unusable", True)


def test_numbers_in_the_place_of_parameters_are_told():
    question = asks(lambda a: (c * a, c**2 + a), [(x,)], parts=("first", "second"))
    exercise = about({c: sp.Rational(-1, 2)})
    for answer in (lambda a: (-a / 2, a + 0.25), lambda a: (c * a, a + 0.25)):
        result = check(question, exercise, answer)
        assert (result.status, result.diagnosis) == ("wrong", ("numbers",)), result
    assert check(question, exercise, lambda a: (c * a, (a * c + c**3) / c)).passed
    # right by chance
    assert check(question, exercise, lambda a: (c * a, a - c / 2)).diagnosis != ("numbers",)
    of_argument = asks(lambda a: 2 * a, [(c,)])  # an argument with the name of a parameter is none
    assert check(of_argument, exercise, lambda a: -1).diagnosis != ("numbers",)
