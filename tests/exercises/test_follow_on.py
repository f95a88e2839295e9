"""A right step on top of a student's own wrong one is marked and said; the keys of follow_on.py are the keys."""

import numpy as np
import pytest

from kfcourse.checks import exercise, sets
from kfcourse.checks.question import answer_for

FOLLOWING = [
    pytest.param(letter, question.name, id=question.name)
    for letter, one in sets().items()
    for question in one.questions
    if question.on is not None
]


@pytest.mark.parametrize(("letter", "name"), FOLLOWING)
def test_on_top_of_a_wrong_answer_the_right_step_follows(letter, name):
    """Each known mistake of an earlier question in turn, until one changes the result: on that, the step is marked as right."""
    task = exercise(letter, "21")
    question = task.questions[name]
    earlier = {one.function: one for one in task.questions.values() if one.name < name}
    below = [earlier[function] for function in question.on.__annotations__ if function in earlier]
    assert below
    for one in below:
        for mistake in one.mistakes:
            try:
                wrong = mistake.answer(task)
                built = answer_for(task, question.on(**{one.function: wrong}))
                task.check(one.name, wrong)
                result = task.check(name, built)
            except ValueError:  # a mistake that this variant does not allow
                continue
            if one.name in task.past.wrong and result.follows:
                assert result.follows == (one.name,)
                assert (result.status, result.diagnosis) == ("wrong", ("follows",))
                break
        else:
            pytest.fail(f"no mistake of {one.name} changes {name}")
        task.check(one.name, one.answer(task))
        assert not task.check(name, built).follows  # the step before is right now


@pytest.mark.parametrize(("letter", "name"), [row for row in FOLLOWING if row.id != "a6"])
def test_nothing_wrong_below_is_the_key(letter, name):
    task = exercise(letter, "20")
    assert task.check(name, task.questions[name].on()).passed


def test_a_step_with_a_wrong_gain_in_words():
    task = exercise("b", "53")

    def gain(Psi, G, F):
        return Psi @ np.swapaxes(G, -1, -2)

    def correct(lam, Psi, h, G, F, y):
        K = gain(Psi, G, F)
        return lam + (K @ (y - h)[..., None])[..., 0], Psi - K @ G @ Psi

    def step(lam, Psi, y, measure, predict):
        z, p = correct(lam, Psi, *measure(lam, Psi), y)
        return z, p, *predict(z, p)

    assert task.check("b1", gain).diagnosis == ("gain-not-divided",)
    assert task.check("b2", correct).follows == ("b1",)
    told = task.check("b3", step)
    assert told.follows == ("b1", "b2")
    assert "right on top of your b1 and b2" in told.message
