"""No question is without answers typed by hand, and most wrong ones are named."""

import importlib
from collections import Counter
from pathlib import Path

import pytest
from answers import ROWS

from kfcourse.checks import sets

FILES = [path.stem for path in sorted(Path(__file__).parent.glob("test_?_*.py"))]


def test_every_set_has_a_file():
    assert {name[len("test_") :] for name in FILES} == {Path(one.folder).name for one in sets().values()}


@pytest.mark.parametrize("name", FILES)
def test_every_question_has_right_and_wrong_answers(name):
    file, letter = importlib.import_module(name), name[len("test_")]
    right, wrong = ({row[0] for row in file.RIGHT}, Counter(row[0] for row in [*file.WRONG, *file.UNUSABLE]))
    assert {*ROWS} <= {*dir(file)}  # else nothing is done with its rows
    for question in sets()[letter].questions:
        assert question.name in right
        assert wrong[question.name] >= (3 if question.level == "core" else 2), question.name


@pytest.mark.parametrize("name", FILES[:5])
def test_five_kinds_of_mistakes_for_every_core_question_of_the_first_sets(name):
    known = {(question.name, mistake.name) for question in sets()[name[len("test_")]].questions for mistake in question.mistakes}
    typed = {(row[0], kind) for row in importlib.import_module(name).WRONG for kind in row[1].split()} & known
    for question in sets()[name[len("test_")]].questions:
        if question.level == "core" and question.mistakes:  # a derivation's lines say what is wrong
            assert len([kind for one, kind in typed if one == question.name]) >= 5, question.name


@pytest.mark.parametrize("name", FILES)
def test_nine_of_ten_wrong_answers_are_named(name):
    wrong = importlib.import_module(name).WRONG
    assert sum(bool(kinds) for _, kinds, _ in wrong) >= 0.9 * len(wrong)
