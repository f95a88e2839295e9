"""Tiny questions of the tests' own, for the machinery that knows no exercise set; answers that stop
or never do."""

from types import SimpleNamespace

import numpy as np
import sympy as sp

from kfcourse.exercises.checks.engine import check
from kfcourse.exercises.checks.question import Question

x, y, z, p, m, d = sp.symbols("x y z p m d", real=True)
c, e, g, f = sp.symbols("c e g f", real=True)


def about(values=(), **more):
    """An exercise about a model of these values."""
    return SimpleNamespace(
        model=SimpleNamespace(values=dict(values)), places=(), posed={}, **{"questions": {}} | more
    )


NOTHING = about()


def asks(right, arguments, mistakes=(), parts=(), **options):
    return Question(
        "t1", "a test", "core", right, lambda _: arguments, tuple(mistakes), parts, **options
    )


SUM = asks(
    lambda a, b: a + 2 * b,
    [(np.array([1.0, 2.5]), np.array([-0.3, 4.0])), (np.array([0.7, -1.0]), np.array([3.0, 0.2]))],
)
FORMULA = asks(lambda a, b: a**2 + sp.sin(b), [(x, y)])


def outcome(question, answer, seconds=1.0, exercise=NOTHING):
    return check(question, exercise, answer, seconds)


def raises(error):
    def answer(*_):
        raise error

    return answer


def endless(*_):
    while True:
        pass


def stubborn(*_):
    while True:
        try:
            sum([1, 2])
        except Exception:
            continue


def very_stubborn(*_):
    while True:
        try:
            sum([1, 2])
        except:  # noqa: E722
            continue
