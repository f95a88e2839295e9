"""A right step on top of a student's own wrong one is marked and said: keys call earlier answers by
their names."""

import pytest
from weekly import weekly

from kfcourse.exercises.checks import Derivation, exercise, sets
from kfcourse.exercises.checks.editing import rebound, uses
from kfcourse.exercises.checks.engine import FOLLOWS
from kfcourse.exercises.checks.question import ForVariant

DEAR = {"f4-f2", "f4-f3"}  # the exact filter again for each mistake
FOLLOWING = [
    (f"{question.name}-{earlier.name}", letter, question, step, earlier)
    for letter, set_ in sets().items()
    for question in set_.questions
    if (step := question.key.step if isinstance(question.key, ForVariant) else question.key)
    for earlier in set_.questions
    if earlier.name < question.name
    and earlier.function in uses(step)
    and not isinstance(question, Derivation)
]


def test_these_steps_stand_on_earlier_ones():
    names = {question.name for _, _, question, *_ in FOLLOWING}
    assert {
        "a6",
        "b2",
        "b3",
        "b4",
        "b5",
        "c3",
        "c4",
        "d2",
        "d3",
        "f4",
        "g5",
        "i2",
        "k4",
        "l5",
        "m5",
        "o3",
        "o6",
    } <= names


@pytest.mark.parametrize(
    ("name", "letter", "question", "step", "earlier"), weekly(FOLLOWING, dear=DEAR)
)
def test_on_top_of_a_wrong_answer_the_right_step_follows(name, letter, question, step, earlier):
    """Each known mistake of an earlier question in turn, until one changes the result: on that, the
    step is marked as right."""
    task = exercise(letter, "21")
    for mistake in earlier.mistakes:
        try:
            wrong = mistake.answer(task)
        except ValueError:  # a mistake that this variant does not allow
            continue
        task.check(earlier.name, wrong)
        built = rebound(step, {earlier.function: wrong})
        result = task.check(question.name, built)
        if earlier.name in task.past.wrong and result.follows:
            assert result.follows == (earlier.name,)
            assert (result.status, result.diagnosis) == ("wrong", (FOLLOWS,))
            break
    else:
        pytest.fail(f"{name}: no mistake changes the step")
    task.check(earlier.name, earlier.answer(task))
    assert not task.check(question.name, built).follows  # the step before is right now
