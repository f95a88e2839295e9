"""No question of the sets f to l is without answers typed by hand."""

import importlib
from collections import Counter
from pathlib import Path

import pytest

from kfcourse.checks import sets

FILES = [path.stem for path in sorted(Path(__file__).parent.glob("test_?_*.py"))]


def test_every_set_after_e_has_a_file():
    assert {name[len("test_") :] for name in FILES} == {Path(one.folder).name for one in sets().values() if one.letter > "e"}


@pytest.mark.parametrize("name", FILES)
def test_every_question_has_right_and_wrong_answers(name):
    file, letter = importlib.import_module(name), name[len("test_")]
    right, wrong = ({row[0] for row in file.RIGHT}, Counter(row[0] for row in [*file.WRONG, *file.UNUSABLE]))
    for question in sets()[letter].questions:
        assert question.name in right
        assert wrong[question.name] >= (3 if question.level == "core" else 2), question.name
