"""What is said of any wrong answer, and right answers in other forms."""

import numpy as np
import pytest
import sympy as sp
from tiny import asks, c, e, outcome, p, z

from kfcourse.checks.editing import edited
from kfcourse.checks.equality import Unusable, like

RNG = np.random.default_rng(3)
A, B = RNG.normal(size=(2, 3, 3))
P = A @ A.T
RUN = RNG.normal(size=(6, 4, 2))


def carried(A, P):
    return A @ P @ A.T


def filtered(y, gain):
    z, found = 0 * y[0], []
    for one in y:
        z = 0.9 * z + gain * (one - 0.9 * z)
        found.append(z)
    return np.array(found)


CARRIED = asks(carried, [(A, P), (np.array([[1.3]]), np.array([[0.7]]))])
FILTERED = asks(filtered, [(RUN, 0.4)], axes=("step", "trajectory"))
DIFFERENCE = asks(lambda P: -P, [(P,), (2 * P,)])  # no covariance: what is subtracted from one
PAIR = asks(lambda a, b: (a + b, a * b), [(2.5, 1.5), (0.5, 3.0)], parts=("sum", "product"))
FORMULAS = asks(lambda z, p: (c * z, c**2 * p + e**2), [(z, p)], parts=("tau", "Theta"))


NUMBERS = asks(lambda a: a, [(np.array([2.0, 3.5]),)])
MATRIX = asks(lambda a: a, [(np.array([[1.0, 2.0], [3.0, 5.0]]),)])
SYMBOLS = asks(lambda a: a, [(sp.ImmutableMatrix([[z, p], [1, 2]]),)])


@pytest.mark.parametrize(
    ("question", "name", "answer"),
    [
        (NUMBERS, "sign", lambda a: -a),
        (NUMBERS, "root", np.sqrt),
        (NUMBERS, "square", lambda a: a**2),
        (NUMBERS, "factor-2", lambda a: a / 2),
        (NUMBERS, "factor-half", lambda a: 2 * a),
        (NUMBERS, "inverse", lambda a: 1 / a),
        (MATRIX, "transposed", lambda a: a.T),
        (SYMBOLS, "transposed", lambda a: a.T),
        (CARRIED, "scalars-only", lambda A, P: A.T @ P @ A),
        (CARRIED, "unused", lambda A, P: A @ A.T),
        (CARRIED, "not-symmetric", lambda A, P: A @ P @ A.T + A),
        (CARRIED, "unchanged", lambda A, P: P),
        (CARRIED, "negative-variance", lambda A, P: A @ P @ A.T - 50 * P),
        (CARRIED, "precision", lambda A, P: carried(A, P).astype(np.float32)),
        (FILTERED, "from-second-step", lambda y, gain: gain * y),
        (FILTERED, "unused", lambda y, gain: filtered(y, 0.3)),
        (FILTERED, "factor", lambda y, gain: 3 * filtered(y, gain)),
        (FILTERED, "term", lambda y, gain: 3 + filtered(y, gain)),
        (PAIR, "swapped", lambda a, b: (a * b, a + b)),
        (PAIR, "another-result", lambda a, b: (a + b, a + b)),
        (FORMULAS, "swapped", lambda z, p: (c**2 * p + e**2, c * z)),
        (FORMULAS, "unused", lambda z, p: (c * z, c**2 + e**2)),
        (FORMULAS, "unused", lambda z, p: (c * z, p + e**2)),
        (FORMULAS, "superfluous", lambda z, p: (c * z, c**2 * p + e**2 * z)),
        (
            asks(lambda z: sp.Matrix([[z, 1], [0, z]]), [(z,)]),
            "entry",
            lambda z: sp.Matrix([[z, 1], [0, 2 * z]]),
        ),
    ],
)
def test_hints(question, name, answer):
    result = outcome(question, answer)
    assert (result.status, result.diagnosis) == ("wrong", (name,)), result


def mixed(a, b):
    return np.sin(a + 2) / np.sqrt((b + 2) ** 2 + 3) * np.arctan2(a + 1, b + 2)


MIXED = asks(mixed, [(RUN[0, 0], RUN[1, 1]), (RUN[2], RUN[3])])


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("inner-sign", "a + 2", "a - 2"),
        ("quotient", "/ np", "* np"),
        ("term-lost", " + 3", ""),
        ("power-lost", " ** 2", ""),
        ("function-lost", "np.sqrt", ""),
        ("factor-lost", "np.sin(a + 2) / ", "1 / "),
        ("number", "3", "4"),
        ("letter", "(b + 2)", "(a + 2)"),
        ("order", "a + 1, b + 2", "b + 2, a + 1"),
    ],
)
def test_one_thing_changed_in_the_key_is_named(name, old, new):
    result = outcome(MIXED, edited(mixed, old, new))
    assert (result.status, result.diagnosis) == ("wrong", (name,)), result
    assert "The right answer would give that with" in result.message


def test_the_precision_is_named():
    single = outcome(CARRIED, lambda A, P: carried(A, P).astype(np.float32)).message
    assert "single precision (float32)" in single and "float64" in single
    rounded = outcome(CARRIED, lambda A, P: np.round(carried(A, P), 5)).message
    assert "rounded" in rounded and "float32" not in rounded


def test_the_same_is_said_once():
    message = outcome(PAIR, lambda a, b: (2 * (a + b), 2 * a * b)).message
    assert message == "not right. sum, product: It is twice what it should be."


@pytest.mark.filterwarnings("ignore:the matrix subclass")
def test_other_forms_are_right():
    assert outcome(PAIR, lambda a, b: np.array([a + b, a * b])).passed
    assert outcome(PAIR, lambda a, b: sp.Matrix([a + b, a * b])).passed
    assert outcome(FORMULAS, lambda z, p: sp.Matrix([c * z, c**2 * p + e**2])).passed
    number = asks(lambda a: a, [(2.0,)])
    assert outcome(number, np.matrix).passed
    assert outcome(number, lambda a: np.array([[a]])).status == "unusable"
    assert outcome(number, complex).passed
    assert outcome(
        asks(lambda a: np.array([0.0, 1.0]), [(1.0,)]), lambda a: np.array([False, True])
    ).passed
    assert like(np.matrix([[1.0]]), z) == 1
    assert outcome(
        asks(lambda a: np.array([0.0, a]), [(2.0,)]), lambda a: np.matrix([0.0, a])
    ).passed
    with pytest.raises(Unusable, match="shape"):
        like(np.matrix([1.0, 2.0]), np.zeros((2, 1)))


def test_complex_numbers_are_told():
    with pytest.raises(Unusable, match="complex"):
        like(np.array([1j]), np.zeros(1))


def test_an_answer_that_ends_the_program_for_other_arguments_does_not_end_the_check():
    def touchy(y, gain):
        if gain != 0.4:  # the search for hints changes the arguments a little
            raise SystemExit
        return gain * y + y[::-1]

    assert outcome(FILTERED, touchy).status == "wrong"


def test_negative_variances_are_no_news_where_the_right_answer_has_them():
    for answer in (lambda P: -3 * P, lambda P: -P - np.eye(3)):
        assert "negative-variance" not in outcome(DIFFERENCE, answer).diagnosis
    assert "negative-variance" in outcome(CARRIED, lambda A, P: A @ P @ A.T - 50 * P).diagnosis


def test_what_is_not_finite_does_not_reach_lapack(capfd):
    """It complains on the terminal, past Python."""
    fitted = asks(
        lambda a: np.linalg.lstsq(np.log([[3 - a, 2], [2, 1]]), [1, 2])[0],
        [(np.float64(0.5),), (np.float64(2.0),)],
    )
    wrong = outcome(fitted, lambda a: np.array([1.0, 2.0]))
    assert wrong.diagnosis == ("unused",)
    assert capfd.readouterr() == ("", "")


def test_results_in_another_order_may_have_other_shapes():
    question = asks(lambda a: (a[0], a), [(np.ones((2, 2)),)], parts=("row", "all"))
    assert "another order" in outcome(question, lambda a: (a, a[0])).message
