"""What a wrong answer gets: its own case, a stronger hint when it comes again, what it follows
from, its share of right parts."""

from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp
from tiny import NOTHING, about, asks, c, d, outcome, p, x, y, z

from kfcourse.exercises.checks.diagnosis import GENERAL
from kfcourse.exercises.checks.engine import FOLLOWS, check
from kfcourse.exercises.checks.question import MIME, Attempts, Mistake, Question

A = np.array([2.0, 3.0])


def test_a_wrong_answer_that_no_hint_explains_gets_its_own_case():
    message = outcome(asks(lambda a: a**3, [(2.5,)]), lambda a: a**3 - a - 1.125).message
    assert message.startswith(f"not right. {GENERAL}")
    assert message.endswith("An example: for a = 2.5 your function gives 12.")
    assert "15.6" not in message  # the right one


def test_the_case_of_a_formula_has_values_of_the_parameters():
    exercise = about({c: sp.Rational(-1, 2)})
    message = check(
        asks(lambda a: c + sp.exp(a), [(x,)]), exercise, lambda a: 3 * c - sp.exp(a)
    ).message
    assert message.endswith("An example: at x = 1.3, c = -0.5 your function gives -5.169.")


def test_the_case_of_a_run_is_the_first_that_is_wrong():
    y = np.arange(12.0).reshape(3, 2, 2)
    question = asks(lambda y, m: y + m, [(y, 1.0)], axes=("step", "trajectory"))

    def wrong(y, m):
        answer = y + m
        answer[1:, 1, 0] = 77
        answer[2:] **= 2
        return answer

    message = outcome(question, wrong).message
    assert (
        "step 1, trajectory 1 (counted from 0): for y = [[2, 3], [6, 7]], m = 1 your function "
        "gives [77, 8]." in message
    )


def test_the_same_wrong_answer_again_gets_a_stronger_hint():
    mistakes = [Mistake("minus", "the sign of b", lambda a, b: a - b)]
    question = asks(lambda a, b: a + b, [(2.5, 1.5)], mistakes, advice="Think of b.")
    past = Attempts()

    def message_of(answer):
        return check(question, NOTHING, answer, past=past).message

    assert message_of(lambda a, b: a - b) == "not right. the sign of b"
    assert message_of(lambda a, b: -b + a) == "not right. the sign of b Think of b."
    assert message_of(lambda a, b: -b + a).startswith(
        "not right. the sign of b Think of b. An example: for a = 2.5"
    )
    assert message_of(lambda a, b: 2 * (a + b)) == "not right. It is twice what it should be."
    assert message_of(lambda a, b: a - b) == "not right. the sign of b"
    assert message_of(lambda a, b: a + b) == "right"
    assert message_of(lambda a, b: a - b) == "not right. the sign of b"


def single(a):
    return a**2 + 1


def doubled(a):
    return 2 * single(a)


def three(a):
    return single(a) + doubled(a)


def named(name, key):
    return Question(name, "", "core", key, lambda _: [(A,)])


QUESTIONS = {
    question.name: question
    for question in (named("t1", single), named("t2", doubled), named("t3", three))
}
EXERCISE = about(questions=QUESTIONS)


def test_a_right_step_on_a_wrong_one_is_marked_and_said():
    past = Attempts()

    def asked(name, answer):
        return check(QUESTIONS[name], EXERCISE, answer, past=past)

    def own(a):
        return [7 * float(value) for value in a]  # a list: what follows takes it as an array

    assert asked("t1", own).status == "wrong"
    result = asked("t2", lambda a: 14 * a)
    assert (result.status, result.follows, result.diagnosis) == ("wrong", ("t1",), (FOLLOWS,))
    assert "right on top of your t1" in result.message
    assert result._repr_mimebundle_()[MIME]["follows"] == ["t1"]
    assert asked("t2", lambda a: 15 * a).follows == ()
    assert asked("t3", lambda a: 22 * a).follows == ("t1", "t2")
    asked("t1", single)
    assert asked("t2", lambda a: 14 * a).follows == ()  # the step before is right now
    asked("t1", lambda a: 1 / 0 if a[0] == 2 else a)  # unusable: nothing can stand on it
    assert asked("t3", lambda a: a**2 + 1 + 14 * a).follows == ("t2",)


def test_a_check_that_fails_in_itself_costs_nothing_but_itself():
    def fails(*_):
        raise AttributeError("of ours")

    result = outcome(Question("t1", "", "core", fails, lambda _: [(2.0,)]), lambda a: a)
    assert (result.status, result.passed, result.share) == ("not checked", False, 0)
    assert "not your fault" in result.message and "AttributeError" not in result.message
    assert "AttributeError: of ours" in result.trouble and "fails" in result.trouble
    assert result._repr_mimebundle_()[MIME]["trouble"] == result.trouble


def test_a_search_for_a_hint_that_fails_costs_the_hint():
    # a catalogue that is broken
    question = asks(lambda a: a**2, [(2.0,)], [SimpleNamespace(answer=None)])
    object.__setattr__(question, "mistakes", (None,))
    result = outcome(question, lambda a: a + 17.0)
    assert result.status == "wrong"
    assert result.message.startswith("not right.")


ROW, SQUARE = sp.ImmutableMatrix([[1, 0]]), sp.ImmutableMatrix([[p, z], [z, d]])
J = sp.ImmutableMatrix([[1, x], [0, y]])


@pytest.mark.parametrize(
    ("question", "answer", "unsaid"),
    [
        # a formula and matrices: exchanged, they have no common shape
        (
            asks(lambda z, p: (z, ROW * z, SQUARE), [(z, p)], parts=("h", "G", "F")),
            lambda z, p: (z, sp.Matrix([[1, 0]]), SQUARE),
            "another order",
        ),
        # a covariance is symmetric by its values
        (
            asks(lambda z: J * SQUARE * J.T, [(z,)]),
            lambda z: J * SQUARE * J.T + sp.Matrix([[1, (x + 1) ** 2], [x**2 + 2 * x + 1, 1]]),
            "symmetric",
        ),
    ],
)
def test_what_cannot_be_so_is_not_said(question, answer, unsaid):
    result = outcome(question, answer)
    assert (result.status, result.trouble) == ("wrong", "") and unsaid not in result.message


def test_an_example_of_a_step_shows_the_rows_beside_it():
    """An interval is the difference of two rows: from one alone nobody sees what is wrong."""
    times = np.array([5.0, 7.0, 8.0])
    question = asks(lambda times: np.diff(times, append=9.0), [(times,)], axes=("step",))
    example = outcome(question, lambda times: np.array([2.0, 1.0, 7.0])).message
    assert "step 2 (counted from 0): for times[1:3] = [7, 8] your function gives 7." in example
    example = outcome(question, lambda times: 1 + np.exp(-times)).message
    assert "times[0:2] = [5, 7]" in example
