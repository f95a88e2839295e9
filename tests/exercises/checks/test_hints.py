"""What is said of a wrong answer: what is so, and nothing that was once said of an answer of which
it is not true; and right answers in other forms."""

import numpy as np
import pytest
import sympy as sp
from numpy import matrix_transpose as T
from tiny import asks, c, e, outcome, p, z

from kfcourse.exercises.checks.editing import edited
from kfcourse.exercises.checks.equality import Unusable, like
from kfcourse.exercises.checks.question import Mistake

RNG = np.random.default_rng(3)
A, B = RNG.normal(size=(2, 3, 3))
P = A @ A.T
RUN = RNG.normal(size=(6, 4, 2))
MANY, MORE = np.random.default_rng(8).normal(size=(2, 7))
STEPS = np.arange(9.0)


def carried(A, P):
    return A @ P @ A.T


def filtered(y, gain):
    z, estimates = 0 * y[0], []
    for measured in y:
        z = 0.9 * z + gain * (measured - 0.9 * z)
        estimates.append(z)
    return np.array(estimates)


def of_many(right):
    return asks(right, [(MANY,), (MORE,)])


def pair(*mistakes):
    calls = [(2.5, 1.5), (0.5, 3.0)]
    return asks(lambda a, b: (a + b, a * b), calls, mistakes, ("sum", "product"))


def formulas(right, *parts):
    return asks(right, [(z, p)], parts=parts)


def three(*mistakes):
    parts = ("first", "second", "third")
    return asks(lambda a: (a, 2 * a, 3 * a), [(1.3,), (0.7,)], mistakes, parts)


def squared(value):
    """A question with a mistake that may coincide with the answer."""
    known = [Mistake("squared", "It is squared.", lambda a: a**2)]
    return asks(lambda a: a, [(value,), (0.3 * value,)], known)


def law(a):
    return a**2 + 1, a**2 + 2


def of_law(a, law, s):
    return -np.sin(a + 1) * s + 1 / law(a)[0]


CARRIED = asks(carried, [(A, P), (np.array([[1.3]]), np.array([[0.7]]))])
FILTERED = asks(filtered, [(RUN, 0.4)], axes=("step", "trajectory"))
LAW = asks(of_law, [(MANY, law, 0.6), (MORE, law, 1.7)])
NUMBERS = asks(lambda a: a, [(np.array([2.0, 3.5]),)])
MATRIX = asks(lambda a: a, [(np.array([[1.0, 2.0], [3.0, 5.0]]),)])
SYMBOLS = asks(lambda a: a, [(sp.ImmutableMatrix([[z, p], [1, 2]]),)])
FORMULAS = formulas(lambda z, p: (c * z, c**2 * p + e**2), "tau", "Theta")
TWO = formulas(lambda z, p: (e * sp.cos(z), p * z), "first", "second")
ENTRY = asks(lambda z: sp.Matrix([[z, 1], [0, z]]), [(z,)])
RAMP = asks(lambda a: a * STEPS, [(1.3,), (0.7,)], axes=("step",))
CEILING = asks(lambda a, n: np.ceil(3 * a) + n, [(2.2, 1), (3.1, 4)])
LEAST = three(
    Mistake("all", "All is done otherwise.", lambda a: (a + 5, a, a**3)),
    Mistake("most", "Most is done otherwise.", lambda a: (a, a, a**3)),
)
MOST = three(
    Mistake("one", "One is done otherwise.", lambda a: (a, 5 * a, a**3)),
    Mistake("two", "Two are done otherwise.", lambda a: (a, np.cos(a), a**3)),
)
DIVIDED = pair(Mistake("divided", "It is divided.", lambda a, b: (a + b, a / b)))

# Question, answer, what it is named, and words of the message.
WRONG = [
    (NUMBERS, lambda a: -a, "wrong-sign", ""),
    (NUMBERS, lambda a: a / 2, "half-of-it", ""),
    (NUMBERS, lambda a: 2 * a, "twice-of-it", ""),
    (NUMBERS, lambda a: 1 / a, "inverse", ""),
    (MATRIX, lambda a: a.T, "transposed", ""),
    (SYMBOLS, lambda a: a.T, "transposed", ""),
    (CARRIED, lambda A, P: A.T @ P @ A, "right-for-scalars-only", ""),
    (CARRIED, lambda A, P: A @ A.T, "argument-unused", ""),
    (CARRIED, lambda A, P: A @ P @ A.T + A, "not-symmetric", ""),
    (CARRIED, lambda A, P: P, "argument-unchanged", ""),
    (CARRIED, lambda A, P: A @ P @ A.T - 50 * P, "negative-variance", ""),
    (CARRIED, lambda A, P: carried(A, P).astype(np.float32), "low-precision", "(float32)"),
    (FILTERED, lambda y, gain: gain * y, "wrong-from-second-step", ""),
    (FILTERED, lambda y, gain: 3 * filtered(y, gain), "wrong-factor", ""),
    (FILTERED, lambda y, gain: 3 + filtered(y, gain), "wrong-term", ""),
    (pair(), lambda a, b: (a * b, a + b), "swapped", ""),
    (pair(), lambda a, b: (a + b, a + b), "another-result", ""),
    (FORMULAS, lambda z, p: (c**2 * p + e**2, c * z), "swapped", ""),
    (FORMULAS, lambda z, p: (c * z, p + e**2), "argument-unused", ""),
    (FORMULAS, lambda z, p: (c * z, c**2 * p + e**2 * z), "symbol-superfluous", ""),
    (ENTRY, lambda z: sp.Matrix([[z, 1], [0, 2 * z]]), "some-entries-wrong", "row 2, column 2"),
    # the mistake that spoils least of what is right, and explains most of what is wrong
    (LEAST, lambda a: (a, 2 * a, a**3), "most", ""),
    # many numbers that agree in the first call that is wrong are no coincidence
    (squared(np.array([2.0, 2.0, 2.0])), lambda a: 2 * a, "squared", ""),
    (RAMP, lambda a: a * STEPS + (STEPS > 0) * np.cos(a * STEPS), "wrong-from-second-step", ""),
    # what is but rounding is zero
    (of_many(lambda a: a.var()), lambda a: (a - a.mean()).mean(), "is-zero", ""),
    (asks(lambda z: e * z, [(z,)]), lambda z: z - z, "is-zero", ""),
    # roots and squares are not always deviations
    (of_many(np.exp), lambda a: np.exp(a / 2), "root-of-it", "of what it should be, as a"),
    (of_many(np.exp), lambda a: np.exp(2 * a), "square-of-it", "of what it should be, as a"),
    (CEILING, lambda a, n: np.ceil(3 * a), "argument-unused", ""),
    (LAW, lambda *values: np.round(of_law(*values), 2), "low-precision", "rounded"),
    (LAW, lambda a, *rest: of_law(a, *rest) - a[0], "wrong-term", "one number for the whole"),
    (
        formulas(lambda z, p: c**2 * p + e**2 * (1 + sp.cos(2 * z)) / 2),
        lambda z, p: c**2 * p + e**2 * sp.cos(z) ** 2 + sp.exp(c * e * p * z),
        "some-terms-wrong",
        "c**2*p is right; look at the rest.",
    ),
    (TWO, lambda z, p: (3 * e * sp.cos(z), p * z), "wrong-factor", "a factor that is a number"),
    (
        TWO,
        lambda z, p: (e * sp.cos(z), p * z**3),
        "wrong-factor",
        "a factor that depends on z only",
    ),
    (pair(), lambda a, b: (a + b, a * b**3), "wrong-factor", "the square of the argument `b`"),
]


@pytest.mark.parametrize(("question", "answer", "name", "words"), WRONG)
def test_hints(question, answer, name, words):
    result = outcome(question, answer)
    assert (result.status, result.diagnosis) == ("wrong", (name,)), result
    assert words in result.message


def information(W, H):
    return np.linalg.inv(W + T(H) @ H)


def by_gain(W, H):
    """Where there is nearly no information, the inverse takes the digits of what is subtracted."""
    P = np.linalg.inv(W)
    return P - P @ T(H) @ np.linalg.inv(H @ P @ T(H) + np.eye(3)) @ H @ P


SCARCE = np.array([np.eye(3) * k for k in (1e-16, 1.3, 0.7, 2.0)])
INFORMATION = asks(information, [(SCARCE, RNG.normal(size=(4, 3, 3)))], axes=("trajectory",))

# Question, answer, and what is not so.
NOT_SO = [
    (INFORMATION, by_gain, "not-symmetric"),
    (MOST, lambda a: (np.sinh(a), np.cos(a), a**3), "one"),
    # 2^2 = 2 * 2 says nothing
    (squared(2.0), lambda a: 2 * a, "squared"),
    # most later steps are right
    (RAMP, lambda a: a * STEPS + (STEPS > 6) * a**2, "wrong-from-second-step"),
    (asks(lambda a: 0 * a, [(MANY,)]), lambda a: a, "is-zero"),
    # what is rounded up depends on its arguments
    (CEILING, lambda a, n: np.ceil(0.03 * a) + n, "argument-unused"),
    # no covariance: what is subtracted from one
    (asks(lambda P: -P, [(P,), (2 * P,)]), lambda P: -P - np.eye(3), "negative-variance"),
]


@pytest.mark.parametrize(("question", "answer", "name"), NOT_SO)
def test_what_is_not_so_is_not_said(question, answer, name):
    result = outcome(question, answer)
    assert result.status == "wrong" and name not in result.diagnosis


# Question, answer, words that are said or, after "~", are not.
GROWING = [(MANY, 2.0), (MORE, 3.0)]
SAYINGS = [
    (MOST, lambda a: (np.sinh(a), np.cos(a), a**3), "Two are done otherwise."),
    # a hint of a later result may tell what follows from the first; a mistake that is known by name
    # may explain both
    (
        pair(),
        lambda a, b: (np.cos(a) * b + 1, 3 * a * b),
        "sum is wrong too: start there. product: It is right but for a factor",
    ),
    (
        DIVIDED,
        lambda a, b: (np.cos(a) * b + 1, a / b),
        "not right. product: It is divided. Or: it follows from sum. sum may be wrong for the "
        "same reason.",
    ),
    (
        pair(),
        lambda a, b: (2 * (a + b), 2 * a * b),
        "not right. sum: It is twice what it should be. product may be wrong for the same reason.",
    ),
    # where nothing has come yet everything is right
    (
        asks(lambda a, now: a + (now > 1) * a**2, GROWING),
        lambda a, now: a + (now > 1) * a**3,
        "~`now`",
    ),
    (
        asks(lambda a, now: a + now * a**2, GROWING),
        lambda a, now: a + now * np.sin(a),
        "right where `now` is zero",
    ),
    # results in another order may have other shapes
    (
        asks(lambda a: (a[0], a), [(np.ones((2, 2)),)], parts=("row", "all")),
        lambda a: (a, a[0]),
        "another order",
    ),
]


@pytest.mark.parametrize(("question", "answer", "words"), SAYINGS)
def test_what_is_said(question, answer, words):
    message = outcome(question, answer).message
    assert (words.removeprefix("~") in message) != words.startswith("~"), message


def mixed(a, b):
    return np.sin(a + 2) / np.sqrt((b + 2) ** 2 + 3) * np.arctan2(a + 1, b + 2)


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("one-sign-wrong", "a + 2", "a - 2"),
        ("product-for-quotient", "/ np", "* np"),
        ("term-lost", " + 3", ""),
        ("power-lost", " ** 2", ""),
        ("function-lost", "np.sqrt", ""),
        ("factor-lost", "np.sin(a + 2) / ", "1 / "),
        ("other-number", "3", "4"),
        ("other-letter", "(b + 2)", "(a + 2)"),
        ("other-order", "a + 1, b + 2", "b + 2, a + 1"),
    ],
)
def test_one_thing_changed_in_the_key_is_named(name, old, new):
    question = asks(mixed, [(RUN[0, 0], RUN[1, 1]), (RUN[2], RUN[3])])
    result = outcome(question, edited(mixed, old, new))
    assert (result.status, result.diagnosis) == ("wrong", (name,)), result
    assert "The right answer would give that with" in result.message


@pytest.mark.filterwarnings("ignore:the matrix subclass")
def test_other_forms_are_right():
    number = asks(lambda a: a, [(2.0,)])
    for question, answer in (
        (pair(), lambda a, b: np.array([a + b, a * b])),
        (pair(), lambda a, b: sp.Matrix([a + b, a * b])),
        (FORMULAS, lambda z, p: sp.Matrix([c * z, c**2 * p + e**2])),
        (number, np.matrix),
        (number, complex),
        (asks(lambda a: np.array([0.0, 1.0]), [(1.0,)]), lambda a: np.array([False, True])),
        (asks(lambda a: np.array([0.0, a]), [(2.0,)]), lambda a: np.matrix([0.0, a])),
    ):
        assert outcome(question, answer).passed
    assert outcome(number, lambda a: np.array([[a]])).status == "unusable"
    assert like(np.matrix([[1.0]]), z) == 1
    for value, right, words in (
        (np.matrix([1.0, 2.0]), np.zeros((2, 1)), "shape"),
        (np.array([1j]), np.zeros(1), "complex"),
    ):
        with pytest.raises(Unusable, match=words):
            like(value, right)


def test_an_answer_that_ends_the_program_for_other_arguments_does_not_end_the_check():
    def touchy(y, gain):
        if gain != 0.4:  # the search for hints changes the arguments a little
            raise SystemExit
        return gain * y + y[::-1]

    assert outcome(FILTERED, touchy).status == "wrong"


def test_what_is_not_finite_does_not_reach_lapack(capfd):
    """It complains on the terminal, past Python."""
    fitted = asks(
        lambda a: np.linalg.lstsq(np.log([[3 - a, 2], [2, 1]]), [1, 2])[0],
        [(np.float64(0.5),), (np.float64(2.0),)],
    )
    wrong = outcome(fitted, lambda a: np.array([1.0, 2.0]))
    assert wrong.diagnosis == ("argument-unused",)
    assert capfd.readouterr() == ("", "")
