"""What the files of this folder share: the sets, opened once."""

from functools import cache

import pytest

from kfcourse.checks import engine, exercise

pytest.register_assert_rewrite("answers")


@cache
def opened(letter, variant):
    return exercise(letter, variant)


@pytest.fixture
def told():
    """What the check says to an answer: told("g4", function)."""

    def as_the_first(name, answer, variant="53"):
        task = opened(name[0], variant)
        return engine.check(task.questions[name], task, answer)  # as if nothing had been handed in before

    return as_the_first


def pytest_generate_tests(metafunc):
    """The tests of answers.py get the rows of the file that imports them."""
    if metafunc.function.__module__ == "answers":
        from answers import ROWS

        rows, arguments = ROWS[metafunc.function.__name__]
        metafunc.parametrize(arguments, getattr(metafunc.module, rows))
