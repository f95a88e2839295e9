"""What a check says of a wrong answer is so: each of these was once said of an answer of which it
is not true."""

import numpy as np
import pytest
import sympy as sp
from tiny import asks, c, e, outcome, p, z

from kfcourse.checks.question import Mistake

RNG = np.random.default_rng(8)
MANY, MORE = RNG.normal(size=(2, 7))
THREE = ("first", "second", "third")


def three(a):
    return a, 2 * a, 3 * a


def test_the_mistake_that_spoils_least_of_what_is_right_is_named():
    mistakes = [
        Mistake("all", "All is done otherwise.", lambda a: (a + 5, a, a**3)),
        Mistake("most", "Most is done otherwise.", lambda a: (a, a, a**3)),
    ]
    question = asks(three, [(1.3,), (0.7,)], mistakes, THREE)
    assert outcome(question, lambda a: (a, 2 * a, a**3)).diagnosis == ("most",)


def test_the_mistake_that_explains_most_of_what_is_wrong_is_named():
    mistakes = [
        Mistake("one", "One is done otherwise.", lambda a: (a, 5 * a, a**3)),
        Mistake("two", "Two are done otherwise.", lambda a: (a, np.cos(a), a**3)),
    ]
    question = asks(three, [(1.3,), (0.7,)], mistakes, THREE)
    result = outcome(question, lambda a: (np.sinh(a), np.cos(a), a**3))
    assert "two" in result.diagnosis and "one" not in result.diagnosis


@pytest.mark.parametrize(("value", "named"), [(2.0, False), (np.array([2.0, 2.0, 2.0]), True)])
def test_one_number_that_coincides_names_no_mistake(value, named):
    """2^2 = 2 * 2 says nothing; many numbers that agree in the first call that is wrong are no
    coincidence."""
    question = asks(
        lambda a: a,
        [(value,), (0.3 * value,)],
        [Mistake("squared", "It is squared.", lambda a: a**2)],
    )
    assert ("squared" in outcome(question, lambda a: 2 * a).diagnosis) is named


def test_the_first_result_without_a_hint_is_where_to_start():
    """A hint of a later result may tell what follows from the first; a mistake that is known by
    name may explain both."""
    question = asks(lambda a, b: (a + b, a * b), [(2.5, 1.5), (0.5, 3.0)], (), ("sum", "product"))
    message = outcome(question, lambda a, b: (np.cos(a) * b + 1, 3 * a * b)).message
    assert (
        "sum is wrong too: start there. product: It is right but for a factor" in message
        and "your result sum is" in message
    )
    known = asks(
        lambda a, b: (a + b, a * b),
        [(2.5, 1.5), (0.5, 3.0)],
        [Mistake("divided", "It is divided.", lambda a, b: (a + b, a / b))],
        ("sum", "product"),
    )
    message = outcome(known, lambda a, b: (np.cos(a) * b + 1, a / b)).message
    assert (
        message
        == "not right. product: It is divided. Or: it follows from sum. sum may be wrong for the "
        "same reason."
    )


def test_most_later_steps_are_wrong_where_only_the_first_is_right():
    steps = np.arange(9.0)
    question = asks(lambda a: a * steps, [(1.3,), (0.7,)], axes=("step",))
    assert (
        "from-second-step"
        not in outcome(question, lambda a: a * steps + (steps > 6) * a**2).diagnosis
    )
    assert outcome(question, lambda a: a * steps + (steps > 0) * np.cos(a * steps)).diagnosis == (
        "from-second-step",
    )


def test_what_is_but_rounding_is_zero():
    question = asks(lambda a: a.var(), [(MANY,), (MORE,)])
    assert outcome(question, lambda a: (a - a.mean()).mean()).diagnosis == ("vanishing",)
    assert outcome(asks(lambda z: e * z, [(z,)]), lambda z: z - z).diagnosis == ("vanishing",)
    assert "vanishing" not in outcome(asks(lambda a: 0 * a, [(MANY,)]), lambda a: a).diagnosis


@pytest.mark.parametrize(
    ("name", "answer"), [("root", lambda a: np.exp(a / 2)), ("square", lambda a: np.exp(2 * a))]
)
def test_roots_and_squares_are_not_always_deviations(name, answer):
    result = outcome(asks(np.exp, [(MANY,), (MORE,)]), answer)
    assert result.diagnosis == (name,) and "of what it should be, as a" in result.message


def test_what_is_rounded_up_depends_on_its_arguments():
    question = asks(lambda a, n: np.ceil(3 * a) + n, [(2.2, 1), (3.1, 4)])
    assert "unused" not in outcome(question, lambda a, n: np.ceil(0.03 * a) + n).diagnosis
    assert outcome(question, lambda a, n: np.ceil(3 * a)).diagnosis == ("unused",)


@pytest.mark.parametrize(
    ("name", "words", "answer"),
    [
        ("square", "the square", lambda a, law, s: (-np.sin(a + 1) * s + 1 / law(a)[0]) ** 2),
        ("precision", "rounded", lambda a, law, s: np.round(-np.sin(a + 1) * s + 1 / law(a)[0], 2)),
        ("term", "one number for all", lambda a, law, s: -np.sin(a + 1) * s + 1 / law(a)[0] - a[0]),
    ],
)
def test_what_was_done_to_the_right_result_is_said(name, words, answer):
    def law(a):
        return a**2 + 1, a**2 + 2

    question = asks(
        lambda a, law, s: -np.sin(a + 1) * s + 1 / law(a)[0], [(MANY, law, 0.6), (MORE, law, 1.7)]
    )
    result = outcome(question, answer)
    assert result.diagnosis == (name,) and words in result.message, result


def test_where_nothing_has_come_yet_everything_is_right():
    question = asks(lambda a, now: a + (now > 1) * a**2, [(MANY, 2.0), (MORE, 3.0)])
    assert "`now`" not in outcome(question, lambda a, now: a + (now > 1) * a**3).message
    continuous = asks(lambda a, now: a + now * a**2, [(MANY, 2.0), (MORE, 3.0)])
    assert (
        "right where `now` is zero"
        in outcome(continuous, lambda a, now: a + now * np.sin(a)).message
    )


def test_terms_in_another_form_are_not_called_wrong():
    question = asks(lambda z, p: c**2 * p + e**2 * (1 + sp.cos(2 * z)) / 2, [(z, p)])
    result = outcome(
        question, lambda z, p: c**2 * p + e**2 * sp.cos(z) ** 2 + sp.exp(c * e * p * z)
    )
    assert result.diagnosis == ("terms",) and result.message.endswith(
        "c**2*p is right; look at the rest."
    )


@pytest.mark.parametrize(
    ("name", "words", "answer"),
    [
        (
            "factor-of",
            "a factor that depends on z only",
            lambda z, p: (e * sp.cos(z) * (2 + z**2), p * z),
        ),
        (
            "term-of",
            "a term that depends on z only",
            lambda z, p: (e * sp.cos(z) + sp.exp(z), p * z),
        ),
        ("factor-of", "a factor that is a number", lambda z, p: (3 * e * sp.cos(z), p * z)),
        (
            "factor-of",
            "a factor that depends on z only",
            lambda z, p: (e * sp.cos(z), p * sp.sqrt(z**2)),
        ),
    ],
)
def test_a_formula_is_told_what_it_differs_by(name, words, answer):
    result = outcome(
        asks(lambda z, p: (e * sp.cos(z), p * z), [(z, p)], parts=("first", "second")), answer
    )
    assert result.diagnosis == (name,) and words in result.message, result


@pytest.mark.parametrize("change", [np.round, np.floor])
def test_whole_numbers_are_not_single_precision(change):
    """They are numbers of float32 as well."""
    question = asks(lambda a: 1e5 * np.exp(a), [(MANY,), (MORE,)])
    result = outcome(question, lambda a: change(1e5 * np.exp(a)))
    assert (
        result.diagnosis == ("precision",)
        and "single" not in result.message
        and "rounded" in result.message
    )
    small = asks(lambda a: 3 * np.exp(a) + 2, [(MANY,), (MORE,)])
    assert outcome(small, lambda a: np.round(3 * np.exp(a) + 2)).message.startswith(
        "not right. It is rounded"
    )


def test_below_zero_is_not_too_large():
    question = asks(lambda a: (a > 0) * 1.0, [(MANY,), (MORE,)])
    assert "too-large" not in outcome(question, lambda a: np.sign(a)).diagnosis
    assert outcome(question, lambda a: (a > 0) + 3.0 * (a < 0)).diagnosis == ("too-large",)


def test_where_digits_are_lost_no_factor_is_missing():
    """Information that is nearly none: its inverse takes the digits of what is subtracted."""
    W = np.array([np.eye(3) * k for k in (1e-16, 1.3, 0.7, 2.0)])
    H = RNG.normal(size=(4, 3, 3))

    def by_gain(W, H):
        P, T = np.linalg.inv(W), H.swapaxes(1, 2)
        return P - P @ T @ np.linalg.inv(H @ P @ T + np.eye(3)) @ H @ P

    question = asks(
        lambda W, H: np.linalg.inv(W + H.swapaxes(1, 2) @ H), [(W, H)], axes=("trajectory",)
    )
    assert outcome(question, by_gain).diagnosis == ("digits-lost",)
    assert outcome(question, lambda W, H: np.linalg.inv(W + H @ H)).diagnosis == ("not-symmetric",)
