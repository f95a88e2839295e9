"""Arguments that the grader asks with: its own, and such that rounding does not decide."""

from __future__ import annotations

import ast
import copy
from contextlib import suppress
from functools import lru_cache
from typing import Any

import numpy as np

from kfcourse.exercises.checks import Exercise, Question, exercise
from kfcourse.exercises.checks.equality import equal
from kfcourse.exercises.checks.reference import posed, standard

ULPS = 4  # by how many last digits arguments are changed
SHARE = 0.3  # of the tolerance may come of that
DRAWS = 20  # arguments that are tried


@lru_cache(maxsize=1000)
def salted(letter: str, opening: str, name: str, salt: str) -> Exercise:
    """The exercise whose hidden arguments are the grader's.

    Random arguments may be a matrix that is nearly singular: then another right answer, with
    roundings of its own, differs from ours by more than the tolerance.  So the first arguments are
    taken for which ours hardly changes with the last digits of them.

    Parameters
    ----------
    letter, opening : str
        The set, and the variant as a notebook opens it.
    name : str
        Of the question.
    salt : str
        What no notebook knows.
    """
    opened = exercise(letter, ast.literal_eval(opening))
    question = opened.questions[name]
    for draw in range(DRAWS):
        asked = Exercise(letter, opened.variant, f"{salt}/{draw}")
        with suppress(Exception):  # of a matrix that is singular
            if steady(question, asked):
                return asked
    return opened  # the arguments of the immediate check, which are known to be good


def steady(question: Question, asked: Exercise) -> bool:
    """Whether the right answer hardly changes when its arguments change by a few units in the last
    place."""
    rng, as_posed = np.random.default_rng(0), posed(question, asked)
    with np.errstate(all="ignore"):
        for values in as_posed.arguments:
            first = standard(as_posed.key(*copy.deepcopy(values)))
            second = standard(as_posed.key(*(_changed(value, rng) for value in values)))
            if not equal(second, first, SHARE * question.tolerance, asked.model.values):
                return False
    return True


def _changed(value: Any, rng: np.random.Generator) -> Any:
    """Numbers changed in the last place, equal ones alike: a symmetric matrix stays so, and what
    never varies; the rest stays.

    Whole numbers stay, too.  No rounding has made them, and a matrix of 1 and -1, which takes
    differences of nearly equal numbers, would take no such any more: where a processor multiplies
    and adds at once, not even of equal ones.
    """
    if (
        not isinstance(value, float | np.floating | np.ndarray)
        or np.asarray(value).dtype.kind != "f"
    ):
        return copy.deepcopy(value)
    different, place = np.unique(value, return_inverse=True)
    signs = rng.choice((-1.0, 1.0), different.shape) * (different != np.round(different))
    return value * (1 + ULPS * np.finfo(float).eps * signs[place].reshape(np.shape(value)))
